"""The page of results, from the stored tables."""

from __future__ import annotations

from measure import AVERAGED_CYCLES, CYCLES_PER_ALARM, WITHIN, WRONG_BINS, chosen, times_at
from methods import EXPOSURES, METHODS, MIN_PHOTONS, OWN_THRESHOLD
from photons import FIND_PEAKS_MIN_PHOTONS, FRAMES_MIN_PHOTONS, HALF_WIDTHS

DESCRIPTIONS = {
    "frames, find_peaks": "every pixel exposes for the same time; `gaussian_filter1d`, then `find_peaks` for "
    "each pixel with enough photons in three neighbours",
    "frames, arrays": "the same without a loop over pixels: the three neighbours with the most photons, "
    "a threshold for Poisson counts",
    "asynchronous, arrays": "the paper's idea: every four laser cycles, each pixel whose three best bins stand clear of the "
    "others reports and starts over",
    "dtof": 'one call of `dtof.photons` with `rule="window"`',
}
SCENES = {
    "bright": "A bright room",
    "outdoor": "Outdoors",
    "recording": "A recording",
}


def text(rows, speeds) -> str:
    """The whole page."""
    parts = [HEAD, in_short(rows, speeds), COMPARED, methods_table(), MEASURED]
    for scene, title in SCENES.items():
        parts += [f"## {title}", SCENE[scene], figures(rows, scene)]
    parts += [SPEED, speed(speeds), machine(speeds), FAIR]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def table(head, lines) -> str:
    rows = ["| " + " | ".join(map(str, row)) + " |" for row in (head, *lines)]
    return "\n".join([rows[0], "|" + "---|" * len(head), *rows[1:]])


def methods_table() -> str:
    lines = [(method.name, DESCRIPTIONS[method.name], method.lines) for method in METHODS]
    return table(("method", "what it does", "lines of code"), lines)


def figures(rows, scene) -> str:
    head = ("error", "method", "mean time", "half of the pixels", "nine in ten", "setting", "wrong, %", "false alarms")
    lines = []
    for within in WITHIN:
        for method in METHODS:
            row = chosen(of(rows, scene, method.name), within)
            times = times_at(of(rows, scene, method.name), within)
            mm_per_bin = row.error_mm / row.error_bins
            setting = f"{row.setting} {'laser cycles' if method.by_exposure else 'photons'}"
            lines.append(
                (
                    f"{within} bins, {rounded(within * mm_per_bin)} mm",
                    method.name,
                    *(f"{time:.0f}" for time in times),
                    setting,
                    f"{100 * row.wrong:.1f}",
                    f"{row.false_alarms:.2f}",
                )
            )
    return table(head, lines)


def speed(speeds) -> str:
    lines = [(method.name, *(rounded(row.one_core) for row in in_scenes(speeds, method.name))) for method in METHODS]
    return table(("method", *(title.lower() for title in SCENES.values())), lines)


def machine(speeds) -> str:
    photons = ", ".join(f"{row.photons / 1e6:.1f}" for row in in_scenes(speeds, "dtof"))
    return f"The scenes have {photons} million photons. The machine: {speeds[0].machine}.\nOther work ran beside."


def in_short(rows, speeds) -> str:
    """The summary with its numbers."""
    find_peaks, frames, asynchronous, ours = (method.name for method in METHODS)
    lines = {method.name: method.lines for method in METHODS}

    def times(method, within, scene="outdoor"):
        return times_at(of(rows, scene, method), within)

    def ratios(over, under):
        pairs = zip(in_scenes(speeds, over), in_scenes(speeds, under))
        return span([one.one_core / other.one_core for one, other in pairs])

    pairs = zip(*([row for row in rows if row.method == name] for name in (ours, asynchronous)))
    errors = [one.error_bins / other.error_bins for one, other in pairs]
    coarse, fine = WITHIN
    compared = (ours, asynchronous, find_peaks, frames)
    coarse_times = [times(name, coarse)[0] for name in compared]
    fine_times = [times(name, fine)[0] for name in compared]
    bright = [times(name, coarse, "bright")[0] for name in compared]
    of_frames = " or ".join(dict.fromkeys(f"{time:.0f}" for time in bright[2:]))
    exact = [times(name, fine, "bright")[0] for name in lines]
    late = [times(name, fine)[2] for name in (ours, find_peaks)]
    own = [row.false_alarms for row in rows if row.method == OWN_THRESHOLD]
    return f"""
- **Photons a second.** Frames in numpy arrays take {ratios(frames, ours)} times as many as `dtof`. Asynchronous
  numpy takes {ratios(asynchronous, ours)} times as many, frames with `find_peaks` {ratios(find_peaks, ours)}.
- **Time.** Outdoors, at an error of {coarse} bins, a pixel is first right after {coarse_times[0]:.0f} laser cycles with `dtof`,
  {coarse_times[1]:.0f} with asynchronous numpy, and {coarse_times[2]:.0f} or {coarse_times[3]:.0f} with frames of the best length, which are more exact.
  At {fine} bins, which all methods reach, it is {fine_times[0]:.0f}, {fine_times[1]:.0f}, and {fine_times[2]:.0f} or {fine_times[3]:.0f}.
- **A bright room.** At {coarse} bins a pixel waits {bright[0]:.0f}, {bright[1]:.0f} and {of_frames} laser cycles; at {fine} bins all take {span(exact)}.
- **The dimmest pixels.** Outdoors, at {fine} bins, nine in ten pixels are right after {late[1]:.0f} laser cycles of frames, and
  after {late[0]:.0f} with `dtof`. Every event needs the same minimum of photons, and dim pixels take long to collect it.
- **Error.** With the same minimum of photons, the error of `dtof` is {span(errors)} times that of asynchronous numpy.
- **Threshold.** With its own threshold, that of `--false-alarm 0.01`, `dtof` has {span(own)} times the false alarms allowed. The
  numpy methods need photons without a target to find theirs; that code is not counted.
- **Lines of code.** {lines[ours]} with `dtof`, {lines[find_peaks]} or {lines[frames]} for frames, {lines[asynchronous]} for asynchronous numpy.
"""


