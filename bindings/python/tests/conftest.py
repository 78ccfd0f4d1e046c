"""The program that the package is compared with, and public recordings."""

import json
import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
DATA = ROOT.parent / "shared" / "data"


def built():
    """Builds the program; returns its path."""
    done = subprocess.run(
        ["cargo", "build", "--release", "--package", "dtof", "--message-format", "json"],
        cwd=ROOT,
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    )
    messages = (json.loads(line) for line in done.stdout.splitlines())
    names = [message.get("executable") for message in messages]
    return next(name for name in names if name and Path(name).stem == "dtof")


@pytest.fixture(scope="session")
def program():
    """Runs the program; returns its output, and fails if it fails."""
    name = os.environ.get("DTOF_PROGRAM") or built()

    def run(*arguments, check=True):
        arguments = [name, *map(os.fspath, arguments)]
        done = subprocess.run(arguments, capture_output=True, text=True)
        assert not check or done.returncode == 0, done.stderr
        return done.stdout if check else done.stderr

    run.name = name
    return run


@pytest.fixture
def recorded(capsys):
    """The path of a public recording; the test is skipped, with a message, without it."""

    def place(name):
        path = DATA / name
        if not path.exists():
            with capsys.disabled():
                print(f"\nSKIPPED: recorded photons: no {path}")
            pytest.skip("no recorded photons")
        return path

    return place
