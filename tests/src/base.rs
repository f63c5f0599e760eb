//! Numerical checks of base parameters: the regressor of the second derivation, compared with the
//! combinations that the engine derived.

use nalgebra::DMatrix;
use regen_codegen::base::{Analysis, Base, Provenance, Term, analyse, derive};
use regen_codegen::constraints::{NumericLoops, close_home, world_equations};
use regen_codegen::diag::Source;
use regen_codegen::kinematics::{Frames, Geometry};
use regen_codegen::spec::{self, Spec};
use regen_codegen::sym::Graph;
use regen_codegen::{model, pipeline};

use crate::reference::{Mechanism, State, evaluate};

/// Singular values below this fraction of the largest count as rounding.
const RANK_TOLERANCE: f64 = 1e-9;

/// A spec with its derived base parameters.
#[derive(Debug)]
pub struct Derivation {
    /// The spec.
    pub spec: Spec,
    /// Its base parameters.
    pub base: Base,
    /// The number of parameters, that is, of the regressor's columns.
    columns: usize,
}

/// How well the combinations reproduce the regressor, and how independent the base columns are.
#[derive(Clone, Copy, Debug)]
pub struct Agreement {
    /// Largest error of a row of W(all) - W(base) combinations, relative to the row's largest entry.
    pub error: f64,
    /// Smallest over largest singular value of the base columns, each scaled to length 1.
    pub independence: f64,
    /// The rank of all columns, from their singular values.
    pub rank: usize,
    /// The ratio of the singular values on both sides of that rank.
    pub gap: f64,
}

impl Derivation {
    /// Derives the base parameters of a spec's text from its tree alone.
    ///
    /// # Errors
    /// The report of the spec's mistakes.
    pub fn new(text: &str) -> Result<Derivation, String> {
        let spec = spec::parse(&Source::new("test.yaml", text)).map_err(|e| e.to_string())?;
        let model = regen_codegen::model::build(&spec);
        Ok(Derivation {
            base: derive(&spec, &model, None),
            columns: model.parameters.len(),
            spec,
        })
    }

    /// Derives the base parameters of a spec's text, with the null directions that loops add to
    /// those of the tree.
    ///
    /// # Errors
    /// The report of the spec's mistakes.
    pub fn completed(text: &str) -> Result<Derivation, String> {
        let robot = pipeline::derive(&Source::new("test.yaml", text)).map_err(|e| e.to_string())?;
        Ok(Derivation {
            base: robot.analysis.ok_or("no analysis")?.base,
            ..Derivation::new(text)?
        })
    }

    /// The value of a coefficient at the geometry of its own spec.
    ///
    /// # Errors
    /// Never; it returns a `Result` to fit [`Derivation::agreement`].
    pub fn value(term: &Term) -> Result<f64, String> {
        Ok(term.value.to_f64())
    }

    /// The value of a coefficient's text at the geometry of another spec, by the second
    /// derivation's reader of expressions.
    ///
    /// # Errors
    /// When the text is not an expression in the names of the other spec.
    pub fn value_at(term: &Term, other: &Spec) -> Result<f64, String> {
        evaluate(&term.coefficient.to_string(), &|name| {
            let found = other.geometry.iter().find(|(n, _)| n.value == name);
            found.map(|(_, quantity)| quantity.value.to_f64())
        })
    }

    /// The columns of the base parameters, including those that `base.drop` leaves out.
    pub fn kept(&self) -> Vec<usize> {
        self.base.parameters.iter().map(|p| p.column).collect()
    }

    /// The matrix that maps all parameters to the base parameters, one combination in each row.
    fn combinations(
        &self,
        value: &dyn Fn(&Term) -> Result<f64, String>,
    ) -> Result<DMatrix<f64>, String> {
        let mut c = DMatrix::zeros(self.base.parameters.len(), self.columns);
        for (i, parameter) in self.base.parameters.iter().enumerate() {
            for term in &parameter.terms {
                c[(i, term.column)] += value(term)?;
            }
        }
        Ok(c)
    }