def of(rows, scene, method):
    return [row for row in rows if (row.scene, row.method) == (scene, method)]


def in_scenes(speeds, method):
    """The rows of a method, one for each scene."""
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

The picture leaves out settings that are later and less exact than another of the same method.

## What is compared

The code is in [`with_numpy.py`](../../bindings/python/bench/side_by_side/with_numpy.py) and
[`with_dtof.py`](../../bindings/python/bench/side_by_side/with_dtof.py). Lines are those of a function and of all it calls
there, without imports, comments and docstrings.
"""

MEASURED = f"""
| what | how it is measured |
|---|---|
| time | laser cycles until a pixel has its first right report. In the mean, a pixel without one has waited for the whole run |
| error | root mean square of these first reports; each pixel counts once |
| wrong | pixels whose first report is more than {WRONG_BINS:.0f} bins off, of those with a report |
| false alarms | reports of pixels without a target, over those allowed: one in {CYCLES_PER_ALARM:,} laser cycles, which is 1 % of exposures of 2000 |

Each method has the lowest threshold with no more false alarms than allowed, on photons without a target. The column
counts false alarms in other photons. About 40 were allowed, so chance alone gives 0.7 to 1.3. Each length of frames has
a threshold of its own; short frames have fewer false alarms where the minimum of photons already rejects most of them.
The other methods keep the threshold of their lowest setting, so higher settings have fewer false alarms.

A setting is the length of frames, {EXPOSURES[0]} to {EXPOSURES[-1]} laser cycles, or the minimum of photons in the three best
bins, {MIN_PHOTONS[0]} to {MIN_PHOTONS[-1]}, in steps of the root of two. Times are those at exactly that error, interpolated in logarithms between
two settings. If all settings of a method are more exact, they are its shortest times. The last three columns belong to
the setting with the shortest mean time that is at least as exact.

[All rows](data/python.csv) are kept, with the error of the mean of all right reports in the first {AVERAGED_CYCLES} laser cycles.
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
sensor is not known: the median error of each method is left out.
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
- The simulated pulse is Gaussian, and its width is known to all methods.
- The recorded pulse falls slowly. `dtof` knows this, by half widths of {HALF_WIDTHS[0]:g} and {HALF_WIDTHS[1]:g} bins; the numpy methods do not.
- The centroid of numpy reaches 2 or 3 bins to each side, whichever has the smaller error in the scene.
- All numpy methods take as background the mean of all bins but the three best. A median of so few photons is zero.
- A frame needs at least {FRAMES_MIN_PHOTONS} photons in its three best bins; on the recording, {FIND_PEAKS_MIN_PHOTONS} for `find_peaks`. This is the best of
  5, 6, 7 and 10 there. In the bright room the shortest frames have no threshold without it: some see no background.
- Most of the cost of asynchronous numpy is to examine all pixels every four laser cycles. With fewer photons in these
  cycles it takes longer for each of them.
- Times begin with a frame. A target that appears within one is seen at the end of the next.
- No numpy method counts what it loses, checks what it is given, or has [echoes, binning and
  tracking](../recordings.md#dim-surfaces-still-surfaces-two-surfaces).

## Again

```sh
pip install "./bindings/python[test,notebook]"
python bindings/python/bench/side_by_side RECORDING            # writes this page, ten minutes
python bindings/python/bench/side_by_side RECORDING --check    # compares all but the speed
```

`RECORDING` is the [public log](../recordings.md#logs-of-sensors). Another version of numpy may draw other photons.
"""
