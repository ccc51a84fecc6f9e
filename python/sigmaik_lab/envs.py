"""Registers the environments with Gymnasium, and imports nothing else. Needs the extra "learn".

    import gymnasium
    import sigmaik                                              # after gymnasium; or sigmaik_lab.envs in any order

    env = gymnasium.make("sigmaik/Fetch-v0")                    # or, without our import:
    env = gymnasium.make("sigmaik_lab.envs:sigmaik/Fetch-v0")

Gymnasium looks for no environments by itself since version 1.0, so that one of these is necessary.
"""

from sigmaik._extras import need

__all__: list[str] = []

need("gymnasium")

import gymnasium  # noqa: E402  (the line above names the missing package and the command that installs it)

gymnasium.register(
    "sigmaik/Fetch-v0",
    entry_point="sigmaik_lab.learn.fetch:Fetch",
    vector_entry_point="sigmaik_lab.learn.vector:FetchVector",
)
