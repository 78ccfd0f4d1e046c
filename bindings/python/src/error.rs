//! Errors in one line, as the program prints them, with keywords in place of flags.

use std::any::Any;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use dtof_data::options::{Options, option_name};
use dtof_engine::settings::SettingsFile;
use dtof_run::given::Given;
use pyo3::exceptions::PyValueError;
use pyo3::{PyErr, PyResult};

pyo3::create_exception!(
    dtof,
    Error,
    PyValueError,
    "What is wrong with a recording or an option, in one line."
);

/// The exception for an error.
pub fn raised(error: &anyhow::Error) -> PyErr {
    let keyword = |key: &str| option_name(key).to_owned();
    let line = dtof_data::options::line(error, &keyword);
    let line: Vec<&str> = line.lines().collect();
    Error::new_err(line.join(" "))
}

/// Runs `job`. A panic in it becomes an error, which says that it is a fault of `dtof`.
pub fn catch_panics<T>(job: impl FnOnce() -> anyhow::Result<T>) -> anyhow::Result<T> {
    catch_unwind(AssertUnwindSafe(job)).unwrap_or_else(|panic| Err(of_panic(panic.as_ref())))
}

/// The options of a job, from keywords and their values as texts.
pub fn options<O: Options>(keywords: Keywords) -> PyResult<O> {
    checked(|| Ok(dtof_data::options::read(keywords)?))
}

/// Jobs whose options override a settings file.
pub trait OverSettings: Options {
    /// Their settings.
    fn given(&mut self) -> &mut Given;
}

macro_rules! over_settings {
    ($($options:ty),+) => {
        $(impl OverSettings for $options {
            fn given(&mut self) -> &mut Given {
                &mut self.given
            }
        })+
    };
}
over_settings!(
    dtof_run::replay::Options,
    dtof_run::simulate::Options,
    dtof_run::compare::job::Options,
    dtof_run::given::Operation
);

/// The same for a job with settings: the name of a file, or a text of several lines.
pub fn options_over<O: OverSettings>(mut keywords: Keywords) -> PyResult<O> {
    let is_text = |(key, value): &mut (String, OsString)| {
        key == "settings" && value.to_str().is_some_and(|text| text.contains('\n'))
    };
    let text = keywords.extract_if(.., is_text).last();
    let mut options: O = options(keywords)?;
    options.given().text = text.and_then(|(_, text)| text.into_string().ok());
    Ok(options)
}

/// Settings from the name of a file, or from a text of several lines.
pub fn settings(given: &str) -> anyhow::Result<SettingsFile> {
    match given.contains('\n') {
        true => SettingsFile::parse_as(Path::new("settings"), given),
        false => SettingsFile::read(Path::new(given)),
    }
}

/// Keywords and their values as texts.
pub type Keywords = Vec<(String, OsString)>;

/// Runs `job`; an error or a panic becomes an exception.
pub fn checked<T>(job: impl FnOnce() -> anyhow::Result<T>) -> PyResult<T> {
    catch_panics(job).map_err(|error| raised(&error))
}

fn of_panic(panic: &(dyn Any + Send)) -> anyhow::Error {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
    let text = text.unwrap_or("no reason given");
    anyhow::anyhow!("a fault of dtof, not of what it was given: {text}")
}
