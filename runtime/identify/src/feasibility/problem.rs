//! The physical fit as a least-squares problem with semidefinite constraints (cones).
//!
//! A *single* parameter belongs to no body and is not negative: a friction coefficient or a rotor
//! inertia. Every parameter is divided by its unit, see [`Setting::units`], and phi is the vector
//! of all p parameters in SI.

use super::cones::{Cone, Objective};
use super::equalities::{Equality, Solved, solve};
use super::program::Affine;
use super::sizes::MAX_SINGLE_RATIO;
use super::symmetric::{ONE, Square, ZERO};
use super::{BaseMap, FeasibilityError, Options, ParameterLayout};
use crate::estimate::QrFactor;

/// The duality gap is divided by at least this fraction of the sum of the squared efforts:
/// residuals below 1e-4 of the efforts count as rounding errors.
const MIN_OBJECTIVE_PART: f64 = 1e-8;

/// The constraint that a cone represents.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    /// The pseudo-inertia of the body with this index, less the margin, is positive semidefinite.
    Body(usize),
    /// A single parameter is not negative.
    Sign,
    /// A lower or an upper limit that the user gave.
    Limit,
    /// The trace of the pseudo-inertia of the body with this index is at most
    /// [`Problem::heaviest`]. This safety limit keeps the feasible set bounded.
    Size(usize),
    /// The absolute value of a single parameter or an offset is at most its safety limit,
    /// [`Setting::single_limit`].
    Strength,
}

/// The face of the semidefinite cone to which equations restrict a body's pseudo-inertia J:
/// `J v = 0` for all v orthogonal to the first `size` columns of `basis`, which are orthonormal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face {
    pub(super) basis: Square,
    pub(super) size: usize,
}

/// The observations, constraints and options of a physical fit.
pub(super) struct Setting<'a> {
    /// The QR factor R, z of the observations of the base parameters.
    pub(super) factor: &'a QrFactor,
    /// The matrix B that gives the base parameters as B phi.
    pub(super) combinations: &'a BaseMap,
    pub(super) layout: &'a ParameterLayout,
    pub(super) options: &'a Options,
    /// The standard deviation of the noise of the factor's rows.
    pub(super) noise: f64,
}

/// The problem in the variables that no equation eliminates. Each variable is one of the
/// parameters, divided by its unit.
#[derive(Clone, Debug)]
pub(super) struct Problem {
    /// All parameters as affine expressions in the variables.
    pub(super) solved: Solved,
    /// The unit of each of the p parameters, SI.
    pub(super) units: Vec<f64>,
    pub(super) objective: Objective,
    pub(super) cones: Vec<Cone>,
    /// The kind of each cone.
    pub(super) kinds: Vec<Kind>,
    /// An upper bound on the absolute value of each variable within the constraints.
    pub(super) reach: Vec<f64>,
    /// The upper limit of the trace of each body's pseudo-inertia, in units of [`Setting::scale`].
    pub(super) heaviest: Vec<f64>,
}

