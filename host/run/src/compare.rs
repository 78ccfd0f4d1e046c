//! Which detection method suits your photons? All methods decide on the same photons: the paper's rule, the average of all
//! bins, windows, tracking, neighbours, blocks of pixels, and frames as a conventional sensor reads them.
//!
//! `compare` gives each method the threshold at which it has the same rate of false alarms. It measures time to a report,
//! error and cost, repeats that under harder conditions, and names the method to take with its settings: the best that
//! keeps every pixel, and the fastest if blocks are faster. This takes up to a minute. `measure` does one pass with thresholds of your own.
//!
//! ## Example
//!
//! ```rust
//! use dtof_run::compare::method::{Kind, Method};
//! use dtof_run::compare::{measure::{Trial, measure}, stress::Stress, truth::Truth};
//! use dtof_core::fixed::types::U8F8;
//! use dtof_engine::settings::Settings;
//! use dtof_light::scene::Scene;
//!
//! let scene = Scene::parse("background = 0.01\n[[surface]]\nrange_mm = 3000\nsignal = 0.5")?;
//! let mut photons = scene.photons(1, 20_000)?; // seed, laser cycles
//! // Those for a pulse of one bin, without blocks of pixels and without neighbours.
//! let methods = Method::all(U8F8::ONE, 0, false, &Settings::static_scene(1));
//! let trial = |method: usize, threshold, effort| {
//!     let settings = methods[method].settings(&Settings::static_scene(1), threshold, effort)?;
//!     anyhow::Ok(Trial { method, effort, settings })
//! };
//! let frames = methods.len() - 1;
//! assert_eq!(methods[frames].kind, Kind::Frames);
//! // The first is the paper's rule, with α = 8 and at least 5 photons; frames last 2,000 laser cycles.
//! let trials = [trial(0, 8.0, 5)?, trial(frames, 0.0, 2000)?];
//! let truth = Truth::Scene(Box::new(scene));
//! let outcomes = measure(&mut photons, &methods, &trials, &truth, &Stress::NONE, &|_| Ok(()))?;
//! assert!(outcomes[0].figures.cycles < outcomes[1].figures.cycles / 5.0);
//! # Ok::<(), anyhow::Error>(())
//! ```
//!
//! ## What it does not know
//!
//! - `compare` opens no recording: the caller, as `job`, has a `PhotonSource` for each seed.
//! - It knows no flags and no device.
//! - Cost is the instruction count of a Cortex-M4F, from a table. It is not measured on this computer.
//! - A trial with fewer than 100 reports does not count.
//!
//! ## Time against error
//!
//! Every rule gets the threshold that gives the requested rate of false alarms in simulated exposures
//! without a target, with the background of the recording. One parameter is left: the minimum count of a
//! peak. A higher one makes reports later and more exact. So each method is a curve of time against
//! error, and so are frames of all lengths.

pub mod answer;
pub mod bound;
mod chart;
pub mod cost;
pub mod job;
pub mod measure;
pub mod method;
pub mod page;
mod selected;
pub mod stress;
mod survey;
mod tally;
mod text;
pub mod thresholds;
pub mod truth;
mod work;

use anyhow::{Result, ensure};
use dtof_core::{Array, BlockLevel, PixelAddress};

use answer::{Answer, Choice, answer, longest_frame};
use bound::Bound;
use dtof_data::options::Refused;
use dtof_data::photons::source::{PhotonSource, has_only_neighbours};
use dtof_engine::host::host_engine;
use dtof_engine::settings::Settings;
use measure::{Trial, TrialOutcome, measure};
use method::{Kind, Method, Rule};
use selected::Selected;
use stress::{Light, Stress, Stressed};
use survey::{PixelLight, light, median, survey};
pub use tally::Figures;
use tally::{WRONG_BEYOND_BINS, mm_per_bin};
use thresholds::{MIN_COUNT, Thresholds};
use truth::Truth;
use work::Work;

/// About so many photons methods are compared on, and so many under stress.
const PHOTONS: f64 = 1.5e7;
const STRESS_PHOTONS: f64 = 3e6;

/// Minimum counts of a peak: each about 1.4 times the one before.
const MIN_COUNTS: [u16; 16] = [
    MIN_COUNT, 7, 10, 14, 20, 28, 40, 57, 80, 113, 160, 226, 320, 453, 640, 905,
];

