//! Kinds of recordings, drawn with random numbers, and what has to be found in them.
//!
//! The numbers of each kind are such that its targets can be found. A test beside these generators checks that with a
//! detector that knows where to look. The kinds differ in what may mislead the search for settings.

use dtof_light::rates::bin_share;
use rand_distr::{Binomial, Distribution, Poisson, Uniform};
use rand_pcg::Pcg64;

/// What is in a file.
pub enum Array {
    /// Counts of all bins, pixel by pixel, and the lengths of the axes.
    Histograms { shape: Vec<usize>, counts: Vec<u64> },
    /// Photons: pixel, laser cycle, bin.
    Photons(Vec<[u32; 3]>),
}

/// What is at a pixel. Positions are in bins.
#[derive(Clone, Copy, Debug)]
pub enum Truth {
    /// No target, so no depth.
    Nothing,
    /// Any depth is right, and none.
    Anything,
    /// A surface.
    At(f64),
    /// Two surfaces: either is right.
    Either(f64, f64),
}

/// What the program has to do.
pub enum Need {
    /// Right depths.
    Right,
    /// A warning with one of these words.
    Told(&'static [&'static str]),
    /// One or the other.
    Either(&'static [&'static str]),
    /// Both.
    RightAndTold(&'static [&'static str]),
    /// Right depths, and no warning at all.
    Clean,
}

/// A recording and what has to be found in it.
pub struct Recording {
    pub array: Array,
    /// Of `dtof replay`.
    pub options: String,
    pub truth: Vec<Truth>,
    /// In bins.
    pub tolerance: f64,
    /// The share of the pixels that have to be right.
    pub least_right: f64,
    pub need: Need,
    /// The standard deviation of the pulse in bins.
    pub sigma: f64,
    /// Of the histograms, or those that the photons of a list are from.
    pub bins: usize,
    /// The laser cycles, if the TDC takes the first photon of each.
    pub first_photons_of: Option<usize>,
}

/// A kind of recordings.
pub struct Kind {
    pub name: &'static str,
    pub draw: fn(&mut Pcg64) -> Recording,
}

/// All of them.
pub const KINDS: &[Kind] = &[
    kind("a_wall_and_something_behind", a_wall_and_something_behind),
    kind("a_wall_under_pile_up", a_wall_under_pile_up),
    kind("a_wall_under_pile_up_as_list", a_wall_under_pile_up_as_list),
    kind(
        "near_targets_behind_glass_under_pile_up",
        near_targets_behind_glass_under_pile_up,
    ),
    kind("pile_up_moves_the_depth", pile_up_moves_the_depth),
    kind("bright_pixels_are_not_hot", bright_pixels_are_not_hot),
    kind("a_bin_that_is_stuck", |rng| a_bin_that_is_stuck(rng, "")),
    kind("a_bin_that_is_stuck_decide_once", |rng| {
        a_bin_that_is_stuck(rng, "--decide-once")
    }),
    kind("many_recorded_cycles", many_recorded_cycles),
    kind("a_sunlit_patch", a_sunlit_patch),
    kind("retroreflectors", retroreflectors),
    kind("glass_before_most_targets", glass_before_most_targets),
    kind("pile_up_without_background", pile_up_without_background),
    kind(
        "much_light_without_background_as_list",
        much_light_without_background_as_list,
    ),
    kind("glass_and_few_targets", glass_and_few_targets),
    kind("glass_in_most_pixels", glass_in_most_pixels),
    kind("glass_that_shifts", glass_that_shifts),
    kind("an_object_that_moves", an_object_that_moves),
    kind("an_object_that_comes_near", an_object_that_comes_near),
    kind("background_is_taken_off", background_is_taken_off),
    kind("counts_are_multiplied", counts_are_multiplied),
    kind("bins_differ_in_width", bins_differ_in_width),
    kind("counts_are_averaged", counts_are_averaged),
    kind("laser_cycles_are_times", laser_cycles_are_times),
    kind("ends_are_hardly_filled", ends_are_hardly_filled),
    kind("counters_were_full", |rng| counters(rng, true)),
    kind("counters_began_again", |rng| counters(rng, false)),
    kind("a_spike_in_some_captures", a_spike_in_some_captures),
    kind("bins_come_first", bins_come_first),
    kind(
        "a_background_that_is_not_flat",
        a_background_that_is_not_flat,
    ),
    kind("too_many_recorded_cycles", too_many_recorded_cycles),
    kind("rain", rain),
    kind("another_lidar", another_lidar),
    kind("clean", clean),
];

const fn kind(name: &'static str, draw: fn(&mut Pcg64) -> Recording) -> Kind {
    Kind { name, draw }
}

const PILE_UP: &[&str] = &["pile", "first photon", "dead time", "los"];
const GLASS: &[&str] = &["glass"];
const CHANGE: &[&str] = &["mov", "chang", "halves", "events"];

fn between(rng: &mut Pcg64, low: f64, high: f64) -> f64 {
    Uniform::new_inclusive(low, high).unwrap().sample(rng)
}

fn log_between(rng: &mut Pcg64, low: f64, high: f64) -> f64 {
    between(rng, low.ln(), high.ln()).exp()
}

fn whole(rng: &mut Pcg64, low: usize, high: usize) -> usize {
    Uniform::new_inclusive(low, high).unwrap().sample(rng)
}

fn one_of<T: Copy>(rng: &mut Pcg64, of: &[T]) -> T {
    of[whole(rng, 0, of.len() - 1)]
}

fn chance(rng: &mut Pcg64, probability: f64) -> bool {
    between(rng, 0.0, 1.0) < probability
}

/// So many of the pixels, in random order.
fn some_pixels(rng: &mut Pcg64, pixels: usize, number: usize) -> Vec<usize> {
    let mut all: Vec<usize> = (0..pixels).collect();
    for place in 0..number {
        let other = whole(rng, place, pixels - 1);
        all.swap(place, other);
    }
    all.truncate(number);
    all
}

/// A part of the pixels, at least one.
fn share_of(pixels: usize, share: f64) -> usize {
    ((pixels as f64 * share) as usize).max(1)
}

/// The size of a sensor and of its pulse.
#[derive(Clone, Copy)]
struct Sensor {
    rows: usize,
    columns: usize,
    bins: usize,
    sigma: f64,
}

impl Sensor {
    /// At least `smallest` by `smallest` pixels, and at most `largest` by `largest`.
    fn draw(rng: &mut Pcg64, smallest: usize, largest: usize) -> Self {
        Self {
            rows: whole(rng, smallest, largest),
            columns: whole(rng, smallest, largest),
            bins: one_of(rng, &[64, 128, 256]),
            sigma: between(rng, 0.6, 1.5),
        }
    }

    const fn pixels(&self) -> usize {
        self.rows * self.columns
    }