    /// The regressor after substituting the equations of `base.zero` and `base.equal`: the column of
    /// each known parameter is added, times its factor, to the columns of the parameters that
    /// express it, and set to zero.
    fn known(
        &self,
        w: &DMatrix<f64>,
        value: &dyn Fn(&Term) -> Result<f64, String>,
    ) -> Result<DMatrix<f64>, String> {
        let mut out = w.clone();
        for known in &self.base.known {
            for term in &known.terms {
                let factor = value(term)?;
                let column = w.column(known.column) * factor;
                let mut target = out.column_mut(term.column);
                target += column;
            }
            out.column_mut(known.column).fill(0.0);
        }
        Ok(out)
    }

    /// Compares combinations and regressor at states of a mechanism.
    ///
    /// # Errors
    /// At a singular state, or when a coefficient has no value.
    pub fn agreement(
        &self,
        mechanism: &Mechanism,
        states: &[State],
        value: &dyn Fn(&Term) -> Result<f64, String>,
    ) -> Result<Agreement, String> {
        let combinations = self.combinations(value)?;
        let kept = self.kept();
        let mut all = DMatrix::zeros(0, self.columns);
        let mut error = 0.0_f64;
        let groups = model::build(&self.spec).column_groups();
        for (k, state) in states.iter().enumerate() {
            let mut w = mechanism.regressor(&state.q, &state.qd, &state.qdd)?;
            // states alternate between no payload and each payload in turn; columns of absent
            // payloads are zero
            for (payload, columns) in groups.iter().enumerate().skip(1) {
                for column in columns.iter().filter(|_| k % groups.len() != payload) {
                    w.column_mut(*column).fill(0.0);
                }
            }
            let w = self.known(&w, value)?;
            let again = w.select_columns(&kept) * &combinations;
            for (row, other) in w.row_iter().zip(again.row_iter()) {
                let size = row.amax();
                let off = (row - other).amax();
                // a row that consists of rounding errors has no meaningful relative error
                if size > 1e-12 || off > 1e-12 {
                    error = error.max(off / size);
                }
            }
            let at = all.nrows();
            all = all.insert_rows(at, w.nrows(), 0.0);
            all.rows_mut(at, w.nrows()).copy_from(&w);
        }
        let singular = |m: DMatrix<f64>| -> Vec<f64> {
            let mut values: Vec<f64> = m.singular_values().iter().copied().collect();
            values.sort_by(|a, b| b.total_cmp(a));
            values
        };
        let of_kept = singular(scaled(all.select_columns(&kept)));
        let independence = match (of_kept.first(), of_kept.last()) {
            (Some(first), Some(last)) if of_kept.len() == kept.len() => last / first,
            _ => f64::from(u8::from(kept.is_empty())),
        };
        let values = singular(scaled(all));
        let bound = RANK_TOLERANCE * values.first().copied().unwrap_or(0.0);
        let rank = values.iter().filter(|v| **v > bound).count();
        let gap = match (rank.checked_sub(1), values.get(rank)) {
            (Some(last), Some(next)) => values[last] / next.max(1e-18),
            _ => f64::INFINITY,
        };
        Ok(Agreement {
            error,
            independence,
            rank,
            gap,
        })
    }
}

/// The result of checking the base of a mechanism.
#[derive(Clone, Debug)]
pub enum Verdict {
    /// The base is complete and reproduces the regressor.
    Correct(BaseFigures),
    /// The analysis reports that it cannot be certain, and why: for example, a loop closes, or has a
    /// special geometry, only to as many digits as its numbers have.
    Uncertified(String),
    /// The base is wrong, or smaller than the certified rank.
    Wrong(String),
}

