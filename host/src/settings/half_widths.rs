//! How far the window of the depth reaches before and after its place: as an option and in a file.

use dtof_core::CentredWindow;
use dtof_core::fixed::types::U8F8;
use serde::de::{Deserialize, Deserializer, Error as _};
use serde::ser::{Error as _, Serialize, Serializer};

use crate::cli::arguments::{fixed, shortest};

/// Reads `BEFORE,AFTER`.
///
/// # Errors
/// If they are not two numbers of bins from 1 to 4.
pub fn half_widths(text: &str) -> Result<CentredWindow, String> {
    let sides = text.split_once(',');
    let sides = sides.and_then(|(before, after)| {
        let [before, after] = [before, after].map(|side| fixed::<U8F8>(side).ok());
        CentredWindow::with_sides(before?, after?)
    });
    sides.ok_or_else(|| "must be BEFORE,AFTER, each 1 to 4 bins, as 2,3.5".to_owned())
}

/// As a list of two numbers, with as few digits as name them.
pub fn serialize<S: Serializer>(
    window: &Option<CentredWindow>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let Some(window) = window else {
        return serializer.serialize_none();
    };
    let number = |side| shortest(side).parse::<f64>().map_err(S::Error::custom);
    [number(window.before())?, number(window.after())?].serialize(serializer)
}

pub fn deserialize<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<CentredWindow>, D::Error> {
    let sides = Option::<[f64; 2]>::deserialize(deserializer)?;
    let window = sides.map(|[before, after]| {
        half_widths(&format!("{before},{after}"))
            .map_err(|error| D::Error::custom(format!("half_widths [{before}, {after}]: {error}")))
    });
    window.transpose()
}
