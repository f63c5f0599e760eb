//! Identification of the physical parameters that fit observations best.
//!
//! The objective is the sum of squared residuals plus the terms of priors. The relative duality gap
//! is an upper bound, computed from dual matrices, on how far the objective of a result is above
//! the minimum, as a fraction of the objective.

use nalgebra::{DMatrix, DVector};

use super::closest::{closest_to_reference, objective};
use super::error::{finite, size};
use super::faces::{InteriorStart, find_interior_point};
use super::interior::{InteriorOutcome, Precision, minimise, start};
use super::known::{Central, Known, Similar, Starts};
use super::problem::{Kind, Problem, Setting};
use super::psd_completion::near_reference;
use super::reduced::PseudoInverse;
use super::verdict::verdict;
use super::{
    BaseMap, Body, Check, FeasibilityError, InertialParameters, InfeasibilityCertificate, Options,
    ParameterLayout, Verdict,
};
use crate::estimate::QrFactor;

/// The interior-point method stops at this relative duality gap.
pub(super) const TARGET_GAP: f64 = 1e-10;
/// A fit that starts near a similar one starts again well inside the cones if it ends with more than
/// this many times the gap at which it should stop.
const MAX_NEAR_RATIO: f64 = 10.0;
/// The largest relative duality gap at which a result counts as the optimum.
pub const MAX_OPTIMAL_GAP: f64 = 1e-4;
/// A safety limit ([`SizeLimit`]) counts as active when lifting it would lower the objective by
/// more than this fraction of it.
const MIN_ACTIVE_GAIN: f64 = 1e-6;
/// A body is at its safety limit if it is larger than this part of it. The choice among parameters that
/// fit equally well gives up far less than the last tenth of an active limit.
const MIN_ACTIVE_PART: f64 = 0.9;

/// Whether constraints or priors changed the least-squares solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The least-squares parameters are physical: the residuals are those of least squares.
    Unconstrained,
    /// Constraints or priors keep the parameters away from the least-squares solution.
    Constrained,
}

/// The physical parameters of a robot that fit observations best.
#[derive(Clone, Debug, PartialEq)]
pub struct PhysicalFit {
    /// All p parameters, SI.
    pub phi: Vec<f64>,
    /// The r base parameters, SI: those of `phi` or, if the outcome is [`Outcome::Unconstrained`],
    /// those of least squares, unchanged.
    pub beta: Vec<f64>,
    /// The sum of squared residuals of `beta`, in the units of the factor: of efforts in N or N m
    /// that are each divided by its standard deviation, it has no unit.
    pub squared_residual: f64,
    /// The sum of squared residuals of least squares without constraints, which is the smallest
    /// possible.
    pub least_squares_residual: f64,
    /// The check that `phi` is physical, computed without the solver. Its list of
    /// negative parameters omits those for which a limit in [`Options::bounds`] allows negative
    /// values.
    pub check: Check,
    /// Whether constraints or priors changed the least-squares solution.
    pub outcome: Outcome,
    /// The relative duality gap: an upper bound on how far the objective (squared residuals plus
    /// the terms of priors) is above its minimum over all physical robots, divided by the squared
    /// residuals plus the quadratic terms of priors, or by 1e-8 of the squared efforts if that is
    /// larger. The bound is computed from dual matrices whose eigenvalues were cut off at 0, by
    /// sums of twice the working precision, and does not rely on what the solver reports. 0 if the
    /// outcome is [`Outcome::Unconstrained`].
    pub gap: f64,
    /// The labels of the bodies that would be heavier or larger without the safety limits in
    /// [`sizes`](Self::sizes): the observations alone would make their masses infinite.
    pub limited: Vec<String>,
    /// The safety limit of each body of the layout; empty if the outcome is
    /// [`Outcome::Unconstrained`].
    pub sizes: Vec<SizeLimit>,
}

/// A safety limit: how heavy and large a body may be, `m + (Ixx + Iyy + Izz) / (2 length^2) <=
/// mass`. The limit of the mass is a thousand times the largest known mass of the robot.
///
/// Without such a limit the best fit can be at infinite masses, so that no best fit exists.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SizeLimit {
    /// The upper limit of the mass, kg.
    pub mass: f64,
    /// The radius of gyration at which the inertia counts as much as the mass, m.
    pub length: f64,
}

