//! Identification among the physical parameters.

use std::prelude::v1::*;
use std::vec;

use nalgebra::{DMatrix, DVector};

use super::completion::near_reference;
use super::entropic::divergence;
use super::error::{finite, size};
use super::inertia::{ENTRIES, TRIANGLE, ten_of};
use super::program::{Affine, Program};
use super::reduced::{Directions, Reduced, Slot};
use super::verdict::{body_triangle, combine, roles, verdict};
use super::{Check, Combinations, FeasibilityError, Layout, Options, Verdict, pseudo_inertia};
use crate::estimate::Factor;

/// What the solver is asked for.
const ACCURACY: f64 = 1e-12;
/// The margin inside the cone, so that what the solver leaves is inside after rounding.
const INSIDE: f64 = 1e-11;
/// The weight of the reference in those directions, as a part of the strongest column.
const REFERENCE: f64 = 1e-4;
/// What a solution may be moved at most to be inside after the solver's last step.
const LIFT: f64 = 1e-5;

/// How the constraints took part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The least-squares parameters are physical themselves: nothing is lost.
    Unconstrained,
    /// Constraints or priors hold the parameters away from the least-squares ones.
    Constrained,
    /// As `Constrained`, and physical, but the solver stopped before the accuracy that it was
    /// asked for: others may fit slightly better.
    Inaccurate,
}

/// Physical parameters of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Physical {
    /// All p parameters, SI.
    pub phi: Vec<f64>,
    /// Their r base parameters, SI.
    pub beta: Vec<f64>,
    /// The sum of squared residuals with them.
    pub squared_residual: f64,
    /// The sum of squared residuals of least squares without constraints: the least there is.
    pub least: f64,
    /// The check that they are physical, made without the solver.
    pub check: Check,
    /// How the constraints took part.
    pub outcome: Outcome,
}

impl Physical {
    /// The rise of the root mean square residual over the least there is, as a part of it:
    /// what being physical costs.
    pub fn rise(&self) -> f64 {
        if self.least > 0.0 {
            (self.squared_residual / self.least).sqrt() - 1.0
        } else {
            0.0
        }
    }
}

