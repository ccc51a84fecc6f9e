"""Which files a URDF may name: those of its own folder or package, and those of declared packages."""

from __future__ import annotations

import pathlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from urllib.parse import unquote, urlsplit

from sigmaik import Error

__all__ = ["MeshFiles"]

_SUFFIXES = {".stl", ".dae", ".obj", ".ply", ".glb", ".gltf", ".off"}
_HIGHEST = 6  # folders above the URDF in which package.xml is looked for


class MeshFiles:
    """From the mesh's name in a URDF to its file: called with a name, returns a path, which need not exist.

    Error where the file is outside the folders that are allowed, or is no mesh: a URDF from elsewhere must not make the
    page show other files of the machine.
    """

    def __init__(self, urdf: pathlib.Path, packages: Mapping[str, str | pathlib.Path] | None = None) -> None:
        """
        urdf: the file; its folder is allowed, and the folder of its own package (with package.xml) above
        packages: name to folder of further packages
        """
        self._folder = urdf.parent.resolve()
        self._packages = {name: pathlib.Path(folder).resolve() for name, folder in (packages or {}).items()}
        for name, folder in self._packages.items():
            if not folder.is_dir():
                raise Error(f"package '{name}': there is no folder {folder}")
        own = _own_package(self._folder)
        if own is not None:
            self._packages.setdefault(*own)

    def __call__(self, fname: str) -> str:  # yourdfpy names the argument
        file = self._place(fname)
        resolved = file.resolve()  # what links lead to counts
        roots = (self._folder, *self._packages.values())
        if not any(resolved.is_relative_to(root) for root in roots):
            raise Error(
                f"the mesh {_shown(fname)} is outside {', '.join(map(str, roots))}; "
                "declare the package that has it (--package NAME=FOLDER)"
            )
        if resolved.suffix.lower() not in _SUFFIXES:
            raise Error(f"the mesh {_shown(fname)} is none of {', '.join(sorted(_SUFFIXES))}")
        return str(resolved)

    def _place(self, name: str) -> pathlib.Path:
        if "\0" in name:
            raise Error(f"the mesh {_shown(name)} has a character that no file name has")
        try:
            parts = urlsplit(name)
        except ValueError as error:
            raise Error(f"the mesh {_shown(name)} has no address: {error}") from None
        if parts.scheme in ("package", "model"):
            rest = unquote(parts.path).lstrip("/")
            return self._packages.get(unquote(parts.netloc), self._folder) / rest
        if parts.scheme == "file":
            if parts.netloc not in ("", "localhost"):
                raise Error(f"the mesh {_shown(name)} is on another machine")
            return pathlib.Path(unquote(parts.path))
        if "://" in name:
            raise Error(f"the mesh {_shown(name)} is not read: only files, package:// and file:// are")
        return self._folder / name


def _shown(name: str) -> str:
    return f"'{ascii(name)[1:-1][:200]}'"


def _own_package(folder: pathlib.Path) -> tuple[str, pathlib.Path] | None:
    """Name and folder of the ROS package that a folder is in."""
    for above in (folder, *folder.parents)[:_HIGHEST]:
        manifest = above / "package.xml"
        if not manifest.is_file():
            continue
        try:
            name = ElementTree.parse(manifest).findtext("name")
        except (ElementTree.ParseError, OSError, ValueError):
            name = None
        return (name or above.name).strip(), above
    return None
