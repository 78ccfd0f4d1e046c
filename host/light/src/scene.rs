//! Scenes: what an array of simulated pixels sees, read from a TOML file.
//!
//! Each pixel sees the nearest surface, and the next one behind if the nearest lets light through.
//! Signal photons follow the reflectivity and the inverse square of the range. The background is
//! the same everywhere. `docs/scenes.md` lists all keys.

mod depth_map;
mod file;
mod of_depth_map;
mod surface;

use anyhow::{Context, Result, ensure};
use dtof_core::{Array, PixelAddress};

use crate::effects::Effects;
use crate::effects::limits::Timing;
use crate::rates::Rates;
use crate::{RatesFn, SimulatedArray, SimulatedPixel};
use dtof_data::photons::MM_PER_PS;
use dtof_data::photons::geometry::FieldOfView;
use dtof_data::photons::source::PhotonSource;
use dtof_data::random::pixel_rng;

pub use depth_map::{DepthAlong, DepthMap};
pub use surface::{Ball, Brightness, Fan, Plane, Rectangle, Shape, Surface};

/// The most signal photons a laser cycle of a pixel.
const MOST_SIGNAL: f64 = 10_000.0;

/// The most photons a laser cycle of all pixels.
const MOST_PHOTONS: f64 = 1e7;

/// Surfaces must always be at least this far away.
const NEAREST_MM: f64 = 1.0;

/// A scene on an array.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Columns and rows of the array, by default those of the file. The place of a pixel in the
    /// scene is its upper left corner.
    pub size: [u32; 2],
    /// Columns and rows in which the places of `surfaces` are given.
    pub layout: [u32; 2],
    /// The field of view, by default [`FieldOfView::default_for`] the layout. Planes need it.
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
    /// By how many bins the longest laser cycle is longer than the shortest.
    pub dither_bins: u16,
    /// Signal photons a laser cycle from a white surface at one metre.
    pub signal_at_one_metre: f64,
    /// In the order of the file.
    pub surfaces: Vec<Surface>,
    /// Effects beyond the plain model.
    pub effects: Effects,
}

/// Where the ray of a pixel hits a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The index in [`Scene::surfaces`].
    pub surface: usize,
    /// How far away it is.
    pub range_mm: f64,
    /// How much light comes back.
    pub light: Brightness,
}

/// The line of sight of a pixel.
#[derive(Clone, Copy, Debug)]
struct LineOfSight {
    /// Its column and row.
    pixel: [u32; 2],
    /// Columns and rows of its array.
    size: [u32; 2],
    /// Column and row of the layout.
    place: [f64; 2],
    /// The unit ray through its middle.
    ray: [f64; 3],
}

impl Scene {
    /// The same scene with the laser off: no signal, and no crosstalk.
    #[must_use]
    pub fn with_laser_off(mut self) -> Self {
        for surface in &mut self.surfaces {
            surface.light = Brightness::Signal(0.0);
        }
        self.effects.cover_glass = None;
        self
    }

    /// What `pixel` sees in laser cycle `cycle`: the truth for its events. `None` if its ray hits
    /// nothing.
    #[must_use]
    pub fn truth(&self, pixel: PixelAddress, cycle: u64) -> Option<Hit> {
        self.hits(pixel, cycle)[0]
    }

    /// The surfaces that `pixel` sees in laser cycle `cycle`: the nearest, and the next behind it
    /// if the nearest lets light through.
    #[must_use]
    pub fn hits(&self, pixel: PixelAddress, cycle: u64) -> [Option<Hit>; 2] {
        self.hits_along(&self.sight(pixel), cycle)
    }

    /// The same along a line of sight.
    fn hits_along(&self, sight: &LineOfSight, cycle: u64) -> [Option<Hit>; 2] {
        let seconds = self.seconds(cycle);
        let [mut nearest, mut second]: [Option<Hit>; 2] = [None; 2];
        for (index, surface) in self.surfaces.iter().enumerate() {
            let Some(range_mm) = surface.range_mm(sight, seconds, self.layout) else {
                continue;
            };
            let hit = Some(Hit {
                surface: index,
                range_mm,
                light: surface.light(sight),
            });
            if nearest.is_none_or(|other| range_mm < other.range_mm) {
                (nearest, second) = (hit, nearest);
            } else if second.is_none_or(|other| range_mm < other.range_mm) {
                second = hit;
            }
        }
        let transmittance = nearest.map_or(0.0, |hit| self.surfaces[hit.surface].transmittance);
        // The light passes the surface twice.
        let behind = second.filter(|_| transmittance > 0.0).map(|hit| Hit {
            light: hit.light.times(transmittance.powi(2)),
            ..hit
        });
        [nearest, behind]
    }

    /// The rates of `pixel` in laser cycle `cycle`.
    #[must_use]
    pub fn rates(&self, pixel: PixelAddress, cycle: u64) -> Rates {
        self.rates_of(self.truth(pixel, cycle))
    }