/// The fewest reports of a trial; a trial with fewer is left out.
const MIN_REPORTS: u64 = 100;

/// If no method with full resolution is as exact as the longest frames, the allowed error grows by this factor until one is, but not
/// beyond that of a wrong report.
const RELAXATION: f64 = std::f64::consts::SQRT_2;

/// Laser cycles of frames, up to L2.
const FRAMES: [u16; 6] = [100, 200, 500, 1000, 2000, 5000];

/// The input of a comparison.
pub struct Task<'a> {
    /// Opens the photons of a seed.
    pub photons: &'a dyn Fn(u64) -> Result<Box<dyn PhotonSource>>,
    /// The true ranges; without them, the range of all photons of the pixel.
    pub truth: Option<Truth>,
    /// Bins, gate, masked pixels, L1, L2, X and seed.
    pub settings: &'a Settings,
    /// Standard deviation of the pulse in bins.
    pub sigma: f64,
    /// The share of exposures without a target that may end with an event.
    pub false_alarm: f64,
    /// The error that is allowed, in millimetres; by default that of the longest frames, or the lowest that
    /// any method reaches.
    pub within_mm: Option<f64>,
    /// Why pixels report no sooner than after L1, for the answer.
    pub why_l1: &'a str,
    /// Takes the name of the current step, and the share of the whole work that is done, 0 to 1: at the start of
    /// each step, and about every half percent. An error from it ends the comparison.
    pub progress: &'a dyn Fn(&str, f64) -> Result<()>,
}

/// The result of a comparison.
pub struct Comparison {
    /// The methods; frames are the last.
    pub methods: Vec<Method>,
    /// The threshold of each method that reports events.
    pub thresholds: Vec<Option<f64>>,
    /// All trials, by method and effort.
    pub outcomes: Vec<TrialOutcome>,
    /// The bound for a single pixel.
    pub bound: Option<Bound>,
    /// The methods with the lowest minimum count, and the longest frame, under each stress. The first is
    /// without stress.
    pub stressed: Vec<(Stress, Vec<TrialOutcome>)>,
    /// The error of the longest frames, of L2 or of fewer laser cycles if there are not as many, in millimetres.
    pub frame_mm: Option<f64>,
    /// The methods to take.
    pub answer: Answer,
    /// The settings of the method to take at full resolution.
    pub settings: Option<Settings>,
    /// The settings of the fastest method, if that is another.
    pub fastest: Option<Settings>,
    /// Pixels report after so many laser cycles at the soonest, and why.
    pub l1: (u16, String),
    /// The light of the median pixel.
    pub light: Light,
    /// The true ranges.
    pub truth: Truth,
    /// Columns and rows of the sensor.
    pub sensor: [u32; 2],
    /// Pixels that were compared.
    pub pixels: usize,
    /// Laser cycles.
    pub cycles: u64,
    /// Laser cycles a second, if they are known.
    pub laser_hz: Option<u64>,
}

/// The methods with their thresholds.
struct Methods<'a> {
    settings: &'a Settings,
    all: Vec<Method>,
    thresholds: Vec<Option<f64>>,
}

impl<'a> Methods<'a> {
    /// All methods for the pulse of `light`, each with the threshold for the same rate of false alarms.
    fn new(task: &Task<'a>, all: Vec<Method>, light: &Light, work: &Work) -> Result<Self> {
        let (settings, methods) = (task.settings, all);
        let mut rules: Vec<Rule> = methods.iter().filter_map(Method::rule).collect();
        rules.dedup();
        let progress = |part| work.at(part);
        let simulated =
            Thresholds::simulate(&rules, settings, light.background, settings.seed, &progress)?;
        let thresholds = methods.iter().map(|method| {
            // Blocks have a quarter of the false alarms.
            let pixels = if method.has_full_resolution() {
                1.0
            } else {
                0.75
            };
            let share = task.false_alarm * pixels;
            method
                .rule()
                .map(|rule| simulated.of(rule, share))
                .transpose()
        });
        Ok(Self {
            settings,
            thresholds: thresholds.collect::<Result<_>>()?,
            all: methods,
        })
    }

