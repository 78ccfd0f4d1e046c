//! Scenes: what an array of simulated pixels looks at, read from a TOML file.
//!
//! Each pixel sees one surface, the nearest at its place, and the next one behind if that lets
//! light through. Signal photons follow
//! the reflectivity and the inverse square of the range; the background is the
//! same everywhere. `docs/scenes.md` lists all keys.

mod depth_map;
mod file;
mod of_depth_map;
mod sight;
mod surface;

use anyhow::{Context, Result, ensure};
use dtof_core::{Array, PixelAddress};

use crate::effects::Effects;
use crate::effects::limits::Timing;
use crate::{RatesAt, SimulatedArray, SimulatedPixel};
use dtof_engine::settings::Settings;
use dtof_photons::MM_PER_PS;
use dtof_photons::geometry::FieldOfView;
use dtof_photons::source::PhotonSource;
use dtof_theory::random::pixel_rng;
use dtof_theory::rates::Rates;

pub use depth_map::{Along, DepthMap};
use sight::Sight;
pub use surface::{Ball, Fan, Light, Plane, Rectangle, Shape, Surface};

/// Signal photons a laser cycle that a pixel may have.
const MOST_SIGNAL: f64 = 10_000.0;

/// Photons a laser cycle that all pixels together may have.
const MOST_PHOTONS: f64 = 1e7;

/// Surfaces are this far away, at least, at all times.
const NEAREST_MM: f64 = 1.0;

/// A scene on an array.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Columns and rows of the array that looks at it, those of the file unless changed. A
    /// pixel's place in the scene is its upper left corner.
    pub size: [u32; 2],
    /// Columns and rows that the places in `surfaces` are given in.
    pub layout: [u32; 2],
    /// The field of view; [`FieldOfView::of`] the layout unless given. Planes need it.
    pub field_of_view: Option<FieldOfView>,
    /// Laser cycles.
    pub cycles: u64,
    /// Bins of a histogram.
    pub bins: u16,
    /// Picoseconds a bin.
    pub bin_width_ps: f64,
    /// Laser pulses a microsecond.
    pub laser_rate_mhz: f64,
    /// Background photons a bin and laser cycle.
    pub background: f64,
    /// Standard deviation of the pulse in bins.
    pub pulse_sigma_bins: f64,
    /// Signal photons a laser cycle from a white surface at one metre.
    pub signal_at_one_metre: f64,
    /// In the order of the file.
    pub surfaces: Vec<Surface>,
    /// Everything beyond the plain model.
    pub effects: Effects,
}

/// The surface that a pixel sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Which of [`Scene::surfaces`].
    pub surface: usize,
    /// How far away it is.
    pub range_mm: f64,
    /// How many photons come back from there.
    pub light: Light,
}

impl Scene {
    /// The same scene with the laser off: no signal, and no crosstalk.
    #[must_use]
    pub fn with_laser_off(mut self) -> Self {
        for surface in &mut self.surfaces {
            surface.light = Light::Signal(0.0);
        }
        self.effects.cover_glass = None;
        self
    }

    /// The view of `pixel` in laser cycle `cycle`: the truth its events are
    /// compared with. None if there is nothing at its place.
    #[must_use]
    pub fn truth(&self, pixel: PixelAddress, cycle: u64) -> Option<View> {
        self.views(pixel, cycle)[0]
    }

    /// What `pixel` sees in laser cycle `cycle`: the nearest surface, and if that lets light
    /// through the nearest of those behind it.
    #[must_use]
    pub fn views(&self, pixel: PixelAddress, cycle: u64) -> [Option<View>; 2] {
        self.views_along(&self.sight(pixel), cycle)
    }

