//! The physical fit as least squares over cones.

use std::format;
use std::prelude::v1::*;
use std::vec;

use super::cones::{Cone, Objective};
use super::equalities::{Equality, Solved, solve};
use super::inertia::{ENTRIES, TRIANGLE};
use super::program::Affine;
use super::symmetric::{ONE, Square, ZERO, cholesky, congruence, inverse, product, transposed};
use super::verdict::combine;
use super::{Combinations, FeasibilityError, Layout, Options, SYMBOLS, Scale, pseudo_inertia};
use crate::estimate::Factor;
use crate::triangle::substitute;

/// A body may be this many times as heavy as all that is known of the robot: the unit of its
/// scale, its reference, what is said of it, base parameters. That keeps the set bounded; without a
/// bound the best fit can lie at masses without end.
const HEAVIEST: f64 = 1e3;
/// What base parameters are believed of a robot's mass at most, in units of the scale: larger ones
/// are of springs and the like that are put as weights.
const BELIEVED: f64 = 10.0;
/// By how many of its standard deviations a base parameter must differ from 0 to be believed.
const CERTAIN: f64 = 10.0;
/// What counts as far below the unit of mass, and the step to a lighter one.
const LIGHT: f64 = 1.0 / 256.0;
const LIGHTER: f64 = 65536.0;
/// A single parameter may be this many times what explains all of the efforts.
const STRONGEST: f64 = 1e4;
/// Residuals below this part of the efforts count as none: its square.
const FLOOR: f64 = 1e-8;

/// What a cone is there for.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    /// A body's pseudo-inertia.
    Body(usize),
    /// The sign of a single parameter.
    Sign,
    /// A limit that the user gave.
    Limit,
    /// The generous limit of a body's mass and reach.
    Size(usize),
    /// The generous limit of a single parameter, such as friction.
    Strength,
}

/// A part of the space in which a body's pseudo-inertia lives, where the equations leave it no
/// more: orthonormal columns, the first `size` of which count.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face {
    pub(super) basis: Square,
    pub(super) size: usize,
}

/// What besides the observations shapes the problem.
pub(super) struct Setting<'a> {
    pub(super) factor: &'a Factor,
    pub(super) combinations: &'a Combinations,
    pub(super) layout: &'a Layout,
    pub(super) options: &'a Options,
    /// The standard deviation of the noise.
    pub(super) noise: f64,
}

/// The problem in variables that no equation determines.
pub(super) struct Problem {
    pub(super) solved: Solved,
    pub(super) units: Vec<f64>,
    pub(super) objective: Objective,
    pub(super) cones: Vec<Cone>,
    pub(super) kinds: Vec<Kind>,
    /// How large each variable can be.
    pub(super) reach: Vec<f64>,
    /// The largest trace of each body's pseudo-inertia, in units of the scale.
    pub(super) heaviest: Vec<f64>,
}