    /// A position in this part of the bins.
    fn position(&self, rng: &mut Pcg64, from: f64, to: f64) -> f64 {
        between(rng, from, to) * self.bins as f64
    }

    /// One for each pixel.
    fn positions(&self, rng: &mut Pcg64, from: f64, to: f64) -> Vec<f64> {
        (0..self.pixels())
            .map(|_| self.position(rng, from, to))
            .collect()
    }

    /// Photons a bin of an even background with so many photons in all bins.
    fn background(&self, photons: f64) -> Light {
        Light(vec![photons / self.bins as f64; self.bins])
    }

    fn histograms(&self, pixels: impl IntoIterator<Item = Vec<u64>>) -> Array {
        let counts: Vec<u64> = pixels.into_iter().flatten().collect();
        let captures = counts.len() / (self.pixels() * self.bins);
        let shape = [self.rows, self.columns, self.bins];
        Array::Histograms {
            shape: match captures {
                1 => shape.into(),
                _ => [&[captures][..], &shape].concat(),
            },
            counts,
        }
    }

    /// Of a photon list.
    fn list_options(&self) -> String {
        format!("--columns {} --bins {}", self.columns, self.bins)
    }

    /// A recording that has to be right within a bin in all but a few pixels: of 16 one may be wrong.
    fn recording(&self, array: Array, options: impl Into<String>, truth: Vec<Truth>) -> Recording {
        Recording {
            array,
            options: options.into(),
            truth,
            tolerance: 1.0,
            least_right: 0.93,
            need: Need::Right,
            sigma: self.sigma,
            bins: self.bins,
            first_photons_of: None,
        }
    }

    /// The same of a TDC that takes the first photon of each of so many laser cycles.
    fn first_photons(&self, array: Array, cycles: usize, truth: Vec<Truth>) -> Recording {
        Recording {
            first_photons_of: Some(cycles),
            ..self.recording(array, format!("--recorded-cycles {cycles}"), truth)
        }
    }
}

/// Mean photons of each bin: in a laser cycle or in the whole recording.
#[derive(Clone)]
struct Light(Vec<f64>);

impl Light {
    /// Adds a pulse of so many photons.
    fn with(mut self, photons: f64, position: f64, sigma: f64) -> Self {
        for (bin, mean) in (0..).zip(&mut self.0) {
            *mean += photons * bin_share(bin, position, sigma);
        }
        self
    }

    /// Adds a pulse with an exponential tail of this length, in bins.
    fn with_tail(mut self, photons: f64, position: f64, sigma: f64, tail: f64) -> Self {
        let last = photons * (1.0 - (-1.0 / tail).exp());
        // What is later is below a millionth.
        for delay in 0..(14.0 * tail) as u32 {
            let delay = f64::from(delay);
            self = self.with(last * (-delay / tail).exp(), position + delay, sigma);
        }
        self
    }

    fn times(mut self, factor: f64) -> Self {
        self.0.iter_mut().for_each(|mean| *mean *= factor);
        self
    }

    /// Counts of a sensor that takes all photons.
    fn counts(&self, rng: &mut Pcg64) -> Vec<u64> {
        let mut last = (0.0, None);
        let counts = self.0.iter().map(|&mean| {
            // Most bins have the mean of the one before.
            if last.0 != mean {
                last = (mean, Some(Poisson::new(mean).unwrap()));
            }
            last.1.map_or(0.0, |counts| counts.sample(rng)) as u64
        });
        counts.collect()
    }

    /// Counts of a sensor whose TDC takes the first photon of each laser cycle.
    fn first_photons(&self, cycles: usize, rng: &mut Pcg64) -> Vec<u64> {
        let mut left = cycles as u64;
        let counts = self.0.iter().map(|mean| {
            let share = -(-mean).exp_m1();
            let count = Binomial::new(left, share).unwrap().sample(rng);
            left -= count;
            count
        });
        counts.collect()
    }
}

/// Photons of a sensor, as a list, of the laser cycles from one to another.
struct List {
    photons: Vec<[u32; 3]>,
}

impl List {
    const fn new() -> Self {
        Self {
            photons: Vec::new(),
        }
    }

    /// All photons of a pixel.
    fn add(&mut self, pixel: usize, light: &Light, from: usize, to: usize, rng: &mut Pcg64) {
        let ends = running_sums(&light.0);
        let all = ends.last().unwrap();
        let number = Poisson::new(all * (to - from) as f64).unwrap().sample(rng) as usize;
        for _ in 0..number {
            let cycle = whole(rng, from, to - 1);
            let place = between(rng, 0.0, *all);
            let bin = ends.partition_point(|end| *end < place);
            self.photons.push([pixel as u32, cycle as u32, bin as u32]);
        }
    }

    /// The first photon of each laser cycle of a pixel.
    fn add_first(&mut self, pixel: usize, light: &Light, cycles: usize, rng: &mut Pcg64) {
        let ends = running_sums(&light.0);
        for cycle in 0..cycles {
            // The photons until the first one are exponentially distributed.
            let before = -between(rng, f64::MIN_POSITIVE, 1.0).ln();
            let bin = ends.partition_point(|end| *end < before);
            if bin < ends.len() {
                self.photons.push([pixel as u32, cycle as u32, bin as u32]);
            }
        }
    }

    fn array(mut self) -> Array {
        self.photons
            .sort_unstable_by_key(|&[pixel, cycle, bin]| (cycle, pixel, bin));
        Array::Photons(self.photons)
    }
}

fn running_sums(means: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    let sums = means.iter().map(|mean| {
        sum += mean;
        sum
    });
    sums.collect()
}

fn at(positions: &[f64]) -> Vec<Truth> {
    positions.iter().copied().map(Truth::At).collect()
}

/// A wall in all pixels, and in less than 40 % of them something dimmer behind. The wall is no cover glass: it is far.
fn a_wall_and_something_behind(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor::draw(rng, 4, 20);
    let cycles = whole(rng, 1000, 10_000);
    let wall = between(rng, 24.0, 0.55 * sensor.bins as f64);
    let behind = between(rng, wall + 12.0, sensor.bins as f64 - 8.0);
    let [background, signal, dim] =
        [(2.0, 10.0), (200.0, 500.0), (100.0, 190.0)].map(|(low, high)| between(rng, low, high));
    let light = sensor
        .background(background * sensor.bins as f64)
        .with(signal, wall, sensor.sigma);
    let share = between(rng, 0.0, 0.39);
    let mut truth = vec![Truth::At(wall); sensor.pixels()];
    for pixel in some_pixels(rng, sensor.pixels(), share_of(sensor.pixels(), share)) {
        truth[pixel] = Truth::Either(wall, behind);
    }
    let both = light.clone().with(dim, behind, sensor.sigma);
    let pixels = truth.iter().map(|truth| match truth {
        Truth::Either(..) => both.counts(rng),
        _ => light.counts(rng),
    });
    let array = sensor.histograms(pixels);
    sensor.recording(array, format!("--recorded-cycles {cycles}"), truth)
}

