//! NumPy arrays: recorded histograms and photon lists from `.npy` and `.npz` files, and pictures,
//! also of floats.

pub(crate) mod archive;
pub(crate) mod header;
pub(crate) mod histograms;
pub mod numbers;
pub(crate) mod records;

/// The header of an array in C order as NumPy writes it, of `bytes` bytes or as many as it needs. `descr` is the type of
/// the elements, such as `<u2`, or a list of fields.
#[must_use]
pub fn header(descr: &str, shape: &[u64], bytes: usize) -> Vec<u8> {
    let quote = if descr.starts_with('[') { "" } else { "'" };
    let lengths: String = shape.iter().map(|length| format!("{length}, ")).collect();
    let lengths = if shape.len() == 1 {
        lengths.trim_end()
    } else {
        lengths.trim_end_matches(", ")
    };
    let text = format!(
        "{{'descr': {quote}{descr}{quote}, 'fortran_order': False, 'shape': ({lengths}), }}"
    );
    let text = format!("{text:<width$}\n", width = bytes.saturating_sub(11));
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend(u16::try_from(text.len()).unwrap_or(u16::MAX).to_le_bytes());
    header.extend(text.bytes());
    header
}

#[cfg(test)]
mod tests;
