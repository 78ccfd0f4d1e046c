//! Scenes with a depth map.

use anyhow::{Result, ensure};

use super::Scene;
use super::depth_map::DepthMap;
use super::surface::{Brightness, Shape, Surface};
use dtof_data::photons::geometry::FieldOfView;

/// Its name in reports.
const NAME: &str = "depth map";

impl Scene {
    /// Adds a depth map as a surface. It fills the field of view of the scene, which becomes
    /// [`FieldOfView::default_for`] the map if the scene has none.
    ///
    /// # Errors
    /// Fails if all of it is beyond the histogram or within its first bin, as with a wrong unit.
    pub fn add_depth_map(&mut self, map: DepthMap) -> Result<()> {
        let (nearest, farthest) = (map.nearest_mm(), map.farthest_mm());
        let unit = "floats are metres, integers millimetres";
        ensure!(
            nearest < self.end_mm(),
            "nothing is nearer than {nearest:.0} mm, and the histogram ends at {:.0} mm: {unit}",
            self.end_mm()
        );
        ensure!(
            farthest >= self.mm_per_bin(),
            "nothing is farther away than {farthest:.1} mm, which is in the first bin: {unit}"
        );
        self.field_of_view
            .get_or_insert_with(|| FieldOfView::default_for(map.size()));
        self.surfaces.push(Surface {
            name: NAME.to_owned(),
            range_mm: nearest,
            range_right_mm: nearest,
            light: Brightness::Reflectivity(1.0),
            transmittance: 0.0,
            velocity_m_per_s: 0.0,
            drift_per_s: [0.0; 2],
            shape: Shape::DepthMap(map),
        });
        Ok(())
    }
}