/// Finds the physical parameters that fit observations best.
///
/// Minimises `||R B phi - z||^2`, with priors weighted by the noise, over all parameters phi
/// whose pseudo-inertias are positive semidefinite and whose single parameters are not negative
/// (Eq. 28 and 29), as one convex programme: its solution is the global one. The least-squares
/// solution is kept to rounding where it is physical.
///
/// - `factor`: R and z over the r combinations (base parameters);
/// - `combinations`: how they combine the p parameters of `layout`.
///
/// # Errors
/// When sizes or labels do not fit, a value is not finite, an entropic prior has no physical
/// reference, or the constraints leave nothing ([`FeasibilityError::Solver`]).
///
/// ```
/// use regen_runtime::estimate::Factor;
/// use regen_runtime::feasibility::{Combinations, Layout, Options, SYMBOLS, identify};
///
/// let labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}(1)")).collect();
/// let layout = Layout::new(&labels)?;
/// let seen = Combinations::identity(&labels).select(&[5, 9])?;
/// // Izz and m measured, both once: the inertia came out negative
/// let mut factor = Factor::new(seen.labels().to_vec());
/// factor.push_block(&[1.0, 0.0, 0.0, 1.0], &[-0.01, 2.0])?;
/// let physical = identify(&factor, &seen, &layout, &Options::default())?;
/// assert!(physical.check.is_physical());
/// assert!(physical.beta[0].abs() < 1e-6 && (physical.beta[1] - 2.0).abs() < 1e-6);
/// assert!((physical.squared_residual - 1e-4).abs() < 1e-7);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn identify(
    factor: &Factor,
    combinations: &Combinations,
    layout: &Layout,
    options: &Options,
) -> Result<Physical, FeasibilityError> {
    let p = layout.len();
    let r = combinations.rows().len();
    size("parameters", p, combinations.parameters())?;
    size("factor", r, factor.columns())?;
    if !options.reference.is_empty() {
        size("reference", p, options.reference.len())?;
    }
    let positive = |what, x: f64| {
        let fits = x.is_finite() && x >= 0.0;
        fits.then_some(())
            .ok_or(FeasibilityError::NotFinite { what, index: 0 })
    };
    positive("margin", options.margin)?;
    positive("entropic", options.entropic)?;
    positive("noise", options.noise.unwrap_or(1.0))?;
    if !options.scale.is_valid() {
        return Err(FeasibilityError::NotFinite {
            what: "scale",
            index: 0,
        });
    }

    if let Some(kept) = least_squares_kept(factor, combinations, layout, options)? {
        return Ok(kept);
    }
    let mut reduced = Reduced::new(layout, options)?;
    let b = DMatrix::from_fn(r, p, |i, j| combinations.rows()[i][j]);
    let triangle = DMatrix::from_column_slice(r, r, factor.r());
    let (mut a, offset) = reduced.reduce(&(&triangle * &b));
    let target = DVector::from_column_slice(factor.z()) - offset;
    // single variables in units that explain all of the efforts
    let whole = target.norm();
    for &j in layout.single() {
        if let Slot::Variable(v) = reduced.slots[j] {
            let norm = a.column(v).norm();
            if norm > 0.0 && whole > 0.0 {
                reduced.units[v] = whole / norm;
            }
        }
    }
    for (v, unit) in reduced.units.iter().enumerate() {
        a.column_mut(v).scale_mut(*unit);
    }
    let strongest = a.column_iter().map(|c| c.norm()).fold(0.0, f64::max);
    let strongest = if strongest > 0.0 { strongest } else { 1.0 };
    a /= strongest;
    let target = target / strongest;

    // around the least-squares solution, so that the objective is only what constraints cost
    let spectrum = Directions::of(&a);
    let start = spectrum.solve(&target);
    let least = (&a * &start - &target).norm_squared() * strongest * strongest + factor.rss();
    let spare = factor.rows().saturating_sub(spectrum.rank).max(1);
    let noise = options.noise.unwrap_or((least / spare as f64).sqrt());
    let mut program = Program::default();
    program.variables(reduced.count);
    // squared deviations in units of the data's objective
    let weight = noise / strongest;
    let mut beliefs = Vec::with_capacity(options.priors.len());
    for (k, prior) in options.priors.iter().enumerate() {
        let fits = prior.value.is_finite() && prior.deviation.is_finite() && prior.deviation > 0.0;
        if !fits {
            return Err(FeasibilityError::NotFinite {
                what: "priors",
                index: k,
            });
        }
        let mut off = reduced.expression(layout.find(&prior.parameter)?, prior.deviation / weight);
        off.constant -= prior.value / prior.deviation * weight;
        beliefs.push(off);
    }
    // around the best parameters that constraints let be; beliefs count there too
    let (rows, middle, open) = if beliefs.is_empty() {
        (a, start, spectrum.null)
    } else {
        let first = a.nrows();
        let mut all = a.resize_vertically(first + beliefs.len(), 0.0);
        let mut sides = target.resize_vertically(first + beliefs.len(), 0.0);
        for (k, belief) in beliefs.iter().enumerate() {
            for (v, factor) in &belief.terms {
                all[(first + k, *v)] += factor;
            }
            sides[first + k] = -belief.constant;
        }
        let both = Directions::of(&all);
        let middle = both.solve(&sides);
        (all, middle, both.null)
    };
    let sides = &rows * &middle;
    for (i, side) in sides.iter().enumerate() {
        program.square(&Affine {
            terms: rows.row(i).iter().copied().enumerate().collect(),
            constant: -side,
        });
    }
    // what neither observations nor beliefs determine
    for direction in &open {
        let mut off = Affine::default();
        for (j, slot) in reduced.slots.iter().enumerate() {
            let Slot::Variable(v) = slot else { continue };
            if off.terms.iter().any(|(k, _)| k == v) {
                continue;
            }
            let factor = REFERENCE * direction[*v];
            off.terms.push((*v, factor));
            let reference = options.reference.get(j).copied().flatten().unwrap_or(0.0);
            off.constant -= factor * reference / reduced.units[*v];
        }
        program.square(&off);
    }

    let inside = options.margin + INSIDE;
    let scaled = layout.units(options.scale);
    let expressions: Vec<Affine> = (0..p).map(|j| reduced.expression(j, scaled[j])).collect();
    for body in layout.bodies() {
        let entries = body_triangle(&expressions, &body.columns, |diagonal| {
            diagonal.constant -= inside;
        });
        program.semidefinite(4, &entries);
        let complete = body
            .columns
            .map(|c| options.reference.get(c).copied().flatten());
        if options.entropic > 0.0 && complete.iter().all(Option::is_some) {
            let reference = body.columns.map(|c| {
                let value = options.reference.get(c).copied().flatten();
                value.unwrap_or(0.0) / scaled[c]
            });
            let plain: Vec<Affine> = TRIANGLE
                .into_iter()
                .zip(ENTRIES)
                .map(|(_, entry)| combine(&expressions, &body.columns, entry))
                .collect();
            let strength = options.entropic * weight * weight;
            if !divergence(&mut program, &plain, &pseudo_inertia(&reference), strength) {
                return Err(FeasibilityError::Reference {
                    body: body.label.clone(),
                });
            }
        }
    }
    for &j in layout.single() {
        if let Slot::Variable(v) = reduced.slots[j] {
            program.not_negative(&reduced.expression(j, reduced.units[v]));
        }
    }
    limits(&mut program, &reduced, layout, options, &scaled)?;
    let solved = program.solve(ACCURACY)?;
    if solved.infeasible {
        return Err(FeasibilityError::Solver(
            "bounds, known values and totals contradict each other or what is physical".to_owned(),
        ));
    }

    let mut phi = reduced.expand(&solved.x);
    finite("solution", &phi).map_err(|_| FeasibilityError::Solver("no solution".to_owned()))?;
    lift(&mut phi, layout, options)?;
    let check = layout.check(&phi, options.scale)?;
    if !(check.is_physical() && check.margin() >= options.margin) {
        return Err(FeasibilityError::Solver(
            "no physical solution was found".to_owned(),
        ));
    }
    let beta = combinations.apply(&phi)?;
    Ok(Physical {
        squared_residual: factor.squared_residual(&beta)?,
        beta,
        phi,
        least,
        check,
        outcome: if solved.accurate {
            Outcome::Constrained
        } else {
            Outcome::Inaccurate
        },
    })
}

