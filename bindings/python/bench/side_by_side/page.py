"""The page of results, from the tables that are kept."""

from __future__ import annotations

from measure import AFTER, CYCLES_PER_ALARM, WITHIN, WRONG_BINS, chosen, times_at
from methods import EXPOSURES, LEAST, METHODS, OWN_THRESHOLD
from photons import FIND_PEAKS_NEEDS, FRAMES_NEED, HALF_WIDTHS

SAYS = {
    "frames, find_peaks": "every pixel exposes for the same time; `gaussian_filter1d`, then `find_peaks` for "
    "each pixel with enough photons in three neighbours",
    "frames, arrays": "the same without a loop over pixels: the three neighbours with the most photons, "
    "a threshold for Poisson counts",
    "asynchronous, arrays": "the paper's idea: every four laser cycles, each pixel whose three best bins stand clear of the "
    "others reports and starts over",
    "dtof": "one call of `dtof.photons` with `rule=\"window\"`",
}
SCENES = {
    "bright": "A bright room",
    "outdoor": "Outdoors",
    "recording": "A recording",
}


def text(rows, speeds) -> str:
    """The whole page."""
    parts = [HEAD, in_short(rows, speeds), COMPARED, ways(), MEASURED]
    for scene, title in SCENES.items():
        parts += [f"## {title}", SCENE[scene], figures(rows, scene)]
    parts += [SPEED, speed(speeds), machine(speeds), FAIR]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def table(head, lines) -> str:
    rows = ["| " + " | ".join(map(str, row)) + " |" for row in (head, *lines)]
    return "\n".join([rows[0], "|" + "---|" * len(head), *rows[1:]])


def ways() -> str:
    lines = [(method.name, SAYS[method.name], method.lines) for method in METHODS]
    return table(("way", "what it does", "lines of code"), lines)


def figures(rows, scene) -> str:
    head = ("error", "way", "mean time", "half of the pixels", "nine in ten", "setting", "wrong, %",
            "false alarms")
    lines = []
    for within in WITHIN:
        for method in METHODS:
            row = chosen(of(rows, scene, method.name), within)
            times = times_at(of(rows, scene, method.name), within)
            mm_per_bin = row.error_mm / row.error_bins
            setting = f"{row.setting} {'laser cycles' if method.by_exposure else 'photons'}"
            lines.append((f"{within} bins, {rounded(within * mm_per_bin)} mm", method.name,
                          *(f"{time:.0f}" for time in times), setting, f"{100 * row.wrong:.1f}",
                          f"{row.false_alarms:.2f}"))
    return table(head, lines)


def speed(speeds) -> str:
    lines = [(method.name, *(rounded(row.one_core) for row in by_name(speeds, method.name)))
             for method in METHODS]
    return table(("way", *(title.lower() for title in SCENES.values())), lines)


def machine(speeds) -> str:
    photons = ", ".join(f"{row.photons / 1e6:.1f}" for row in by_name(speeds, "dtof"))
    return (f"The scenes have {photons} million photons. The machine: {speeds[0].machine}.\n"
            "Other work ran beside.")


def in_short(rows, speeds) -> str:
    """What comes out, each with its figures."""
    slow, frames, events, ours = (method.name for method in METHODS)
    lines = {method.name: method.lines for method in METHODS}

    def times(method, within, scene="outdoor"):
        return times_at(of(rows, scene, method), within)

    def ratios(over, under):
        pairs = zip(by_name(speeds, over), by_name(speeds, under))
        return span([one.one_core / other.one_core for one, other in pairs])

    pairs = zip(*([row for row in rows if row.method == name] for name in (ours, events)))
    errors = [one.error_bins / other.error_bins for one, other in pairs]
    coarse, fine = WITHIN
    waits = [times(name, coarse)[0] for name in (ours, events, slow, frames)]
    alike = [times(name, fine)[0] for name in (ours, events, slow, frames)]
    bright = [times(name, coarse, "bright")[0] for name in (ours, events, slow, frames)]
    of_frames = " or ".join(dict.fromkeys(f"{time:.0f}" for time in bright[2:]))
    exact = [times(name, fine, "bright")[0] for name in lines]
    late = [times(name, fine)[2] for name in (ours, slow)]
    own = [row.false_alarms for row in rows if row.method == OWN_THRESHOLD]
    return f"""
- **Photons a second.** Frames in numpy arrays take {ratios(frames, ours)} times as many as `dtof`. Asynchronous
  numpy takes {ratios(events, ours)} times as many, frames with `find_peaks` {ratios(slow, ours)}.
- **Time.** Outdoors, at an error of {coarse} bins, a pixel is first right after {waits[0]:.0f} laser cycles with `dtof`,
  {waits[1]:.0f} with asynchronous numpy, and {waits[2]:.0f} or {waits[3]:.0f} with frames of the best length, which are more exact.
  At {fine} bins, which all can be, it is {alike[0]:.0f}, {alike[1]:.0f}, and {alike[2]:.0f} or {alike[3]:.0f}.
- **A bright room.** At {coarse} bins a pixel waits {bright[0]:.0f}, {bright[1]:.0f} and {of_frames} laser cycles; at {fine} bins all take {span(exact)}.
- **The dimmest pixels.** Outdoors, at {fine} bins, nine in ten pixels are right after {late[1]:.0f} laser cycles of frames, and
  after {late[0]:.0f} with `dtof`. Every event has the same least photons, which dim pixels take long to see.
- **Error.** With the same least photons, the error of `dtof` is {span(errors)} times that of asynchronous numpy.
- **Threshold.** With its own, that of `--false-alarm 0.01`, `dtof` has {span(own)} times the false alarms allowed. The
  ways of numpy need photons without a target to find theirs; that code is not counted.
- **Lines of code.** {lines[ours]} with `dtof`, {lines[slow]} or {lines[frames]} for frames, {lines[events]} for asynchronous numpy.
"""


