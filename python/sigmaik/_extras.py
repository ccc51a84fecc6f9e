"""Packages that only some functions need, and that a plain `pip install` leaves out."""

from __future__ import annotations

import importlib.util

from ._core import Error

__all__ = ["MissingPackage", "installed", "need"]

#: pip's requirement for a module, where the requirement differs from the module's name.
_REQUIREMENTS = {
    "cv2": "opencv-python-headless",
    "gymnasium": "'gymnasium>=1'",
    "distributed": "'dask[distributed]'",
    "mujoco": "'mujoco>=3'",
    "PIL": "pillow",
    "optik": "optik-py",
    "placo": "'placo>=0.10'",
    "rclpy": "ros-rclpy ros-rmw-fastrtps-cpp ros-diagnostic-msgs ros-geometry-msgs ros-sensor-msgs ros-std-srvs "
    "ros-trajectory-msgs",
    "viser": "'viser>=1'",
}


class MissingPackage(Error, ImportError):
    """A function was called whose package is not installed. The text has the command that installs the package."""


def need(*modules: str) -> None:
    """Raises MissingPackage where modules are not installed; the text has the command that installs these modules."""
    missing = [module for module in modules if not installed(module)]
    if not missing:
        return
    verb, noun = ("is", "it") if len(missing) == 1 else ("are", "them")
    command = " ".join(_REQUIREMENTS.get(module, module) for module in missing)
    raise MissingPackage(f"{' and '.join(missing)} {verb} not installed; pip install {command} brings {noun}")


def installed(module: str) -> bool:
    """Whether a module can be imported; the module is not imported."""
    try:
        return importlib.util.find_spec(module) is not None
    except ImportError:
        return False