    /// The same for a pixel whose sight is at hand.
    fn views_along(&self, sight: &Sight, cycle: u64) -> [Option<View>; 2] {
        let seconds = self.seconds(cycle);
        let [mut nearest, mut second]: [Option<View>; 2] = [None; 2];
        for (index, surface) in self.surfaces.iter().enumerate() {
            let Some(range_mm) = surface.range_mm(sight, seconds, self.layout) else {
                continue;
            };
            let view = Some(View {
                surface: index,
                range_mm,
                light: surface.light(sight),
            });
            if nearest.is_none_or(|other| range_mm < other.range_mm) {
                (nearest, second) = (view, nearest);
            } else if second.is_none_or(|other| range_mm < other.range_mm) {
                second = view;
            }
        }
        let transmittance = nearest.map_or(0.0, |view| self.surfaces[view.surface].transmittance);
        // The light passes on its way there and back.
        let behind = second.filter(|_| transmittance > 0.0).map(|view| View {
            light: view.light.times(transmittance.powi(2)),
            ..view
        });
        [nearest, behind]
    }

    /// The rates of `pixel` in laser cycle `cycle`.
    #[must_use]
    pub fn rates(&self, pixel: PixelAddress, cycle: u64) -> Rates {
        self.rates_of(self.truth(pixel, cycle))
    }

    /// The rates of what a pixel sees.
    fn rates_of(&self, view: Option<View>) -> Rates {
        Rates {
            background: self.background,
            signal: view.map_or(0.0, |view| self.signal(view.light, view.range_mm)),
            position: view.map_or(0.0, |view| view.range_mm / self.mm_per_bin()),
            sigma: self.pulse_sigma_bins,
        }
    }

    /// The photons of `cycles` laser cycles.
    ///
    /// # Errors
    /// If a surface comes too near in that time, or there are too many photons
    /// or pixels.
    pub fn photons(&self, seed: u64, cycles: u64) -> Result<SimulatedArray> {
        self.check_motion(cycles)?;
        let array = self.array()?;
        self.check_hot_pixels(array.pixels())?;
        let timing = self.timing();
        let has_behind = self
            .surfaces
            .iter()
            .any(|surface| surface.transmittance > 0.0);
        let sights: Vec<Sight> = self.addresses().map(|pixel| self.sight(pixel)).collect();
        let pixels = self.addresses().zip(&sights).map(|(address, sight)| {
            let [rates, behind] = self.views_along(sight, 0).map(|view| self.rates_of(view));
            let pixel = SimulatedPixel::new(&rates, self.bins, pixel_rng(seed, address))?;
            let pixel = match has_behind {
                true => pixel.with_behind(&behind, seed, address)?,
                false => pixel,
            };
            pixel.with_effects(&self.effects, &timing, seed, address)
        });
        let pixels = pixels.collect::<Result<_>>()?;
        let rates_at = self.surfaces.iter().any(Surface::moves).then(|| {
            let scene = self.clone();
            Box::new(move |pixel: PixelAddress, cycle| {
                let [seen, behind] = scene.views_along(&sights[usize::from(pixel.0)], cycle);
                [scene.rates_of(seen), scene.rates_of(behind)]
            }) as RatesAt
        });
        let photons =
            SimulatedArray::new(array, pixels, cycles, rates_at).with_laser_hz(self.laser_hz());
        let each_cycle = photons.photons_per_cycle();
        ensure!(
            each_cycle <= MOST_PHOTONS,
            "{each_cycle:.0} photons a laser cycle: more than {MOST_PHOTONS:.0}"
        );
        Ok(photons)
    }

    /// Millimetres of range a bin.
    #[must_use]
    pub fn mm_per_bin(&self) -> f64 {
        self.bin_width_ps * MM_PER_PS
    }

    /// Where the last bin ends.
    #[must_use]
    pub fn end_mm(&self) -> f64 {
        f64::from(self.bins) * self.mm_per_bin()
    }

    /// Pixels that see a surface at the start or the end of `cycles` laser cycles too
    /// far away for the histogram.
    #[must_use]
    pub fn pixels_beyond(&self, surface: usize, cycles: u64) -> usize {
        let is_beyond = |address, cycle| {
            let views = self.views(address, cycle).into_iter().flatten();
            let mut of_surface = views.filter(|view| view.surface == surface);
            of_surface.any(|view| view.range_mm >= self.end_mm())
        };
        self.addresses()
            .filter(|&address| is_beyond(address, 0) || is_beyond(address, cycles))
            .count()
    }

