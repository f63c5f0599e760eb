//! Identification among the physical parameters.

use nalgebra::{DMatrix, DVector};

use super::error::{finite, size};
use super::faces::{InteriorStart, inside};
use super::interior::{InteriorOutcome, minimise, start};
use super::problem::{Kind, Problem, Setting};
use super::psd_completion::near_reference;
use super::reduced::Directions;
use super::verdict::verdict;
use super::{BaseMap, Body, Check, FeasibilityError, Options, ParameterLayout, Verdict};
use crate::estimate::QrFactor;

/// The gap that is sought, as a part of the objective.
const GOAL: f64 = 1e-10;
/// The gap up to which a result is called the optimum, as a part of the objective.
pub const OPTIMAL: f64 = 1e-4;
/// What closeness to the reference may cost at most, as a part of the objective.
const PULL: f64 = 1e-8;
/// Where the data fit exactly: a part of the least objective that counts.
const EXACT: f64 = 1e-4;
/// What it may cost where the data fit exactly, as a part of what counts as exact.
const NOTHING: f64 = 1e-5;
/// A generous limit counts as active when the fit would gain this part of its objective by it.
const ACTIVE: f64 = 1e-6;

/// How the constraints took part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The least-squares parameters are physical themselves: nothing is lost.
    Unconstrained,
    /// Constraints or priors hold the parameters away from the least-squares ones.
    Constrained,
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
    /// The check that they are physical, made without the solver. Single parameters that a limit
    /// of [`Options::bounds`] lets be negative are none that are missing there.
    pub check: Check,
    /// How the constraints took part.
    pub outcome: Outcome,
    /// By how much of itself the objective (squared residuals, and what priors add) can be
    /// above the lowest that any physical robot has, at most: bounded from dual matrices whose
    /// eigenvalues were cut off at 0, by sums of twice the working precision, whatever the
    /// solver says of itself. The objective counts as at least 1e-8 of the squared efforts.
    pub gap: f64,
    /// The bodies that would be heavier or larger if [`sizes`](Self::sizes) did not keep them:
    /// observations that want masses without end.
    pub limited: Vec<String>,
    /// The generous limit of each body of the layout, a thousand times what is known of the robot;
    /// none where no constraint took part.
    pub sizes: Vec<SizeLimit>,
}

/// How heavy and large a body may be: `m + (Ixx + Iyy + Izz) / (2 length^2) <= mass`.
///
/// Without such a limit the best fit can be at masses without end, where it is not attained.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SizeLimit {
    /// The mass that is never exceeded, kg.
    pub mass: f64,
    /// The radius of gyration that counts as much as the mass, m.
    pub length: f64,
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

    /// Whether the gap proves that nothing fits better by more than 1e-4 of the objective.
    pub fn is_optimal(&self) -> bool {
        self.gap <= OPTIMAL
    }
}

/// Finds the physical parameters that fit observations best.
///
/// Minimises `||R B phi - z||^2`, with priors weighted by the noise, over all parameters phi
/// whose pseudo-inertias are positive semidefinite and whose single parameters are not negative
/// (Eq. 28 and 29), as one convex programme: its solution is the global one. The least-squares
/// solution is kept to rounding where it is physical.
///
/// Observations decide alone. Among the parameters that fit equally well, those are taken that
/// are close to the reference, or small: that changes the objective by less than 1e-8 of it.
/// How far the result can be from the optimum is in [`Physical::gap`].
///
/// - `factor`: R and z over the r combinations (base parameters);
/// - `combinations`: how they combine the p parameters of `layout`.
///
/// # Errors
/// When sizes or labels do not fit, a value is not finite, an entropic prior has no physical
/// reference, something that is asked for can have no effect ([`FeasibilityError::Idle`]), or the
/// constraints leave nothing ([`FeasibilityError::Contradiction`]).
///
/// ```
/// use regen_identify::estimate::QrFactor;
/// use regen_identify::feasibility::{BaseMap, ParameterLayout, Options, SYMBOLS, identify};
///
/// let labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}(1)")).collect();
/// let layout = ParameterLayout::new(&labels)?;
/// let seen = BaseMap::identity(&labels).select(&[5, 9])?;
/// // Izz and m measured, both once: the inertia came out negative
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
    let InteriorStart { problem, x: within } = inside(&setting)?;
    let lost = || FeasibilityError::Solver("no physical solution was found".to_owned());
    let first = start(&problem.objective, &problem.cones, within.clone()).ok_or_else(lost)?;
    let all = &problem.cones;
    let ended = minimise(
        &problem.objective,
        all,
        &problem.reach,
        first,
        GOAL,
        &|_| false,
    );
    let ended = ended.ok_or_else(lost)?;
    let limited = limited(&problem, layout, &ended);
    let (x, gap) = if options.rough {
        (ended.best.x.clone(), ended.gap.part())
    } else {
        closest(&problem, options, &ended)
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

/// The least sum of squares, and the rank of the observations.
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

/// The generous limits of the bodies in SI.
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

/// The bodies whose generous limits matter to the fit.
fn limited(problem: &Problem, layout: &ParameterLayout, ended: &InteriorOutcome) -> Vec<String> {
    let duals = problem.kinds.iter().zip(&ended.best.duals);
    let matters = duals.filter_map(|(kind, dual)| {
        let Kind::Size(body) = kind else { return None };
        let gain = dual[0][0] * problem.heaviest.get(*body)?;
        (gain > ACTIVE * ended.gap.value).then(|| layout.bodies().get(*body))?
    });
    matters.map(|body| body.label.clone()).collect()
}

/// Among what fits as well, what is close to the reference; and the gap of that.
///
/// The objective with a pull `w ||phi - reference||^2` is minimised again. A pull that is `PULL`
/// of the objective at the first solution can cost no more than that: at its own minimum the sum
/// is not larger than there.
fn closest(problem: &Problem, options: &Options, ended: &InteriorOutcome) -> (Vec<f64>, f64) {
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
    // where the data fit exactly the cost of a pull is of second order: more is allowed to pull,
    // as long as the cost stays nothing
    let floor = EXACT * plain.floor;
    let squares = plain.squares(&first.0);
    let exact = squares <= floor;
    let (pulls, allowed): (&[f64], f64) = if exact {
        (&[1e3, 1e2, 1e1, 1.0], NOTHING * floor)
    } else {
        (&[PULL], 2.0 * PULL * squares)
    };
    for pull in pulls {
        let weight = pull * squares.max(floor) / distance;
        let again = minimise(
            &problem.pulled(&options.reference, weight),
            &problem.cones,
            &problem.reach,
            ended.inside.clone(),
            1e-2 * PULL * squares.max(floor) / ended.gap.value,
            &|_| false,
        );
        let Some(again) = again else { continue };
        let x = again.best.x;
        let rise = objective(problem, &x) - objective(problem, &first.0);
        if rise <= allowed && far(&x) < distance {
            let whole = ended.gap.complementarity + ended.gap.left + rise.max(0.0);
            return (x, whole / ended.gap.value);
        }
    }
    first
}

/// What is minimised, up to a constant.
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

/// The parameters at a point, which are physical by their own check: where rounding takes an
/// eigenvalue to the wrong side, a little of a point well inside is mixed in.
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

/// The least-squares solution, if nothing else is wanted and it is physical.
fn least_squares_kept(
    factor: &QrFactor,
    combinations: &BaseMap,
    layout: &ParameterLayout,
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
    if wishes {
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

/// The physical parameters whose base parameters are nearest to given ones, in the norm of the
/// observations: least `||R (B phi - beta)||`.
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
