//! `regen eval`: closure and regressors at given states.

use std::fmt::Write as _;
use std::io::{self, Read};
use std::path::Path;

use regen_codegen::diag::Source;
use regen_codegen::robot::Robot;
use regen_runtime::{BaseModel, LoopClosure, Model, Status};
use serde::Serialize;

use crate::args::{EvalArgs, Format};
use crate::closed::close;
use crate::exit::Failure;
use crate::{load, mistakes, table, terminal};
use regen_identify::files::{MotionState, State, states};
use regen_interpreted::Interpreted;

/// The JSON of one state.
#[derive(Serialize)]
struct Evaluated {
    q: Vec<f64>,
    qd: Vec<f64>,
    qdd: Vec<f64>,
    residual: Vec<f64>,
    jacobian: Vec<Vec<f64>>,
    bias: Vec<f64>,
    regressor: Vec<Vec<f64>>,
    base_regressor: Vec<Vec<f64>>,
}

/// The hint for valid JSON that is not a list of states.
const NO_LIST: &str =
    r#"such as [{"q": [...], "qd": [...], "qdd": [...]}]; see `regen eval --help`"#;

/// Runs the command.
pub(crate) fn run(args: &EvalArgs) -> Result<(), Failure> {
    let robot = load::robot(&args.file)?;
    let source = read(&args.states)?;
    let model = Interpreted::new(&robot);
    let states = states(&source.text, &model.info())
        .map_err(|why| mistakes::failure(source, why, NO_LIST))?;
    let mut closure = LoopClosure::new(&model)?;
    let mut results = Vec::with_capacity(states.len());
    for (k, state) in states.into_iter().enumerate() {
        let motion = match state {
            State::Full(motion) => motion,
            State::Independent(motion) => close(&mut closure, &motion)?
                .map_err(|why| Failure::Numeric(format!("state {}: {why}", k + 1)))?,
        };
        results.push(evaluate(&model, motion, k + 1)?);
    }
    terminal::print(&match args.format {
        Format::Human => to_text(&robot, &results),
        Format::Json => table::json(&results),
    })
}

fn read(path: &Path) -> Result<Source, Failure> {
    let (name, text) = if path == Path::new("-") {
        let mut text = String::new();
        io::stdin()
            .read_to_string(&mut text)
            .map_err(|error| Failure::Io(format!("cannot read standard input: {error}")))?;
        ("<stdin>".to_owned(), text)
    } else {
        (path.display().to_string(), load::text(path)?)
    };
    Ok(Source { name, text })
}

fn evaluate(
    model: &Interpreted<'_>,
    motion: MotionState,
    number: usize,
) -> Result<Evaluated, Failure> {
    let MotionState { q, qd, qdd } = motion;
    let info = model.info();
    let (n, dof) = (q.len(), info.dof());
    let mut residual = vec![0.0; info.rows];
    model.constraints(&q, &mut residual)?;
    let mut jacobian = vec![0.0; info.rows * n];
    model.jacobian(&q, &mut jacobian)?;
    let mut bias = vec![0.0; info.rows];
    model.bias(&q, &qd, &mut bias)?;
    let mut full = vec![0.0; dof * info.parameters.len()];
    let condition = model.regressor(&q, &qd, &qdd, &mut full)?;
    let mut base = vec![0.0; dof * model.rank()];
    let _condition = model.base_regressor(&q, &qd, &qdd, &mut base)?;

    let results = [&residual, &jacobian, &bias, &full, &base];
    let finite = results.iter().all(|r| r.iter().all(|x| x.is_finite()));
    match condition.status() {
        Status::Regular if finite => {}
        Status::NearSingular if finite => terminal::note(&format!(
            "warning: state {number} is near a singularity (pivot {:.1e}): digits are lost",
            condition.pivot
        )),
        Status::Singular => {
            return Err(Failure::Numeric(format!(
                "state {number} is singular (pivot {:.1e}): the independent coordinates do not \
                 determine the others there",
                condition.pivot
            )));
        }
        _ => {
            return Err(Failure::Numeric(format!(
                "state {number}: the results are not finite numbers"
            )));
        }
    }
    let rows = |column_major: &[f64]| -> Vec<Vec<f64>> {
        let row = |r: usize| column_major.iter().skip(r).step_by(dof.max(1)).copied();
        (0..dof).map(|r| row(r).collect()).collect()
    };
    Ok(Evaluated {
        residual,
        jacobian: jacobian
            .chunks_exact(n.max(1))
            .map(<[f64]>::to_vec)
            .collect(),
        bias,
        regressor: rows(&full),
        base_regressor: rows(&base),
        q,
        qd,
        qdd,
    })
}

fn to_text(robot: &Robot, results: &[Evaluated]) -> String {
    let mut out = String::new();
    for (k, state) in results.iter().enumerate() {
        let _ = writeln!(
            out,
            "{}{}, state {}",
            if k > 0 { "\n" } else { "" },
            robot.name,
            k + 1
        );
        let motion: Vec<Vec<String>> = robot
            .coordinates
            .iter()
            .zip(state.q.iter().zip(&state.qd).zip(&state.qdd))
            .map(|(name, ((q, qd), qdd))| {
                let figures = [q, qd, qdd].map(|&x| table::figure(x));
                std::iter::once(name.clone()).chain(figures).collect()
            })
            .collect();
        out.push_str(&table::columns(&["coordinate", "q", "qd", "qdd"], &motion));
        if !state.residual.is_empty() {
            let largest = state.residual.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
            let _ = writeln!(out, "\n  largest residual of the closure: {largest:.1e}");
        }
        out.push_str("\n  regressor, one column per independent coordinate\n");
        out.push_str(&regressor(robot, state));
    }
    out
}

/// The transposed regressor, in blocks of columns that fit the width.
fn regressor(robot: &Robot, state: &Evaluated) -> String {
    /// Columns per block: the label, then columns of 11 characters, 2 characters apart.
    const BLOCK: usize = 5;
    let names: Vec<&str> = robot
        .independent
        .iter()
        .filter_map(|&k| robot.coordinates.get(k).map(String::as_str))
        .collect();
    let mut out = String::new();
    for (names, rows) in names.chunks(BLOCK).zip(state.regressor.chunks(BLOCK)) {
        let head: Vec<&str> = std::iter::once("parameter")
            .chain(names.iter().copied())
            .collect();
        let lines: Vec<Vec<String>> = robot
            .parameters
            .iter()
            .enumerate()
            .map(|(p, parameter)| {
                let entries = rows.iter().filter_map(|row| row.get(p));
                std::iter::once(parameter.label.clone())
                    .chain(entries.map(|&x| table::figure(x)))
                    .collect()
            })
            .collect();
        out.push_str(&table::columns(&head, &lines));
    }
    out
}
