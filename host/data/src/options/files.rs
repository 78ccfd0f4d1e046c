//! Output files. Each is written to a temporary file in the same folder and renamed when it is
//! complete.
//!
//! A file that a command reads is never replaced.

use std::fs;
use std::io::{BufWriter, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, ensure};
use tempfile::NamedTempFile;

/// The suffix of incomplete files.
pub const PARTIAL: &str = ".partial";

/// The mark of a file is searched in so many bytes at its start.
const HEAD: u64 = 1024;

/// The most bytes of a text file. None that the program reads is longer.
const MOST_TEXT: u64 = 1 << 24;

/// Reads a text file.
///
/// # Errors
/// Fails if it cannot be read, is not in UTF-8 or longer than 16 MiB. The error begins with its name.
pub fn read_text(path: &Path) -> Result<String> {
    let name = || path.display().to_string();
    let mut bytes = Vec::new();
    let file = fs::File::open(path).with_context(name)?;
    // Some files, such as `/dev/zero`, have no end.
    let read = file.take(MOST_TEXT + 1).read_to_end(&mut bytes);
    ensure!(
        read.with_context(name)? as u64 <= MOST_TEXT,
        "{}: more than {MOST_TEXT} bytes: no such file is so long",
        name()
    );
    String::from_utf8(bytes).map_err(|error| {
        let before = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = before.iter().filter(|&&byte| byte == b'\n').count() + 1;
        anyhow!("{}: line {line}: not UTF-8; save the file as UTF-8", name())
    })
}

/// Fills `bytes`.
///
/// # Errors
/// Fails if it cannot be read, or with `too_short` if fewer are left.
pub fn fill(input: &mut impl Read, bytes: &mut [u8], too_short: &str) -> Result<()> {
    input.read_exact(bytes).map_err(|error| match error.kind() {
        ErrorKind::UnexpectedEof => anyhow!("{too_short}"),
        _ => error.into(),
    })
}

/// The path of an output file.
pub struct Destination {
    /// Its folder, where the temporary file is written.
    pub folder: PathBuf,
    /// The path itself, with links resolved.
    pub file: PathBuf,
}

/// Resolves the output path `out` and checks that it may be written. It must be new or a file, and
/// none of `inputs`.
///
/// # Errors
/// Fails if something other than a file is at `out`, if `out` is one of `inputs`, or if its folder
/// does not exist.
pub fn destination(out: &Path, inputs: &[&Path]) -> Result<Destination> {
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
    Ok(Destination { folder, file })
}

/// Checks that a result may be written to `file`: nothing is there yet, or a file of an earlier
/// run, which has `mark` near its start.
///
/// # Errors
/// Fails if `file` was not written by this program, or is one of `inputs`.
pub fn may_replace(file: &Path, mark: &str, inputs: &[&Path]) -> Result<()> {
    ensure!(
        is_new_or_marked(file, mark, inputs)?,
        "{}: was not written by this program; move it away, or write into another folder",
        file.display()
    );
    Ok(())
}

/// [`destination`] and [`may_replace`] in one.
///
/// # Errors
/// Those of both.
pub fn marked_destination(file: &Path, mark: &str, inputs: &[&Path]) -> Result<Destination> {
    may_replace(file, mark, inputs)?;
    destination(file, inputs)
}

/// Returns whether nothing is at `file` yet, or a file that has `mark` near its start.
///
/// # Errors
/// Fails if `file` cannot be read, is no file, or is one of `inputs`.
pub fn is_new_or_marked(file: &Path, mark: &str, inputs: &[&Path]) -> Result<bool> {
    if !is_no_input(file, inputs)? {
        return Ok(true);
    }
    let name = || file.display().to_string();
    let mut head = Vec::new();
    let opened = fs::File::open(file).with_context(name)?;
    opened
        .take(HEAD)
        .read_to_end(&mut head)
        .with_context(name)?;
    Ok(head.windows(mark.len()).any(|part| part == mark.as_bytes()))
}

/// Renames the file in `place` that `text` will replace, unless it is the same: somebody may have edited it. Returns the
/// new name, which ends in `~1`, or in the first number that is free.
///
/// # Errors
/// Fails if it cannot be read or renamed; the error begins with its name.
pub fn keep_edited(place: &Path, text: &str) -> Result<Option<PathBuf>> {
    let name = || place.display().to_string();
    let there = match fs::read(place) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(error).with_context(name),
        Ok(there) if there == text.as_bytes() => return Ok(None),
        Ok(there) => there,
    };
    for number in 1u64.. {
        let mut kept = place.as_os_str().to_owned();
        kept.push(format!("~{number}"));
        let kept = PathBuf::from(kept);
        if fs::read(&kept).is_ok_and(|other| other == there) {
            return Ok(Some(kept));
        }
        // Fails if the name is taken, so that nothing is replaced.
        match fs::hard_link(place, &kept) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            // Not every file system has links.
            Err(_) if !kept.exists() => {
                fs::rename(place, &kept).with_context(name)?;
                return Ok(Some(kept));
            }
            Err(error) => return Err(error).with_context(name),
            Ok(()) => return Ok(Some(kept)),
        }
    }
    Ok(None)
}

