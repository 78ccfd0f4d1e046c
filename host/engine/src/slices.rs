//! Feeds an engine slice by slice, and makes the photons of the next slice meanwhile.

use std::ops::ControlFlow;

use anyhow::{Context, Result};

use dtof_data::photons::source::{PhotonSource, Slice};

/// The most laser cycles of a slice. It does not change events.
const SLICE: u16 = 256;
/// A slice is longer if it surely has no more photons than that: each slice is work for each pixel, and where photons
/// are few there would be more of it than of theirs.
const SPARSE: u64 = 1 << 14;
/// About the photons of a slice: so few a pixel that they stay in the cache, but enough in all to
/// be worth a slice, and no more than fit into memory.
const PHOTONS_A_PIXEL: f64 = 128.0;
const FEWEST_PHOTONS: f64 = 5e5;
const MOST_PHOTONS: f64 = 1e7;

/// Gives all of `source` to `decide`, slice by slice, and makes the photons of the next slice
/// meanwhile. `observe` gets each slice, its result, and how many laser cycles are done, and may end it
/// there.
///
/// # Errors
/// Returns the first error of the recording, of `decide` or of `observe`.
pub fn each_slice<T: Send>(
    source: &mut dyn PhotonSource,
    mut decide: impl FnMut(&Slice) -> Result<T> + Send,
    mut observe: impl FnMut(&Slice, T, u64) -> Result<ControlFlow<()>>,
) -> Result<()> {
    let mut done = 0;
    let mut next = next_slice(source, done)?;
    while let Some((slice, length)) = next {
        done += u64::from(length);
        let (mut decided, mut after) = (None, Ok(None));
        rayon::in_place_scope(|scope| {
            scope.spawn(|_| decided = Some(decide(&slice)));
            after = next_slice(source, done);
        });
        let decided = decided.context("no slice was decided on")??;
        if observe(&slice, decided, done)?.is_break() {
            break;
        }
        next = after?;
    }
    Ok(())
}

/// The next slice after `done` laser cycles and its length, unless the source has ended.
fn next_slice(source: &mut dyn PhotonSource, done: u64) -> Result<Option<(Slice, u16)>> {
    if done >= source.cycles() {
        return Ok(None);
    }
    let length = next_cycles(source, done);
    Ok(Some((source.next_slice(length)?, length)))
}

/// Laser cycles of the next slice after `done`.
#[must_use]
pub fn next_cycles(source: &dyn PhotonSource, done: u64) -> u16 {
    let photons = source.addresses().len() as f64 * PHOTONS_A_PIXEL;
    let photons = photons.clamp(FEWEST_PHOTONS, MOST_PHOTONS);
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "1 to SLICE"
    )]
    let most = (photons / source.photons_per_cycle()).clamp(1.0, SLICE.into()) as u16;
    let sparse = source.sparse_cycles(SPARSE);
    let most = u16::try_from(sparse).unwrap_or(u16::MAX).max(most);
    u16::try_from(source.cycles() - done).map_or(most, |left| left.min(most))
}