/// The least-squares solution, if nothing else is wanted and it is physical.
fn least_squares_kept(
    factor: &Factor,
    combinations: &Combinations,
    layout: &Layout,
    options: &Options,
) -> Result<Option<Physical>, FeasibilityError> {
    let wishes = !options.priors.is_empty()
        || options.entropic > 0.0
        || !options.known.is_empty()
        || !options.bounds.is_empty()
        || !options.totals.is_empty()
        || !options.identical.is_empty();
    let Ok(beta) = factor.solve() else {
        return Ok(None);
    };
    if wishes || roles(combinations).is_err() {
        return Ok(None);
    }
    let Verdict::Feasible { phi, margin } = verdict(layout, combinations, &beta, options.scale)?
    else {
        return Ok(None);
    };
    if margin < options.margin {
        return Ok(None);
    }
    let inside = (phi.as_slice(), margin);
    let (phi, check) = near_reference(layout, combinations, &beta, inside, options)?;
    let squared_residual = factor.squared_residual(&beta)?;
    Ok(Some(Physical {
        phi,
        beta,
        squared_residual,
        least: squared_residual,
        check,
        outcome: Outcome::Unconstrained,
    }))
}

/// The physical parameters whose base parameters are nearest to given ones, in the norm of the
/// observations: least `||R (B phi - beta)||`.
///
/// - `beta`: r base parameters, SI.
///
/// # Errors
/// As [`identify`].
pub fn nearest(
    factor: &Factor,
    combinations: &Combinations,
    layout: &Layout,
    beta: &[f64],
    options: &Options,
) -> Result<Physical, FeasibilityError> {
    size("beta", factor.columns(), beta.len())?;
    finite("beta", beta)?;
    let n = beta.len();
    let mut z = vec![0.0; n];
    for (column, value) in factor.r().chunks_exact(n.max(1)).zip(beta) {
        for (sum, r) in z.iter_mut().zip(column) {
            *sum += r * value;
        }
    }
    let labels = factor.labels().to_vec();
    let shifted = Factor::from_parts(labels, factor.r().to_vec(), z, 0.0, factor.rows())?;
    identify(&shifted, combinations, layout, options)
}