    /// Laser cycles a second, rounded.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the file is checked: more than 0 MHz, and the histogram fits"
    )]
    #[must_use]
    pub fn laser_hz(&self) -> u64 {
        (self.laser_rate_mhz * 1e6).round() as u64
    }

    /// Picoseconds as bins.
    fn timing(&self) -> Timing {
        Timing {
            bins: self.bins,
            bin_width_ps: self.bin_width_ps,
            period: 1e6 / self.laser_rate_mhz / self.bin_width_ps,
        }
    }

    /// The array that looks at it.
    ///
    /// # Errors
    /// If it has more pixels than addresses, or none.
    pub fn array(&self) -> Result<Array> {
        let [columns, rows] = self.size;
        let pixels = u64::from(columns) * u64::from(rows);
        let array = Array::new(columns, rows);
        array.with_context(|| match pixels {
            0 => "no pixels".to_owned(),
            _ => format!("{pixels} pixels: more than 65,536"),
        })
    }

    /// Every pixel of the array.
    fn addresses(&self) -> impl Iterator<Item = PixelAddress> + use<> {
        let [columns, rows] = self.size.map(|side| side as usize);
        let pixels = (0..=u16::MAX).map(PixelAddress);
        pixels.take(columns.saturating_mul(rows))
    }

    /// The field of view: the one given, or the default.
    #[must_use]
    pub fn view(&self) -> FieldOfView {
        let view = self.field_of_view;
        view.unwrap_or_else(|| FieldOfView::of(self.layout))
    }

    /// Where a pixel looks, along the ray that `dtof export` has.
    fn sight(&self, pixel: PixelAddress) -> Sight {
        let pixel = u32::from(pixel.0);
        let pixel = [pixel % self.size[0], pixel / self.size[0]];
        let [column, row] = pixel.map(f64::from);
        let [columns, rows] = self.size.map(f64::from);
        let view = self.view();
        Sight {
            pixel,
            size: self.size,
            place: [
                column * (f64::from(self.layout[0]) / columns),
                row * (f64::from(self.layout[1]) / rows),
            ],
            ray: view.ray((column + 0.5) / columns, (row + 0.5) / rows),
        }
    }

    fn seconds(&self, cycle: u64) -> f64 {
        cycle as f64 / (self.laser_rate_mhz * 1e6)
    }

    /// Signal photons a laser cycle from a range.
    fn signal(&self, light: Light, range_mm: f64) -> f64 {
        match light {
            Light::Signal(signal) => signal,
            Light::Reflectivity(reflectivity) => {
                self.signal_at_one_metre * reflectivity / (range_mm / 1000.0).powi(2)
            }
        }
    }

    /// Are the listed hot pixels there?
    fn check_hot_pixels(&self, pixels: u32) -> Result<()> {
        let listed = self.effects.hot_pixels.iter().flat_map(|hot| &hot.pixels);
        for pixel in listed {
            ensure!(
                u32::from(*pixel) < pixels,
                "[hot_pixels]: pixel {pixel} of {pixels}"
            );
        }
        Ok(())
    }

    /// As near as a surface comes in `cycles` laser cycles.
    #[must_use]
    pub fn nearest_mm(&self, surface: &Surface, cycles: u64) -> f64 {
        let at = |seconds| surface.nearest_mm(seconds, self.layout);
        at(0.0).min(at(self.seconds(cycles)))
    }

    /// Does every surface stay where a target can be, and is none too bright?
    fn check_motion(&self, cycles: u64) -> Result<()> {
        for surface in &self.surfaces {
            let nearest = self.nearest_mm(surface, cycles);
            ensure!(
                nearest >= NEAREST_MM,
                "{}: comes as near as {nearest:.1} mm; must stay {NEAREST_MM} mm away",
                surface.name
            );
            let (light, from_mm) = surface.brightest(nearest);
            let signal = self.signal(light, from_mm);
            ensure!(
                signal <= MOST_SIGNAL,
                "{}: {signal:.0} signal photons a laser cycle from {from_mm:.1} mm; must be at most \
                 {MOST_SIGNAL:.0}",
                surface.name
            );
        }
        Ok(())
    }
}

/// The paper's settings for its static scene (section III-B), on 128 bins of
/// 250 ps.
#[must_use]
pub fn settings(seed: u64) -> Settings {
    Settings::static_scene(seed)
}