def of(rows, scene, method):
    return [row for row in rows if (row.scene, row.method) == (scene, method)]


def by_name(speeds, method):
    """A row for each scene."""
    return [row for scene in SCENES for row in of(speeds, scene, method)]


def span(values) -> str:
    low, high = rounded(min(values)), rounded(max(values))
    return low if low == high else f"{low} to {high}"


def rounded(value) -> str:
    """Two digits, or all before the point."""
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


HEAD = """
# numpy and scipy beside dtof

Made by `python bindings/python/bench/side_by_side`; do not edit. The same photons go through code as a researcher
writes it today, and through [`dtof` for Python](../../bindings/python/README.md).
"""

COMPARED = """
![Error against the mean time to the first right report](../figures/python.svg)

The picture leaves out settings that are later and less exact than another of the same way.

## What is compared

The code is in [`numpy_way.py`](../../bindings/python/bench/side_by_side/numpy_way.py) and
[`dtof_way.py`](../../bindings/python/bench/side_by_side/dtof_way.py). Lines are those of a function and of all it calls
there, without imports, comments and docstrings.
"""

MEASURED = f"""
| what | how it is measured |
|---|---|
| time | laser cycles until a pixel has its first right report. In the mean, a pixel without one has waited for the whole run |
| error | root mean square of these first reports; each pixel counts once |
| wrong | pixels whose first report is more than {WRONG_BINS:.0f} bins off, of those with a report |
| false alarms | reports of pixels without a target, over those allowed: one in {CYCLES_PER_ALARM:,} laser cycles, which is 1 % of exposures of 2000 |

Each way has the lowest threshold with no more false alarms than allowed, on photons without a target. The column counts
them in other photons. About 40 were allowed, so 0.7 to 1.3 is what chance does. Each length of frames has a threshold of
its own; short ones have fewer false alarms where the least photons hold off more. The other ways keep the threshold of
the least photons, so higher settings have fewer.

A setting is the length of frames, {EXPOSURES[0]} to {EXPOSURES[-1]} laser cycles, or the least photons in the three best bins,
{LEAST[0]} to {LEAST[-1]}, in steps of the root of two. Times are those at just that error, on a line in logarithms between two
settings. Where a way is always more exact, they are its shortest. The columns from the setting on belong to the soonest
setting that is as exact.

[All rows](data/python.csv) are kept, with the error of the mean of all right reports in the first {AFTER} laser cycles.
"""

SCENE = {
    "bright": """
1024 pixels see targets at 0.5 to 4.3 m with 0.3 to 1 signal photons a laser cycle. The background is 0.005 photons a bin
and laser cycle. A bin is 250 ps, the pulse has a standard deviation of one bin.
""",
    "outdoor": """
1024 pixels see targets at 6 to 18 m, of a reflectivity of 0.1 to 0.8. That makes 0.03 to 2 signal photons a laser cycle,
and 0.01 to 0.045 background photons a bin. A bin is 1 ns, the pulse has a standard deviation of one bin.
""",
    "recording": """
The centre zone of a TMF8820 before a plane at 30 to 400 mm: 149 captures, each cut into eight pixels that share no
photon. The recording has next to no background, so 0.01 photons a bin and laser cycle were added. The offset of the
sensor is not known: the median error of each way is left out.
""",
}

SPEED = """
## Speed

Millions of photons a second of processor time on one core, the best of three, with the setting for 0.4 bins. Everything
from photons to reports counts.
"""

FAIR = f"""
## How fair this is

- All photons are ideal: no dead time, no afterpulses, and nothing moves.
- The simulated pulse is Gaussian, and its width is known to all ways.
- The recorded pulse falls slowly. `dtof` knows this, by half widths of {HALF_WIDTHS[0]:g} and {HALF_WIDTHS[1]:g} bins; the ways of numpy do not.
- The centroid of numpy reaches 2 or 3 bins to each side, whichever has the smaller error in the scene.
- All ways of numpy take as background the mean of all bins but the three best. A median of so few photons is zero.
- A frame needs at least {FRAMES_NEED} photons in its three best bins; on the recording, {FIND_PEAKS_NEEDS} for `find_peaks`. This is the best of
  5, 6, 7 and 10 there. In the bright room the shortest frames have no threshold without it: some see no background.
- The cost of asynchronous numpy is that of looks at all pixels. With fewer photons a look it is slower for each of them.
- Times begin with a frame. A target that appears within one is seen at the end of the next.
- No way of numpy counts what it loses, checks what it is given, or has [echoes, binning and
  tracking](../recordings.md#dim-surfaces-still-surfaces-two-surfaces).

## Again

```sh
pip install "./bindings/python[test,notebook]"
python bindings/python/bench/side_by_side RECORDING            # writes this page, ten minutes
python bindings/python/bench/side_by_side RECORDING --check    # compares all but the speed
```

`RECORDING` is the [public log](../recordings.md#logs-of-sensors). Another version of numpy may draw other photons.
"""
