"""Which OpenGL MuJoCo draws with. MuJoCo reads its environment variable MUJOCO_GL once, when it is imported."""

from __future__ import annotations

import os
import sys

__all__ = ["choose_opengl"]


def choose_opengl() -> None:
    """Chooses EGL, which needs no display and no GPU, where there is no display and nothing was chosen.

    Has to be called before mujoco is imported; later the call changes nothing.
    """
    if "mujoco" not in sys.modules and sys.platform == "linux" and not os.environ.get("DISPLAY"):
        os.environ.setdefault("MUJOCO_GL", "egl")
