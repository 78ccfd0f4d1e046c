//! Random scenes for calibration, and the false alarms with the resulting settings.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "numbers are drawn from small ranges"
)]

use std::fmt::Write as _;

use dtof_calibrate::{Calibration, Length, Observed};
use dtof_core::fixed::types::U4F12;
use dtof_core::rule::detect;
use dtof_core::{Array, Count, DepthEstimator, RangeGate, WindowRule};
use dtof_data::photons::histograms::Histograms;
use dtof_data::photons::source::{PhotonSource, Slice};
use dtof_data::random::trial_rng;
use dtof_engine::host::host_engine;
use dtof_engine::settings::SettingsFile;
use dtof_light::looks::exposure::{Exposures, Looks};
use dtof_light::rates::{Rates, bin_share};
use dtof_light::scene::Scene;
use rand_core::SeedableRng;
use rand_distr::{Distribution, Uniform};
use rand_pcg::Pcg64;

/// About the most photons of a recording.
const PHOTONS: f64 = 1.2e7;

/// A scene and its truth.
pub struct Drawn {
    pub scene: Scene,
    pub cycles: u64,
    pub wall_mm: f64,
    pub offset_mm: f64,
    pub hot: Vec<usize>,
    pub dead: Vec<usize>,
    /// Whether the pulse may be seen above the noise of a hot pixel, which then is none.
    pub shows_in_hot: bool,
    surfaces: usize,
}

impl Drawn {
    pub fn new(number: u64) -> Self {
        let mut rng = Pcg64::seed_from_u64(0x5ca1e + number);
        let mut between = |low: f64, high: f64| Uniform::new(low, high).unwrap().sample(&mut rng);
        let log = |between: &mut dyn FnMut(f64, f64) -> f64, low: f64, high: f64| {
            between(low.ln(), high.ln()).exp()
        };
        let bins = [64, 128, 256][between(0.0, 3.0) as usize];
        let [columns, rows] =
            [[4, 4], [8, 8], [16, 8], [16, 16], [32, 16]][between(0.0, 5.0) as usize];
        let pixels = columns * rows;
        let bin_width_ps = between(60.0, 500.0).round();
        let mm_per_bin = bin_width_ps * dtof_data::photons::MM_PER_PS;
        let background = log(&mut between, 0.002, 0.3);
        let sigma = between(0.5, 1.6);
        // Some have hot pixels, which produce most of the photons.
        let hot_count = (between(-3.0, 6.0).max(0.0) as usize).min(pixels / 4);
        let mut hot = Vec::new();
        while hot.len() < hot_count {
            let pixel = between(0.0, pixels as f64) as usize;
            if !hot.contains(&pixel) {
                hot.push(pixel);
            }
        }
        hot.sort_unstable();
        let mut dead = Vec::new();
        if between(0.0, 1.0) < 0.3 {
            let pixel = between(0.0, pixels as f64) as usize;
            if !hot.contains(&pixel) {
                dead.push(pixel);
            }
        }
        let each_cycle = background * bins as f64 * (pixels + 99 * hot.len()) as f64;
        let cycles = log(&mut between, 4000.0, 100_000.0).min((PHOTONS / each_cycle).max(4000.0));
        let cycles = cycles.round();
        // A multiple of its noise in each pixel.
        let noise = (background * (4.0 * sigma + 1.0) / cycles).sqrt();
        let signal = (between(15.0, 60.0) * noise).max(0.03);
        let glass = (between(0.0, 1.0) < 0.6).then(|| {
            let brightness = log(&mut between, 0.2, 10.0);
            (signal * brightness, between(2.5, 8.0))
        });
        let nearest = if glass.is_some() { 24.0 } else { 8.0 };
        let last = bins as f64 - 10.0;
        let wall = between(0.6 * last, last);
        let mut text = format!(
            "columns = {columns}\nrows = {rows}\nbins = {bins}\nbin_width_ps = {bin_width_ps:?}\n\
             laser_rate_mhz = 0.5\nbackground = {background:?}\npulse_sigma_bins = {sigma:?}\n\
             [[surface]]\nposition_bins = {wall:?}\nsignal = {signal:?}\n"
        );
        // Most pixels still see the wall.
        let several = if pixels == 16 { 1 } else { 3 };
        let surfaces = if between(0.0, 1.0) < 0.3 { 0 } else { several };
        for surface in 0..surfaces {
            // A strip of less than a sixth of the columns or of the rows, the last one slanted.
            let strip = [columns, rows][surface % 2] as f64;
            let from = (strip / 4.0 * surface as f64).floor();
            let to = from + (strip / 6.0).max(1.0).floor();
            let side = ["columns", "rows"][surface % 2];
            let other = ["rows", "columns"][surface % 2];
            let at = between(nearest, wall - 8.0);
            // A scene is also checked one column after its last.
            let right = between(nearest, wall - 8.0).max(0.5 * at);
            let slant = if surface == 2 { right } else { at } * mm_per_bin;
            writeln!(
                text,
                "[[surface]]\nrange_mm = {:?}\nrange_right_mm = {slant:?}\nsignal = {:?}\n\
                 rectangle = {{ {side} = [{from}, {to}], {other} = [0, 100] }}",
                at * mm_per_bin,
                signal * between(0.5, 2.0)
            )
            .unwrap();
        }
        if let Some((signal, position)) = glass {
            writeln!(
                text,
                "[cover_glass]\nsignal = {signal:?}\nposition_bins = {position:?}"
            )
            .unwrap();
        }
        if !hot.is_empty() {
            writeln!(text, "[hot_pixels]\nmultiple = 100\npixels = {hot:?}").unwrap();
        }
        Self {
            scene: Scene::parse(&text).unwrap(),
            cycles: cycles as u64,
            wall_mm: wall * mm_per_bin,
            offset_mm: between(-300.0, 300.0),
            hot,
            dead,
            // Surfaces have up to twice the signal; a pulse is as high as the background, at least.
            shows_in_hot: 2.0 * signal * bin_share(0, 0.5, sigma) > 0.8 * 100.0 * background,
            surfaces,
        }
    }

