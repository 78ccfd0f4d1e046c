//! Long work on a thread of its own: the interpreter is free meanwhile, Ctrl-C stops the work, and the
//! calling thread reports progress.

use std::mem;
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use anyhow::{Result, ensure};
use dtof_data::options::progress::Progress;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::{Error, catch_panics, raised};

/// The interval for signals and progress.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Progress of work, and whether it has to stop.
#[derive(Debug, Default)]
pub struct Control {
    is_stopped: AtomicBool,
    /// How many items of the part are done, and how many there are.
    items: Mutex<(u64, u64)>,
    steps: Mutex<Vec<(String, f64)>>,
}

impl Control {
    /// Reports the current step, and the share of the whole that is done, 0 to 1.
    ///
    /// # Errors
    /// Fails if the work was cancelled.
    pub fn step(&self, step: &str, share: f64) -> Result<()> {
        locked(&self.steps).push((step.to_owned(), share));
        self.check_running()
    }

    fn check_running(&self) -> Result<()> {
        ensure!(!self.is_stopped.load(Ordering::Relaxed), "stopped");
        Ok(())
    }
}

impl Progress for &Control {
    fn begin(&mut self, total: u64, _unit: &str) {
        *locked(&self.items) = (0, total);
    }

    fn at(&mut self, done: u64) -> Result<()> {
        locked(&self.items).0 = done;
        self.check_running()
    }

    fn end(&mut self) {}
}

/// Reports progress to the callback of a Python program.
struct Reporter<'py> {
    progress: Option<Bound<'py, PyAny>>,
    last: (u64, u64),
}

impl Reporter<'_> {
    /// Calls it with each step and its share, then with done and total if they have changed.
    fn report(&mut self, control: &Control) -> PyResult<()> {
        let steps = mem::take(&mut *locked(&control.steps));
        let (done, total) = *locked(&control.items);
        let Some(progress) = &self.progress else {
            return Ok(());
        };
        for step in steps {
            progress.call1(step)?;
        }
        if (done, total) != self.last {
            self.last = (done, total);
            progress.call1((done, total))?;
        }
        Ok(())
    }
}

/// Runs `job`. `progress` is called with the progress of its [`Control`].
///
/// # Errors
/// Fails if `job` or `progress` fails, or on an interrupt. A `job` that does not check its [`Control`] then
/// runs on in the background, and its result is dropped.
pub fn work<T: Send + 'static>(
    py: Python,
    progress: Option<Bound<PyAny>>,
    job: impl FnOnce(&Control) -> Result<T> + Send + 'static,
) -> PyResult<T> {
    let pool = pool().map_err(|error| raised(&error))?;
    let control = Arc::new(Control::default());
    let (send, done) = channel();
    let done = Mutex::new(done);
    let for_job = Arc::clone(&control);
    let thread = thread::Builder::new()
        .name("dtof".to_owned())
        .spawn(move || {
            let result = pool.install(|| catch_panics(|| job(&for_job)));
            // After an interrupt there is no receiver.
            let _ = send.send(result);
        });
    thread.map_err(|error| Error::new_err(format!("no thread to work on: {error}")))?;
    let mut reporter = Reporter {
        progress,
        last: (0, 0),
    };
    loop {
        let result = py.detach(|| locked(&done).recv_timeout(POLL_INTERVAL));
        let checked = py.check_signals().and_then(|()| reporter.report(&control));
        if let Err(error) = checked {
            control.is_stopped.store(true, Ordering::Relaxed);
            return Err(error);
        }
        match result {
            Ok(result) => return result.map_err(|error| raised(&error)),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Err(Error::new_err(
                    "a fault of dtof: the work ended without a result",
                ));
            }
        }
    }
}

/// The threads of a process.
struct Pool {
    process: u32,
    threads: Arc<ThreadPool>,
}

/// The threads of this process: as many as `RAYON_NUM_THREADS` says, or one a core. A forked process has none
/// of the threads of its parent.
pub fn pool() -> Result<Arc<ThreadPool>> {
    static POOL: Mutex<Option<Pool>> = Mutex::new(None);
    let mut current = locked(&POOL);
    let process = process::id();
    if let Some(pool) = &*current
        && pool.process == process
    {
        return Ok(Arc::clone(&pool.threads));
    }
    let builder = ThreadPoolBuilder::new().thread_name(|number| format!("dtof-{number}"));
    let threads = Arc::new(builder.build()?);
    let pool = Pool {
        process,
        threads: Arc::clone(&threads),
    };
    if let Some(before) = current.replace(pool) {
        // The threads of the parent do not exist here: dropping the pool would wait for them forever.
        mem::forget(before);
    }
    Ok(threads)
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