/// With λ signal photons a laser cycle the first photon comes 0.28 λσ earlier on average, here at most 0.3 bins.
fn a_wall_under_pile_up(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor::draw(rng, 4, 12);
    let cycles = whole(rng, 10_000, 40_000);
    let wall = sensor.position(rng, 0.3, 0.7);
    let background = between(rng, 0.5, 2.0);
    let signal = between(rng, 0.3, 0.7);
    let light = sensor
        .background(background)
        .with(signal, wall, sensor.sigma);
    let pixels = (0..sensor.pixels()).map(|_| light.first_photons(cycles, rng));
    let array = sensor.histograms(pixels);
    let truth = vec![Truth::At(wall); sensor.pixels()];
    Recording {
        tolerance: 0.6,
        ..sensor.first_photons(array, cycles, truth)
    }
}

fn a_wall_under_pile_up_as_list(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor::draw(rng, 4, 6);
    let cycles = whole(rng, 3000, 6000);
    let wall = sensor.position(rng, 0.3, 0.7);
    let background = between(rng, 0.5, 1.5);
    let signal = between(rng, 0.3, 0.7);
    let light = sensor
        .background(background)
        .with(signal, wall, sensor.sigma);
    let mut list = List::new();
    for pixel in 0..sensor.pixels() {
        list.add_first(pixel, &light, cycles, rng);
    }
    let truth = vec![Truth::At(wall); sensor.pixels()];
    Recording {
        tolerance: 0.6,
        options: sensor.list_options(),
        ..sensor.first_photons(list.array(), cycles, truth)
    }
}

/// The farthest target still has 200 photons or so, twenty times their noise.
fn near_targets_behind_glass_under_pile_up(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor {
        sigma: between(rng, 0.6, 1.2),
        ..Sensor::draw(rng, 6, 12)
    };
    let cycles = whole(rng, 15_000, 40_000);
    let glass = (between(rng, 0.7, 1.2), between(rng, 2.5, 4.0));
    let background = between(rng, 2.0, 3.5);
    let signal = between(rng, 0.4, 0.6);
    let near = between(rng, 17.0, 22.0);
    let bins = sensor.bins as f64;
    let mut positions = sensor.positions(rng, 32.0 / bins, 0.85);
    for position in positions.iter_mut().step_by(4) {
        *position = near;
    }
    let before = sensor.background(background).with(glass.0, glass.1, 0.6);
    let pixels = positions.iter().map(|&position| {
        let light = before.clone().with(signal, position, sensor.sigma);
        light.first_photons(cycles, rng)
    });
    let array = sensor.histograms(pixels);
    Recording {
        least_right: 0.9,
        ..sensor.first_photons(array, cycles, at(&positions))
    }
}

/// The first photons come 0.14 bins early at most, and thousands of them are found. What is seen of the background falls
/// by e or more, so widths at half of the peak are not those of the pulse.
fn pile_up_moves_the_depth(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor {
        sigma: between(rng, 0.6, 1.0),
        ..Sensor::draw(rng, 4, 10)
    };
    let cycles = whole(rng, 15_000, 40_000);
    let background = between(rng, 2.0, 4.0);
    let signal = between(rng, 0.3, 0.5);
    let position = sensor.position(rng, 0.25, 0.4);
    let light = sensor
        .background(background)
        .with(signal, position, sensor.sigma);
    let pixels = (0..sensor.pixels()).map(|_| light.first_photons(cycles, rng));
    let array = sensor.histograms(pixels);
    let truth = vec![Truth::At(position); sensor.pixels()];
    Recording {
        tolerance: 0.25,
        ..sensor.first_photons(array, cycles, truth)
    }
}

/// Nearly no photon comes after the pulse. The first of up to 4.5 photons comes one σ early.
fn bright_pixels_are_not_hot(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor {
        sigma: between(rng, 0.6, 1.0),
        ..Sensor::draw(rng, 8, 20)
    };
    let cycles = whole(rng, 1000, 2000);
    let background = sensor.background(between(rng, 1.5, 2.5));
    let signal = between(rng, 2.5, 4.5);
    let positions = sensor.positions(rng, 0.25, 0.85);
    let pixels = positions.iter().map(|&position| {
        let light = background.clone().with(signal, position, sensor.sigma);
        light.first_photons(cycles, rng)
    });
    let array = sensor.histograms(pixels);
    Recording {
        tolerance: 0.3 + sensor.sigma,
        least_right: 0.95,
        options: format!("--recorded-cycles {cycles} --decide-once"),
        ..sensor.first_photons(array, cycles, at(&positions))
    }
}

/// In one pixel of 64. All others see a wall, with an error of 0.06 bins.
fn a_bin_that_is_stuck(rng: &mut Pcg64, option: &str) -> Recording {
    let sensor = Sensor {
        rows: 8,
        columns: 8,
        sigma: between(rng, 0.6, 1.0),
        ..Sensor::draw(rng, 8, 8)
    };
    let cycles = whole(rng, 8000, 20_000);
    let wall = sensor.position(rng, 0.3, 0.8);
    let background = between(rng, 3.0, 10.0);
    let signal = between(rng, 300.0, 600.0);
    let light = sensor
        .background(background * sensor.bins as f64)
        .with(signal, wall, sensor.sigma);
    let mut pixels: Vec<Vec<u64>> = (0..64).map(|_| light.counts(rng)).collect();
    let (pixel, stuck) = loop {
        let bin = whole(rng, 0, sensor.bins - 1);
        if (bin as f64 - wall).abs() > 10.0 {
            break (whole(rng, 0, 63), bin);
        }
    };
    pixels[pixel][stuck] += (between(rng, 0.4, 1.0) * cycles as f64) as u64;
    let mut truth = vec![Truth::At(wall); 64];
    truth[pixel] = Truth::Anything;
    let array = sensor.histograms(pixels);
    Recording {
        tolerance: 0.25,
        ..sensor.recording(array, format!("--recorded-cycles {cycles} {option}"), truth)
    }
}

/// Few of them have a photon. The targets have twenty times their noise, but only if all laser cycles are used.
fn many_recorded_cycles(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor::draw(rng, 4, 16);
    let cycles = log_between(rng, 20_000.0, 1e6) as usize;
    let background = sensor.background(between(rng, 20.0, 80.0) * sensor.bins as f64);
    let signal = between(rng, 400.0, 800.0);
    let positions = sensor.positions(rng, 0.25, 0.85);
    let pixels = positions.iter().map(|&position| {
        let light = background.clone().with(signal, position, sensor.sigma);
        light.counts(rng)
    });
    let array = sensor.histograms(pixels);
    sensor.recording(array, format!("--recorded-cycles {cycles}"), at(&positions))
}

