//! The cones of the physical fit: pseudo-inertias of bodies, signs of single parameters, and
//! limits.

use super::cones::Cone;
use super::inertia::{ENTRIES, TRIANGLE};
use super::problem::{Face, Kind, Problem, Setting};
use super::program::Affine;
use super::symmetric::{Square, ZERO, cholesky, congruence, inverse, product, transposed};
use super::verdict::combine;
use super::{FeasibilityError, pseudo_inertia};
use regen_runtime::Sign;

/// The limit of a body's mass, as a multiple of the largest known value of the robot in units of
/// the scale: 1, its reference, its known values, limits and priors, and its base parameters. The
/// limit keeps the set bounded; without it the best fit can lie at infinite masses.
const MAX_MASS_RATIO: f64 = 1e3;
/// Base parameters count at most as this mass of the robot, in units of the scale: larger ones
/// describe springs and the like that are modelled as weights.
const MAX_BASE_PARAMETER_MASS: f64 = 10.0;

impl Setting<'_> {
    /// Adds the cones of the bodies' pseudo-inertias, and the limits of their mass and size.
    pub(super) fn bodies(
        &self,
        problem: &mut Problem,
        faces: &[Option<Face>],
    ) -> Result<(), FeasibilityError> {
        let options = self.options;
        let certain = self.certain_sizes(&problem.units).into_iter();
        let largest = certain.fold(1.0, f64::max).min(MAX_BASE_PARAMETER_MASS);
        let margin = options.margin * options.scale.mass / self.scale().mass;
        for (k, body) in self.layout.bodies().iter().enumerate() {
            let stated = body
                .columns
                .iter()
                .flat_map(|c| self.stated_sizes(*c, &problem.units));
            let heaviest = MAX_MASS_RATIO * stated.fold(largest, f64::max);
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
                    cone.constant = congruence(&basis, &cone.constant, 4);
                    for (_, m) in &mut cone.terms {
                        *m = congruence(&basis, m, 4);
                    }
                }
                problem.push(cone, Kind::Body(k));
            }
            problem.push(Cone::line(&lighter), Kind::Size(k));
        }
        Ok(())
    }

    /// Adds the log-det divergence from a body's reference to the objective, if the body has one.
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
        // the sum of squares is twice the negative logarithm of the likelihood
        let strength = 2.0 * options.entropic * self.noise * self.noise;
        for (v, m) in &plain.terms {
            problem.objective.linear[*v] += strength * super::symmetric::inner(&whitening, m);
        }
        let mut cone = plain.clone();
        cone.logarithm = strength;
        problem.push(cone, Kind::Body(body));
        Ok(())
    }

    /// Adds the signs of the single parameters, unless a limit of the user replaces the sign, and
    /// their safety limits; offsets have these limits alone.
    pub(super) fn singles(&self, problem: &mut Problem) -> Result<(), FeasibilityError> {
        for &j in self.layout.single().iter().chain(self.layout.any_sign()) {
            let label = &self.layout.labels()[j];
            let expression = problem.solved.expressions[j].clone();
            let own = self.options.bounds.iter().find(|b| b.parameter == *label);
            let any_sign = self.layout.any_sign().contains(&j);
            let free = any_sign || own.is_some_and(|b| b.lowest < 0.0);
            if expression.terms.is_empty() {
                if expression.constant < 0.0 && !free {
                    return Err(FeasibilityError::Contradiction(format!(
                        "a value of {label} below 0"
                    )));
                }
                continue;
            }
            let strongest = self.single_limit(j, &problem.units);
            let mut most = Affine {
                terms: expression.terms.iter().map(|(v, f)| (*v, -f)).collect(),
                constant: strongest - expression.constant,
            };
            problem.push(Cone::line(&most), Kind::Strength);
            if !free {
                problem.push(Cone::line(&expression), Kind::Sign);
            } else if own.is_none_or(|b| !b.lowest.is_finite()) {
                most = expression;
                most.constant += strongest;
                problem.push(Cone::line(&most), Kind::Strength);
            }
        }
        Ok(())
    }

    /// Adds the limits that the user gave.
    pub(super) fn limits(&self, problem: &mut Problem) -> Result<(), FeasibilityError> {
        for (k, bound) in self.options.bounds.iter().enumerate() {
            if bound.lowest.is_nan() || bound.highest.is_nan() || bound.lowest > bound.highest {
                return Err(FeasibilityError::NotFinite {
                    what: "bounds",
                    index: k,
                });
            }
            let j = self.layout.find(&bound.parameter)?;
            self.refuse_idle_limits(j, bound.lowest, bound.highest)?;
            if bound.lowest >= bound.highest {
                continue;
            }
            let expression = &problem.solved.expressions[j];
            let label = &bound.parameter;
            if expression.terms.is_empty() {
                let value = expression.constant * problem.units[j];
                let fits = value >= bound.lowest && value <= bound.highest;
                // the friction search may limit a parameter that turns out to be fixed
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

    /// Returns an error for limits that have no effect, for any data.
    fn refuse_idle_limits(
        &self,
        j: usize,
        lowest: f64,
        highest: f64,
    ) -> Result<(), FeasibilityError> {
        let label = &self.layout.labels()[j];
        let symbol = self.layout.inertial(j);
        let positive = symbol.is_some_and(|s| s.sign() == Sign::Nonnegative);
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
        let bare = positive || self.layout.single().contains(&j);
        if bare && lowest == 0.0 && highest == f64::INFINITY {
            return idle(format!(
                "{label} is not below 0 anyway: this limit does nothing"
            ));
        }
        Ok(())
    }
}
