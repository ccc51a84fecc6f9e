"""Recordings of a session as the files of a folder: saved, kept in memory where the disk is full, recovered."""

from __future__ import annotations

import pathlib
import threading
from dataclasses import dataclass

from sigmaik import Error

from .episode import Episode
from .journal import cut_off
from .session import Session

__all__ = ["Recorder", "Unsaved", "summary"]


@dataclass(frozen=True)
class Unsaved:
    """A recording that no file has."""

    name: str  #: of the npz file
    episode: Episode
    reason: str


class Recorder:
    """Records a session into a folder. While a recording goes on, its file is `.part`; once saved, `.npz`.

    Any thread may call the functions.
    """

    def __init__(self, session: Session, directory: str | pathlib.Path) -> None:
        self.session, self.directory = session, pathlib.Path(directory)
        self._unsaved: list[Unsaved] = []
        self._part: pathlib.Path | None = None
        self._name = ""
        self._lock = threading.RLock()

    @property
    def unsaved(self) -> tuple[Unsaved, ...]:
        """Recordings that could not be saved, and are kept in memory."""
        return tuple(self._unsaved)

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the saved recordings, sorted."""
        return tuple(sorted(file.name for file in self.directory.glob("*.npz")))

    def start(self) -> str:
        """Starts a recording. Returns why the recording is in memory only; empty where a file has it."""
        with self._lock:
            stem = self._free_stem()
            part = self.directory / f"{stem}.part"
            trouble = ""
            try:
                self.session.start_recording(part)
            except OSError as error:
                trouble = f"{part}: {error.strerror or error}"
                self.session.start_recording()
            self._name, self._part = f"{stem}.npz", None if trouble else part
            return trouble

    def stop(self) -> str:
        """Ends the recording and saves it. Returns the recording in a line, see `summary`.

        Error where the file cannot be written: the recording is then `unsaved`.
        """
        with self._lock:
            episode = self.session.stop_recording()
            name, part = self._name, self._part
            try:
                line = self._save(self.directory / name, episode)
            except (OSError, MemoryError) as error:
                reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
                self._unsaved.append(Unsaved(name, episode, reason))
                raise Error(
                    f"{self.directory / name} is not saved: {reason}. The recording is kept in memory: choose another "
                    "folder, and save again"
                ) from None
            if part is not None:
                part.unlink(missing_ok=True)
            return line

    def save_unsaved(self, directory: str | pathlib.Path | None = None) -> list[str]:
        """Saves what is unsaved, into another folder where one is named. Returns a line for each recording.

        Error where a file cannot be written.
        """
        with self._lock:
            saved = []
            folder = self.directory if directory is None else pathlib.Path(directory)
            if not folder.is_dir():
                raise Error(f"there is no folder {folder}")
            while self._unsaved:
                waiting = self._unsaved[0]
                file = folder / waiting.name
                if file.exists():
                    raise Error(f"{file} exists already")
                try:
                    saved.append(self._save(file, waiting.episode))
                except OSError as error:
                    raise Error(f"{file} is not saved: {error.strerror or error}") from None
                del self._unsaved[0]
                (self.directory / waiting.name).with_suffix(".part").unlink(missing_ok=True)
            return saved

    def recover(self) -> list[str]:
        """Saves the recordings of programs that ended in the middle. Returns what was done, a line each."""
        said = []
        for part in cut_off(self.directory) if self.directory.is_dir() else ():
            file = part.with_suffix(".npz")
            if file.exists():
                continue
            try:
                episode = Episode.load(part)
                line = self._save(file, episode)
            except (Error, OSError) as error:
                said.append(f"{part.name} is left as it is: {error}")
                continue
            part.unlink(missing_ok=True)
            said.append(f"{part.name} was cut off, and is recovered: {line}")
        return said

    def finish(self) -> str:
        """Saves a recording that goes on, for the end of the program. Returns what was done; empty: nothing was."""
        with self._lock:
            if not self.session.recording:
                return ""
            part = self._part
            try:
                return f"{self.directory}: {self.stop()}"
            except Error as error:
                kept = f"; {part} has it as far as it could be written" if part is not None and part.exists() else ""
                return f"{error}{kept}"

    def _save(self, file: pathlib.Path, episode: Episode) -> str:
        episode.save(file)
        return summary(file, episode)

    def _free_stem(self) -> str:
        number, waiting = 0, {unsaved.name for unsaved in self._unsaved}
        while True:
            stem = f"episode-{number:04d}"
            taken = any((self.directory / f"{stem}{suffix}").exists() for suffix in (".npz", ".part"))
            if not taken and f"{stem}.npz" not in waiting:
                return stem
            number += 1


def summary(file: pathlib.Path, episode: Episode) -> str:
    """A saved recording in a line."""
    try:
        broken = f"limits broken {sum(episode.broken_limits().values())} times"
    except Error as error:
        broken = f"limits cannot be judged: {error}"
    gaps = episode.gaps
    missing = f", {len(gaps)} gaps of {sum(gap.seconds for gap in gaps):.3f} s" if gaps else ""
    return f"{file.name}: {len(episode)} cycles, {episode.duration:.1f} s{missing}, {broken}"
