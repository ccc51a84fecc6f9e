"""Gymnasium looks for no environments by itself since version 1.0: installed packages register theirs here.

A package names a module in the entry point group "sigmaik.environments", and the module registers when it is imported.
"""

import sys


def register() -> None:
    """Imports the modules of the group, where Gymnasium has been imported; otherwise nothing."""
    if "gymnasium" not in sys.modules:
        return
    from importlib.metadata import entry_points

    for entry in entry_points(group="sigmaik.environments"):
        entry.load()