    /// A trial of the method with this number.
    fn trial(&self, number: usize, effort: u16) -> Result<Trial> {
        let threshold = self.thresholds[number].unwrap_or_default();
        Ok(Trial {
            method: number,
            effort,
            settings: self.all[number].settings(self.settings, threshold, effort)?,
        })
    }

    /// All methods with all efforts.
    fn trials(&self, light: &Light) -> Result<Vec<Trial>> {
        let methods = self.all.iter().enumerate();
        let trials = methods.flat_map(|(number, method)| {
            let efforts = efforts(method, self.settings.configuration.l2, light).into_iter();
            efforts.map(move |effort| self.trial(number, effort))
        });
        trials.collect()
    }

    /// All methods with the lowest minimum count, and frames of so many laser cycles.
    fn fastest(&self, frame_cycles: u16) -> Result<Vec<Trial>> {
        let methods = self.all.iter().enumerate();
        let trials = methods.map(|(number, method)| match method.kind {
            Kind::Frames => self.trial(number, frame_cycles),
            Kind::Events(_) => self.trial(number, MIN_COUNT),
        });
        trials.collect()
    }
}

/// Compares all methods for the pulse.
///
/// # Errors
/// Fails if the photons cannot be read, if settings are invalid, if no pixel has a target, or if frames
/// give too few reports and no error is given.
pub fn compare(task: &Task) -> Result<Comparison> {
    let Task {
        settings, sigma, ..
    } = *task;
    // Invalid settings are refused before any photons are drawn.
    host_engine(settings, const { Array::new(1, 1).unwrap() }, &[])?;
    let work = Work::new(task.progress);
    let mut source = photons(task, 0, PHOTONS)?;
    let cost = Cost::new(source.as_ref());
    work.begin(
        "surveys the photons",
        cost.pass(0),
        cost.pass(0) + cost.rest(120, 14, 9),
    )?;
    let (array, laser_hz) = (source.array(), source.laser_hz());
    let (most_levels, has_neighbours) = (
        most_levels(source.as_ref()),
        has_neighbours(source.as_ref()),
    );
    let sensor = [array.columns(), source.capture_rows()];
    let surveyed = survey(source.as_mut(), settings, sigma, &|part| work.at(part))?;
    let truth = known_ranges(task.truth.clone(), &surveyed, settings, array)?;
    let has_target = |pixel| truth.has_target(pixel, 0);
    ensure!(
        surveyed.iter().any(|(pixel, _)| has_target(*pixel)),
        "no pixel has a target: there is nothing to compare"
    );
    let light = light(&surveyed, sigma, has_target);

    let mut stresses = Stress::all(&light, settings.configuration.gate.0);
    // A stress that makes every pixel hot leaves none to compare.
    let is_hot = |stress: &Stress, pixel| stress.is_hot(pixel, array.columns());
    stresses.retain(|stress| surveyed.iter().any(|(pixel, _)| !is_hot(stress, *pixel)));

    let pulse = dtof_core::fixed::types::U8F8::saturating_from_num(light.sigma);
    let all = Method::all(pulse, most_levels, has_neighbours, settings);
    let tried = all
        .iter()
        .map(|method| efforts(method, settings.configuration.l2, &light).len());
    let (tried, under_stress_tried) = (tried.sum(), all.len() + 2);
    let rest = cost.rest(tried, under_stress_tried, stresses.len());
    let step = "finds thresholds of equal false alarms";
    work.begin(step, Cost::THRESHOLDS, rest)?;
    let methods = Methods::new(task, all, &light, &work)?;
    let bound = Bound::new(&light, settings, task.false_alarm, settings.seed)?;

    work.begin(
        "tries all methods",
        cost.pass(tried),
        rest - Cost::THRESHOLDS,
    )?;
    let mut source = photons(task, 0, PHOTONS)?;
    let (pixels, cycles) = (source.addresses().len(), source.cycles());
    let trials = methods.trials(&light)?;
    let mut outcomes = measure(
        source.as_mut(),
        &methods.all,
        &trials,
        &truth,
        &Stress::NONE,
        &|part| work.at(part),
    )?;
    outcomes.retain(|outcome| is_measured(outcome, cycles));

    let frame = longest_frame(&methods.all, &outcomes);
    let frame_mm = frame.map(|frame| frame.figures.error_mm);
    let frame_cycles = frame.map_or(settings.configuration.l2, |frame| frame.trial.effort);
    let answer = choose(task, &methods.all, &outcomes, frame_mm)?;
    let trial = |choice: Option<Choice>| {
        let trial = choice.map(|choice| methods.trial(choice.method, choice.effort));
        trial.transpose()
    };
    let (best, fastest) = (trial(answer.best)?, trial(answer.fastest)?);
    // The methods to take are tried under stress with the minimum count that they are taken with.
    let mut trials = methods.fastest(frame_cycles)?;
    trials.extend(best.iter().chain(&fastest).cloned());
    let each = cost.under_stress(trials.len());
    let mut stressed = Vec::new();
    for (number, stress) in stresses.iter().enumerate() {
        work.begin(stress.name, each, each * (stresses.len() - number) as f64)?;
        let outcomes = under_stress(task, &methods.all, &trials, &truth, stress, &work)?;
        stressed.push((stress.clone(), outcomes));
    }
    (task.progress)("is done", 1.0)?;
    Ok(Comparison {
        frame_mm,
        answer,
        settings: best.map(|best| best.settings),
        fastest: fastest.map(|fastest| fastest.settings),
        methods: methods.all,
        thresholds: methods.thresholds,
        outcomes,
        bound,
        stressed,
        l1: (settings.configuration.l1, task.why_l1.to_owned()),
        light,
        truth,
        sensor,
        pixels,
        cycles,
        laser_hz,
    })
}

