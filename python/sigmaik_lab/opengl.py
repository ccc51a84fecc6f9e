"""MuJoCo's offscreen renderer, and which OpenGL it draws with.

MuJoCo reads its environment variable MUJOCO_GL once, when MuJoCo is imported.
"""

from __future__ import annotations

import os
import sys
from typing import Any

__all__ = ["choose_opengl", "open_renderer"]


def choose_opengl() -> None:
    """Chooses EGL, which needs no display and no GPU, where there is no display and nothing was chosen.

    Has to be called before mujoco is imported; later the call changes nothing.
    """
    if "mujoco" not in sys.modules and sys.platform == "linux" and not os.environ.get("DISPLAY"):
        os.environ.setdefault("MUJOCO_GL", "egl")


def open_renderer(model: Any, height: int, width: int, shadows: bool) -> Any:
    """A mujoco.Renderer. shadows: they take nine tenths of the time where OpenGL is software.

    OSError where no OpenGL is found; the text says what to install.
    """
    choose_opengl()
    import mujoco  # type: ignore[import-untyped]

    try:
        renderer: Any = mujoco.Renderer(model, height, width)
    except Exception as error:  # each backend of MuJoCo raises an error of its own kind
        raise OSError(
            f"MuJoCo finds no OpenGL ({error}); set MUJOCO_GL=egl before mujoco is imported. On Debian or Ubuntu "
            "`apt install libegl1 libgl1-mesa-dri` brings one that needs no GPU"
        ) from error
    renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadows
    return renderer
