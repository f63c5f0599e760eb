//! Identification of the physical parameters that fit observations best.

use nalgebra::{DMatrix, DVector};

use super::error::{finite, size};
use super::faces::{InteriorStart, find_interior_point};
use super::interior::{InteriorOutcome, minimise, start};
use super::problem::{Kind, Problem, Setting};
use super::psd_completion::near_reference;
use super::reduced::Directions;
use super::verdict::verdict;
use super::{BaseMap, Body, Check, FeasibilityError, Options, ParameterLayout, Verdict};
use crate::estimate::QrFactor;

/// The interior-point method stops at this gap, as a fraction of the objective.
const TARGET_GAP: f64 = 1e-10;
/// The gap up to which a result counts as the optimum, as a fraction of the objective.
pub const MAX_OPTIMAL_GAP: f64 = 1e-4;
/// The largest rise of the objective for the sake of closeness to the reference, as a fraction of
/// the objective.
const MAX_REFERENCE_COST: f64 = 1e-8;
/// The data count as fitted exactly when the sum of squares is at most this fraction of the
/// objective's floor.
const EXACT_FIT_PART: f64 = 1e-4;
/// With an exact fit, the largest rise of the objective for closeness to the reference, as a
/// fraction of the sum that counts as exact.
const MAX_EXACT_FIT_COST: f64 = 1e-5;
/// A generous limit (of [`SizeLimit`]) counts as active when lifting it would lower the objective
/// by at least this fraction.
const MIN_ACTIVE_GAIN: f64 = 1e-6;

/// Whether constraints or priors changed the least-squares solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The least-squares parameters are physical: the residuals are those of least squares.
    Unconstrained,
    /// Constraints or priors keep the parameters away from the least-squares solution.
    Constrained,
}

/// Physical parameters of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Physical {
    /// All p parameters, SI.
    pub phi: Vec<f64>,
    /// The r base parameters of `phi`, SI.
    pub beta: Vec<f64>,
    /// The sum of squared residuals of these parameters.
    pub squared_residual: f64,
    /// The sum of squared residuals of least squares without constraints, which is the smallest
    /// possible.
    pub least: f64,
    /// The check that the parameters are physical, computed without the solver. Its list of
    /// negative parameters omits those for which a limit in [`Options::bounds`] allows negative
    /// values.
    pub check: Check,
    /// Whether constraints or priors changed the least-squares solution.
    pub outcome: Outcome,
    /// An upper bound on how far the objective (squared residuals plus the terms of priors) is
    /// above its minimum over all physical robots, as a fraction of the objective. The bound is
    /// computed from dual matrices whose eigenvalues were cut off at 0, by sums of twice the
    /// working precision, and does not rely on what the solver reports. The objective counts as at
    /// least 1e-8 of the squared efforts.
    pub gap: f64,
    /// The labels of the bodies that would be heavier or larger without the limits in
    /// [`sizes`](Self::sizes): the observations alone would make their masses infinite.
    pub limited: Vec<String>,
    /// The generous limit of each body of the layout, a thousand times the known masses of the
    /// robot; empty if no constraint took part.
    pub sizes: Vec<SizeLimit>,
}

/// How heavy and large a body may be: `m + (Ixx + Iyy + Izz) / (2 length^2) <= mass`.
///
/// Without such a limit the best fit can be at infinite masses, so that no best fit exists.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SizeLimit {
    /// The upper limit of the mass, kg.
    pub mass: f64,
    /// The radius of gyration at which the inertia counts as much as the mass, m.
    pub length: f64,
}

impl Physical {
    /// The relative rise of the root mean square residual above that of least squares without
    /// constraints: the cost of being physical.
    pub fn rise(&self) -> f64 {
        if self.least > 0.0 {
            (self.squared_residual / self.least).sqrt() - 1.0
        } else {
            0.0
        }
    }

    /// Whether the gap proves that no physical parameters lower the objective by more than 1e-4 of
    /// it.
    pub fn is_optimal(&self) -> bool {
        self.gap <= MAX_OPTIMAL_GAP
    }
}

