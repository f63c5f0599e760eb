//! The Python class of a derived robot.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use regen_batch::TrajectoryClosure;
use regen_cli::call;
use regen_codegen::diag::Source;
use regen_interpreted::{BaseTerms, Interpreted};
use regen_runtime::function::{Shape, Signature, Size};
use regen_runtime::{BaseFunction, ControlFunction, Function, Outcome};
use serde_json::json;

use crate::evaluate::{Batch, Which};
use crate::supervise::{raised, supervised};

/// A derived robot, whose functions can be evaluated. Each description is derived once in a process:
/// objects of the same description share the result, which is never freed.
#[pyclass(frozen, module = "regen._native")]
pub(crate) struct Derived {
    model: &'static Interpreted<'static>,
}

/// Derived robots by their description and payload.
static DERIVED: Mutex<BTreeMap<(String, Option<bool>), &'static Interpreted<'static>>> =
    Mutex::new(BTreeMap::new());

/// Arrays of states, one row each.
type States<'py> = PyReadonlyArray2<'py, f64>;
/// One row per state, the entries of the rows one after the other.
type Values<'py> = Bound<'py, PyArray1<f64>>;

#[pymethods]
impl Derived {
    /// Derives a robot from the text of its description; `name` is that of the file in messages.
    #[new]
    #[pyo3(signature = (text, name, payload=None, progress=None))]
    fn new(
        py: Python<'_>,
        text: String,
        name: String,
        payload: Option<bool>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let key = (text.clone(), payload);
        let found = DERIVED
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .get(&key)
            .copied();
        if let Some(model) = found {
            return Ok(Self { model });
        }
        let source = Source::new(&name, &text);
        let (result, notes) = supervised(py, progress, move |handle| {
            call::derive(&source, payload, handle)
        })?;
        let robot = result.map_err(|error| raised(error, notes))?;
        let robot = Box::leak(Box::new(robot));
        let terms = Box::leak(Box::new(BaseTerms::new(robot)));
        let model = Box::leak(Box::new(Interpreted::with_terms(robot, terms)));
        let mut derived = DERIVED.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(Self {
            model: *derived.entry(key).or_insert(model),
        })
    }

    /// The robot's names, sizes and nominal values, and its functions with their arguments and
    /// shapes, as JSON.
    fn info(&self) -> String {
        let info = self.model.info();
        let sizes = self.sizes();
        let parameters = info
            .parameters
            .iter()
            .map(|p| json!({"label": p.to_string(), "unit": p.unit(info.motion_of(p.owner))}));
        let functions = Function::ALL
            .iter()
            .map(|f| f.signature())
            .chain(BaseFunction::ALL.iter().map(|f| f.signature()))
            .chain(ControlFunction::ALL.iter().map(|f| f.signature()));
        let functions = functions.map(|s| {
            let arguments = s.arguments.iter().map(|a| {
                json!({
                    "name": a.name(),
                    "length": sizes.length(a.size()),
                    "parameter": a.is_parameter(),
                })
            });
            json!({
                "name": s.name,
                "arguments": arguments.collect::<Vec<_>>(),
                "shape": shape(s, &|size| sizes.length(size)),
                "condition": s.has_condition,
            })
        });
        let base = self.model.base_info();
        let cuts = info
            .cuts
            .iter()
            .map(|cut| json!({"name": cut.name, "rows": cut.rows}));
        json!({
            "robot": info.name,
            "coordinates": info.coordinates,
            "independent": info.independent,
            "dependent": info.dependent,
            "actuated": info.actuated,
            "parameters": parameters.collect::<Vec<_>>(),
            "nominal": info.nominal,
            "bodies": info.bodies,
            "frames": info.frames,
            "cuts": cuts.collect::<Vec<_>>(),
            "home": info.home,
            "gravity": info.gravity,
            "base": base.base.iter().map(|b| b.label).collect::<Vec<_>>(),
            "free": base.free,
            "complete": base.complete,
            "digest": regen_identify::identify::digest(self.model),
            "functions": functions.collect::<Vec<_>>(),
        })
        .to_string()
    }