impl Setting<'_> {
    /// The equations between the parameters divided by their units: forms that the model takes as
    /// zero, identical bodies, known values and sums, and limits that leave a single value.
    ///
    /// Fails if a label is unknown, a value is not finite, or a body is declared identical to
    /// nothing or to itself.
    pub(super) fn equalities(&self, units: &[f64]) -> Result<Vec<Equality>, FeasibilityError> {
        let mut out = Vec::new();
        for (name, row) in self.combinations.zeros() {
            let terms = row.iter().enumerate().filter(|(_, f)| **f != 0.0);
            out.push(Equality {
                form: Affine {
                    terms: terms.map(|(k, f)| (k, f * units[k])).collect(),
                    constant: 0.0,
                },
                source: format!("the spec's `base:`, of {name},"),
                group: None,
                rounded: 0.0,
            });
        }
        let options = self.options;
        let mut group = 0;
        for bodies in &options.identical {
            let Some((first, others)) = bodies.split_first() else {
                continue;
            };
            if others.is_empty() {
                return Err(FeasibilityError::Idle(format!(
                    "body {first} alone is identical to nothing: name two or more"
                )));
            }
            let own = self.layout.body(first)?;
            for label in others {
                let other = self.layout.body(label)?;
                if other.label == own.label {
                    return Err(FeasibilityError::Idle(format!(
                        "body {label} is identical to itself"
                    )));
                }
                for (a, b) in own.columns.iter().zip(&other.columns) {
                    out.push(Equality {
                        form: Affine {
                            terms: vec![(*b, 1.0), (*a, -1.0)],
                            constant: 0.0,
                        },
                        source: format!("that {first} and {label} are identical"),
                        group: Some(group),
                        rounded: 0.0,
                    });
                }
                group += 1;
            }
        }
        let value = |label: &str, value: f64, group: usize| -> Result<_, FeasibilityError> {
            let j = self.layout.find(label)?;
            Ok(Equality {
                form: Affine {
                    terms: vec![(j, 1.0)],
                    constant: -value / units[j],
                },
                source: format!("the known value {label} = {value}"),
                group: Some(group),
                rounded: 0.0,
            })
        };
        for form in &options.forms {
            let mut terms = Vec::with_capacity(form.terms.len());
            for (k, (label, factor)) in form.terms.iter().enumerate() {
                finite("forms", k, *factor)?;
                let place = self.layout.find(label)?;
                terms.push((place, factor * units[place]));
            }
            out.push(Equality {
                form: Affine {
                    terms,
                    constant: 0.0,
                },
                source: form.source.clone(),
                group: Some(group),
                rounded: 0.0,
            });
            group += 1;
        }
        for (k, (label, known)) in options.known.iter().enumerate() {
            finite("known", k, *known)?;
            out.push(value(label, *known, group)?);
            group += 1;
        }
        for bound in options.bounds.iter().filter(|b| b.lowest >= b.highest) {
            out.push(value(&bound.parameter, bound.lowest, group)?);
            group += 1;
        }
        for (k, total) in options.totals.iter().enumerate() {
            finite("totals", k, total.value)?;
            let mut form = Affine {
                terms: Vec::new(),
                constant: -total.value,
            };
            for label in &total.parameters {
                let j = self.layout.find(label)?;
                form.terms.push((j, units[j]));
            }
            out.push(Equality {
                form,
                source: format!(
                    "the sum of {} = {}",
                    total.parameters.join(", "),
                    total.value
                ),
                group: Some(group),
                rounded: 0.0,
            });
            group += 1;
        }
        Ok(out)
    }

    /// The problem with these equations, and for each body the face of its cone, `None` for the
    /// whole cone.
    pub(super) fn problem(
        &self,
        equalities: &[Equality],
        faces: &[Option<Face>],
    ) -> Result<Problem, FeasibilityError> {
        let units = self.units();
        let p = self.layout.len();
        let solved = solve(p, equalities)?;
        let n = solved.variables.len();
        let objective = self.objective(&solved, &units)?;
        let mut problem = Problem {
            solved,
            units,
            objective,
            cones: Vec::new(),
            kinds: Vec::new(),
            reach: vec![0.0; n],
            heaviest: Vec::new(),
        };
        self.bodies(&mut problem, faces)?;
        self.singles(&mut problem)?;
        self.limits(&mut problem)?;
        // the limits of all parameters, of which the variables are some; the trace of the
        // pseudo-inertia bounds each of the ten parameters of a body
        let mut most = vec![0.0_f64; p];
        for (body, heaviest) in self.layout.bodies().iter().zip(&problem.heaviest) {
            body.columns.iter().for_each(|c| most[*c] = *heaviest);
        }
        for &j in self.layout.single().iter().chain(self.layout.any_sign()) {
            most[j] = self.single_limit(j, &problem.units);
        }
        for (slot, j) in problem.reach.iter_mut().zip(&problem.solved.variables) {
            *slot = most[*j];
        }
        Ok(problem)
    }

    /// The squares `||R B phi - z||^2 + rss` of the observations, and one row for each prior,
    /// weighted by the noise over the prior's standard deviation.
    pub(super) fn objective(
        &self,
        solved: &Solved,
        units: &[f64],
    ) -> Result<Objective, FeasibilityError> {
        let n = solved.variables.len();
        let r = self.factor.columns();
        let mut rows = vec![vec![0.0; n + 1]; r];
        for (i, row) in rows.iter_mut().enumerate() {
            row[n] = self.factor.z()[i];
        }
        for (j, expression) in solved.expressions.iter().enumerate() {
            let column = self.column(j);
            for (row, a) in rows.iter_mut().zip(&column) {
                if *a != 0.0 {
                    row[n] -= a * units[j] * expression.constant;
                    for (v, factor) in &expression.terms {
                        row[*v] += a * units[j] * factor;
                    }
                }
            }
        }
        for (k, prior) in self.options.priors.iter().enumerate() {
            let fits = prior.value.is_finite() && prior.deviation.is_finite();
            if !fits || prior.deviation <= 0.0 {
                return Err(FeasibilityError::NotFinite {
                    what: "priors",
                    index: k,
                });
            }
            let j = self.layout.find(&prior.parameter)?;
            let expression = &solved.expressions[j];
            if expression.terms.is_empty() {
                continue;
            }
            let weight = self.noise / prior.deviation;
            let mut row = vec![0.0; n + 1];
            for (v, factor) in &expression.terms {
                row[*v] += weight * units[j] * factor;
            }
            row[n] = weight * (prior.value - units[j] * expression.constant);
            rows.push(row);
        }
        Ok(Objective {
            rows,
            linear: vec![0.0; n],
            constant: self.factor.rss(),
            floor: (MIN_OBJECTIVE_PART * self.squared_efforts()).max(f64::MIN_POSITIVE.sqrt()),
        })
    }
}

