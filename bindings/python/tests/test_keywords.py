"""Keywords have types, ranges and help, and they are those of the program."""

import inspect
import os
import re
import subprocess
import sys

import numpy
import pytest

import dtof
from conftest import ROOT
from dtof import _keywords, _native

OTHERS = {
    "replay": "input out dynamic_depth threshold_mm reference echo no_csv quiet help",
    "simulate": "scene depth depth_along albedo fov signal_at_one_metre background pulse_sigma_bins out dynamic_depth "
    "threshold_mm reference echo no_csv quiet device image help",
    "calibrate": "input device image seconds photons host_timeout out report settings quiet help",
    "compare": "input scene truth out quiet help",
    "tune": "json help",
    "export": "format out settings events slice_us threshold_mm reference quiet help",
}


def help_of(program, job):
    """The help of each option, with the names of keywords."""
    options, name = {}, None
    for line in program(job, "--help").splitlines():
        flag = re.match(r"\s+(?:-\w, )?--([\w-]+)(?:\[?[ =]*<[^>]*>\]?)?(?:\s{2,}(.*))?$", line)
        if flag:
            name = flag[1].replace("-", "_")
            options[name] = flag[2] or ""
        elif name and line.strip() and not options[name]:
            options[name] = line.strip()
    named = {
        name: re.sub(r"--([a-z0-9-]+)", lambda flag: flag[1].replace("-", "_"), text) for name, text in options.items()
    }
    return {name: re.sub(r" \[possible values:.*\]$", "", text) for name, text in named.items()}


@pytest.mark.parametrize("job", OTHERS)
def test_keywords_are_the_options_of_the_program_with_their_help(program, job):
    of_program = help_of(program, job)
    expected = {name: text for name, text in of_program.items() if name not in OTHERS[job].split()}
    keywords = _keywords.all_of(getattr(_keywords, {"export": "Points"}.get(job, job.title()) + "Options"))
    assert {name: keyword.help for name, keyword in keywords.items()} == expected
    function = getattr(dtof, job)
    assert set(expected) <= set(inspect.signature(function).parameters)
    for name, keyword in keywords.items():
        assert f"\n{name}: {keyword.values}\n" in function.__doc__


def test_types_are_made_from_the_tables_of_the_options():
    types = []
    for options, keywords in _native.keywords():
        of = {"PixelOptions": "``Pixel`` and ``Pixels``", "PointsOptions": "``points`` and ``export``"}
        of = of.get(options, f"``{options.removesuffix('Options').lower()}``")
        lines = "".join(f"    {name}: {kind}\n" for name, kind, _, _ in keywords)
        types.append(f'class {options}(TypedDict, total=False):\n    """Of {of}."""\n\n{lines}')
    file = ROOT / "bindings" / "python" / "python" / "dtof" / "_keywords.py"
    text = file.read_text()
    begin, end = text.index("test_keywords.py\n") + len("test_keywords.py\n"), text.index("# The end of these types.")
    made = "\n\n" + "\n\n".join(types) + "\n\n"
    if os.environ.get("DTOF_BLESS"):
        file.write_text(text[:begin] + made + text[end:])
    else:
        assert text[begin:end] == made


def test_ranges_are_those_of_the_program():
    tried = 0
    for name, keyword in _keywords.all_of(_keywords.ReplayOptions).items():
        ends = re.match(r"(whole )?number, (-?[\d.]+) to (-?[\d.]+)", keyword.values)
        if not ends:
            continue
        whole, low, high = ends.groups()
        number, step = (int, 1) if whole else (float, 0.01)
        for value in (number(low), number(high)):
            dtof._native.check_options([(name, repr(value))])
        for value in (number(low) - step, number(high) + step):
            with pytest.raises(dtof.Error, match=name):
                dtof._native.check_options([(name, repr(value))])
        tried += 1
    assert tried >= 15


def test_mypy_names_a_wrong_keyword(tmp_path):
    code = tmp_path / "code.py"
    code.write_text(
        "import dtof, numpy\n"
        "counts = numpy.ones((2, 3, 16), dtype=int)\n"
        "dtof.replay(counts, alpha=4, gate=(3, 9), mask=numpy.array([1]), settings={'sensor': {}}, l1=numpy.int64(4))\n"
        "dtof.replay(counts, alhpa=4)\n"
        "dtof.tune(background='much')\n"
        "dtof.Pixels(2, 2, rule='best')\n"
    )
    done = subprocess.run([sys.executable, "-m", "mypy", "--cache-dir", tmp_path, code], capture_output=True, text=True)
    lines = [line for line in done.stdout.splitlines() if ": error: " in line]
    assert [int(line.split(":")[1]) for line in lines] == [4, 5, 6], done.stdout
    assert 'Unexpected keyword argument "alhpa"' in lines[0] and '"alpha"' in lines[0]


def test_settings_are_a_file_a_text_a_dict_or_a_result(tmp_path):
    counts = numpy.random.default_rng(3).poisson(9.0, (4, 4, 64)) + 90 * (numpy.arange(64) == 20)
    run = dtof.replay(counts, l1=60, gate=(2, 50), mask=[3])
    (tmp_path / "own.toml").write_text(run.toml)
    for settings in (tmp_path / "own.toml", str(tmp_path / "own.toml"), run.toml, run.settings, run):
        again = dtof.replay(counts, settings=settings)
        assert (again.events == run.events).all() and again.settings == run.settings
        assert dtof.Pixels(4, 4, 64, settings=settings).settings["detection"]["l1"] == 60
    found = dtof.calibrate(counts, recorded_cycles=9000, settings=run.settings)
    assert dtof.replay(counts, settings=found).settings["sensor"]["gate"] == found.settings["sensor"]["gate"]
    assert dtof.replay(counts, settings={}).events.size > 0