/// Figures of a mechanism whose base is right.
#[derive(Clone, Copy, Debug)]
pub struct BaseFigures {
    /// The number of base parameters.
    pub rank: usize,
    /// Largest error of a row of W(all) - W(base) combinations, relative to the row's largest entry.
    pub error: f64,
    /// The number of null directions that the analysis of trees did not find.
    pub completed: usize,
    /// The number of factors in these directions that were left as plain numbers, because no
    /// expression in the geometry was recognised.
    pub numbers: usize,
    /// The number of base parameters whose combination is neither derived nor proven.
    pub unproven: usize,
}

/// The largest relative error of a row that is accepted.
const MAX_ROW_ERROR: f64 = 1e-9;

/// Analyses a spec's text: trees, completion and certificate, nothing else.
///
/// # Errors
/// The report of the spec's mistakes, or a home that does not close.
pub fn analysed(text: &str) -> Result<Analysis, String> {
    let spec = spec::parse(&Source::new("test.yaml", text)).map_err(|e| e.to_string())?;
    let model = model::build(&spec);
    let mut g = Graph::new();
    for coordinate in &model.coordinates {
        g.symbol(&coordinate.name);
    }
    let frames = Frames::new(&mut g, &model, Geometry::Values);
    let equations = world_equations(&mut g, &frames, &model, None);
    let loops = NumericLoops::new(&g, &equations, &model);
    let home = close_home(&loops, &model).map_err(|e| format!("home: {e:?}"))?;
    Ok(analyse(&spec, &model, &home))
}

/// Checks the base of a spec: it is complete, has the certified rank, and reproduces every row of
/// the second derivation's regressor at random states.
///
/// # Errors
/// When the spec cannot be analysed, or its second derivation finds no states.
pub fn check_base(text: &str, seed: u64) -> Result<Verdict, String> {
    let analysis = analysed(text)?;
    let certificate = match analysis.certificate {
        Ok(certificate) if certificate.is_certain() => certificate,
        Ok(open) => return Ok(Verdict::Uncertified(format!("the rank is open: {open:?}"))),
        Err(why) => return Ok(Verdict::Uncertified(why)),
    };
    let base = analysis.base;
    let found = format!(
        "{} kept, {} from trees, {} completed, {certificate:?}",
        base.parameters.len(),
        base.from_trees,
        base.completed
    );
    if !analysis.complete || base.parameters.len() != certificate.rank {
        return Ok(Verdict::Wrong(format!("incomplete: {found}")));
    }
    let mechanism = Mechanism::from_yaml(text)?;
    let derivation = Derivation {
        spec: spec::parse(&Source::new("test.yaml", text)).map_err(|e| e.to_string())?,
        columns: certificate.columns,
        base,
    };
    let states = mechanism.random_states(seed, states_for(&mechanism))?;
    let agreement = derivation.agreement(&mechanism, &states, &Derivation::value)?;
    if agreement.error.is_nan() || agreement.error > MAX_ROW_ERROR {
        return Ok(Verdict::Wrong(format!("{agreement:?}: {found}")));
    }
    Ok(Verdict::Correct(BaseFigures {
        rank: certificate.rank,
        error: agreement.error,
        completed: derivation.base.completed,
        numbers: derivation.base.unrecognised.len(),
        unproven: (derivation.base.parameters.iter())
            .filter(|p| p.provenance == Provenance::Completed)
            .count(),
    }))
}

/// Scales columns to length 1; columns that consist of rounding errors become 0.
fn scaled(mut w: DMatrix<f64>) -> DMatrix<f64> {
    for mut column in w.column_iter_mut() {
        let norm = column.norm();
        if norm > 1e-9 {
            column /= norm;
        } else {
            column.fill(0.0);
        }
    }
    w
}

/// The number of states that give one and a half times as many rows as there are columns.
pub fn states_for(mechanism: &Mechanism) -> usize {
    (3 * mechanism.parameters.len() / 2).div_ceil(mechanism.dof().max(1)) + 4
}