impl Problem {
    pub(super) fn push(&mut self, cone: Cone, kind: Kind) {
        self.cones.push(cone);
        self.kinds.push(kind);
    }

    /// All p parameters, SI, at the values `x` of the variables.
    pub(super) fn expand(&self, x: &[f64]) -> Vec<f64> {
        let pairs = self.solved.expressions.iter().zip(&self.units);
        pairs
            .map(|(e, unit)| {
                let sum: f64 = e.terms.iter().map(|(v, f)| f * x[*v]).sum();
                (sum + e.constant) * unit
            })
            .collect()
    }

    /// The objective plus `weight` times the squared distance of the parameters from `reference`
    /// (SI; 0 where there is none), each divided by its unit.
    pub(super) fn pulled(&self, reference: &[Option<f64>], weight: f64) -> Objective {
        let mut objective = self.objective.clone();
        let n = self.solved.variables.len();
        let root = weight.sqrt();
        for (j, expression) in self.solved.expressions.iter().enumerate() {
            if expression.terms.is_empty() {
                continue;
            }
            let mut row = vec![0.0; n + 1];
            for (v, factor) in &expression.terms {
                row[*v] += root * factor;
            }
            let to = reference.get(j).copied().flatten().unwrap_or(0.0) / self.units[j];
            row[n] = root * (to - expression.constant);
            objective.rows.push(row);
        }
        objective
    }

    /// The cones and the bounds of the variables for the search for a point strictly inside all
    /// cones. One more variable t, the last, is subtracted from the diagonal of every cone's
    /// matrix; at a point with t > 0 all these matrices are positive definite.
    pub(super) fn interior_search(&self) -> (Vec<Cone>, Vec<f64>) {
        let n = self.solved.variables.len();
        let cones = self.cones.iter().map(|cone| {
            let mut cone = cone.clone();
            let mut less = ZERO;
            for (k, row) in less.iter_mut().enumerate().take(cone.size) {
                row[k] = -ONE[k][k];
            }
            cone.terms.push((n, less));
            cone.logarithm = 0.0;
            cone
        });
        let mut reach = self.reach.clone();
        reach.push(MAX_SINGLE_RATIO);
        (cones.collect(), reach)
    }
}

/// Fails unless `x`, entry `index` of the option `what`, is finite.
pub(super) fn finite(what: &'static str, index: usize, x: f64) -> Result<(), FeasibilityError> {
    if x.is_finite() {
        Ok(())
    } else {
        Err(FeasibilityError::NotFinite { what, index })
    }
}