impl SizeLimit {
    /// The size of a body as a part of this limit.
    fn part(&self, phi: &InertialParameters) -> f64 {
        let [xx, _, _, yy, _, zz, .., m] = phi;
        (m + (xx + yy + zz) / (2.0 * self.length * self.length)) / self.mass
    }
}

impl PhysicalFit {
    /// The relative rise of the root mean square residual above that of least squares without
    /// constraints: the cost of being physical.
    pub fn rise(&self) -> f64 {
        if self.least_squares_residual > 0.0 {
            (self.squared_residual / self.least_squares_residual).sqrt() - 1.0
        } else {
            0.0
        }
    }

    /// Whether the relative duality gap proves that no physical parameters lower the objective by
    /// more than 1e-4 of it.
    pub fn is_optimal(&self) -> bool {
        self.gap <= MAX_OPTIMAL_GAP
    }
}

/// Finds the physical parameters that fit observations best.
///
/// Minimises `||R B phi - z||^2`, with priors weighted by the noise, over all parameters phi whose
/// pseudo-inertias are positive semidefinite and whose single parameters (friction, rotors) are not
/// negative (Eq. 28 and 29), as one convex programme: its solution is the global one. If there are
/// no priors and no further constraints, and the least-squares solution is physical, its base
/// parameters are returned unchanged; otherwise those of the fit, which agree with a physical
/// least-squares solution up to the tolerance of the fit.
///
/// Only the observations decide the fit. Among the parameters that fit equally well, the result is
/// close to the reference, or small without one: that choice raises the objective by at most 2e-8
/// of it. [`PhysicalFit::gap`] bounds how far the result is from the optimum.
///
/// - `factor`: R (r x r) and z (r) of the observations, over the r base parameters;
/// - `combinations`: B (r x p), which expresses the base parameters as combinations of the p
///   parameters of `layout`.
///
/// # Errors
/// - [`FeasibilityError::Size`], [`Unknown`](FeasibilityError::Unknown),
///   [`Duplicate`](FeasibilityError::Duplicate): sizes or labels do not fit;
/// - [`FeasibilityError::NotFinite`]: a value is not finite; or the margin, the entropic weight or
///   the noise is negative, or a unit of the scale is not positive;
/// - [`FeasibilityError::Reference`]: an entropic prior has no physical reference;
/// - [`FeasibilityError::Idle`]: a constraint can have no effect;
/// - [`FeasibilityError::Contradiction`]: the constraints admit no parameters;
/// - [`FeasibilityError::Solver`]: the interior-point method found no solution;
/// - [`FeasibilityError::Estimate`]: the base parameters or residuals cannot be computed from the
///   factor.
///
/// ```
/// use regen_identify::estimate::QrFactor;
/// use regen_identify::feasibility::{BaseMap, ParameterLayout, Options, SYMBOLS, identify};
///
/// let labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}(1)")).collect();
/// let layout = ParameterLayout::new(&labels)?;
/// let measured = BaseMap::identity(&labels).select(&[5, 9])?;
/// // Izz and m, each measured once: the measured inertia is negative
/// let mut factor = QrFactor::new(measured.labels().to_vec());
/// factor.push_block(&[1.0, 0.0, 0.0, 1.0], &[-0.01, 2.0])?;
/// let physical = identify(&factor, &measured, &layout, &Options::default())?;
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
) -> Result<PhysicalFit, FeasibilityError> {
    identify_like(factor, combinations, layout, options, &Known::default())
}

/// As [`identify`], with the results of fits to similar observations. A start near a similar fit is
/// quick and proves nothing: [`PhysicalFit::gap`] is then infinite.
pub(crate) fn identify_like(
    factor: &QrFactor,
    combinations: &BaseMap,
    layout: &ParameterLayout,
    options: &Options,
    known: &Known,
) -> Result<PhysicalFit, FeasibilityError> {
    Ok(fitted(factor, combinations, layout, options, known)?.0)
}

/// As [`identify`], with the certificate that no physical robot has the least-squares parameters, if
/// there is one; also returns what fits of similar observations may begin from.
pub(crate) fn identify_first(
    factor: &QrFactor,
    combinations: &BaseMap,
    layout: &ParameterLayout,
    options: &Options,
    certificate: Option<&InfeasibilityCertificate>,
) -> Result<(PhysicalFit, Option<Known>), FeasibilityError> {
    let known = Known::certified(certificate);
    let (fit, similar) = fitted(factor, combinations, layout, options, &known)?;
    Ok((fit, similar.map(|similar| known.with(similar))))
}