impl Setting<'_> {
    /// The unit of each parameter: single ones in what explains all of the efforts.
    pub(super) fn units(&self) -> Vec<f64> {
        let mut units = self.layout.units(self.scale());
        let whole = self.whole().sqrt();
        for &j in self.layout.single() {
            let column: f64 = self.column(j).iter().map(|x| x * x).sum();
            if column > 0.0 && whole > 0.0 {
                units[j] = whole / column.sqrt();
            }
        }
        units
    }

    /// The scale in which the problem is solved: that of the options, or a lighter one where
    /// three of four certain base parameters are far below it, as beside weights that stand for
    /// springs.
    fn scale(&self) -> Scale {
        let mut scale = self.options.scale;
        let mut sizes = self.certain(&self.layout.units(scale));
        sizes.sort_by(f64::total_cmp);
        let Some(most) = sizes.get(3 * sizes.len() / 4).copied() else {
            return scale;
        };
        let mut mass = 1.0;
        while most > 0.0 && most < LIGHT * mass && mass > 1e-100 {
            mass /= LIGHTER;
        }
        scale.mass *= mass;
        scale
    }

    /// The sum of the squared efforts.
    fn whole(&self) -> f64 {
        self.factor.z().iter().map(|z| z * z).sum::<f64>() + self.factor.rss()
    }

    /// A parameter's column of `R B`.
    fn column(&self, parameter: usize) -> Vec<f64> {
        let r = self.factor.columns();
        let mut out = vec![0.0; r];
        let rows = self.combinations.rows().iter();
        for (row, column) in rows.zip(self.factor.r().chunks_exact(r.max(1))) {
            let factor = row[parameter];
            if factor != 0.0 {
                for (sum, x) in out.iter_mut().zip(column) {
                    *sum += factor * x;
                }
            }
        }
        out
    }

    /// The equations between parameters, in units: what the model takes as known, identical
    /// bodies, known values and sums, limits that leave one value.
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

    /// The problem with these equations and faces.
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
        // how far each variable can go, which is a parameter of its own
        let mut most = vec![0.0_f64; p];
        for (body, heaviest) in self.layout.bodies().iter().zip(&problem.heaviest) {
            body.columns.iter().for_each(|c| most[*c] = *heaviest);
        }
        for &j in self.layout.single() {
            most[j] = self.strongest(j, &problem.units);
        }
        for (slot, j) in problem.reach.iter_mut().zip(&problem.solved.variables) {
            *slot = most[*j];
        }
        Ok(problem)
    }

    fn objective(&self, solved: &Solved, units: &[f64]) -> Result<Objective, FeasibilityError> {
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
            floor: (FLOOR * self.whole()).max(f64::MIN_POSITIVE.sqrt()),
        })
    }

    /// The generous limit of a single parameter, in its unit.
    fn strongest(&self, j: usize, units: &[f64]) -> f64 {
        self.said(j, units).fold(1.0, f64::max) * STRONGEST
    }

    /// The sizes of what is said of a parameter, in its unit.
    fn said<'b>(&'b self, j: usize, units: &'b [f64]) -> impl Iterator<Item = f64> + 'b {
        let label = &self.layout.labels()[j];
        let options = self.options;
        let known = options.known.iter().filter(move |(l, _)| l == label);
        let bounds = options.bounds.iter().filter(move |b| b.parameter == *label);
        let totals = options.totals.iter();
        let totals = totals.filter(move |t| t.parameters.contains(label));
        let priors = options.priors.iter().filter(move |p| p.parameter == *label);
        let reference = options.reference.get(j).copied().flatten();
        known
            .map(|(_, v)| *v)
            .chain(bounds.flat_map(|b| [b.lowest, b.highest]))
            .chain(totals.map(|t| t.value))
            .chain(priors.map(|p| p.value))
            .chain(reference)
            .filter(|x| x.is_finite())
            .map(move |x| (x / units[j]).abs())
    }

    /// The sizes of the base parameters of bodies that are certain, in their units.
    fn certain(&self, units: &[f64]) -> Vec<f64> {
        let factor = self.factor;
        let (n, mut sizes) = (factor.columns(), Vec::new());
        let Ok(beta) = factor.solve() else {
            return sizes;
        };
        let spare = factor.rows().saturating_sub(n).max(1) as f64;
        let noise = (factor.rss() / spare).sqrt();
        // variances: the squared rows of R^-1
        let mut variances = vec![0.0; n];
        for k in 0..n {
            let mut one = vec![0.0; n];
            one[k] = 1.0;
            for (sum, x) in variances
                .iter_mut()
                .zip(substitute(factor.r(), &one).unwrap_or_default())
            {
                *sum += x * x;
            }
        }
        let values = beta.iter().zip(&variances).zip(self.combinations.rows());
        for ((value, variance), row) in values {
            // a combination's own unit is that of its strongest body parameter
            let of_bodies = self.layout.bodies().iter().flat_map(|b| b.columns);
            let unit = of_bodies
                .map(|c| row[c].abs() * units[c])
                .fold(0.0, f64::max);
            if unit > 0.0 && value.abs() > CERTAIN * noise * variance.sqrt() {
                sizes.push((value / unit).abs());
            }
        }
        sizes
    }

    /// The cones of the bodies, and the limits of their mass and reach.
    fn bodies(
        &self,
        problem: &mut Problem,
        faces: &[Option<Face>],
    ) -> Result<(), FeasibilityError> {
        let options = self.options;
        let certain = self.certain(&problem.units).into_iter();
        let largest = certain.fold(1.0, f64::max).min(BELIEVED);
        let margin = options.margin * options.scale.mass / self.scale().mass;
        for (k, body) in self.layout.bodies().iter().enumerate() {
            let said = body
                .columns
                .iter()
                .flat_map(|c| self.said(*c, &problem.units));
            let heaviest = HEAVIEST * said.fold(largest, f64::max);
            problem.heaviest.push(heaviest);
            let mut plain = Cone {
                size: 4,
                constant: ZERO,
                terms: Vec::new(),
                logarithm: 0.0,
            };
            for ((r, c), entry) in TRIANGLE.into_iter().zip(ENTRIES) {
                let sum = combine(&problem.solved.expressions, &body.columns, entry);
                let set = |m: &mut Square, x: f64| {
                    m[r][c] = x;
                    m[c][r] = x;
                };
                set(&mut plain.constant, sum.constant);
                for (v, factor) in sum.terms {
                    if let Some((_, m)) = plain.terms.iter_mut().find(|(k, _)| *k == v) {
                        set(m, factor);
                    } else {
                        let mut m = ZERO;
                        set(&mut m, factor);
                        plain.terms.push((v, m));
                    }
                }
            }
            let trace = |m: &Square| m[0][0] + m[1][1] + m[2][2] + m[3][3];
            let lighter = Affine {
                terms: plain.terms.iter().map(|(v, m)| (*v, -trace(m))).collect(),
                constant: heaviest - trace(&plain.constant),
            };
            self.entropic(problem, k, &plain)?;
            if options.margin > 0.0 || problem.kinds.last() != Some(&Kind::Body(k)) {
                let mut cone = plain;
                for (i, row) in cone.constant.iter_mut().enumerate() {
                    row[i] -= margin;
                }
                if let Some(face) = faces.get(k).copied().flatten() {
                    let basis = transposed(&face.basis);
                    cone.size = face.size;
                    cone.constant = congruence(&basis, &cone.constant);
                    for (_, m) in &mut cone.terms {
                        *m = congruence(&basis, m);
                    }
                }
                problem.push(cone, Kind::Body(k));
            }
            problem.push(Cone::line(&lighter), Kind::Size(k));
        }
        Ok(())
    }

    /// The log-det divergence from a body's reference, where it has one.
    fn entropic(
        &self,
        problem: &mut Problem,
        body: usize,
        plain: &Cone,
    ) -> Result<(), FeasibilityError> {
        let options = self.options;
        let Some(own) = self.layout.bodies().get(body) else {
            return Ok(());
        };
        let of = |c: usize| options.reference.get(c).copied().flatten();
        if options.entropic <= 0.0 || own.columns.iter().any(|c| of(*c).is_none()) {
            return Ok(());
        }
        let reference = own.columns.map(|c| of(c).unwrap_or(0.0) / problem.units[c]);
        let reference = pseudo_inertia(&reference);
        let Some(l) = cholesky(&reference, 4) else {
            return Err(FeasibilityError::Reference {
                body: own.label.clone(),
            });
        };
        let l = inverse(&l, 4);
        let whitening = product(&transposed(&l), &l);
        // squares are of twice the negative logarithm of the likelihood
        let strength = 2.0 * options.entropic * self.noise * self.noise;
        for (v, m) in &plain.terms {
            problem.objective.linear[*v] += strength * super::symmetric::inner(&whitening, m);
        }
        let mut cone = plain.clone();
        cone.logarithm = strength;
        problem.push(cone, Kind::Body(body));
        Ok(())
    }

    /// The signs of single parameters, unless a limit of the user's stands for it.
    fn singles(&self, problem: &mut Problem) -> Result<(), FeasibilityError> {
        for &j in self.layout.single() {
            let label = &self.layout.labels()[j];
            let expression = problem.solved.expressions[j].clone();
            let own = self.options.bounds.iter().find(|b| b.parameter == *label);
            let free = own.is_some_and(|b| b.lowest < 0.0);
            if expression.terms.is_empty() {
                if expression.constant < 0.0 && !free {
                    return Err(FeasibilityError::Contradiction(format!(
                        "a value of {label} below 0"
                    )));
                }
                continue;
            }
            let strongest = self.strongest(j, &problem.units);
            let mut most = Affine {
                terms: expression.terms.iter().map(|(v, f)| (*v, -f)).collect(),
                constant: strongest - expression.constant,
            };
            problem.push(Cone::line(&most), Kind::Strength);
            if !free {
                problem.push(Cone::line(&expression), Kind::Sign);
            } else if own.is_some_and(|b| !b.lowest.is_finite()) {
                most = expression;
                most.constant += strongest;
                problem.push(Cone::line(&most), Kind::Strength);
            }
        }
        Ok(())
    }

    /// The limits that the user gave.
    fn limits(&self, problem: &mut Problem) -> Result<(), FeasibilityError> {
        for (k, bound) in self.options.bounds.iter().enumerate() {
            if bound.lowest.is_nan() || bound.highest.is_nan() || bound.lowest > bound.highest {
                return Err(FeasibilityError::NotFinite {
                    what: "bounds",
                    index: k,
                });
            }
            let j = self.layout.find(&bound.parameter)?;
            self.acts(j, bound.lowest, bound.highest)?;
            if bound.lowest >= bound.highest {
                continue;
            }
            let expression = &problem.solved.expressions[j];
            let label = &bound.parameter;
            if expression.terms.is_empty() {
                let value = expression.constant * problem.units[j];
                let fits = value >= bound.lowest && value <= bound.highest;
                // a search inside may limit what turns out to be fixed
                if fits && self.options.rough {
                    continue;
                }
                return Err(if fits {
                    FeasibilityError::Idle(format!(
                        "{label} is {value} already, so that limits of it do nothing"
                    ))
                } else {
                    FeasibilityError::Contradiction(format!(
                        "a limit of {label}, which is {value} already,"
                    ))
                });
            }
            // in units of the interval, so that its inside is near 1
            let width = bound.highest - bound.lowest;
            let width = if width.is_finite() {
                width / problem.units[j]
            } else {
                1.0
            };
            let mut lines = Vec::new();
            for (limit, sign) in [(bound.lowest, 1.0), (bound.highest, -1.0)] {
                if limit.is_finite() {
                    let constant = expression.constant - limit / problem.units[j];
                    lines.push(Affine {
                        terms: expression
                            .terms
                            .iter()
                            .map(|(v, f)| (*v, sign * f / width))
                            .collect(),
                        constant: sign * constant / width,
                    });
                }
            }
            for line in lines {
                problem.push(Cone::line(&line), Kind::Limit);
            }
        }
        Ok(())
    }

    /// Refuses limits that do nothing, whatever the data are.
    fn acts(&self, j: usize, lowest: f64, highest: f64) -> Result<(), FeasibilityError> {
        let label = &self.layout.labels()[j];
        let symbol = label.split('(').next().unwrap_or_default();
        let of_body = SYMBOLS.contains(&symbol) && !self.layout.single().contains(&j);
        let positive = matches!(symbol, "m" | "Ixx" | "Iyy" | "Izz") && of_body;
        let idle = |text: String| Err(FeasibilityError::Idle(text));
        if lowest == f64::NEG_INFINITY && highest == f64::INFINITY {
            return idle(format!("{label}: a range without limits does nothing"));
        }
        if positive && lowest < 0.0 && lowest.is_finite() {
            return idle(format!(
                "{label} cannot be below 0 whatever the limit, so that {lowest} does nothing: \
                 leave it out"
            ));
        }
        let bare = positive || !of_body;
        if bare && lowest == 0.0 && highest == f64::INFINITY {
            return idle(format!(
                "{label} is not below 0 anyway: this limit does nothing"
            ));
        }
        Ok(())
    }
}

impl Problem {
    fn push(&mut self, cone: Cone, kind: Kind) {
        self.cones.push(cone);
        self.kinds.push(kind);
    }

    /// All parameters, SI, at a point.
    pub(super) fn expand(&self, x: &[f64]) -> Vec<f64> {
        let pairs = self.solved.expressions.iter().zip(&self.units);
        pairs
            .map(|(e, unit)| {
                let sum: f64 = e.terms.iter().map(|(v, f)| f * x[*v]).sum();
                (sum + e.constant) * unit
            })
            .collect()
    }

    /// Two problems with the same variables: the objective with a pull of `weight` towards
    /// reference values added, squared distances in units.
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

    /// The problem of being inside: a variable more, the part of its unit by which every cone is
    /// inside, which is to be 1.
    pub(super) fn inside(&self) -> (Vec<Cone>, Vec<f64>) {
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
        reach.push(STRONGEST);
        (cones.collect(), reach)
    }
}

fn finite(what: &'static str, index: usize, x: f64) -> Result<(), FeasibilityError> {
    if x.is_finite() {
        Ok(())
    } else {
        Err(FeasibilityError::NotFinite { what, index })
    }
}