/// The work of each step: photons, times the trials that decide on them.
struct Cost {
    photons: f64,
}

impl Cost {
    /// Photons cost as much to draw as so many trials.
    const DRAWN: f64 = 8.0;
    /// The work of the exposures that are simulated for thresholds.
    const THRESHOLDS: f64 = 2e8;

    fn new(source: &dyn PhotonSource) -> Self {
        Self {
            photons: source.photons_per_cycle() * source.cycles() as f64,
        }
    }

    /// A pass over all photons.
    fn pass(&self, trials: usize) -> f64 {
        self.photons * (Self::DRAWN + trials as f64)
    }

    /// A pass under stress.
    fn under_stress(&self, trials: usize) -> f64 {
        self.photons.min(STRESS_PHOTONS) * (Self::DRAWN + trials as f64)
    }

    /// All after the survey.
    fn rest(&self, trials: usize, under_stress: usize, stresses: usize) -> f64 {
        Self::THRESHOLDS + self.pass(trials) + self.under_stress(under_stress) * stresses as f64
    }
}

/// About `most` photons of the seed that is `nth_seed` after the first.
fn photons(task: &Task, nth_seed: u64, most: f64) -> Result<Box<dyn PhotonSource>> {
    let (seed, l2) = (task.settings.seed, task.settings.configuration.l2);
    limited((task.photons)(seed + nth_seed)?, most, l2)
}

/// The methods to take. Their error is at most the one given, or else that of the longest frames, `frame_mm`.
fn choose(
    task: &Task,
    methods: &[Method],
    outcomes: &[TrialOutcome],
    frame_mm: Option<f64>,
) -> Result<Answer> {
    if let Some(within_mm) = task.within_mm {
        return Ok(answer(methods, outcomes, within_mm));
    }
    let frame_mm = frame_mm.ok_or_else(|| {
        Refused::input(format!(
            "frames give fewer than {MIN_REPORTS} reports here; set `within`, or take more pixels or \
             laser cycles"
        ))
    })?;
    let first = answer(methods, outcomes, frame_mm);
    let widest = WRONG_BEYOND_BINS * mm_per_bin(task.settings);
    let wider = |last: &Answer| {
        let within_mm = RELAXATION * last.limits.within_mm;
        (last.limits.within_mm < widest).then(|| answer(methods, outcomes, within_mm))
    };
    let mut all: Vec<Answer> = std::iter::successors(Some(first), wider).collect();
    // Only blocks may be exact enough.
    let has_full = all.iter().position(|found| found.best.is_some());
    let has_any = all.iter().position(|found| found.fastest.is_some());
    Ok(all.swap_remove(has_full.or(has_any).unwrap_or(all.len() - 1)))
}