/// The fit and, where constraints change least squares, the points that others may begin from.
fn fitted(
    factor: &QrFactor,
    combinations: &BaseMap,
    layout: &ParameterLayout,
    options: &Options,
    known: &Known,
) -> Result<(PhysicalFit, Option<Similar>), FeasibilityError> {
    let p = layout.len();
    let r = combinations.rows().len();
    size("parameters", p, combinations.parameters())?;
    size("factor", r, factor.columns())?;
    if !options.reference.is_empty() {
        size("reference", p, options.reference.len())?;
    }
    let not_negative = |what, x: f64| {
        let is_valid = x.is_finite() && x >= 0.0;
        is_valid
            .then_some(())
            .ok_or(FeasibilityError::NotFinite { what, index: 0 })
    };
    not_negative("margin", options.margin)?;
    not_negative("entropic", options.entropic)?;
    not_negative("noise", options.noise.unwrap_or(1.0))?;
    if !options.scale.is_valid() {
        return Err(FeasibilityError::NotFinite {
            what: "scale",
            index: 0,
        });
    }

    if let Some(fit) = physical_least_squares(factor, combinations, layout, options, known)? {
        return Ok((fit, None));
    }
    let setting = Setting::new(factor, combinations, layout, options);
    let least_squares_residual = least_squares_residual(factor).0;
    let no_solution = || FeasibilityError::Solver("no physical solution was found".to_owned());
    let Starts {
        problem,
        inside,
        central,
        goal,
    } = if let Some(starts) = known.starts(&setting)? {
        starts
    } else {
        let InteriorStart { problem, x } = find_interior_point(&setting)?;
        Starts {
            problem,
            inside: x,
            central: None,
            goal: TARGET_GAP,
        }
    };
    let minimum = least(&problem, &inside, central, goal).ok_or_else(no_solution)?;
    let (x, gap) = if options.rough {
        (minimum.best.x.clone(), minimum.gap.part())
    } else {
        closest_to_reference(&problem, options, &minimum)
    };
    let (phi, check, physical_x) =
        physical_parameters(&problem, layout, options, &x, &inside).ok_or_else(no_solution)?;
    let rise = objective(&problem, &physical_x) - objective(&problem, &x);
    let gap = gap + rise.max(0.0) / minimum.gap.value;
    finite("solution", &phi).map_err(|_| no_solution())?;
    let beta = combinations.apply(&phi)?;
    let sizes = size_limits(&problem, layout);
    let limited = bodies_at_limit(&problem, layout, &minimum, (&phi, &sizes));
    let fit = PhysicalFit {
        squared_residual: factor.squared_residual(&beta)?,
        beta,
        phi,
        least_squares_residual,
        check,
        outcome: Outcome::Constrained,
        gap,
        limited,
        sizes,
    };
    let central = Some(Central::of(minimum));
    let similar = Similar::new(setting.noise, problem, inside, central);
    Ok((fit, Some(similar)))
}

/// The minimum of a problem: from the central start if that leads there, which is quicker but proves
/// nothing, and else from the point well inside the cones.
fn least(
    problem: &Problem,
    inside: &[f64],
    central: Option<Central>,
    goal: f64,
) -> Option<InteriorOutcome> {
    let Problem {
        objective,
        cones,
        reach,
        ..
    } = problem;
    let near = central.and_then(|central| {
        let Central { point, reach } = central;
        let quick = (goal, Precision::Quick);
        let mut found = minimise(objective, cones, &reach, point, quick, &|_| false)?;
        if found.gap.part() > MAX_NEAR_RATIO * goal {
            return None;
        }
        found.gap.unbalanced = f64::INFINITY;
        Some(found)
    });
    near.or_else(|| {
        let point = start(objective, cones, inside.to_vec())?;
        let full = (TARGET_GAP, Precision::Full);
        minimise(objective, cones, reach, point, full, &|_| false)
    })
}

impl<'a> Setting<'a> {
    /// The noise is that of the options, or that of the residuals of least squares.
    pub(super) fn new(
        factor: &'a QrFactor,
        combinations: &'a BaseMap,
        layout: &'a ParameterLayout,
        options: &'a Options,
    ) -> Self {
        let (least_squares_residual, rank) = least_squares_residual(factor);
        let degrees_of_freedom = factor.rows().saturating_sub(rank).max(1);
        let noise = (least_squares_residual / degrees_of_freedom as f64).sqrt();
        Setting {
            factor,
            combinations,
            layout,
            options,
            noise: options.noise.unwrap_or(noise),
        }
    }
}

