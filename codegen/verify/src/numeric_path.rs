//! Comparison of the base parameters with the numeric method (Gautier, 1991): rank and null space
//! of an observation matrix over random closed states.

use nalgebra::{DMatrix, DVector};
use regen_codegen::base::{Analysis, Base, NullDirection};
use regen_codegen::robot::{ParameterKind, Robot};
use regen_interpreted::Interpreted;
use regen_reference::Random;
use regen_runtime::LoopClosure;

use crate::check::{Check, Report, Statement};
use crate::error::VerifyError;
use crate::independent::rounding;
use crate::numeric::{Numeric, Rank};
use crate::states::{Reach, SEED, closed_state};
use crate::vector::larger;

/// Rows of the observation matrix per column.
const ROWS_PER_COLUMN: usize = 4;
/// Number of random parameter vectors that are projected on the base parameters.
const PROJECTED_VECTORS: usize = 8;
/// The largest accepted angle between the analytic and the numeric null space, rad.
const MAX_ANGLE_RAD: f64 = 1e-6;
/// The largest accepted change of the forces when parameters are replaced by their base parameters,
/// relative to the largest force.
const MAX_PROJECTION_ERROR: f64 = 1e-9;

/// The comparison of the numeric method with the analytic base parameters.
#[derive(Clone, Debug)]
pub struct NumericPath {
    /// The checks of the comparison.
    pub report: Report,
    /// Number of rows of the observation matrix.
    pub rows: usize,
    /// Number of columns of the observation matrix: all dynamic parameters.
    pub columns: usize,
    /// The certified rank over all columns, if there is a certificate.
    pub certificate: Option<usize>,
    /// The rank according to the derived null directions, over the columns that `base` of the spec
    /// does not remove.
    pub analytic: usize,
    /// The rank by singular values over all columns.
    pub svd: Rank,
    /// The rank by QR with pivoting over all columns.
    pub qr: Rank,
    /// The ranks without the columns that `base` of the spec removes; `None` if it removes none.
    pub reduced: Option<Reduced>,
    /// The largest angle between the analytic and the numeric null space, rad.
    pub angle: f64,
    /// The rank from which the numeric null space was determined.
    pub angle_rank: Rank,
}

/// Ranks over the columns that `base` of the spec does not remove.
#[derive(Clone, Copy, Debug)]
pub struct Reduced {
    /// Number of these columns.
    pub columns: usize,
    /// The rank by singular values.
    pub svd: Rank,
    /// The rank by QR with pivoting.
    pub qr: Rank,
}

impl NumericPath {
    /// Whether one of the ranks is doubtful in double precision.
    pub fn is_doubtful(&self) -> bool {
        let reduced = self.reduced.iter().flat_map(|r| [r.svd, r.qr]);
        let mut all = [self.svd, self.qr].into_iter().chain(reduced);
        all.any(|rank| !rank.certain)
    }
}

/// The analysis of a robot's base parameters; an error if the robot has none.
pub(crate) fn analysis(robot: &Robot) -> Result<&Analysis, VerifyError> {
    robot.analysis.as_ref().ok_or_else(|| VerifyError::NoBase {
        robot: robot.name.clone(),
        parameters: robot.parameters.len(),
    })
}

/// The number of states: the one that is asked for, if it gives at least as many rows as columns, or
/// by default one that gives [`ROWS_PER_COLUMN`] in each run.
fn state_count(robot: &Robot, wanted: Option<usize>) -> Result<usize, VerifyError> {
    let (columns, dof) = (robot.parameters.len(), robot.independent.len().max(1));
    let least = columns.div_ceil(dof).max(1);
    match wanted {
        Some(states) if states < least => Err(VerifyError::TooFewStates {
            robot: robot.name.clone(),
            states,
            rows: states * dof,
            columns,
            least,
        }),
        Some(states) => Ok(states),
        None => {
            let runs = 1 + robot.payloads.len();
            Ok(runs * (ROWS_PER_COLUMN * columns).div_ceil(dof).max(1))
        }
    }
}