/// An even background, and targets in half of the pixels.
struct HalfLit {
    sensor: Sensor,
    background: f64,
    lights: Vec<Light>,
    truth: Vec<Truth>,
}

impl HalfLit {
    /// So many background photons a bin.
    fn draw(rng: &mut Pcg64, least: f64, most: f64) -> Self {
        let sensor = Sensor::draw(rng, 6, 18);
        let background = log_between(rng, least, most);
        let signal = between(rng, 25.0, 50.0) * background.max(4.0).sqrt();
        let dark = sensor.background(background * sensor.bins as f64);
        let positions = sensor.positions(rng, 0.25, 0.85);
        let lit = some_pixels(rng, sensor.pixels(), sensor.pixels() / 2);
        let mut lights = vec![dark.clone(); sensor.pixels()];
        let mut truth = vec![Truth::Nothing; sensor.pixels()];
        for pixel in lit {
            let position = positions[pixel];
            lights[pixel] = dark.clone().with(signal, position, sensor.sigma);
            truth[pixel] = Truth::At(position);
        }
        Self {
            sensor,
            background,
            lights,
            truth,
        }
    }

    /// What was made of the counts has to be told.
    fn recording(self, pixels: Vec<Vec<u64>>, words: &'static [&'static str]) -> Recording {
        let array = self.sensor.histograms(pixels);
        Recording {
            need: Need::Told(words),
            ..self.sensor.recording(array, "", self.truth)
        }
    }
}

/// The mean of the background was subtracted, and what was below it is 0.
fn background_is_taken_off(rng: &mut Pcg64) -> Recording {
    let scene = HalfLit::draw(rng, 5.0, 500.0);
    let mean = scene.background.round() as u64;
    let left = |light: &Light| {
        light
            .counts(rng)
            .iter()
            .map(|count| count.saturating_sub(mean))
            .collect()
    };
    let pixels = scene.lights.iter().map(left).collect();
    scene.recording(pixels, &["background was subtracted"])
}

fn counts_are_multiplied(rng: &mut Pcg64) -> Recording {
    let scene = HalfLit::draw(rng, 1.0, 200.0);
    let factor = match chance(rng, 0.5) {
        true => whole(rng, 2, 60) as f64,
        false => between(rng, 5.0, 60.0),
    };
    let pixels = scene.lights.iter();
    let pixels = pixels.map(|light| {
        light
            .counts(rng)
            .iter()
            .map(|&count| (count as f64 * factor).round() as u64)
            .collect()
    });
    let pixels = pixels.collect();
    scene.recording(pixels, &["multiples of", "were multiplied"])
}

/// By a third or more, in all pixels alike or in each.
fn bins_differ_in_width(rng: &mut Pcg64) -> Recording {
    let scene = HalfLit::draw(rng, 30.0, 300.0);
    let (differ, each) = (between(rng, 0.4, 0.7), chance(rng, 0.5));
    let mut widths = Vec::new();
    let pixels = scene.lights.iter().map(|light| {
        if each || widths.is_empty() {
            widths = light
                .0
                .iter()
                .map(|_| between(rng, 1.0 - differ, 1.0 + differ))
                .collect();
        }
        let means = light.0.iter().zip(&widths);
        Light(means.map(|(mean, width)| mean * width).collect()).counts(rng)
    });
    let pixels = pixels.collect();
    let targets = scene.truth.iter();
    // A narrow bin hides a part of its pulse.
    let truth = targets.map(|truth| match truth {
        Truth::At(_) => Truth::Anything,
        _ => Truth::Nothing,
    });
    let truth = truth.collect();
    HalfLit { truth, ..scene }.recording(pixels, &["unequal width"])
}

/// Of 3 to 16 recordings the mean was saved.
fn counts_are_averaged(rng: &mut Pcg64) -> Recording {
    let scene = HalfLit::draw(rng, 20.0, 500.0);
    let captures = whole(rng, 3, 16) as u64;
    let pixels = scene.lights.iter().map(|light| {
        let all = light.clone().times(captures as f64).counts(rng);
        all.iter()
            .map(|count| (count + captures / 2) / captures)
            .collect()
    });
    let pixels = pixels.collect();
    scene.recording(pixels, &["averaged"])
}

/// A list with the time of the laser pulse, in nanoseconds or picoseconds.
fn laser_cycles_are_times(rng: &mut Pcg64) -> Recording {
    let scene = HalfLit::draw(rng, 0.5, 5.0);
    let (cycles, period) = (whole(rng, 1000, 4000), log_between(rng, 2.0, 1e5) as u32);
    let start = whole(rng, 0, 100_000) as u32;
    let mut list = List::new();
    for (pixel, light) in scene.lights.iter().enumerate() {
        list.add(
            pixel,
            &light.clone().times(1.0 / cycles as f64),
            0,
            cycles,
            rng,
        );
    }
    for [_, cycle, _] in &mut list.photons {
        *cycle = start + *cycle * period;
    }
    Recording {
        need: Need::Told(&["laser cycles are multiples"]),
        ..scene
            .sensor
            .recording(list.array(), scene.sensor.list_options(), scene.truth)
    }
}

/// More background in the first 10 to 45 % of the pixels.
fn a_sunlit_patch(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor::draw(rng, 5, 20);
    let cycles = whole(rng, 1500, 4000);
    let dark = sensor.background(between(rng, 0.03, 0.06) * cycles as f64);
    let sunlit = dark.clone().times(between(rng, 5.0, 30.0));
    let patch = share_of(sensor.pixels(), between(rng, 0.1, 0.45));
    let signal = between(rng, 0.2, 0.4) * cycles as f64;
    let positions = sensor.positions(rng, 0.25, 0.85);
    let pixels = positions.iter().enumerate().map(|(pixel, &position)| {
        let background = if pixel < patch { &sunlit } else { &dark };
        let light = background.clone().with(signal, position, sensor.sigma);
        light.counts(rng)
    });
    let array = sensor.histograms(pixels);
    sensor.recording(array, format!("--recorded-cycles {cycles}"), at(&positions))
}

/// One to three pixels have 50 to 300 times the signal.
fn retroreflectors(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor::draw(rng, 6, 20);
    let cycles = whole(rng, 1500, 4000);
    let background = sensor.background(between(rng, 0.03, 0.08) * cycles as f64);
    let mut signals = vec![between(rng, 0.2, 0.4) * cycles as f64; sensor.pixels()];
    let number = whole(rng, 1, 3);
    for pixel in some_pixels(rng, sensor.pixels(), number) {
        signals[pixel] *= between(rng, 50.0, 300.0);
    }
    let positions = sensor.positions(rng, 0.25, 0.85);
    let pixels = positions.iter().zip(&signals).map(|(&position, &signal)| {
        let light = background.clone().with(signal, position, sensor.sigma);
        light.counts(rng)
    });
    let array = sensor.histograms(pixels);
    sensor.recording(array, "", at(&positions))
}

