//! What a recording is read from: a file, or an `.npy` array in memory.

use std::fmt;
use std::fs::File;
use std::io::{self, Cursor, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Result;

use crate::options::files::is_file;

/// Data that can be read more than once.
#[derive(Clone, Debug)]
pub enum Input {
    /// A file.
    File(PathBuf),
    /// An array in memory.
    Array(Arc<NpyArray>),
}

/// The content of an `.npy` file, in memory.
pub struct NpyArray {
    /// Its name in errors.
    pub name: String,
    /// The header, as `numpy.lib.format` writes it.
    pub header: Vec<u8>,
    /// The elements.
    pub data: Box<dyn AsRef<[u8]> + Send + Sync>,
}

impl fmt::Debug for NpyArray {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str(&self.name)
    }
}

/// The elements of an array, from index `next` on.
struct Elements {
    array: Arc<NpyArray>,
    next: usize,
}

impl Read for Elements {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let all: &[u8] = (*self.array.data).as_ref();
        let mut left = all.get(self.next..).unwrap_or_default();
        let read = left.read(buffer)?;
        self.next += read;
        Ok(read)
    }
}

impl Input {
    /// A file of these bytes, in memory.
    #[cfg(test)]
    pub fn in_memory(name: &str, bytes: impl Into<Vec<u8>>) -> Self {
        Self::Array(Arc::new(NpyArray {
            name: name.to_owned(),
            header: Vec::new(),
            data: Box::new(bytes.into()),
        }))
    }

    /// All bytes from the start, and their number.
    ///
    /// # Errors
    /// Fails if it is no file, such as a pipe, or the file cannot be read.
    pub fn open(&self) -> Result<(Box<dyn Read>, u64)> {
        match self {
            Self::File(path) => {
                is_file(path)?;
                let file = File::open(path)?;
                let length = file.metadata()?.len();
                Ok((Box::new(file), length))
            }
            Self::Array(array) => {
                let length = array.header.len() + (*array.data).as_ref().len();
                let header = Cursor::new(array.header.clone());
                let elements = Elements {
                    array: Arc::clone(array),
                    next: 0,
                };
                Ok((Box::new(header.chain(elements)), length as u64))
            }
        }
    }

    /// The path, if it is a file.
    #[must_use]
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::File(path) => Some(path),
            Self::Array(_) => None,
        }
    }
}

/// The name in errors.
impl fmt::Display for Input {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::File(path) => path.display().fmt(formatter),
            Self::Array(array) => formatter.write_str(&array.name),
        }
    }
}

impl From<&Path> for Input {
    fn from(path: &Path) -> Self {
        Self::File(path.to_owned())
    }
}

impl From<&PathBuf> for Input {
    fn from(path: &PathBuf) -> Self {
        Self::File(path.clone())
    }
}

impl From<&Self> for Input {
    fn from(input: &Self) -> Self {
        input.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_reads_as_its_file_would_again_and_again() {
        let input = Input::Array(Arc::new(NpyArray {
            name: "counts".to_owned(),
            header: b"header".to_vec(),
            data: Box::new(b"elements".to_vec()),
        }));
        for _ in 0..2 {
            let (bytes, length) = input.open().unwrap();
            let mut all = Vec::new();
            // Elements that do not end are found, too.
            bytes.take(20).read_to_end(&mut all).unwrap();
            assert_eq!(all, b"headerelements");
            assert_eq!(length, 14);
        }
        assert_eq!(input.to_string(), "counts");
        assert_eq!(format!("{input:?}"), "Array(counts)");
        assert!(input.file().is_none());
    }

    #[test]
    fn a_file_is_named_by_its_path_and_a_folder_is_none() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
        let path = folder.join("Cargo.toml");
        for input in [Input::from(&path), Input::from(&*path)] {
            assert_eq!(input.to_string(), path.display().to_string());
            assert_eq!(input.file(), Some(&*path));
            let (mut bytes, length) = input.open().unwrap();
            let mut all = Vec::new();
            bytes.read_to_end(&mut all).unwrap();
            assert_eq!(all, std::fs::read(&path).unwrap());
            assert_eq!(length, all.len() as u64);
        }
        let error = Input::from(folder).open().err().unwrap();
        assert_eq!(error.to_string(), "is a folder; name a file in it");
    }
}