/// The observation matrix over random closed states. With payloads, the states alternate between a
/// run without payload and a run with each payload; columns of absent payloads are zero.
fn observe(robot: &Robot, states: usize, random: &mut Random) -> Result<DMatrix<f64>, VerifyError> {
    let model = Interpreted::new(robot);
    let mut closure = LoopClosure::new(&model)?;
    let (dof, columns) = (model.info().dof(), robot.parameters.len());
    let mut w = DMatrix::zeros(dof * states, columns);
    for k in 0..states {
        let state = closed_state(&model, &mut closure, random, Reach::RANKS)?;
        let entries: Vec<f64> = rounding::certain(robot, &state);
        if entries.iter().any(|x| !x.is_finite()) {
            return Err(VerifyError::NotFinite {
                robot: robot.name.clone(),
            });
        }
        let mut rows = w.rows_mut(k * dof, dof);
        rows.copy_from(&DMatrix::from_column_slice(dof, columns, &entries));
        let run = k % (1 + robot.payloads.len());
        for (column, parameter) in robot.parameters.iter().enumerate() {
            if let ParameterKind::Inertial { body, .. } = parameter.kind
                && let Some(payload) = robot.payloads.iter().position(|p| *p == body)
                && payload + 1 != run
            {
                rows.column_mut(column).fill(0.0);
            }
        }
    }
    Ok(w)
}

/// Checks a robot's base parameters against the numeric method, over the given number of random
/// closed states, or by default as many as give four rows per column without payload and with each
/// payload.
///
/// # Errors
/// If the robot has no base parameters, the states are too few, no closed state is found, or the
/// singular values do not converge.
pub fn numeric_path(robot: &Robot, states: Option<usize>) -> Result<NumericPath, VerifyError> {
    let analysis = analysis(robot)?;
    let states = state_count(robot, states)?;
    let base = &analysis.base;
    let mut random = Random::new(SEED);
    let w = observe(robot, states, &mut random)?;
    let undecided = || VerifyError::NoSingularValues {
        robot: robot.name.clone(),
    };
    let whole = Numeric::new(&w).ok_or_else(undecided)?;
    let kept = KeptColumns::new(base, robot.parameters.len());
    let left = kept.columns_of(&w, base);
    let (numeric, reduced) = if base.known.is_empty() {
        (whole.clone(), None)
    } else {
        let numeric = Numeric::new(&left).ok_or_else(undecided)?;
        let reduced = Reduced {
            columns: left.ncols(),
            svd: numeric.svd,
            qr: numeric.qr,
        };
        (numeric, Some(reduced))
    };
    let angle = numeric.angle(&kept.null_directions(base));
    let error = kept.projection(base, &left, &mut random);
    Ok(NumericPath {
        report: Report {
            robot: robot.name.clone(),
            states,
            checks: checks(analysis, &whole, &numeric, angle, error),
        },
        rows: w.nrows(),
        columns: w.ncols(),
        certificate: analysis.certificate.as_ref().ok().map(|c| c.rank),
        analytic: base.parameters.len(),
        svd: whole.svd,
        qr: whole.qr,
        reduced,
        angle,
        angle_rank: numeric.svd,
    })
}

/// The checks of the comparison. A doubtful rank is not evidence against the certificate or the
/// analytic rank, and is not compared with them.
fn checks(
    analysis: &Analysis,
    whole: &Numeric,
    numeric: &Numeric,
    angle: f64,
    projection: f64,
) -> Vec<Check> {
    let mut checks = vec![Check::truth(
        Statement::identity("base parameters are certified complete"),
        analysis.complete,
    )];
    let mut ranks = |statements: [&'static str; 2], found: &Numeric, rank: usize| {
        for (statement, found) in statements.into_iter().zip([found.svd, found.qr]) {
            if found.certain {
                let apart = found.count.abs_diff(rank) as f64;
                checks.push(Check::of(Statement::identity(statement), apart, 0.0));
            }
        }
    };
    if let Ok(certificate) = &analysis.certificate {
        let statements = ["SVD rank = certified rank", "QR rank = certified rank"];
        ranks(statements, whole, certificate.rank);
    }
    let statements = ["SVD rank = analytic rank", "QR rank = analytic rank"];
    ranks(statements, numeric, analysis.base.parameters.len());
    if numeric.svd.certain {
        let what = Statement::identity("angle between the null spaces, rad");
        checks.push(Check::of(what, angle, MAX_ANGLE_RAD));
    }
    let what = Statement::identity("projection by the combinations");
    checks.push(Check::of(what, projection, MAX_PROJECTION_ERROR));
    checks
}

