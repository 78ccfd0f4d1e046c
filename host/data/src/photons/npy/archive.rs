//! `.npz` files: arrays by name in a zip archive.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use anyhow::{Context, Error, Result, bail, ensure};
use zip::result::ZipError;
use zip::{CompressionMethod, ZipArchive};

use super::header::Array;
use super::histograms::{self, ArrayHistograms};
use crate::options::{Refused, plain};
use crate::photons::axes::Axes;

/// Reads the histograms of the array `name`. The name may be left out if there is only one array.
///
/// # Errors
/// Returns what is wrong with the file, after its name.
pub fn read(path: &Path, name: Option<&str>, axes: Option<&Axes>) -> Result<ArrayHistograms> {
    named(path, name, axes).with_context(|| path.display().to_string())
}

fn named(path: &Path, name: Option<&str>, axes: Option<&Axes>) -> Result<ArrayHistograms> {
    let mut file = BufReader::new(File::open(path)?);
    let start = file.fill_buf()?;
    ensure!(!start.is_empty(), "the file is empty");
    let is_archive = start.starts_with(b"PK");
    let reason = match is_archive {
        true => "the archive is damaged or cut off",
        false => "not an .npz file as numpy.savez writes it",
    };
    let mut zip = ZipArchive::new(file).map_err(|error| match error {
        ZipError::InvalidArchive(_) => Error::msg(reason),
        error => Error::from(error).context(reason),
    })?;
    let mut arrays = Vec::new();
    for name in zip.file_names() {
        let name = name.context("a file without a name")?;
        arrays.extend(name.strip_suffix(".npy").map(str::to_owned));
    }
    arrays.sort();
    // Names may have line breaks, but an error is one line.
    let list: Vec<String> = arrays.iter().map(|name| one_line(name)).collect();
    let list = list.join(", ");
    let chosen = match (name, &arrays[..]) {
        (Some(name), arrays) => arrays.iter().find(|array| *array == name),
        (None, [single]) => Some(single),
        (None, []) => None,
        (None, several) => {
            let several = several.len();
            bail!(Refused::input(format!(
                "{several} arrays: choose one with `array`: {}",
                plain(list)
            )));
        }
    };
    ensure!(!arrays.is_empty(), "no arrays");
    let chosen = chosen.with_context(|| {
        let name = name.unwrap_or_default();
        format!("no array {name:?}; there is {list}")
    })?;
    let entry = zip.by_name(&format!("{chosen}.npy"));
    let entry = entry.with_context(|| format!("array {}", one_line(chosen)))?;
    let method = entry.compression();
    ensure!(
        matches!(
            method,
            CompressionMethod::Stored | CompressionMethod::Deflated
        ),
        "array {}: its compression, {method}, is not known here; save it with numpy.savez or \
         numpy.savez_compressed",
        one_line(chosen)
    );
    let length = entry.size();
    let mut entry = BufReader::new(entry);
    let array = Array::read(&mut entry, length);
    let histograms = array.and_then(|array| histograms::read(array, axes));
    // At the end of the data zip compares the checksum. It also refuses more data than the archive says.
    let checked = histograms.and_then(|histograms| {
        entry.read(&mut [0]).context("the archive is damaged")?;
        Ok(histograms)
    });
    checked.with_context(|| format!("array {}", one_line(chosen)))
}

fn one_line(name: &str) -> String {
    name.escape_debug().to_string()
}
