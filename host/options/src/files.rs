//! Files that are written: each beside its place, and moved there when it is whole.
//!
//! A file that a command reads is never replaced.

use std::fs;
use std::io::{BufWriter, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use tempfile::NamedTempFile;

/// Names of files that are not complete end so.
pub const ASIDE: &str = ".partial";

/// Bytes at the start of a file that say what wrote it.
const HEAD: u64 = 1024;

/// Where a file is to be.
pub struct Place {
    /// The folder it is written in.
    pub folder: PathBuf,
    /// The file.
    pub file: PathBuf,
}

/// Where `out` is: what it leads to, if it is a link. Only a file is ever replaced, and
/// none of `inputs`.
///
/// # Errors
/// If something else is there, or there is no folder for it.
pub fn place_of(out: &Path, inputs: &[&Path]) -> Result<Place> {
    let name = || out.display().to_string();
    let is_there = is_no_input(out, inputs)?;
    let file = if is_there {
        fs::canonicalize(out).with_context(name)?
    } else {
        out.to_owned()
    };
    let folder = match file.parent() {
        Some(folder) if folder == Path::new("") => Path::new("."),
        Some(folder) => folder,
        None => Path::new("/"),
    };
    ensure!(
        folder.is_dir(),
        "{}: there is no folder {}",
        name(),
        folder.display()
    );
    let folder = folder.to_owned();
    Ok(Place { folder, file })
}

/// Checks that a result may take the place `file`: nothing is there, or a file with `mark`
/// near its start, which an earlier run has written.
///
/// # Errors
/// If something else is there, or one of `inputs`.
pub fn may_replace(file: &Path, mark: &str, inputs: &[&Path]) -> Result<()> {
    if !is_no_input(file, inputs)? {
        return Ok(());
    }
    let name = || file.display().to_string();
    let mut head = Vec::new();
    let opened = fs::File::open(file).with_context(name)?;
    opened
        .take(HEAD)
        .read_to_end(&mut head)
        .with_context(name)?;
    ensure!(
        head.windows(mark.len()).any(|part| part == mark.as_bytes()),
        "{}: was not written by this program; move it away, or write into another folder",
        name()
    );
    Ok(())
}

/// Whether something is at `file`, which must then be a file and none of `inputs`.
fn is_no_input(file: &Path, inputs: &[&Path]) -> Result<bool> {
    let name = file.display();
    match fs::metadata(file) {
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            ensure!(!file.is_symlink(), "{name}: is a link to what is not there");
            return Ok(false);
        }
        Err(error) => return Err(error).with_context(|| name.to_string()),
        Ok(there) => ensure!(there.is_file(), "{name}: is there, and is no file"),
    }
    let is_read = inputs.iter().any(|input| are_same(input, file));
    ensure!(!is_read, "{name}: is the file that is read");
    Ok(true)
}

/// Whether two names lead to one file, also through links of either kind.
#[cfg(unix)]
#[must_use]
pub fn are_same(one: &Path, other: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |path| fs::metadata(path).map(|file| (file.dev(), file.ino()));
    matches!((identity(one), identity(other)), (Ok(one), Ok(other)) if one == other)
}

/// Whether two names lead to one file.
#[cfg(not(unix))]
#[must_use]
pub fn are_same(one: &Path, other: &Path) -> bool {
    matches!((fs::canonicalize(one), fs::canonicalize(other)), (Ok(one), Ok(other)) if one == other)
}

/// A file in `folder` that vanishes unless it is moved to its place. Its name begins
/// with `prefix`, which says whose it is.
///
/// # Errors
/// If the folder cannot be written.
pub fn aside(folder: &Path, prefix: &str) -> Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(prefix).suffix(ASIDE);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // As any other new file: the umask takes away what it should.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder
        .tempfile_in(folder)
        .with_context(|| folder.display().to_string())
}

/// Writes the buffer to disk.
///
/// # Errors
/// If it cannot be written.
pub fn flushed(file: BufWriter<NamedTempFile>) -> Result<NamedTempFile> {
    let file = file
        .into_inner()
        .map_err(std::io::IntoInnerError::into_error)?;
    file.as_file().sync_all()?;
    Ok(file)
}

/// A text that is to be the file `place`. One of an earlier run, with `mark` near its start, is
/// replaced.
pub struct Marked<'a> {
    /// Where.
    pub place: &'a Path,
    /// What.
    pub text: &'a str,
    /// By what files of this kind are known.
    pub mark: &'a str,
}

/// Writes `files`, all or none, in this order. None of `inputs` is replaced.
///
/// # Errors
/// If something else is in one of the places, or cannot be written.
pub fn write_marked(files: &[Marked], inputs: &[&Path]) -> Result<()> {
    let mut written = Vec::new();
    for Marked { place, text, mark } in files {
        may_replace(place, mark, inputs)?;
        let name = || place.display().to_string();
        let to = place_of(place, inputs)?;
        let mut file = BufWriter::new(aside(&to.folder, ".dtof-")?);
        file.write_all(text.as_bytes()).with_context(name)?;
        written.push((flushed(file).with_context(name)?, to.file));
    }
    for (file, place) in written {
        let name = || place.display().to_string();
        file.persist(&place).with_context(name)?;
    }
    Ok(())
}