    /// One flat wall without a cover glass.
    pub fn is_wall_alone(&self) -> bool {
        self.surfaces == 0 && self.scene.effects.cover_glass.is_none()
    }

    /// The histograms of all pixels.
    pub fn capture(&self, seed: u64) -> Vec<Vec<u64>> {
        let mut capture = recorded(&self.scene, self.cycles, seed);
        for &pixel in &self.dead {
            capture[pixel].fill(0);
        }
        capture
    }

    /// The first bin after which the crosstalk of the cover glass is below half a standard deviation of
    /// the background, in 2000 laser cycles or as many as fit the counters.
    pub fn glass_end(&self) -> u16 {
        let Some(glass) = &self.scene.effects.cover_glass else {
            return 0;
        };
        let cycles = (860.0 / self.scene.background).min(2000.0).floor();
        let sigma = self.scene.pulse_sigma_bins;
        let share = |bin: u16| bin_share(bin.into(), glass.position_bins, sigma);
        let matters = |bin: &u16| {
            glass.signal * cycles * share(*bin) >= 0.5 * (self.scene.background * cycles).sqrt()
        };
        (0..self.scene.bins)
            .rev()
            .find(matters)
            .map_or(0, |bin| bin + 1)
    }
}

/// Captures without truth, rays or earlier offsets.
pub fn observed(
    array: Array,
    captures: &Histograms,
    length: Length,
    bin_width_ps: f64,
) -> Observed<'_> {
    Observed {
        array,
        histograms: captures,
        masked: None,
        length,
        cycles: None,
        bin_width_ps,
        truth_mm: None,
        slant: None,
        bias_mm: None,
        offsets_mm: &[],
        times: None,
    }
}

/// Calls `each` with all photons of a source, in parts.
pub fn slices(mut photons: impl PhotonSource, cycles: u64, mut each: impl FnMut(&Slice)) {
    let mut left = cycles;
    while left > 0 {
        let next = left.min(1000);
        each(&photons.next_slice(next as u16).unwrap());
        left -= next;
    }
}

/// The histograms of all pixels of a scene.
pub fn recorded(scene: &Scene, cycles: u64, seed: u64) -> Vec<Vec<u64>> {
    let bins = usize::from(scene.bins);
    let mut capture = vec![vec![0; bins]; scene.array().unwrap().pixels() as usize];
    let photons = scene.photons(seed, cycles).unwrap();
    slices(photons, cycles, |slice| {
        for (counts, pixel) in capture.iter_mut().zip(&slice.pixels) {
            for photon in &pixel.photons {
                counts[usize::from(photon.code)] += 1;
            }
        }
    });
    capture
}

/// Events of the scene with these settings, and how many are more than three bins away from the
/// surface that their pixel sees.
pub fn events(scene: &Scene, settings: &SettingsFile, cycles: u64) -> (usize, usize) {
    let settings = settings.settings(128).unwrap();
    let photons = scene.photons(99, cycles).unwrap();
    let mut engine = host_engine(&settings, photons.array(), &photons.addresses()).unwrap();
    let (mut all, mut wrong) = (0, 0);
    slices(photons, cycles, |slice| {
        for event in engine.run(slice).unwrap() {
            let truth = scene.truth(event.pixel, 0).unwrap().range_mm / scene.mm_per_bin();
            let at = f64::from(event.position().raw()) / 256.0;
            all += 1;
            wrong += usize::from((at - truth).abs() > 3.0);
        }
    });
    (all, wrong)
}

/// The share of exposures to `background` alone that have an event, with the settings of the
/// calibration.
pub fn false_alarms(found: &Calibration, background: f64) -> f64 {
    match found.bins {
        64 => of::<64>(found, background),
        128 => of::<128>(found, background),
        256 => of::<256>(found, background),
        bins => panic!("{bins} bins"),
    }
}

fn of<const BINS: usize>(found: &Calibration, background: f64) -> f64 {
    // About 200 events, or as many as do not take long.
    let exposure = background * BINS as f64 * 2000.0;
    let exposures_drawn = (6e8 / exposure).clamp(10_000.0, 20_000.0) as u32;
    let detection = found.detection;
    let z = U4F12::from_num(detection.z.unwrap());
    let minimum = Count::saturating(detection.min_count.into());
    let rule = WindowRule::new(detection.window, z, minimum).unwrap();
    let gate = RangeGate::<BINS>::new(found.gate.0, found.gate.1).unwrap();
    let looks = Looks::new(detection.x, detection.l1, detection.l2);
    let rates = Rates::without_target(background);
    let exposures = Exposures::new(&rates, BINS as u16, looks).unwrap();
    let mut rng = trial_rng(0xfa15e, found.gate.0);
    let mut events = 0;
    for _ in 0..exposures_drawn {
        exposures.run::<BINS>(&gate, &mut rng, |_, histogram| {
            let event = detect(histogram, &gate, &rule, &DepthEstimator::Centroid3).is_some();
            events += u32::from(event);
            event
        });
    }
    f64::from(events) / f64::from(exposures_drawn)
}