/// Finds the physical parameters that fit observations best.
///
/// Minimises `||R B phi - z||^2`, with priors weighted by the noise, over all parameters phi whose
/// pseudo-inertias are positive semidefinite and whose single parameters (friction, rotors) are not
/// negative (Eq. 28 and 29), as one convex programme: its solution is the global one. If the
/// least-squares solution is physical, it is returned, up to rounding.
///
/// Only the observations decide the fit. Among the parameters that fit equally well, the result is
/// close to the reference, or small without one: that choice changes the objective by less than
/// 1e-8 of it. [`Physical::gap`] bounds the distance of the result from the optimum.
///
/// - `factor`: R and z over the r combinations (base parameters);
/// - `combinations`: how they combine the p parameters of `layout`.
///
/// # Errors
/// When sizes or labels do not fit, a value is not finite, an entropic prior has no physical
/// reference, a constraint can have no effect ([`FeasibilityError::Idle`]), or the constraints
/// admit no parameters ([`FeasibilityError::Contradiction`]).
///
/// ```
/// use regen_identify::estimate::QrFactor;
/// use regen_identify::feasibility::{BaseMap, ParameterLayout, Options, SYMBOLS, identify};
///
/// let labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}(1)")).collect();
/// let layout = ParameterLayout::new(&labels)?;
/// let seen = BaseMap::identity(&labels).select(&[5, 9])?;
/// // Izz and m, each measured once: the measured inertia is negative
/// let mut factor = QrFactor::new(seen.labels().to_vec());
/// factor.push_block(&[1.0, 0.0, 0.0, 1.0], &[-0.01, 2.0])?;
/// let physical = identify(&factor, &seen, &layout, &Options::default())?;
/// assert!(physical.check.is_physical());
/// assert!(physical.beta[0].abs() < 1e-6 && (physical.beta[1] - 2.0).abs() < 1e-6);
/// assert!((physical.squared_residual - 1e-4).abs() < 1e-7);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn identify(
    factor: &QrFactor,
    combinations: &BaseMap,
    layout: &ParameterLayout,
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
    let (least, rank) = least(factor);
    let spare = factor.rows().saturating_sub(rank).max(1);
    let setting = Setting {
        factor,
        combinations,
        layout,
        options,
        noise: options.noise.unwrap_or((least / spare as f64).sqrt()),
    };
    let InteriorStart { problem, x: within } = find_interior_point(&setting)?;
    let lost = || FeasibilityError::Solver("no physical solution was found".to_owned());
    let first = start(&problem.objective, &problem.cones, within.clone()).ok_or_else(lost)?;
    let all = &problem.cones;
    let ended = minimise(
        &problem.objective,
        all,
        &problem.reach,
        first,
        TARGET_GAP,
        &|_| false,
    );
    let ended = ended.ok_or_else(lost)?;
    let limited = limited(&problem, layout, &ended);
    let (x, gap) = if options.rough {
        (ended.best.x.clone(), ended.gap.part())
    } else {
        closest_to_reference(&problem, options, &ended)
    };
    let (phi, check, moved) = physical(&problem, layout, options, &x, &within).ok_or_else(lost)?;
    let cost = objective(&problem, &moved) - objective(&problem, &x);
    let gap = gap + cost.max(0.0) / ended.gap.value;
    finite("solution", &phi).map_err(|_| lost())?;
    let beta = combinations.apply(&phi)?;
    Ok(Physical {
        squared_residual: factor.squared_residual(&beta)?,
        beta,
        phi,
        least,
        check,
        outcome: Outcome::Constrained,
        gap,
        limited,
        sizes: sizes(&problem, layout),
    })
}

/// The sum of squared residuals of least squares, and the rank of the observations.
fn least(factor: &QrFactor) -> (f64, usize) {
    if factor.solve().is_ok() {
        return (factor.rss(), factor.columns());
    }
    let r = factor.columns();
    let a = DMatrix::from_column_slice(r, r, factor.r());
    let z = DVector::from_column_slice(factor.z());
    let spectrum = Directions::of(&a);
    let off = &a * spectrum.solve(&z) - z;
    (off.norm_squared() + factor.rss(), spectrum.rank)
}

/// The generous limits of the bodies, SI.
fn sizes(problem: &Problem, layout: &ParameterLayout) -> Vec<SizeLimit> {
    let bodies = layout.bodies().iter().zip(&problem.heaviest);
    let limit = |(body, heaviest): (&Body, &f64)| {
        let [inertia, .., mass] = body.columns.map(|c| problem.units[c]);
        SizeLimit {
            mass: heaviest * mass,
            length: (inertia / mass).sqrt(),
        }
    };
    bodies.map(limit).collect()
}

/// The labels of the bodies whose generous limits are active.
fn limited(problem: &Problem, layout: &ParameterLayout, ended: &InteriorOutcome) -> Vec<String> {
    let duals = problem.kinds.iter().zip(&ended.best.duals);
    let matters = duals.filter_map(|(kind, dual)| {
        let Kind::Size(body) = kind else { return None };
        let gain = dual[0][0] * problem.heaviest.get(*body)?;
        (gain > MIN_ACTIVE_GAIN * ended.gap.value).then(|| layout.bodies().get(*body))?
    });
    matters.map(|body| body.label.clone()).collect()
}

