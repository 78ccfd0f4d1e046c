//! Long work, on a thread of its own: the interpreter is free meanwhile, Ctrl-C ends it, and
//! progress is told by the thread that called.

use std::mem;
use std::process;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use anyhow::{Result, ensure};
use dtof_options::progress::Progress;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::{Error, guarded, raised};

/// How long a signal or progress may wait.
const PATIENCE: Duration = Duration::from_millis(50);

/// How far work is.
#[derive(Debug, Default)]
pub struct Watch {
    is_stopped: AtomicBool,
    done: AtomicU64,
    total: AtomicU64,
    steps: Mutex<Vec<String>>,
}

impl Watch {
    /// What comes next.
    ///
    /// # Errors
    /// If nobody wants it.
    pub fn step(&self, step: &str) -> Result<()> {
        locked(&self.steps).push(step.to_owned());
        self.go_on()
    }

    fn go_on(&self) -> Result<()> {
        ensure!(!self.is_stopped.load(Ordering::Relaxed), "stopped");
        Ok(())
    }
}

/// A run tells it what has been done.
impl Progress for &Watch {
    fn begin(&mut self, total: u64, _unit: &str) {
        self.total.store(total, Ordering::Relaxed);
    }

    fn at(&mut self, done: u64) -> Result<()> {
        self.done.store(done, Ordering::Relaxed);
        self.go_on()
    }

    fn end(&mut self) {}
}

/// What a program is told of its work.
struct Told<'py> {
    progress: Option<Bound<'py, PyAny>>,
    last: (u64, u64),
}

impl Told<'_> {
    /// Steps as text, the rest as two numbers.
    fn tell(&mut self, watch: &Watch) -> PyResult<()> {
        let steps = mem::take(&mut *locked(&watch.steps));
        let [done, total] = [&watch.done, &watch.total].map(|of| of.load(Ordering::Relaxed));
        let Some(progress) = &self.progress else {
            return Ok(());
        };
        for step in steps {
            progress.call1((step,))?;
        }
        if (done, total) != self.last {
            self.last = (done, total);
            progress.call1((done, total))?;
        }
        Ok(())
    }
}

/// Does `job`. `progress` is called with what [`Watch`] is told.
///
/// # Errors
/// Those of `job`, of `progress`, and an interrupt. Work that does not look at its [`Watch`] ends
/// by itself then, and what comes of it is dropped.
pub fn work<T: Send + 'static>(
    py: Python,
    progress: Option<Bound<PyAny>>,
    job: impl FnOnce(&Watch) -> Result<T> + Send + 'static,
) -> PyResult<T> {
    let pool = pool().map_err(|error| raised(&error))?;
    let watch = Arc::new(Watch::default());
    let (send, done) = channel();
    let done = Mutex::new(done);
    let of_job = Arc::clone(&watch);
    let thread = thread::Builder::new()
        .name("dtof".to_owned())
        .spawn(move || {
            let result = pool.install(|| guarded(|| job(&of_job)));
            // Nobody may be there any more.
            let _ = send.send(result);
        });
    thread.map_err(|error| Error::new_err(format!("no thread to work on: {error}")))?;
    let mut told = Told {
        progress,
        last: (0, 0),
    };
    loop {
        let result = py.detach(|| locked(&done).recv_timeout(PATIENCE));
        let checked = py.check_signals().and_then(|()| told.tell(&watch));
        if let Err(error) = checked {
            watch.is_stopped.store(true, Ordering::Relaxed);
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

/// How many threads a process has, if that was said.
static THREADS: AtomicUsize = AtomicUsize::new(0);

/// The threads of a process.
struct Pool {
    process: u32,
    asked: usize,
    threads: Arc<ThreadPool>,
}

/// From now on this process has so many threads, 0 for one a core. Work that has begun keeps its own.
pub fn use_threads(threads: usize) {
    THREADS.store(threads, Ordering::Relaxed);
}

/// The threads of this process. A process that was forked has none of its parent's.
fn pool() -> Result<Arc<ThreadPool>> {
    static POOL: Mutex<Option<Pool>> = Mutex::new(None);
    let mut known = locked(&POOL);
    let (process, asked) = (process::id(), THREADS.load(Ordering::Relaxed));
    if let Some(pool) = &*known
        && (pool.process, pool.asked) == (process, asked)
    {
        return Ok(Arc::clone(&pool.threads));
    }
    let builder = ThreadPoolBuilder::new().num_threads(asked);
    let builder = builder.thread_name(|number| format!("dtof-{number}"));
    let threads = Arc::new(builder.build()?);
    let pool = Pool {
        process,
        asked,
        threads: Arc::clone(&threads),
    };
    if let Some(before) = known.replace(pool)
        && before.process != process
    {
        // The threads of the parent are not here: to wait for their end would take for ever.
        mem::forget(before);
    }
    Ok(threads)
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
