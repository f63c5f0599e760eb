//! Comparison with published test vectors: regressors and closure Jacobians at given states, which
//! another program computed.

use nalgebra::DMatrix;
use regen_codegen::signature::FunctionKind;
use serde_json::Value;

use super::compare::{Figures, row_error};
use super::{Answer, Engine};
use crate::files;

/// The largest relative error of a row that is accepted; the vectors are accurate to rounding.
const VECTOR_TOLERANCE: f64 = 1e-11;

/// The names of the robots that have vectors.
pub const ORACLES: [&str; 4] = ["3rps", "fivebar", "puma560", "tree_branch"];

/// Compares an engine with the vectors of one of [`ORACLES`]. The given accelerations satisfy the
/// closure equations only to 1e-8; they are not corrected, since the regressor takes any.
///
/// # Errors
/// When a file is missing, a name differs or a comparison fails.
pub fn check_oracle(engine: &dyn Engine, name: &str) -> Result<Figures, String> {
    let path = files::oracle().join(format!("{name}.json"));
    let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    let oracle: Value = serde_json::from_str(&text).map_err(|e| format!("{name}: {e}"))?;
    let names = engine.names();
    for (key, ours) in [
        ("coordinates", &names.coordinates),
        ("independent", &names.independent),
        ("parameters", &names.parameters),
    ] {
        if *ours != texts(&oracle[key])? {
            return Err(format!(
                "{name}: the engine has other {key} than the vectors"
            ));
        }
    }
    let mut figures = Figures::default();
    let states = oracle["states"].as_array().ok_or("no states")?;
    if states.is_empty() {
        return Err(format!("{name}: no states"));
    }
    for state in states {
        let (q, qd, qdd) = (
            numbers(&state["q"])?,
            numbers(&state["qd"])?,
            numbers(&state["qdd"])?,
        );
        let error = row_error(
            &engine.matrix(FunctionKind::Regressor, &[&q, &qd, &qdd])?,
            &matrix(&state["regressor"])?,
        );
        figures.record("regressor", error, VECTOR_TOLERANCE);
        if names.cuts.is_empty() {
            continue;
        }
        let error = row_error(
            &engine.matrix(FunctionKind::Jacobian, &[&q])?,
            &matrix(&state["jacobian"])?,
        );
        figures.record("jacobian", error, VECTOR_TOLERANCE);
    }
    figures.verdict(name)
}

fn list(value: &Value) -> Answer<&Vec<Value>> {
    value.as_array().ok_or_else(|| "expected a list".into())
}

fn numbers(value: &Value) -> Answer<Vec<f64>> {
    let number = |v: &Value| v.as_f64().ok_or_else(|| format!("{v} is not a number"));
    list(value)?.iter().map(number).collect()
}

fn texts(value: &Value) -> Answer<Vec<String>> {
    let text = |v: &Value| v.as_str().map(String::from).ok_or_else(|| format!("{v}"));
    list(value)?.iter().map(text).collect()
}

fn matrix(value: &Value) -> Answer<DMatrix<f64>> {
    let rows: Vec<Vec<f64>> = list(value)?.iter().map(numbers).collect::<Result<_, _>>()?;
    let width = rows.first().map_or(0, Vec::len);
    if rows.iter().any(|r| r.len() != width) {
        return Err("rows of different lengths".into());
    }
    Ok(DMatrix::from_fn(rows.len(), width, |i, j| rows[i][j]))
}