/// A cover glass in all pixels, and a target in some of them.
struct BehindGlass {
    sensor: Sensor,
    cycles: usize,
    /// Photons of the glass, its position, and the standard deviation of its pulse.
    glass: [f64; 3],
    /// Photons a bin.
    background: f64,
    signal: f64,
    positions: Vec<f64>,
}

impl BehindGlass {
    fn draw(rng: &mut Pcg64) -> Self {
        let sensor = Sensor::draw(rng, 6, 18);
        let glass = [(300.0, 1000.0), (2.5, 4.0), (0.6, 1.0)];
        Self {
            sensor,
            cycles: whole(rng, 3000, 8000),
            glass: glass.map(|(low, high)| between(rng, low, high)),
            background: between(rng, 2.0, 6.0),
            signal: between(rng, 150.0, 300.0),
            positions: sensor.positions(rng, 20.0 / sensor.bins as f64, 0.85),
        }
    }

    /// Which pixels have a glass, how far it is shifted there, and which have a target.
    fn recording(
        &self,
        has_glass: impl Fn(usize) -> bool,
        shift: impl Fn(usize) -> f64,
        has_target: impl Fn(usize) -> bool,
        rng: &mut Pcg64,
    ) -> Recording {
        let Self { sensor, glass, .. } = self;
        let mut truth = vec![Truth::Nothing; sensor.pixels()];
        let pixels = self.positions.iter().enumerate().map(|(pixel, &position)| {
            let mut light = sensor.background(self.background * sensor.bins as f64);
            if has_glass(pixel) {
                light = light.with(glass[0], glass[1] + shift(pixel), glass[2]);
            }
            if has_target(pixel) {
                light = light.with(self.signal, position, sensor.sigma);
                truth[pixel] = Truth::At(position);
            }
            light.counts(rng)
        });
        let array = sensor.histograms(pixels);
        sensor.recording(array, format!("--recorded-cycles {}", self.cycles), truth)
    }

    /// A share of the pixels.
    fn part(&self, rng: &mut Pcg64, from: f64, to: f64) -> Vec<usize> {
        let pixels = self.sensor.pixels();
        let share = between(rng, from, to);
        some_pixels(rng, pixels, share_of(pixels, share))
    }
}

/// Targets in 60 to 100 % of the pixels.
fn glass_before_most_targets(rng: &mut Pcg64) -> Recording {
    let scene = BehindGlass::draw(rng);
    let targets = scene.part(rng, 0.6, 1.0);
    scene.recording(|_| true, |_| 0.0, |pixel| targets.contains(&pixel), rng)
}

/// Where most pixels see only a glass, no one can tell it from a near wall.
fn glass_and_few_targets(rng: &mut Pcg64) -> Recording {
    let mut scene = BehindGlass::draw(rng);
    scene.glass[1] = between(rng, 0.5, 4.0);
    let targets = scene.part(rng, 0.05, 0.35);
    Recording {
        need: Need::Told(GLASS),
        ..scene.recording(|_| true, |_| 0.0, |pixel| targets.contains(&pixel), rng)
    }
}

/// A glass in 75 to 85 % of the pixels, and targets in all.
fn glass_in_most_pixels(rng: &mut Pcg64) -> Recording {
    let scene = BehindGlass::draw(rng);
    let glass = scene.part(rng, 0.75, 0.85);
    Recording {
        need: Need::Either(GLASS),
        ..scene.recording(|pixel| glass.contains(&pixel), |_| 0.0, |_| true, rng)
    }
}

/// In every other pixel the glass is two bins later. All have targets.
fn glass_that_shifts(rng: &mut Pcg64) -> Recording {
    let scene = BehindGlass::draw(rng);
    let shift = |pixel: usize| 2.0 * (pixel % 2) as f64;
    Recording {
        need: Need::Either(GLASS),
        ..scene.recording(|_| true, shift, |_| true, rng)
    }
}

/// The first photons come up to 1.3 bins early, and no background tells that some were lost.
fn pile_up_without_background(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor::draw(rng, 6, 18);
    let cycles = whole(rng, 1000, 4000);
    let signal = between(rng, 1.5, 3.0);
    let positions = sensor.positions(rng, 0.25, 0.85);
    let pixels = positions.iter().map(|&position| {
        let light = sensor.background(0.0).with(signal, position, sensor.sigma);
        light.first_photons(cycles, rng)
    });
    let array = sensor.histograms(pixels);
    Recording {
        tolerance: 0.3,
        need: Need::Either(PILE_UP),
        options: format!("--recorded-cycles {cycles} --decide-once"),
        ..sensor.first_photons(array, cycles, at(&positions))
    }
}

/// A list tells whether the TDC takes all photons or the first of each laser cycle.
fn much_light_without_background_as_list(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor::draw(rng, 3, 6);
    let cycles = whole(rng, 1000, 4000);
    let signal = between(rng, 1.0, 3.0);
    let positions = sensor.positions(rng, 0.25, 0.85);
    let takes_first = chance(rng, 0.5);
    let mut list = List::new();
    for (pixel, &position) in positions.iter().enumerate() {
        let light = sensor.background(0.0).with(signal, position, sensor.sigma);
        match takes_first {
            true => list.add_first(pixel, &light, cycles, rng),
            false => list.add(pixel, &light, 0, cycles, rng),
        }
    }
    let recording = Recording {
        need: Need::Clean,
        options: format!("{} --decide-once", sensor.list_options()),
        ..sensor.first_photons(list.array(), cycles, at(&positions))
    };
    Recording {
        tolerance: 0.3,
        first_photons_of: recording.first_photons_of.filter(|_| takes_first),
        ..recording
    }
}

/// A list of photons: a surface in all pixels, and another one in the second half of the laser cycles.
fn change(sensor: Sensor, surfaces: [(f64, f64); 2], rng: &mut Pcg64) -> Array {
    let cycles = whole(rng, 2500, 5000);
    let background = sensor.background(between(rng, 0.006, 0.012) * sensor.bins as f64);
    let mut list = List::new();
    for (half, (signal, position)) in surfaces.into_iter().enumerate() {
        let light = background.clone().with(signal, position, sensor.sigma);
        for pixel in 0..sensor.pixels() {
            list.add(pixel, &light, half * cycles, (half + 1) * cycles, rng);
        }
    }
    list.array()
}

/// Bright first, then dimmer elsewhere.
fn an_object_that_moves(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor::draw(rng, 3, 4);
    let [first, second] = loop {
        let both = [0, 1].map(|_| sensor.position(rng, 0.3, 0.85));
        if (both[0] - both[1]).abs() > 12.0 {
            break both;
        }
    };
    let surfaces = [
        (between(rng, 0.4, 0.7), first),
        (between(rng, 0.15, 0.25), second),
    ];
    let array = change(sensor, surfaces, rng);
    let truth = vec![Truth::Either(first, second); sensor.pixels()];
    Recording {
        need: Need::Told(CHANGE),
        ..sensor.recording(array, sensor.list_options(), truth)
    }
}