/// The columns that `base` of the spec does not remove, in order.
struct KeptColumns {
    columns: Vec<usize>,
    /// For each column of the model, its index in `columns`; `None` if `base` removes it.
    place: Vec<Option<usize>>,
}

impl KeptColumns {
    fn new(base: &Base, all: usize) -> Self {
        let known = |c: &usize| base.known.iter().any(|k| k.column == *c);
        let columns: Vec<usize> = (0..all).filter(|c| !known(c)).collect();
        let mut place = vec![None; all];
        for (k, &column) in columns.iter().enumerate() {
            place[column] = Some(k);
        }
        Self { columns, place }
    }

    fn place(&self, column: usize) -> Option<usize> {
        self.place.get(column).copied().flatten()
    }

    /// The observation matrix over these columns. Each removed column is added, times its factors,
    /// to the columns of the parameters that express the removed one.
    fn columns_of(&self, w: &DMatrix<f64>, base: &Base) -> DMatrix<f64> {
        let mut reduced = w.select_columns(&self.columns);
        for known in &base.known {
            for term in &known.terms {
                if let Some(k) = self.place(term.column) {
                    let column = w.column(known.column) * term.value.to_f64();
                    reduced.column_mut(k).axpy(1.0, &column, 1.0);
                }
            }
        }
        reduced
    }

    /// The analytic null directions, with one entry for each of these columns.
    fn null_directions(&self, base: &Base) -> Vec<DVector<f64>> {
        let direction = |row: &NullDirection| {
            let mut direction = DVector::zeros(self.columns.len());
            for term in &row.terms {
                if let Some(k) = self.place(term.column) {
                    direction[k] = term.value.to_f64();
                }
            }
            direction
        };
        base.null.iter().map(direction).collect()
    }

    /// The largest change of the forces when parameters are replaced by their base parameters,
    /// relative to the largest force.
    fn projection(&self, base: &Base, w: &DMatrix<f64>, random: &mut Random) -> f64 {
        let mut worst: f64 = 0.0;
        for _ in 0..PROJECTED_VECTORS {
            let phi = DVector::from_fn(self.columns.len(), |_, _| random.signed());
            let mut projected = DVector::zeros(self.columns.len());
            for parameter in &base.parameters {
                let terms = parameter.terms.iter();
                let value: f64 = terms
                    .filter_map(|t| Some(t.value.to_f64() * phi.get(self.place(t.column)?)?))
                    .sum();
                if let Some(k) = self.place(parameter.column) {
                    projected[k] = value;
                }
            }
            let forces = w * &phi;
            let missed = (w * projected - &forces).amax();
            let scale = forces.amax();
            worst = larger(worst, if scale > 0.0 { missed / scale } else { missed });
        }
        worst
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use regen_codegen::sym::Number;

    #[test]
    fn a_wrong_factor_in_a_combination_changes_the_projected_forces() {
        let source = regen_codegen::diag::Source::new("arm.yaml", crate::testing::ARM);
        let mut robot = regen_codegen::pipeline::derive(&source).unwrap();
        let failing = |robot: &Robot| -> Vec<&'static str> {
            let report = numeric_path(robot, None).unwrap().report;
            let failing = report.checks.iter().filter(|check| check.fails());
            failing.map(|check| check.what.statement).collect()
        };
        assert_eq!(failing(&robot), [""; 0]);
        let base = &mut robot.analysis.as_mut().unwrap().base;
        let combined = base.parameters.iter_mut().find(|p| p.terms.len() > 1);
        let term = &mut combined.unwrap().terms[1];
        // a relative error of one millionth
        let factor = Number::ratio(1_000_001, 1_000_000).unwrap();
        term.value = term.value.mul(&factor);
        assert_eq!(failing(&robot), ["projection by the combinations"]);
    }
}
