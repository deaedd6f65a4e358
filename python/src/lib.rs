//! The commands of `north` for Python: arguments in, the machine-readable result out. It is the command itself that runs, so results have the same
//! names, digits and errors.

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::mpsc::{RecvTimeoutError, channel};
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
    _north_finder,
    NorthFinderError,
    pyo3::exceptions::PyException,
    "What the command `north` refuses, with its sentence."
);

/// How often the interpreter is asked for interrupts while a command works.
const ASKED: Duration = Duration::from_millis(50);

/// Works in a thread of its own, with the interpreter's lock released; an interrupt ends it.
fn work<T: Send>(python: Python<'_>, work: impl FnOnce() -> Result<T, Failure> + Send) -> PyResult<T> {
    interrupt::request(false);
    thread::scope(|scope| {
        let (done, ended) = channel();
        scope.spawn(move || {
            // Nobody listens any more where an interrupt came first.
            let _ = done.send(work());
        });
        // A receiver alone is not shared with the calls that wait for it.
        let ended = Mutex::new(ended);
        loop {
            let waited = python
                .detach(|| ended.lock().map_or(Err(RecvTimeoutError::Disconnected), |ended| ended.recv_timeout(ASKED)));
            match waited {
                Ok(Err(Failure::Interrupted)) => return Err(PyKeyboardInterrupt::new_err(())),
                Ok(result) => return result.map_err(|failure| NorthFinderError::new_err(failure.to_string())),
                Err(RecvTimeoutError::Timeout) => {
                    if let Err(interrupted) = python.check_signals() {
                        interrupt::request(true);
                        return Err(interrupted);
                    }
                }
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(NorthFinderError::new_err("the command ended without a result"));
                }
            }
        }
    })
}

/// Runs the command with these arguments, without its name; gives its machine-readable result as JSON, empty where it has none.
#[pyfunction]
fn run(python: Python<'_>, arguments: Vec<String>) -> PyResult<String> {
    let words = std::iter::once("north".to_owned()).chain(arguments);
    let command = Cli::try_parse_from(words).map_err(|error| NorthFinderError::new_err(error.to_string()))?;
    work(python, || {
        let (json, ended) = output::captured(|| command.run());
        ended.map(|()| String::from_utf8_lossy(&json).into_owned())
    })
}

/// The rows of all runs of a campaign, as columns: `run`, its number from 0, and one of numbers for each name; NaN where a row has no value.
#[pyfunction]
fn columns<'py>(python: Python<'py>, path: PathBuf) -> PyResult<Bound<'py, PyDict>> {
    let Columns { run, names, numbers } = work(python, || Columns::read(&Campaign::read(&path)?))?;
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
    module.add("NorthFinderError", module.py().get_type::<NorthFinderError>())?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(run, module)?)?;
    module.add_function(wrap_pyfunction!(columns, module)?)
}
