//! Rows of the page: cases that fail alike, and what to do about them.

/// Similar cases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row {
    /// What the cases have in common.
    pub name: &'static str,
    /// What helps besides another method. Empty if there is nothing to say.
    pub advice: &'static str,
    /// Why no flag marks the wrong events. Empty if flags do, or if the reason is not known.
    pub silence: &'static str,
}

const fn row(name: &'static str, advice: &'static str, silence: &'static str) -> Row {
    Row {
        name,
        advice,
        silence,
    }
}

const COUNTERS: &str = "not measured: wider counters";
const SET: &str = "set the dead time";
const ECHOES_LAST: &str = "not measured: take the last of several echoes";
const SLOPE: &str = "The histogram is that of a near target";
const SINGLE: &str = "The histogram is that of a near target. The rule compares single bins with one level; the window rule \
                      weighs them";

pub(crate) const PLAIN: Row = row("plain, no target, background to 50", "", "");
pub(crate) const MUCH_LIGHT: Row = row("background 500", COUNTERS, "");
pub(crate) const WEAK: Row = row("weak signal, background to 5", "", "");
pub(crate) const WEAK_50: Row = row("weak signal, background 50 or × 4", "", "");
pub(crate) const WEAK_500: Row = row("weak signal, background 500", COUNTERS, "");
pub(crate) const HOT: Row = row(
    "hot pixel, 100 × background",
    "not measured: switch the pixel off",
    "The threshold lets one exposure in 100 bring a false alarm, and hardly any brings another event. That events are \
     so rare tells, no single histogram does",
);

pub(crate) const SHAPES: Row = row("bin edge, echo, tail, 80 photons", "", "");
pub(crate) const FULL: Row = row(
    "signal of 400 photons",
    "not measured: a shorter L1; leave out saturated events",
    "",
);
pub(crate) const ENDS: Row = row(
    "pulse at 0.3 or at 127.7 bins",
    "not measured: leave out clipped events, or shift the histogram",
    "",
);
pub(crate) const QUADRANTS: Row = row(
    "a pulse in each quadrant",
    "not measured: a gate, if one of them is known",
    "",
);
pub(crate) const DRIFT: Row = row(
    "drift of 5 bins in 1000 cycles",
    "not measured: a rule that fires sooner",
    "The histogram is that of a still target, where it was on average. The event tells its exposure",
);
pub(crate) const WEAK_DRIFT: Row = row(
    "drift of 5 bins, weak signal",
    "not measured: more light or a shorter L2, so that exposures are shorter",
    "In 390 laser cycles, the window's, the target goes 2 bins. That widens the pulse from σ 1 to 1.15, and its 47 \
     signal photons tell the width to 10 % at best. A test of the width that flags 1 % of still targets finds less \
     than an eighth of such events, so none is built",
);

pub(crate) const FEW_PHOTONS: Row = row("one hit, to 1.5 photons a cycle", "", SLOPE);
pub(crate) const ONE_HIT: Row = row("one hit, 2 photons, or 3 in a pulse", "", SINGLE);
pub(crate) const FIRST: Row = row("first photon only, 3 to 12 photons", SET, SLOPE);
pub(crate) const FIRST_SET: Row = row("first photon only, 3 or 6, set", "", SINGLE);
pub(crate) const FIRST_12_SET: Row = row("first photon only, 12, set", "", SINGLE);
pub(crate) const DEAD_20: Row = row("dead for 20 bins, to 6 photons", "", SINGLE);
pub(crate) const DEAD_20_12: Row = row("dead for 20 bins, 12 photons", SET, SLOPE);
pub(crate) const DEAD_20_12_SET: Row = row("dead for 20 bins, 12, set", "", SINGLE);
pub(crate) const DEAD_20_EMPTY: Row = row("dead for 20 bins, no target", SET, SLOPE);
pub(crate) const DEAD_20_EMPTY_SET: Row = row("dead for 20 bins, no target, set", "", SINGLE);
pub(crate) const CROSSTALK: Row = row(
    "crosstalk, no target, set to 19 or 20",
    "",
    "Rules that take each bin as live see a target where the crosstalk's dead time ends",
);
pub(crate) const CROSSTALK_21: Row = row(
    "crosstalk, set to 21 of 20 bins",
    "round the dead time down",
    "The bin where the crosstalk's dead time ends was live more often than any of the rules expects",
);
pub(crate) const DEAD_5: Row = row(
    "dead for 5 bins, to 12 photons",
    "set the dead time: then all hold",
    SLOPE,
);

pub(crate) const GLASS: Row = row(
    "cover glass, 10 × the signal",
    "a gate from bin 10: all hold",
    "The histogram is that of a bright target at 3.5 bins before another one. A gate needs to know of the glass",
);
pub(crate) const GATE: Row = row("cover glass or rain, with a gate", "", "");
pub(crate) const SMALL_DROPS: Row = row("rain, drops of 3 photons", "", "");
pub(crate) const RAIN: Row = row(
    "rain, drops of 30 photons",
    "count photons once a bin and laser cycle, or a gate behind the drops",
    "The histogram is that of a near target. It does not tell that all photons came in one laser cycle",
);
pub(crate) const RAIN_ONCE: Row = row("rain, counted once per bin", "", "");
pub(crate) const THIN: Row = row(
    "veil of 0.5, smoke of 2 × the signal",
    ECHOES_LAST,
    "The histogram is that of two surfaces, or of a wide target before another one. No test of the width is built",
);
pub(crate) const VEIL: Row = row(
    "veil of 2 × the signal",
    ECHOES_LAST,
    "The histogram is that of two surfaces",
);

const STAYS: &str = "The histogram is that of a target where the other pulse stays";
pub(crate) const DIM_LIDAR: Row = row(
    "LiDAR, same rate, half as bright",
    "dither: a random time from pulse to pulse",
    STAYS,
);
pub(crate) const LIDAR: Row = row(
    "LiDAR, as bright or more; no target",
    "dither: a random time from pulse to pulse",
    STAYS,
);
pub(crate) const OTHER_RATE: Row = row("LiDAR, rate 1 % off", "", "");
pub(crate) const DITHER: Row = row(
    "LiDAR, own dither of 128 bins",
    "count photons once a bin and laser cycle, too: all hold",
    "All photons of one pulse of the other come in the same one to three bins. The histogram does not tell that they \
     came in one laser cycle",
);
pub(crate) const DITHER_ONCE: Row = row("LiDAR, dither, counted once per bin", "", "");

/// All rows with the titles of their sections, in the order of the page.
pub const SECTIONS: [(&str, &[Row]); 5] = [
    (
        "Signal and background",
        &[PLAIN, MUCH_LIGHT, WEAK, WEAK_50, WEAK_500, HOT],
    ),
    ("Pulse", &[SHAPES, FULL, ENDS, QUADRANTS, DRIFT, WEAK_DRIFT]),
    (
        "Dead time, by photons a laser cycle",
        &[
            FEW_PHOTONS,
            ONE_HIT,
            FIRST,
            FIRST_SET,
            FIRST_12_SET,
            DEAD_20,
            DEAD_20_12,
            DEAD_20_12_SET,
            DEAD_20_EMPTY,
            DEAD_20_EMPTY_SET,
            CROSSTALK,
            CROSSTALK_21,
            DEAD_5,
        ],
    ),
    (
        "Glass, rain, smoke",
        &[GLASS, GATE, SMALL_DROPS, RAIN, RAIN_ONCE, THIN, VEIL],
    ),
    (
        "Another LiDAR",
        &[DIM_LIDAR, LIDAR, OTHER_RATE, DITHER, DITHER_ONCE],
    ),
];