/// Among the parameters that fit equally well, those close to the reference, with their gap.
///
/// Minimises the objective again with the additional term `w ||phi - reference||^2`. If that term
/// is at most `MAX_REFERENCE_COST` of the objective at the first solution, the objective cannot
/// rise by more: at the new minimum the sum of both is not larger than at the first solution.
fn closest_to_reference(
    problem: &Problem,
    options: &Options,
    ended: &InteriorOutcome,
) -> (Vec<f64>, f64) {
    let first = (ended.best.x.clone(), ended.gap.part());
    let plain = &problem.objective;
    let far = |x: &[f64]| {
        let pulled = problem.pulled(&options.reference, 1.0);
        let both: f64 = pulled.residuals(x)[plain.rows.len()..]
            .iter()
            .map(|r| r * r)
            .sum();
        both
    };
    let distance = far(&first.0);
    if distance.is_nan() || distance <= 0.0 {
        return first;
    }
    // if the data fit exactly, the cost of the additional term is of second order: its weight may
    // be larger, as long as the cost stays negligible
    let floor = EXACT_FIT_PART * plain.floor;
    let squares = plain.squares(&first.0);
    let exact = squares <= floor;
    let (pulls, allowed): (&[f64], f64) = if exact {
        (&[1e3, 1e2, 1e1, 1.0], MAX_EXACT_FIT_COST * floor)
    } else {
        (&[MAX_REFERENCE_COST], 2.0 * MAX_REFERENCE_COST * squares)
    };
    for pull in pulls {
        let weight = pull * squares.max(floor) / distance;
        let again = minimise(
            &problem.pulled(&options.reference, weight),
            &problem.cones,
            &problem.reach,
            ended.inside.clone(),
            1e-2 * MAX_REFERENCE_COST * squares.max(floor) / ended.gap.value,
            &|_| false,
        );
        let Some(again) = again else { continue };
        let x = again.best.x;
        let rise = objective(problem, &x) - objective(problem, &first.0);
        if rise <= allowed && far(&x) < distance {
            let whole = ended.gap.complementarity + ended.gap.unbalanced + rise.max(0.0);
            return (x, whole / ended.gap.value);
        }
    }
    first
}

/// The objective including its logarithms, up to a constant.
fn objective(problem: &Problem, x: &[f64]) -> f64 {
    let logarithms: f64 = problem
        .cones
        .iter()
        .filter(|cone| cone.logarithm > 0.0)
        .map(|cone| {
            let l = super::symmetric::cholesky(&cone.at(x), cone.size);
            let roots = l.map_or(f64::NAN, |l| {
                (0..4).map(|k| libm::log(l[k][k])).sum::<f64>()
            });
            2.0 * cone.logarithm * roots
        })
        .sum();
    problem.objective.squares(x) - logarithms
}

/// The parameters at a point, with the check that they are physical and the point they belong to.
/// If rounding makes an eigenvalue negative, a small part of a point well inside is mixed in.
fn physical(
    problem: &Problem,
    layout: &ParameterLayout,
    options: &Options,
    x: &[f64],
    within: &[f64],
) -> Option<(Vec<f64>, Check, Vec<f64>)> {
    for part in [0.0, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8] {
        let mixed: Vec<f64> = x
            .iter()
            .zip(within)
            .map(|(a, b)| a + part * (b - a))
            .collect();
        let mut phi = problem.expand(&mixed);
        for (label, value) in &options.known {
            if let Ok(j) = layout.find(label) {
                phi[j] = *value;
            }
        }
        let mut check = layout.check(&phi, options.scale).ok()?;
        check.negative.retain(|label| {
            let own = options.bounds.iter().find(|b| b.parameter == *label);
            let at = layout.find(label).ok().and_then(|j| phi.get(j));
            !own.is_some_and(|b| at.is_some_and(|x| *x >= b.lowest))
        });
        if check.is_physical() && check.margin() >= options.margin {
            return Some((phi, check, mixed));
        }
    }
    None
}

/// The least-squares solution, if it is physical and there are no priors or further constraints.
fn least_squares_kept(
    factor: &QrFactor,
    combinations: &BaseMap,
    layout: &ParameterLayout,
    options: &Options,
) -> Result<Option<Physical>, FeasibilityError> {
    let has_constraints = !options.priors.is_empty()
        || options.entropic > 0.0
        || !options.known.is_empty()
        || !options.bounds.is_empty()
        || !options.totals.is_empty()
        || !options.identical.is_empty();
    let Ok(beta) = factor.solve() else {
        return Ok(None);
    };
    if has_constraints {
        return Ok(None);
    }
    let Ok(Verdict::Feasible { phi, margin }) = verdict(layout, combinations, &beta, options.scale)
    else {
        return Ok(None);
    };
    if margin < options.margin {
        return Ok(None);
    }
    let (phi, check) = if options.rough {
        let check = layout.check(&phi, options.scale)?;
        (phi, check)
    } else {
        let inside = (phi.as_slice(), margin);
        near_reference(layout, combinations, &beta, inside, options)?
    };
    let squared_residual = factor.squared_residual(&beta)?;
    Ok(Some(Physical {
        phi,
        beta,
        squared_residual,
        least: squared_residual,
        check,
        outcome: Outcome::Unconstrained,
        gap: 0.0,
        limited: Vec::new(),
        sizes: Vec::new(),
    }))
}

/// Finds the physical parameters whose base parameters are nearest to given ones, in the norm of
/// the observations: it minimises `||R (B phi - beta)||`.
///
/// - `beta`: r base parameters, SI.
///
/// # Errors
/// As [`identify`].
pub fn nearest(
    factor: &QrFactor,
    combinations: &BaseMap,
    layout: &ParameterLayout,
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
    let shifted = QrFactor::from_parts(labels, factor.r().to_vec(), z, 0.0, factor.rows())?;
    identify(&shifted, combinations, layout, options)
}