/// As near as a cover glass.
fn an_object_that_comes_near(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor::draw(rng, 3, 4);
    let far = sensor.position(rng, 0.4, 0.85);
    let near = between(rng, 4.0, 10.0);
    let surfaces = [far, near].map(|position| (between(rng, 0.3, 0.6), position));
    let array = change(sensor, surfaces, rng);
    let truth = vec![Truth::Either(near, far); sensor.pixels()];
    Recording {
        need: Need::RightAndTold(CHANGE),
        ..sensor.recording(array, sensor.list_options(), truth)
    }
}

/// The TDC ends before the histogram does: the last bins, or the first, hold up to a tenth of the background.
fn ends_are_hardly_filled(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor::draw(rng, 3, 10);
    let all = (sensor.bins as f64 * between(rng, 0.75, 0.95)) as usize;
    let level = log_between(rng, 20.0, 500.0);
    let share = between(rng, 0.0, 0.1);
    let is_first = chance(rng, 0.3);
    let positions = match chance(rng, 0.5) {
        // A wall, up to the end.
        true => vec![between(rng, 0.3, 1.0) * (all as f64 - 4.0); sensor.pixels()],
        false => sensor.positions(rng, 0.1, 0.7),
    };
    let offset = if is_first {
        (sensor.bins - all) as f64
    } else {
        0.0
    };
    let signal = between(rng, 15.0, 40.0) * (level * (4.0 * sensor.sigma + 1.0)).sqrt();
    let pixels: Vec<Vec<u64>> = positions
        .iter()
        .map(|&position| {
            let mut light = Light(vec![level; sensor.bins]).with(signal, position, sensor.sigma);
            light.0[all..].fill(share * level);
            if is_first {
                light.0.rotate_right(sensor.bins - all);
            }
            light.counts(rng)
        })
        .collect();
    let cycles = (level * sensor.bins as f64 * log_between(rng, 0.3, 10.0)) as usize;
    let truth: Vec<f64> = positions.iter().map(|position| position + offset).collect();
    let array = sensor.histograms(pixels);
    Recording {
        need: Need::Either(&["range"]),
        ..sensor.recording(array, format!("--recorded-cycles {cycles}"), at(&truth))
    }
}

/// Counters of 8, 10 or 12 bits that stop at the highest count, or begin again at 0.
fn counters(rng: &mut Pcg64, stop: bool) -> Recording {
    let sensor = Sensor {
        sigma: between(rng, 0.9, 1.5),
        ..Sensor::draw(rng, 4, 12)
    };
    let most = one_of(rng, &[255, 1023, 4095]);
    // How much of the peaks they cut.
    let highest = most as f64 * between(rng, 1.3, 4.0);
    let level = most as f64 * between(rng, 0.02, 0.2);
    let positions = match chance(rng, 0.5) {
        true => vec![sensor.position(rng, 0.2, 0.8); sensor.pixels()],
        false => sensor.positions(rng, 0.2, 0.8),
    };
    let pixels: Vec<Vec<u64>> = positions
        .iter()
        .map(|&position| {
            let photons = highest * 2.5 * sensor.sigma;
            let light = Light(vec![level; sensor.bins]).with(photons, position, sensor.sigma);
            let counts = light.counts(rng).into_iter();
            counts
                .map(|count| match stop {
                    true => count.min(most),
                    false => count % (most + 1),
                })
                .collect()
        })
        .collect();
    let array = sensor.histograms(pixels);
    let truth = vec![Truth::Anything; sensor.pixels()];
    Recording {
        need: Need::Told(if stop { &["full"] } else { &["began again"] }),
        ..sensor.recording(array, "--recorded-cycles 10000", truth)
    }
}

/// In some captures of each pixel a bin has hundreds of photons of no pulse.
fn a_spike_in_some_captures(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor {
        sigma: between(rng, 0.8, 1.5),
        ..Sensor::draw(rng, 4, 8)
    };
    let (level, captures) = (log_between(rng, 1.0, 50.0), whole(rng, 4, 8));
    let positions = sensor.positions(rng, 0.3, 0.7);
    let signal = between(rng, 12.0, 30.0) * (level * (4.0 * sensor.sigma + 1.0)).sqrt();
    let spike = signal * between(rng, 2.0, 10.0);
    let bin = one_of(rng, &[0, 1, sensor.bins / 8, sensor.bins - 1]);
    let number = whole(rng, 1, captures - 1);
    let with_spike = some_pixels(rng, captures, number);
    let mut pixels = Vec::new();
    for capture in 0..captures {
        for &position in &positions {
            let mut light = Light(vec![level; sensor.bins]).with(signal, position, sensor.sigma);
            if with_spike.contains(&capture) {
                light.0[bin] += spike;
            }
            pixels.push(light.counts(rng));
        }
    }
    let truth = at(&positions).repeat(captures);
    Recording {
        need: Need::Either(&["spike"]),
        ..sensor.recording(
            sensor.histograms(pixels),
            "--axes captures,rows,columns,bins",
            truth,
        )
    }
}

/// Saved with the bins as the first axis, and read without axes.
fn bins_come_first(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor::draw(rng, 8, 40);
    let signal = log_between(rng, 15.0, 1000.0);
    let background = signal * between(rng, 0.02, 1.0) / sensor.bins as f64;
    let positions = match chance(rng, 0.3) {
        true => vec![sensor.position(rng, 0.2, 0.8); sensor.pixels()],
        false => sensor.positions(rng, 0.2, 0.8),
    };
    let pixels: Vec<Vec<u64>> = positions
        .iter()
        .map(|&position| {
            Light(vec![background; sensor.bins])
                .with(signal, position, sensor.sigma)
                .counts(rng)
        })
        .collect();
    let counts: Vec<u64> = (0..sensor.bins)
        .flat_map(|bin| pixels.iter().map(move |bins| bins[bin]))
        .collect();
    let shape = vec![sensor.bins, sensor.rows, sensor.columns];
    let truth = vec![Truth::Anything; sensor.bins * sensor.rows];
    Recording {
        need: Need::Told(&["axis", "axes"]),
        ..sensor.recording(Array::Histograms { shape, counts }, "", truth)
    }
}