    /// Computes a function at many states, without holding the interpreter's lock.
    ///
    /// - `states`: the arguments that differ from state to state, each with one row per state, in the
    ///   order of the function's arguments; `parameters`: the other arguments, in the same order.
    ///
    /// Returns the values, state by state, each matrix by rows; and for each state the pivot that
    /// tells how near it is to a singularity.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        function: &str,
        states: Vec<States<'py>>,
        parameters: Vec<PyReadonlyArray1<'py, f64>>,
    ) -> PyResult<(Values<'py>, Values<'py>)> {
        let which = Which::named(function)
            .ok_or_else(|| PyValueError::new_err(format!("there is no function `{function}`")))?;
        let sizes = self.sizes();
        let count = states.first().map_or(1, |s| s.shape()[0]);
        // memory of numpy rather than a `Vec`: numpy asks the system for large pages
        let length = sizes.output(which.signature());
        let values = PyArray1::zeros(py, length * count, false);
        let pivots = PyArray1::zeros(py, count, false);
        let (mut own_values, mut own_pivots) = (values.readwrite(), pivots.readwrite());
        let mut batch = Batch::new(
            self.model,
            which,
            sizes,
            own_values.as_slice_mut()?,
            own_pivots.as_slice_mut()?,
        );
        let mut given = states.iter();
        let mut constants = parameters.iter();
        for argument in which.signature().arguments {
            let slice = if argument.is_parameter() {
                constants.next().map(|p| p.as_slice())
            } else {
                given.next().map(|s| s.as_slice())
            };
            let slice = slice
                .ok_or_else(|| PyValueError::new_err(format!("`{}` is missing", argument.name())))?
                .map_err(|_| PyValueError::new_err("arrays must be contiguous, row by row"))?;
            batch
                .give(*argument, slice)
                .map_err(PyValueError::new_err)?;
        }
        let mut next = 0;
        while next < batch.count() {
            let from = next;
            next = py
                .detach(|| batch.go_on(from))
                .map_err(|error| PyValueError::new_err(error.to_string()))?;
            py.check_signals()?;
        }
        drop((own_values, own_pivots));
        Ok((values, pivots))
    }

    /// Closes the loops along a trajectory of the independent coordinates, which must begin near
    /// home. Returns all coordinates, velocities and accelerations, one row per state, NaN at states
    /// that are not closed; and for each state the reason why it is not closed, empty if it is.
    fn close<'py>(
        &self,
        py: Python<'py>,
        q: States<'py>,
        qd: States<'py>,
        qdd: States<'py>,
    ) -> PyResult<(Values<'py>, Values<'py>, Values<'py>, Vec<String>)> {
        let count = q.shape()[0];
        let dof = self.model.info().independent.len();
        let mut series = Vec::with_capacity(3);
        for (name, array) in [("q", &q), ("qd", &qd), ("qdd", &qdd)] {
            if *array.shape() != [count, dof] {
                let text = format!("`{name}` must have the shape ({count}, {dof})");
                return Err(PyValueError::new_err(text));
            }
            let slice = array
                .as_slice()
                .map_err(|_| PyValueError::new_err("arrays must be contiguous, row by row"))?;
            series.push(transposed(slice, count, dof));
        }
        let model = self.model;
        let ((found, reasons), _) = supervised(py, None, move |_| {
            let [q, qd, qdd] = &series[..] else {
                return (None, Vec::new());
            };
            let tracked = TrajectoryClosure::new(model)
                .and_then(|mut closure| closure.track(count, q, qd, qdd));
            match tracked {
                Ok(states) => {
                    let reasons = states.outcomes.iter().map(|o| reason(*o)).collect();
                    let n = model.info().coordinates.len();
                    let by_state = [&states.q, &states.qd, &states.qdd]
                        .map(|series| transposed(series, n, count));
                    (Some(by_state), reasons)
                }
                Err(error) => (None, vec![error.to_string()]),
            }
        })?;
        let Some([q, qd, qdd]) = found else {
            return Err(PyValueError::new_err(reasons.concat()));
        };
        Ok((
            PyArray1::from_vec(py, q),
            PyArray1::from_vec(py, qd),
            PyArray1::from_vec(py, qdd),
            reasons,
        ))
    }
}

impl Derived {
    fn sizes(&self) -> regen_runtime::function::Sizes {
        regen_runtime::function::Sizes::of(&self.model.info()).with_base(&self.model.base_info())
    }
}

/// The shape of one state's output.
fn shape(signature: &Signature, length: &dyn Fn(Size) -> usize) -> Vec<usize> {
    match signature.shape {
        Shape::Vector(size) => vec![length(size)],
        Shape::Matrix { rows, columns, .. } => vec![length(rows), length(columns)],
    }
}

/// Reorders a matrix from storage by rows to storage by columns.
fn transposed(matrix: &[f64], rows: usize, columns: usize) -> Vec<f64> {
    let mut out = Vec::with_capacity(matrix.len());
    for column in 0..columns {
        out.extend((0..rows).map(|row| matrix[row * columns + column]));
    }
    out
}

/// The reason why a state is not closed; empty if it is.
fn reason(outcome: Outcome) -> String {
    match outcome {
        Outcome::Closed => String::new(),
        other => regen_cli::call::reason(other),
    }
}