/// The sum of squared residuals of least squares, and the rank of the observations.
fn least_squares_residual(factor: &QrFactor) -> (f64, usize) {
    if factor.solve().is_ok() {
        return (factor.rss(), factor.columns());
    }
    let r = factor.columns();
    let a = DMatrix::from_column_slice(r, r, factor.r());
    let z = DVector::from_column_slice(factor.z());
    let spectrum = PseudoInverse::of(&a);
    let residual = &a * spectrum.solve(&z) - z;
    (residual.norm_squared() + factor.rss(), spectrum.rank)
}

/// The safety limits of the bodies, SI.
fn size_limits(problem: &Problem, layout: &ParameterLayout) -> Vec<SizeLimit> {
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

/// The labels of the bodies whose safety limits are active at the minimum, and that have come near them:
/// duals of a minimum that was not reached say nothing.
///
/// - `phi`, `sizes`: the p parameters, SI, and the limit of each body.
fn bodies_at_limit(
    problem: &Problem,
    layout: &ParameterLayout,
    minimum: &InteriorOutcome,
    (phi, sizes): (&[f64], &[SizeLimit]),
) -> Vec<String> {
    let duals = problem.kinds.iter().zip(&minimum.best.duals);
    let active = duals.filter_map(|(kind, dual)| {
        let Kind::Size(body) = kind else { return None };
        let gain = dual[0][0] * problem.heaviest.get(*body)?;
        let (own, limit) = (layout.bodies().get(*body)?, sizes.get(*body)?);
        let near = limit.part(&own.columns.map(|c| phi[c])) > MIN_ACTIVE_PART;
        (near && gain > MIN_ACTIVE_GAIN * minimum.gap.value).then_some(own)
    });
    active.map(|body| body.label.clone()).collect()
}

/// The parameters at a point of the problem's variables, the check that they are physical, and the
/// point that they belong to. If rounding makes an eigenvalue negative, the point is moved towards
/// the interior point by a small fraction of the way.
fn physical_parameters(
    problem: &Problem,
    layout: &ParameterLayout,
    options: &Options,
    x: &[f64],
    interior_point: &[f64],
) -> Option<(Vec<f64>, Check, Vec<f64>)> {
    for fraction in [0.0, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8] {
        let mixed: Vec<f64> = x
            .iter()
            .zip(interior_point)
            .map(|(a, b)| a + fraction * (b - a))
            .collect();
        let mut phi = problem.expand(&mixed);
        for (label, value) in &options.known {
            if let Ok(j) = layout.find(label) {
                phi[j] = *value;
            }
        }
        let mut check = layout.check(&phi, options.scale).ok()?;
        check.negative.retain(|label| {
            let bound = options.bounds.iter().find(|b| b.parameter == *label);
            let value = layout.find(label).ok().and_then(|j| phi.get(j));
            !bound.is_some_and(|b| value.is_some_and(|x| *x >= b.lowest))
        });
        if check.is_physical() && check.margin() >= options.margin {
            return Some((phi, check, mixed));
        }
    }
    None
}

/// The least-squares solution, if it is physical and there are no priors or further constraints.
fn physical_least_squares(
    factor: &QrFactor,
    combinations: &BaseMap,
    layout: &ParameterLayout,
    options: &Options,
    known: &Known,
) -> Result<Option<PhysicalFit>, FeasibilityError> {
    let Ok(beta) = factor.solve() else {
        return Ok(None);
    };
    if options.has_constraints() {
        return Ok(None);
    }
    if known.refutes(layout, combinations, &beta, options.scale)? {
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
        let interior_point = (phi.as_slice(), margin);
        near_reference(layout, combinations, &beta, interior_point, options)?
    };
    let squared_residual = factor.squared_residual(&beta)?;
    Ok(Some(PhysicalFit {
        phi,
        beta,
        squared_residual,
        least_squares_residual: squared_residual,
        check,
        outcome: Outcome::Unconstrained,
        gap: 0.0,
        limited: Vec::new(),
        sizes: Vec::new(),
    }))
}

/// Finds the physical parameters whose base parameters are nearest to given ones, in the norm of
/// the observations: it minimises `||R (B phi - beta)||`, with `factor` and `combinations` as in
/// [`identify`]. The z of the factor is not used.
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
) -> Result<PhysicalFit, FeasibilityError> {
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
