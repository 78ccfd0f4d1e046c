"""The live page of events, by the program ``dtof``."""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import tempfile
import webbrowser
from typing import Any, Optional

from ._native import Error
from ._warn import warn, with_keywords


class View:
    """A page that plays events on this computer, until it is closed or Python ends.

    ``address`` is for a browser. A notebook shows the page in the output of its cell. A script that would end calls
    :meth:`wait`.
    """

    address: str

    def __init__(self, command: list[str], folder: Optional[tempfile.TemporaryDirectory[str]]) -> None:
        # A session of its own: Ctrl-C in Python is for Python.
        with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as complaints:
            self._program = subprocess.Popen(
                command,
                stdout=subprocess.PIPE,
                stderr=complaints,
                stdin=subprocess.DEVNULL,
                text=True,
                start_new_session=True,
            )
            self._folder = folder
            atexit.register(self.close)
            assert self._program.stdout is not None
            self.address = self._program.stdout.readline().strip()
            complaints.seek(0)
            lines = complaints.read().splitlines()
            if not self.address:
                self.close()
                lines = lines or ["the program dtof has shown no page"]
                raise Error(with_keywords(lines[-1].removeprefix("error: ")))
            try:
                warn([line.removeprefix("warning: ") for line in lines], callers=3)
            except Warning:
                self.close()
                raise

    def wait(self) -> None:
        """Waits until the page ends, as by Ctrl-C."""
        try:
            self._program.wait()
        finally:
            self.close()

    def close(self) -> None:
        """Ends the page."""
        atexit.unregister(self.close)
        self._program.terminate()
        self._program.wait()
        if self._program.stdout is not None:
            self._program.stdout.close()
        if self._folder is not None:
            self._folder.cleanup()

    def __enter__(self) -> View:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<dtof.View: {self.address}>"

    def _repr_html_(self) -> str:
        address = self.address
        return (
            f'<p><a href="{address}" target="_blank">{address}</a></p>'
            f'<iframe src="{address}" title="Live page" style="width: 100%; height: 800px; border: 0"></iframe>'
        )


def view(run: Any, *, speed: Optional[float] = None, laser_hz: Optional[int] = None, browser: bool = True) -> View:
    """Shows the events of a run, or of an AER file, on a page in the browser.

    They play at the rate of the laser, ``speed`` times as fast (1). ``laser_hz`` is that rate in hertz; by default it is
    that of the run or the file, and 10 MHz with a warning for a run that has none. With ``browser=False`` no browser
    opens: the ``address`` of the result is for one. The page is that of ``dtof view``: it needs the program ``dtof``,
    which is installed apart.
    """
    program = shutil.which("dtof")
    if program is None:
        raise Error("view needs the program dtof, which is not installed: cargo install --locked --path host/cli")
    folder = None
    if isinstance(run, (str, os.PathLike)):
        file = os.fspath(run)
    elif hasattr(run, "write_events"):
        folder = tempfile.TemporaryDirectory(prefix="dtof-")
        file = os.path.join(folder.name, "events.aer")
        run.write_events(file)
        if laser_hz is None and not run.array.laser_millihertz:
            laser_hz = 10_000_000
            warn([f"the laser rate is not known: the events are shown at {laser_hz} Hz; laser_hz changes that"])
    else:
        raise Error(f"{type(run).__name__}: must be a run or the name of an AER file")
    options = [] if speed is None else [f"--speed={speed}"]
    options += [] if laser_hz is None else [f"--laser-hz={laser_hz}"]
    page = View([program, "view", file, *options], folder)
    if browser:
        webbrowser.open(page.address)
    return page
