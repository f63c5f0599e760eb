//! All parameters of a physical robot with given base parameters.

use super::program::{Affine, Program};
use super::verdict::{Role, body_triangle, complete, expressions, reproduces, roles, with_leads};
use super::{BaseMap, Check, FeasibilityError, Options, ParameterLayout};

/// The tolerance of the solver: it is coarse because the free parameters only have to be plausible.
const ACCURACY: f64 = 1e-9;
/// The margin of the solution, if the set allows that much: the smallest eigenvalue of a
/// pseudo-inertia, in units of the scale.
const TARGET_MARGIN: f64 = 1e-6;

/// Among the physical robots with these base parameters, finds one whose parameters are close to
/// the reference, or small without one. [`ParameterLayout::check`] confirms that it is physical.
///
/// - `inside`: the parameters of a physical robot with these base parameters, and its margin.
///
/// The solver's result may be slightly outside the set by rounding. The set is convex, so points
/// between that result and `inside` are tried until one is physical.
pub(super) fn near_reference(
    layout: &ParameterLayout,
    combinations: &BaseMap,
    beta: &[f64],
    (inside, margin): (&[f64], f64),
    options: &Options,
) -> Result<(Vec<f64>, Check), FeasibilityError> {
    let leading = with_leads(combinations, beta)?;
    let (combinations, beta) = (&leading.combinations, leading.values.as_slice());
    let (roles, free) = roles(combinations)?;
    let units = layout.units(options.scale);
    let (expressions, free_units) = expressions(combinations, &roles, &units, beta);
    let mut program = Program::default();
    program.variables(free);
    for (j, expression) in expressions.iter().enumerate() {
        if expression.terms.is_empty() {
            continue;
        }
        let reference = options.reference.get(j).copied().flatten();
        let mut off = expression.clone();
        off.constant -= reference.unwrap_or(0.0) / units[j];
        program.square(&off);
    }
    let target = options.margin.max((margin / 2.0).min(TARGET_MARGIN));
    for body in layout.bodies() {
        let triangle = body_triangle(&expressions, &body.columns, |diagonal: &mut Affine| {
            diagonal.constant -= target;
        });
        program.semidefinite(4, &triangle);
    }
    for &j in layout.single() {
        if matches!(roles[j], Role::Free(_)) || !expressions[j].terms.is_empty() {
            program.not_negative(&expressions[j]);
        }
    }
    let solved = program.solve(ACCURACY)?;
    let values: Vec<f64> = (0..free).map(|f| solved.x[f] * free_units[f]).collect();
    let near = complete(combinations, &roles, beta, &values);
    for part in [0.0, 1e-6, 1e-4, 1e-2, 0.1, 0.5, 1.0] {
        let between = near.iter().zip(inside);
        let phi: Vec<f64> = between.map(|(a, b)| (1.0 - part) * a + part * b).collect();
        let check = layout.check(&phi, options.scale)?;
        let fits = check.is_physical() && check.margin() >= options.margin;
        if fits && reproduces(combinations, &phi, beta) {
            return Ok((phi, check));
        }
    }
    let check = layout.check(inside, options.scale)?;
    Ok((inside.to_vec(), check))
}