/// Returns whether `file` exists. If it does, it must be a file and none of `inputs`.
fn is_no_input(file: &Path, inputs: &[&Path]) -> Result<bool> {
    let name = file.display();
    match fs::metadata(file) {
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            ensure!(!file.is_symlink(), "{name}: is a broken link");
            return Ok(false);
        }
        Err(error) => return Err(error).with_context(|| name.to_string()),
        Ok(there) => ensure!(there.is_file(), "{name}: exists and is not a file"),
    }
    let is_read = inputs.iter().any(|input| is_same_file(input, file));
    ensure!(!is_read, "{name}: is an input file");
    Ok(true)
}

/// Returns whether two paths lead to the same file, through links of either kind.
#[cfg(unix)]
#[must_use]
pub fn is_same_file(one: &Path, other: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |path| fs::metadata(path).map(|file| (file.dev(), file.ino()));
    matches!((identity(one), identity(other)), (Ok(one), Ok(other)) if one == other)
}

/// Returns whether two paths lead to the same file.
#[cfg(not(unix))]
#[must_use]
pub fn is_same_file(one: &Path, other: &Path) -> bool {
    matches!((fs::canonicalize(one), fs::canonicalize(other)), (Ok(one), Ok(other)) if one == other)
}

/// Checks that a recording is a file. A pipe or a device may never end, and cannot be read twice.
///
/// # Errors
/// Fails if nothing is at `path`, or something else.
pub fn is_file(path: &Path) -> Result<()> {
    let there = fs::metadata(path)?;
    ensure!(!there.is_dir(), "is a folder; name a file in it");
    ensure!(
        there.is_file(),
        "is a pipe or a device; save it as a file first"
    );
    Ok(())
}

/// Creates a file in `folder` that is deleted unless it is persisted. Its name begins with
/// `prefix`.
///
/// # Errors
/// Fails if the folder cannot be written.
pub fn temporary_file(folder: &Path, prefix: &str) -> Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(prefix).suffix(PARTIAL);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // The same permissions as any other new file, less the umask.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder
        .tempfile_in(folder)
        .with_context(|| folder.display().to_string())
}

/// Writes the buffer to disk.
///
/// # Errors
/// Fails if it cannot be written.
pub fn flush_to_disk(file: BufWriter<NamedTempFile>) -> Result<NamedTempFile> {
    let file = file
        .into_inner()
        .map_err(std::io::IntoInnerError::into_error)?;
    file.as_file().sync_all()?;
    Ok(file)
}

/// A text to be written to `place`. A file of an earlier run, with `mark` near its start, is
/// replaced.
pub struct MarkedFile<'a> {
    /// The path.
    pub place: &'a Path,
    /// The content.
    pub text: &'a str,
    /// Marks files of this kind.
    pub mark: &'a str,
    /// People edit such files: one that differs is kept under another name.
    pub is_edited: bool,
}

/// Writes all `files` in this order, or none. None of `inputs` is replaced. Once all are written, those at `removed` are
/// removed, if they exist, before the first moves to its place. Returns the new name of a file that was kept.
///
/// # Errors
/// Fails if one of the files cannot be written, replaced or removed.
pub fn write_marked(
    files: &[MarkedFile],
    removed: &[&Path],
    inputs: &[&Path],
) -> Result<Option<PathBuf>> {
    let mut written = Vec::new();
    for MarkedFile {
        place, text, mark, ..
    } in files
    {
        let to = marked_destination(place, mark, inputs)?;
        let name = || place.display().to_string();
        let file = temporary_file(&to.folder, ".dtof-").with_context(name)?;
        let mut file = BufWriter::new(file);
        file.write_all(text.as_bytes()).with_context(name)?;
        written.push((flush_to_disk(file).with_context(name)?, to.file, place));
    }
    let mut kept = None;
    for (file, (_, to, place)) in files.iter().zip(&written) {
        if file.is_edited {
            kept = keep_edited(to, file.text).with_context(|| place.display().to_string())?;
        }
    }
    for old in removed {
        // As above, a link stays.
        let linked = fs::canonicalize(old).ok();
        let removed = remove(linked.as_deref().unwrap_or(old));
        removed.with_context(|| old.display().to_string())?;
    }
    for (file, to, place) in written {
        let moved = file.persist(to).map_err(|error| error.error);
        moved.with_context(|| place.display().to_string())?;
    }
    Ok(kept)
}

/// Removes a file, if it exists.
///
/// # Errors
/// Fails if it cannot be removed; the error begins with its name.
pub fn remove(file: &Path) -> Result<()> {
    match fs::remove_file(file) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(error).with_context(|| file.display().to_string())
        }
        _ => Ok(()),
    }
}