/// Ambient light that falls by a third to nine tenths over the range, or rises.
fn a_background_that_is_not_flat(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor::draw(rng, 8, 16);
    let level = log_between(rng, 30.0, 1000.0);
    let fall = between(rng, 0.33, 0.9);
    let is_curved = chance(rng, 0.5);
    let is_rising = chance(rng, 0.5);
    let positions = sensor.positions(rng, 0.2, 0.8);
    let lit = some_pixels(rng, sensor.pixels(), share_of(sensor.pixels(), 0.5));
    let signal = between(rng, 15.0, 40.0) * (level * (4.0 * sensor.sigma + 1.0)).sqrt();
    let pixels: Vec<Vec<u64>> = positions
        .iter()
        .enumerate()
        .map(|(pixel, &position)| {
            let mean = |bin: usize| {
                let along = bin as f64 / sensor.bins as f64;
                match is_curved {
                    true => level * (1.0 - fall).powf(along),
                    false => level * (1.0 - fall * along),
                }
            };
            let mut light = Light((0..sensor.bins).map(mean).collect());
            if is_rising {
                light.0.reverse();
            }
            let signal = if lit.contains(&pixel) { signal } else { 0.0 };
            light.with(signal, position, sensor.sigma).counts(rng)
        })
        .collect();
    let cycles = (level * sensor.bins as f64 / between(rng, 4.0, 20.0)) as usize;
    Recording {
        need: Need::Told(&["not flat"]),
        ..sensor.recording(
            sensor.histograms(pixels),
            format!("--recorded-cycles {cycles}"),
            vec![Truth::Anything; sensor.pixels()],
        )
    }
}

/// Right histograms, with so many laser cycles that there is hardly any light.
fn too_many_recorded_cycles(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor::draw(rng, 4, 12);
    let positions = sensor.positions(rng, 0.2, 0.8);
    let level = log_between(rng, 1.0, 50.0);
    let signal = 40.0 * (level * (4.0 * sensor.sigma + 1.0)).sqrt();
    let pixels: Vec<Vec<u64>> = positions
        .iter()
        .map(|&position| {
            Light(vec![level; sensor.bins])
                .with(signal, position, sensor.sigma)
                .counts(rng)
        })
        .collect();
    let photons = level * sensor.bins as f64 + signal;
    let cycles = (photons * log_between(rng, 2e5, 1e8)) as u64;
    Recording {
        need: Need::Told(&["recorded-cycles"]),
        ..sensor.recording(
            sensor.histograms(pixels),
            format!("--recorded-cycles {cycles}"),
            at(&positions),
        )
    }
}

/// Drops near the sensor, each with many photons in one laser cycle.
fn rain(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor::draw(rng, 3, 6);
    let cycles = whole(rng, 4000, 8000);
    let signal = between(rng, 0.1, 0.3);
    let positions = sensor.positions(rng, 0.4, 0.85);
    let background = sensor.background(log_between(rng, 0.05, 5.0));
    let drops = between(rng, 20.0, 60.0);
    let each = between(rng, 20.0, 60.0);
    let mut list = List::new();
    for (pixel, &position) in positions.iter().enumerate() {
        list.add(
            pixel,
            &background.clone().with(signal, position, sensor.sigma),
            0,
            cycles,
            rng,
        );
        for _ in 0..whole(rng, (drops / 2.0) as usize, drops as usize) {
            let place = between(rng, 2.0, 0.2 * sensor.bins as f64);
            let cycle = whole(rng, 0, cycles - 1);
            let drop = sensor.background(0.0).with(each, place, sensor.sigma);
            list.add(pixel, &drop, cycle, cycle + 1, rng);
        }
    }
    Recording {
        need: Need::Told(&["rain"]),
        ..sensor.recording(list.array(), sensor.list_options(), at(&positions))
    }
}

/// Its pulses wander through the range of some pixels.
fn another_lidar(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor::draw(rng, 4, 7);
    let cycles = whole(rng, 4000, 8000);
    let positions = sensor.positions(rng, 0.2, 0.85);
    let background = sensor.background(log_between(rng, 0.05, 5.0));
    let speed = one_of(rng, &[-1.0, 1.0]) * between(rng, 50.0, 400.0) / cycles as f64;
    let photons = between(rng, 0.5, 1.5);
    let period = between(rng, 1.5, 3.0) * sensor.bins as f64;
    let mut list = List::new();
    for (pixel, &position) in positions.iter().enumerate() {
        list.add(
            pixel,
            &background
                .clone()
                .with(between(rng, 0.3, 0.6), position, sensor.sigma),
            0,
            cycles,
            rng,
        );
        let start = between(rng, 0.0, period);
        // For some laser cycles it stays.
        for first in (0..cycles).step_by(20) {
            let place = (start + speed * first as f64).rem_euclid(period);
            if place < sensor.bins as f64 - 1.0 {
                let pulse = sensor.background(0.0).with(photons, place, sensor.sigma);
                list.add(pixel, &pulse, first, (first + 20).min(cycles), rng);
            }
        }
    }
    Recording {
        need: Need::Told(&["lidar"]),
        ..sensor.recording(
            list.array(),
            sensor.list_options(),
            vec![Truth::Anything; sensor.pixels()],
        )
    }
}

/// Nothing is wrong with it.
fn clean(rng: &mut Pcg64) -> Recording {
    let recording = match whole(rng, 0, 9) {
        0 => clean_list(rng),
        1 => clean_pile_up(rng),
        _ => clean_histograms(rng),
    };
    Recording {
        need: Need::Clean,
        ..recording
    }
}

/// So many pixels or a few more, in a shape that is not too long, or in one row.
fn shape(rng: &mut Pcg64, pixels: usize) -> [usize; 2] {
    if chance(rng, 0.1) {
        return [1, pixels];
    }
    let rows = (pixels as f64 / between(rng, 1.0, 2.5)).sqrt();
    let rows = (rows.round() as usize).max(1);
    [rows, pixels.div_ceil(rows)]
}

/// The positions of the surfaces of a clean scene, beyond a bin.
fn surfaces(sensor: &Sensor, nearest: f64, rng: &mut Pcg64) -> Vec<f64> {
    let farthest = sensor.bins as f64 - 10.0;
    match whole(rng, 0, 3) {
        // A wall, far or near.
        0 => vec![between(rng, nearest, farthest); sensor.pixels()],
        1 => vec![between(rng, nearest, 2.0 * nearest); sensor.pixels()],
        // A wall that is tilted in rows and columns.
        2 => {
            let corners = [0; 3].map(|_| between(rng, nearest, farthest));
            let [from, down, right] = corners;
            let ends = [sensor.rows, sensor.columns].map(|length| (length.max(2) - 1) as f64);
            let position = |pixel: usize| {
                let row = (pixel / sensor.columns) as f64 / ends[0];
                let column = (pixel % sensor.columns) as f64 / ends[1];
                from + (down - from) * row / 2.0 + (right - from) * column / 2.0
            };
            (0..sensor.pixels()).map(position).collect()
        }
        _ => (0..sensor.pixels())
            .map(|_| between(rng, nearest, farthest))
            .collect(),
    }
}

