"""The chart of error against time, in the colours of all pictures, light and dark."""

from __future__ import annotations

import io
import re

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
from stored import PALETTE

TITLE = ("Outdoors, events come sooner than frames,", "from numpy nearly as from dtof")
WIDTH, HEIGHT = 560, 720
# The classes of the palette, by their colours in light mode.
CLASSES = {
    "#1f2328": "ink",
    "#59636e": "soft",
    "#0067b1": "c0",
    "#b3470b": "c1",
    "#0a7554": "c2",
    "#7a3db8": "c3",
    "#b0307f": "c4",
    "#8a6100": "c5",
}
INK, SOFT, GRID, EDGE, PAPER = "#1f2328", "#59636e", "#e3e7eb", "#8c959f", "#ffffff"
PENS = {  # colour and mark
    "frames, find_peaks": ("#b0307f", "^"),
    "frames, arrays": ("#8a6100", "v"),
    "asynchronous, arrays": ("#0a7554", "D"),
    "dtof": ("#0067b1", "o"),
}
# A panel for each scene: title, ticks, and the positions of names: index of the dot, and offset.
PANELS = {
    "outdoor": (
        "outdoors: bright and dim pixels",
        (100, 200, 500, 1000),
        (0.15, 0.2, 0.3, 0.4, 0.5),
        {
            "frames, find_peaks": (-1, 9, -12),
            "frames, arrays": (-1, 9, 2),
            "asynchronous, arrays": (0, 10, -2),
            "dtof": (6, -34, -12),
        },
    ),
    "bright": (
        "a bright room: alike from 0.3 bins down",
        (20, 50, 100, 200, 500, 1000),
        (0.05, 0.1, 0.2, 0.4),
        {
            "frames, find_peaks": (-1, 9, -12),
            "frames, arrays": (-1, 9, 4),
            "asynchronous, arrays": (1, 14, 2),
            "dtof": (5, -40, -14),
        },
    ),
}


def svg(rows) -> str:
    """The chart as an SVG document with colours as classes."""
    settings = {
        "svg.fonttype": "none",
        "svg.hashsalt": "dtof",
        "font.size": 14.5,
        "font.family": "sans-serif",
        "font.sans-serif": ["Liberation Sans", "DejaVu Sans"],
    }
    with matplotlib.rc_context(settings):
        figure, panels = plt.subplots(2, 1, figsize=(WIDTH / 72, HEIGHT / 72))
        figure.subplots_adjust(left=0.08, right=0.7, top=0.83, bottom=0.08, hspace=0.33)
        for axes, scene in zip(panels, PANELS):
            draw(axes, [row for row in rows if row.scene == scene], *PANELS[scene])
        for y, words, colour, size, weight in (
            (0.963, TITLE[0], INK, 20, "bold"),
            (0.928, TITLE[1], INK, 20, "bold"),
            (0.892, "error of the first right report, bins", SOFT, 14.5, "normal"),
        ):
            figure.text(0.025, y, words, color=colour, fontsize=size, fontweight=weight)
        figure.text(0.39, 0.014, "laser cycles until then, mean of the pixels", color=SOFT, ha="center")
        drawn = io.StringIO()
        figure.savefig(drawn, format="svg", metadata={"Date": None})
        plt.close(figure)
    return in_classes(drawn.getvalue())


def draw(axes, rows, title, times, errors, places):
    axes.set_facecolor("none")
    axes.set_title(title, loc="left", fontsize=14.5, fontweight="bold", color=INK, pad=8)
    axes.set_xscale("log")
    axes.set_yscale("log")
    for method, (colour, mark) in PENS.items():
        points = best([(row.mean, row.error_bins) for row in rows if row.method == method])
        axes.plot(*zip(*points), color=colour, marker=mark, markersize=5, linewidth=1.5)
        dot, right, up = places[method]
        axes.annotate(method, points[dot], (right, up), color=colour, textcoords="offset points")
    axes.set_xticks(times, [str(time) for time in times])
    axes.set_yticks(errors, [str(error) for error in errors])
    axes.minorticks_off()
    axes.tick_params(labelcolor=SOFT, color=EDGE)
    axes.grid(axis="y", color=GRID, linewidth=1)
    axes.set_axisbelow(True)
    for side, spine in axes.spines.items():
        spine.set_visible(side == "bottom")
        spine.set_color(EDGE)


def best(points):
    """The Pareto frontier: points without another that is both sooner and more exact."""
    return [point for point in points if not any(other[0] < point[0] and other[1] < point[1] for other in points)]


def in_classes(text: str) -> str:
    """Replaces colours by classes, so that the style sheet follows the reader's colour scheme."""
    text = re.sub(r"<metadata>.*?</metadata>|<style.*?</style>", "", text, flags=re.DOTALL)
    text = re.sub(r"font-family: [^;\"]*;? ?", "", text)

    def named(match):
        tag, style, rest = match.groups()
        found = set(re.findall(r"#[0-9a-f]{6}\b", style))
        if found == {GRID}:
            return f'<{tag} class="grid" style="{without(style)}"{rest}'
        if found == {EDGE}:
            return f'<{tag} class="edge" style="{without(style)}"{rest}'
        if found == {PAPER}:
            return f'<{tag} class="paper"{rest}'
        if not found:
            return match.group()
        (colour,) = found  # an element has one colour
        style = style.replace(colour, "currentColor")
        return f'<{tag} class="{CLASSES[colour]}" style="{style}"{rest}'

    def without(style):
        kept = [part.strip() for part in style.split(";") if "#" not in part]
        return "; ".join(["fill: none", *(part for part in kept if part and part != "fill: none")])

    text = re.sub(r'<(\w+(?: [^<>]*?)?) style="([^"]*)"([^<>]*>)', named, text)
    sheet = PALETTE.read_text(encoding="utf-8")
    head = (
        f'<svg width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" '
        'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        f'class="dtof" role="img"><title>{" ".join(TITLE)}</title><style>{sheet}</style>'
    )
    body = text[text.index(">", text.index("<svg")) + 1 :]
    lines = (line.strip() for line in body.splitlines())
    return head + "\n" + "\n".join(line for line in lines if line) + "\n"