/// The outcomes of `trials` under `stress`, on photons of another seed.
fn under_stress(
    task: &Task,
    methods: &[Method],
    trials: &[Trial],
    truth: &Truth,
    stress: &Stress,
    work: &Work,
) -> Result<Vec<TrialOutcome>> {
    let source = photons(task, 1, STRESS_PHOTONS)?;
    let bins = u16::try_from(task.settings.bins)?;
    let mut source = Stressed::new(source, stress, bins, task.sigma, task.settings.seed);
    let progress = |part| work.at(part);
    measure(&mut source, methods, trials, truth, stress, &progress)
}

/// Whether a trial has enough reports for its time and its error.
fn is_measured(outcome: &TrialOutcome, cycles: u64) -> bool {
    let figures = &outcome.figures;
    figures.reports >= MIN_REPORTS && figures.cycles <= cycles as f64
}

/// The true ranges, or those of all photons of each pixel. Ranges of a recording may have another offset:
/// the median over the pixels removes it.
fn known_ranges(
    truth: Option<Truth>,
    surveyed: &[(PixelAddress, PixelLight)],
    settings: &Settings,
    array: Array,
) -> Result<Truth> {
    let mm_per_bin = mm_per_bin(settings);
    let offset = settings.configuration.offset_mm.to_num::<f64>();
    let range = |address: PixelAddress, pixel: &PixelLight| {
        let own = settings.offsets_mm.get(usize::from(address.raw()));
        let own: f64 = own.map_or(0.0, |own| own.to_num());
        Some(pixel.position? * mm_per_bin + offset + own)
    };
    Ok(match truth {
        Some(Truth::Scene(scene)) => Truth::Scene(scene),
        Some(given) => {
            let errors = surveyed.iter().filter_map(|(address, pixel)| {
                Some(range(*address, pixel)? - given.ranges(*address, 0)[0]?)
            });
            let offset = median(errors.collect());
            given.moved(offset)
        }
        None => {
            let mut ranges = vec![None; array.pixels() as usize];
            for (address, pixel) in surveyed {
                ranges[usize::from(address.raw())] = range(*address, pixel);
            }
            Truth::OfAllPhotons(ranges)
        }
    })
}

/// The highest level whose blocks fit the array and do not reach across captures.
fn most_levels(source: &dyn PhotonSource) -> u8 {
    let array = source.array();
    let fits = |level: &u8| {
        array.columns().min(array.rows()) >= 1 << level
            && has_only_neighbours(source, BlockLevel::saturating(*level))
    };
    [2, 1].into_iter().find(fits).unwrap_or(0)
}

/// Whether the pixels of `source` have neighbours on all sides, and those of one capture only.
fn has_neighbours(source: &dyn PhotonSource) -> bool {
    let array = source.array();
    array.columns().min(array.rows()) > 1
        && source.capture_rows() == array.rows()
        && source.axis_names()[0] == "column"
}

/// Limits `source` to about `most` photons: first to fewer laser cycles, at least three exposures, then to
/// fewer pixels.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "positive, limited"
)]
fn limited(source: Box<dyn PhotonSource>, most: f64, l2: u16) -> Result<Box<dyn PhotonSource>> {
    let each_cycle = source.photons_per_cycle();
    let least = 3 * u64::from(l2);
    if each_cycle * source.cycles() as f64 <= most {
        return Ok(source);
    }
    let cycles = ((most / each_cycle) as u64).clamp(least.min(source.cycles()), source.cycles());
    let nth = (each_cycle * cycles as f64 / most).ceil().max(1.0) as u32;
    Ok(Box::new(Selected::new(source, nth, cycles)))
}

/// The minimum counts that a method can reach within L2, or the lengths of frames.
fn efforts(method: &Method, l2: u16, light: &Light) -> Vec<u16> {
    match method.kind {
        Kind::Frames => {
            let mut lengths: Vec<u16> = FRAMES.into_iter().filter(|&length| length < l2).collect();
            lengths.push(l2);
            lengths
        }
        Kind::Events(_) => {
            let all = (light.signal + light.background) * f64::from(l2);
            // Neighbours take three times as long to try.
            let step = if method.neighbours().is_some() { 2 } else { 1 };
            let reachable = MIN_COUNTS.into_iter().step_by(step);
            reachable
                .filter(|&count| count == MIN_COUNT || f64::from(count) <= 2.0 * all)
                .collect()
        }
    }
}