/// The signal photons are 9 to 40 times the noise of the background under the pulse, and 15 to 150 at least. That holds for
/// the first 10,000 laser cycles, too.
fn clean_histograms(rng: &mut Pcg64) -> Recording {
    // Photons that are replayed.
    const MOST: f64 = 1.5e6;
    let [bins, captures] = [one_of(rng, &[64, 128, 256]), one_of(rng, &[1, 1, 1, 2, 5])];
    let sigma = between(rng, 0.6, 1.5);
    let background = log_between(rng, 0.01, 1e6);
    let all_background = background * bins as f64;
    let cycles = (all_background / log_between(rng, 0.02, 2.0)).max(between(rng, 1000.0, 20_000.0));
    let replayed = (10_000.0 / cycles).min(1.0);
    let tail = chance(rng, 0.25).then(|| between(rng, 0.5, 2.0));

    // Bins under the pulse.
    let under = 4.0 * sigma + 1.0 + 2.0 * tail.unwrap_or(0.0);
    let noise = (background * replayed * under).sqrt();
    let signal = (between(rng, 9.0, 40.0) * noise).max(between(rng, 15.0, 150.0)) / replayed;
    // A histogram has at most one photon of a laser cycle in a bin.
    let cycles = cycles.max(2.0 * signal).ceil();
    let replayed = (10_000.0 / cycles).min(1.0);
    // With the photons of a glass, if there is one.
    let each = (all_background + 5.0 * signal) * replayed * captures as f64;
    let pixels = log_between(rng, 1.0, 4096.0).min(MOST / each).max(1.0);
    let [rows, columns] = shape(rng, pixels as usize);
    let sensor = Sensor {
        rows,
        columns,
        bins,
        sigma,
    };
    // Before a few pixels it cannot be told from a target.
    let glass = (sensor.pixels() >= 9 && chance(rng, 0.3)).then(|| {
        // Also dimmer than a peak of one histogram.
        let photons = signal * log_between(rng, 0.1, 4.0);
        (photons.min(cycles), between(rng, 2.5, 4.0))
    });

    let is_empty = glass.is_none() && chance(rng, 0.1);
    let positions = surfaces(&sensor, if glass.is_some() { 20.0 } else { 6.0 }, rng);
    // At least 60 %. A few pixels may see nothing only if there are many.
    let number = match sensor.pixels() {
        _ if is_empty => 0,
        all if all >= 25 && chance(rng, 0.4) => share_of(all, between(rng, 0.65, 1.0)),
        all => all,
    };
    let targets = some_pixels(rng, sensor.pixels(), number);
    let mut truth = vec![Truth::Nothing; sensor.pixels()];
    // The position of a pulse with a tail is anything from its peak to its mean.
    let late = tail.map_or(0.0, |tail| 1.0 / ((1.0 / tail).exp() - 1.0));
    for &pixel in &targets {
        truth[pixel] = Truth::At(positions[pixel] + late / 2.0);
    }
    let mut multiples = vec![1.0; sensor.pixels()];
    if sensor.pixels() >= 36 && chance(rng, 0.25) {
        // More than one in twenty are doubted.
        let hot = whole(rng, 1, (sensor.pixels() / 20).min(3));
        for pixel in some_pixels(rng, sensor.pixels(), hot) {
            // At most one photon a bin and laser cycle.
            let most = (cycles / background).clamp(30.0, 1000.0);
            multiples[pixel] = log_between(rng, 30.0, most);
            truth[pixel] = Truth::Anything;
        }
    }
    let with_pulse = |light: Light, [photons, position]: [f64; 2]| match tail {
        Some(tail) => light.with_tail(photons, position, sigma, tail),
        None => light.with(photons, position, sigma),
    };
    let mut before = sensor.background(all_background);
    if let Some((photons, position)) = glass {
        before = with_pulse(before, [photons, position]);
    }
    let light = |pixel: usize| match truth[pixel] {
        Truth::Anything => sensor.background(all_background).times(multiples[pixel]),
        Truth::Nothing => before.clone(),
        _ => with_pulse(before.clone(), [signal, positions[pixel]]),
    };
    let lights: Vec<Light> = (0..sensor.pixels()).map(light).collect();
    let all = (0..captures).flat_map(|_| &lights);
    let array = sensor.histograms(all.map(|light| light.counts(rng)));
    let mut options = format!("--recorded-cycles {cycles}");
    // It may be missing, unless the recording is so large that it would take minutes then.
    if captures == 1 && each / replayed < MOST && chance(rng, 0.3) {
        options.clear();
    }
    if captures > 1 {
        options += " --axes captures,rows,columns,bins";
    }
    let truth = truth.repeat(captures);
    // One pixel that sees nothing may report: 1 % of them do.
    let all_but_one = 1.0 - 1.0 / truth.len() as f64;
    Recording {
        tolerance: 0.6 + late,
        least_right: if is_empty {
            all_but_one.min(0.93)
        } else {
            0.93
        },
        ..sensor.recording(array, options, truth)
    }
}

/// All photons of a list of up to 60 pixels.
fn clean_list(rng: &mut Pcg64) -> Recording {
    let pixels = log_between(rng, 1.0, 60.0) as usize;
    let [rows, columns] = shape(rng, pixels);
    let sensor = Sensor {
        rows,
        columns,
        ..Sensor::draw(rng, 1, 1)
    };
    let cycles = whole(rng, 1000, 10_000);
    // Photons of the whole recording: even in a dark one each pixel has some.
    let background = log_between(rng, 0.5, 30.0);
    let noise = (background * (4.0 * sensor.sigma + 1.0)).sqrt();
    let signal = (between(rng, 9.0, 40.0) * noise).max(between(rng, 15.0, 150.0));
    let positions = surfaces(&sensor, 6.0, rng);
    let background = sensor.background(background * sensor.bins as f64);
    let mut list = List::new();
    for (pixel, &position) in positions.iter().enumerate() {
        let light = background.clone().with(signal, position, sensor.sigma);
        list.add(pixel, &light.times(1.0 / cycles as f64), 0, cycles, rng);
    }
    Recording {
        tolerance: 0.6,
        ..sensor.recording(list.array(), sensor.list_options(), at(&positions))
    }
}

/// First photons, and how many laser cycles there were.
fn clean_pile_up(rng: &mut Pcg64) -> Recording {
    let sensor = Sensor::draw(rng, 4, 12);
    let cycles = log_between(rng, 10_000.0, 200_000.0) as usize;
    let background = sensor.background(between(rng, 0.2, 1.0));
    let signal = between(rng, 0.2, 0.5);
    let positions = sensor.positions(rng, 0.2, 0.8);
    let pixels = positions.iter().map(|&position| {
        let light = background.clone().with(signal, position, sensor.sigma);
        light.first_photons(cycles, rng)
    });
    let array = sensor.histograms(pixels);
    Recording {
        tolerance: 0.6,
        ..sensor.first_photons(array, cycles, at(&positions))
    }
}