/// Adds bounds and totals.
fn limits(
    program: &mut Program,
    reduced: &Reduced,
    layout: &Layout,
    options: &Options,
    scaled: &[f64],
) -> Result<(), FeasibilityError> {
    for (k, bound) in options.bounds.iter().enumerate() {
        if bound.lowest.is_nan() || bound.highest.is_nan() || bound.lowest > bound.highest {
            return Err(FeasibilityError::NotFinite {
                what: "bounds",
                index: k,
            });
        }
        let j = layout.find(&bound.parameter)?;
        let unit = match reduced.slots[j] {
            Slot::Variable(v) => reduced.units[v],
            Slot::Known(_) => scaled[j],
        };
        for (limit, sign) in [(bound.lowest, 1.0), (bound.highest, -1.0)] {
            if limit.is_finite() {
                let mut off = reduced.expression(j, sign * unit);
                off.constant -= sign * limit / unit;
                program.not_negative(&off);
            }
        }
    }
    for (k, total) in options.totals.iter().enumerate() {
        if !total.value.is_finite() {
            return Err(FeasibilityError::NotFinite {
                what: "totals",
                index: k,
            });
        }
        let unit = total.value.abs().max(f64::MIN_POSITIVE);
        let unit = if total.value == 0.0 { 1.0 } else { unit };
        let mut sum = Affine {
            terms: Vec::new(),
            constant: -total.value / unit,
        };
        for label in &total.parameters {
            let more = reduced.expression(layout.find(label)?, unit);
            sum.constant += more.constant;
            sum.terms.extend(more.terms);
        }
        program.zero(&sum);
    }
    Ok(())
}

/// Moves what the solver left on the wrong side by rounding to the right one.
fn lift(phi: &mut [f64], layout: &Layout, options: &Options) -> Result<(), FeasibilityError> {
    let far = || FeasibilityError::Solver("no physical solution was found".to_owned());
    let unit = layout.units(options.scale);
    let mut identity = [[0.0; 4]; 4];
    for (k, row) in identity.iter_mut().enumerate() {
        row[k] = 1.0;
    }
    let direction = ten_of(&identity);
    for body in layout.bodies() {
        let ten = body.columns.map(|c| phi[c]);
        let lacking = options.margin - options.scale.smallest_eigenvalue(&ten);
        let size = (0..10).fold(1.0, |m: f64, k| {
            m.max((ten[k] / unit[body.columns[k]]).abs())
        });
        if lacking.is_nan() || lacking > LIFT * size {
            return Err(far());
        }
        if lacking >= 0.0 {
            // and over the rounding of the eigenvalue itself
            let by = lacking + 16.0 * f64::EPSILON * size;
            for (column, d) in body.columns.iter().zip(direction) {
                phi[*column] += by * d * unit[*column];
            }
        }
    }
    for &j in layout.single() {
        phi[j] = phi[j].max(0.0);
    }
    Ok(())
}