    /// The rates for what a pixel sees.
    fn rates_of(&self, hit: Option<Hit>) -> Rates {
        Rates {
            background: self.background,
            signal: hit.map_or(0.0, |hit| self.signal(hit.light, hit.range_mm)),
            position: hit.map_or(0.0, |hit| hit.range_mm / self.mm_per_bin()),
            sigma: self.pulse_sigma_bins,
        }
    }

    /// The photons of `cycles` laser cycles.
    ///
    /// # Errors
    /// Fails if a surface comes too near in that time, or if there are too many photons or pixels.
    pub fn photons(&self, seed: u64, cycles: u64) -> Result<SimulatedArray> {
        self.check_motion(cycles)?;
        let array = self.array()?;
        self.check_hot_pixels(array.pixels())?;
        let timing = self.timing();
        let has_behind = self
            .surfaces
            .iter()
            .any(|surface| surface.transmittance > 0.0);
        let lines: Vec<LineOfSight> = self.addresses().map(|pixel| self.sight(pixel)).collect();
        let pixels = self.addresses().zip(&lines).map(|(address, sight)| {
            let [rates, behind] = self.hits_along(sight, 0).map(|hit| self.rates_of(hit));
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
                let [seen, behind] = scene.hits_along(&lines[usize::from(pixel.raw())], cycle);
                [scene.rates_of(seen), scene.rates_of(behind)]
            }) as RatesFn
        });
        let photons = SimulatedArray::new(array, pixels, cycles, rates_at)?;
        let photons = photons.with_laser_hz(self.laser_hz());
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

    /// The range at the end of the last bin.
    #[must_use]
    pub fn end_mm(&self) -> f64 {
        f64::from(self.bins) * self.mm_per_bin()
    }

    /// How many pixels see the surface beyond the end of the histogram, at the start or the end of
    /// `cycles` laser cycles.
    #[must_use]
    pub fn pixels_beyond(&self, surface: usize, cycles: u64) -> usize {
        let is_beyond = |address, cycle| {
            let hits = self.hits(address, cycle).into_iter().flatten();
            let mut of_surface = hits.filter(|hit| hit.surface == surface);
            of_surface.any(|hit| hit.range_mm >= self.end_mm())
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

    /// The time base of the effects.
    fn timing(&self) -> Timing {
        Timing {
            bins: self.bins,
            bin_width_ps: self.bin_width_ps,
            period: 1e6 / self.laser_rate_mhz / self.bin_width_ps,
            dither_bins: self.dither_bins,
        }
    }

    /// The array.
    ///
    /// # Errors
    /// Fails if it has no pixels, or more than there are addresses.
    pub fn array(&self) -> Result<Array> {
        let [columns, rows] = self.size;
        let pixels = u64::from(columns) * u64::from(rows);
        let array = Array::new(columns, rows);
        array.with_context(|| match pixels {
            0 => "no pixels".to_owned(),
            _ => format!("{pixels} pixels: more than 65,536"),
        })
    }

    /// The addresses of all pixels.
    fn addresses(&self) -> impl Iterator<Item = PixelAddress> + use<> {
        let [columns, rows] = self.size.map(|side| side as usize);
        let pixels = (0..=u16::MAX).map(PixelAddress::new);
        pixels.take(columns.saturating_mul(rows))
    }

    /// The field of view of the scene, or the default.
    #[must_use]
    pub fn effective_field_of_view(&self) -> FieldOfView {
        let view = self.field_of_view;
        view.unwrap_or_else(|| FieldOfView::default_for(self.layout))
    }

    /// The line of sight of a pixel, along the ray that `dtof export` uses.
    fn sight(&self, pixel: PixelAddress) -> LineOfSight {
        let pixel = u32::from(pixel.raw());
        let pixel = [pixel % self.size[0], pixel / self.size[0]];
        let [column, row] = pixel.map(f64::from);
        let [columns, rows] = self.size.map(f64::from);
        let view = self.effective_field_of_view();
        LineOfSight {
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
    fn signal(&self, light: Brightness, range_mm: f64) -> f64 {
        match light {
            Brightness::Signal(signal) => signal,
            Brightness::Reflectivity(reflectivity) => {
                self.signal_at_one_metre * reflectivity / (range_mm / 1000.0).powi(2)
            }
        }
    }

    /// Checks that the listed hot pixels are in the array.
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

    /// The nearest distance of a surface in `cycles` laser cycles.
    #[must_use]
    pub fn nearest_mm(&self, surface: &Surface, cycles: u64) -> f64 {
        let at = |seconds| surface.nearest_mm(seconds, self.layout);
        at(0.0).min(at(self.seconds(cycles)))
    }

    /// Checks that no surface comes too near or is too bright.
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
