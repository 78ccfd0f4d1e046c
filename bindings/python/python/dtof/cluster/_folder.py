"""The results folder of one recording: reuse of an earlier run, and new results."""

from __future__ import annotations

import hashlib
import json
import os
from contextlib import suppress
from typing import Any, Callable, Optional
from uuid import uuid4

import numpy

from .. import _native
from .._arrays import EVENT
from .._files import write_events
from .._options import Keywords, flags
from .._run import Replay

#: Formats of event files.
FORMATS = ("aer", "npy")
#: Further files that the program writes.
_OF_THE_PROGRAM = (
    "events.csv",
    "report.html",
    "depth-last.svg",
    "depth-mean.svg",
    "event-counts.svg",
    "reflectivity-events.svg",
    "reflectivity-signal.svg",
    "photon-counts.svg",
    "depth.npy",
    "depth.csv",
    "confidence.npy",
    "depth-nearest.npy",
    "depth-nearest.csv",
    "depth-farthest.npy",
    "depth-farthest.csv",
)


class Folder:
    """The results folder of one recording.

    ``summary.json`` is written last and removed first: a folder that has it is complete.
    """

    def __init__(self, folder: str, events: str, file: str, keywords: Keywords) -> None:
        self._folder = folder
        self._events = f"events.{events}"
        self._request = _request(file, keywords)
        self._inputs = [file, *(name for name in _settings(keywords) if "\n" not in name)]

    def kept_statistics(self) -> Optional[dict[str, Any]]:
        """The statistics of an earlier run with the same request, if its files are unchanged."""
        summary = self._earlier()
        expected = {**self._request, "events": self._events}
        request = dict(summary.pop("request", None) or {}) if summary else {}
        hashes = request.pop("sha256", None)
        return summary if request == expected and self._hashes() == hashes else None

    def write(self, run: Replay) -> None:
        """Writes the files, each atomically. Replaces only results of this module."""
        self._earlier()
        # They would stay beside events of another run.
        other = next((name for name in _OF_THE_PROGRAM if os.path.lexists(self._place(name))), None)
        if other is not None:
            raise _native.Error(f"{self._folder}: has {other} of another run: move the folder away")
        for name, is_ours in _OWN_FILES.items():
            place = self._place(name)
            if not os.path.lexists(place):
                continue
            if not (os.path.isfile(place) and is_ours(place)):
                raise _native.Error(f"{place}: was not written by dtof: move it away")
            if any(os.path.samefile(place, name) for name in self._inputs):
                raise _native.Error(f"{place}: is an input file")
        os.makedirs(self._folder, exist_ok=True)
        for name in ("summary.json", *(f"events.{other}" for other in FORMATS)):
            if name != self._events:
                # Dask may run a task twice at a time, so the file may be gone.
                with suppress(FileNotFoundError):
                    os.remove(self._place(name))
        events = self._place(self._events)
        if self._events == "events.aer":
            write_events(events, run.events, run.array)
        else:
            self._put(self._events, lambda file: numpy.save(file, run.events))
        self._put("dtof.toml", lambda file: file.write(run.toml.encode()))
        request = {**self._request, "events": self._events, "sha256": self._hashes()}
        summary = json.dumps({**run.statistics, "request": request}, indent=2) + "\n"
        self._put("summary.json", lambda file: file.write(summary.encode()))

    def _hashes(self) -> dict[str, Optional[str]]:
        """The SHA-256 of each file except the summary, None for a missing file."""
        places = {name: self._place(name) for name in (self._events, "dtof.toml")}
        return {name: _hash(place) if os.path.isfile(place) else None for name, place in places.items()}

    def _place(self, name: str) -> str:
        return os.path.join(self._folder, name)

    def _earlier(self) -> Optional[dict[str, Any]]:
        """The summary of an earlier run, if there is one."""
        place = self._place("summary.json")
        try:
            with open(place, encoding="utf-8") as file:
                summary = json.load(file)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except ValueError:
            summary = None
        if not isinstance(summary, dict) or not str(summary.get("program")).startswith("dtof "):
            raise _native.Error(f"{place}: was not written by dtof: move it away")
        return summary

    def _put(self, name: str, write: Callable[[Any], Any]) -> None:
        """Writes a temporary file, and moves it to its place."""
        temporary = self._place(f".dtof-{uuid4().hex}.partial")
        try:
            with open(temporary, "xb") as file:
                write(file)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, self._place(name))
        except BaseException:
            if os.path.exists(temporary):
                os.unlink(temporary)
            raise


def _settings(keywords: Keywords) -> list[str]:
    return [text for key, text in keywords if key == "settings"]


def _request(file: str, keywords: Keywords) -> dict[str, Any]:
    """Everything that the results depend on."""
    try:
        info = os.stat(file)
    except OSError as error:
        raise _native.Error(f"{file}: {error.strerror}") from error
    settings = _settings(keywords)
    return {
        "version": _native.__version__,
        "file": file,
        "bytes": info.st_size,
        "modified_ns": info.st_mtime_ns,
        "options": flags(keywords),
        "settings_sha256": [_hash(name) for name in settings],
    }


def _hash(name: str) -> str:
    """The hash of a file, or of a text of several lines."""
    if "\n" in name:
        return hashlib.sha256(name.encode()).hexdigest()
    try:
        digest = hashlib.sha256()
        with open(name, "rb") as file:
            while chunk := file.read(1 << 20):
                digest.update(chunk)
        return digest.hexdigest()
    except OSError as error:
        raise _native.Error(f"{name}: {error.strerror}") from error


def _starts_with(mark: bytes) -> Callable[[str], bool]:
    """Whether ``mark`` is near the start of a file."""

    def is_ours(place: str) -> bool:
        with open(place, "rb") as file:
            return mark in file.read(1024)

    return is_ours


def _holds_events(place: str) -> bool:
    try:
        return bool(numpy.load(place, mmap_mode="r").dtype == EVENT)
    except (ValueError, OSError, EOFError):
        return False


_OWN_FILES: dict[str, Callable[[str], bool]] = {
    "events.aer": _starts_with(b"DTOF-AER"),
    "events.npy": _holds_events,
    "dtof.toml": _starts_with(b"# dtof settings"),
}
