//! The commands of `north` for Python: arguments in, the machine-readable result out. It is the command itself that runs, so results have the same
//! names, digits and errors.

use std::any::Any;
use std::convert::Infallible;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Mutex, MutexGuard, TryLockError};
use std::thread;
use std::time::Duration;

use clap::Parser;
use north::campaign::{Campaign, Columns};
use north::commands::Cli;
use north::failure::Failure;
use north::{interrupt, output};
use numpy::{IntoPyArray, PyArray1};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use pyo3::types::PyDict;

pyo3::create_exception!(
    north_finder,
    NorthFinderError,
    pyo3::exceptions::PyException,
    "What the command `north` refuses, with its sentence."
);

/// How often the interpreter is asked for interrupts while a command works, and how often one that waits looks whether it may begin.
const ASKED: Duration = Duration::from_millis(50);

/// Held by the command that runs: `--force` and the flag of interrupts are those of the process.
static TURN: Mutex<()> = Mutex::new(());

/// Waits until no other command runs; `None` after an interrupt. One that panicked leaves nothing behind that the next one does not set anew.
fn turn(stop: &AtomicBool) -> Option<MutexGuard<'static, ()>> {
    while !stop.load(Ordering::Relaxed) {
        match TURN.try_lock() {
            Ok(turn) => return Some(turn),
            Err(TryLockError::Poisoned(turn)) => return Some(turn.into_inner()),
            Err(TryLockError::WouldBlock) => thread::sleep(ASKED),
        }
    }
    None
}

/// Works in a thread of its own, one work at a time, with the interpreter's lock released. Returns when the thread has ended, after an interrupt, too.
fn work<T: Send + 'static>(python: Python<'_>, work: impl FnOnce() -> T + Send + 'static) -> PyResult<T> {
    // It is never freed, one byte a call: threads that an interrupted command leaves behind go on looking at it.
    let stop: &'static AtomicBool = Box::leak(Box::new(AtomicBool::new(false)));
    let (working, ended) = channel();
    let worker = thread::spawn(move || -> Option<T> {
        // Dropped at the end, that of a panic, too.
        let _working = working;
        let _turn = turn(stop)?;
        interrupt::install(stop);
        Some(work())
    });
    let waited = wait(python, ended);
    if waited.is_err() {
        stop.store(true, Ordering::Relaxed);
    }
    let done = python.detach(move || worker.join());
    waited?;
    match done {
        Ok(Some(done)) => Ok(done),
        Ok(None) => Err(PyKeyboardInterrupt::new_err(())),
        Err(panic) => {
            Err(NorthFinderError::new_err(format!("the command ended without a result: {}", said(panic.as_ref()))))
        }
    }
}

/// Waits until the sender is gone. Errors: what an interrupt raises.
fn wait(python: Python<'_>, ended: Receiver<Infallible>) -> PyResult<()> {
    // A receiver alone is not shared with the calls that wait for it.
    let ended = Mutex::new(ended);
    loop {
        let waited = python
            .detach(|| ended.lock().map_or(Err(RecvTimeoutError::Disconnected), |ended| ended.recv_timeout(ASKED)));
        match waited {
            Err(RecvTimeoutError::Timeout) => python.check_signals()?,
            _ => return Ok(()),
        }
    }
}

/// The text of a panic.
fn said(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&'static str>().copied()).unwrap_or("it does not say why")
}

fn raised(failure: Failure) -> PyErr {
    match failure {
        Failure::Interrupted => PyKeyboardInterrupt::new_err(()),
        failure => NorthFinderError::new_err(failure.to_string()),
    }
}

/// Runs the command with these arguments, without its name; gives its machine-readable result as JSON, empty where it has none. An error has as its
/// `result` what the command wrote before.
#[pyfunction]
fn run(python: Python<'_>, arguments: Vec<String>) -> PyResult<String> {
    let words = std::iter::once("north".to_owned()).chain(arguments);
    let command = Cli::try_parse_from(words).map_err(|error| NorthFinderError::new_err(error.to_string()))?;
    let (json, ended) = work(python, move || output::captured(|| command.run()))?;
    let json = String::from_utf8_lossy(&json).into_owned();
    let Err(failure) = ended else { return Ok(json) };
    let error = raised(failure);
    if !json.is_empty() {
        error.value(python).setattr("result", json)?;
    }
    Err(error)
}

/// The rows of all runs of a campaign, as columns: `run`, its number from 0, and one of numbers for each name; NaN where a row has no value.
#[pyfunction]
fn columns<'py>(python: Python<'py>, path: PathBuf) -> PyResult<Bound<'py, PyDict>> {
    let read = move || -> Result<Columns, Failure> { Columns::read(&Campaign::read(&path)?) };
    let Columns { run, names, numbers } = work(python, read)?.map_err(raised)?;
    let columns = PyDict::new(python);
    columns.set_item("run", run.into_pyarray(python))?;
    for (name, values) in names.into_iter().zip(numbers) {
        let values: Bound<'py, PyArray1<f64>> = values.into_pyarray(python);
        columns.set_item(name, values)?;
    }
    Ok(columns)
}

#[pymodule]
fn _north_finder(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let error = module.py().get_type::<NorthFinderError>();
    // Of an error before which the command wrote nothing.
    error.setattr("result", module.py().None())?;
    module.add("NorthFinderError", error)?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(run, module)?)?;
    module.add_function(wrap_pyfunction!(columns, module)?)
}
