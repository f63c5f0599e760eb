//! Identified parameters for Isaac Sim and Isaac Lab: a layer of USD with masses and inertias, and a configuration
//! of actuators with friction and inertia of the drives.

use std::fmt::Write as _;

use regen_codegen::spec::{Interval, Spec};

use crate::export::{BodyParameters, JointParameters};
use crate::pose::{M3, UNIT, product, transposed};

/// A layer of USD that gives links their identified masses, centres of mass and inertias.
///
/// - `robot`: the name of the robot in its file; `links`: the parameters of each link, in its frame.
///
/// The paths are those of Isaac Sim's importer: links below the robot, in m and kg. Principal moments are kg m^2, about
/// principal axes as a quaternion `w, x, y, z`.
///
/// ```
/// use regen_import::{BodyParameters, usd_layer};
///
/// let rod = BodyParameters {
///     mass: 2.0,
///     com: [0.0, 0.0, -0.3],
///     inertia: [0.06, 0.0, 0.0, 0.05, 0.0, 0.001],
/// };
/// let layer = usd_layer("pendulum", &[("rod".to_owned(), rod)]);
/// assert!(layer.contains("over \"rod\" (\n        prepend apiSchemas = [\"PhysicsMassAPI\"]"));
/// assert!(layer.contains("float3 physics:diagonalInertia = (0.06, 0.05, 0.001)"));
/// ```
#[must_use]
pub fn usd_layer(robot: &str, links: &[(String, BodyParameters)]) -> String {
    let mut out = String::from(
        "#usda 1.0\n(\n    doc = \"Identified masses and inertias, written by regen export\"\n",
    );
    out.push_str("    metersPerUnit = 1\n    kilogramsPerUnit = 1\n)\n\n");
    let _ = writeln!(out, "over \"{}\"\n{{", identifier(robot));
    for (name, values) in links {
        let (moments, axes) = principal(values.inertia);
        let [x, y, z] = values.com;
        let [a, b, c] = moments;
        let [w, i, j, k] = quaternion(&axes);
        let _ = writeln!(
            out,
            "    over \"{}\" (\n        prepend apiSchemas = [\"PhysicsMassAPI\"]\n    )\n    {{\n        \
             float physics:mass = {}\n        point3f physics:centerOfMass = ({x}, {y}, {z})\n        \
             float3 physics:diagonalInertia = ({a}, {b}, {c})\n        \
             quatf physics:principalAxes = ({w}, {i}, {j}, {k})\n    }}",
            identifier(name),
            values.mass,
        );
    }
    out.push_str("}\n");
    out
}

/// The configuration of actuators of Isaac Lab with identified friction and inertias of the drives, and the limits of
/// the spec, as Python.
///
/// Friction is that of Isaac Sim 5 and later, N m or N: the same at rest and in motion, since that is how it was
/// identified, and viscous. Gains stay those of the asset.
///
/// ```
/// use regen_codegen::{diag::Source, spec};
/// use regen_import::{JointParameters, isaac_lab};
///
/// let text = "name: arm\nlimbs: [{name: a, joints: [{name: q1, type: revolute, axis: z, body: b, actuated: true}]}]\n";
/// let spec = spec::parse(&Source::new("arm.yaml", text)).unwrap();
/// let joint = JointParameters { viscous: Some(1.2), coulomb: Some(0.4), ..JointParameters::default() };
/// let python = isaac_lab(&spec, &[("q1".to_owned(), joint)]);
/// assert!(python.contains("viscous_friction={\"q1\": 1.2}"));
/// assert!(python.contains("dynamic_friction={\"q1\": 0.4}"));
/// ```
#[must_use]
pub fn isaac_lab(spec: &Spec, joints: &[(String, JointParameters)]) -> String {
    let robot = &spec.name.value;
    let mut out = format!(
        "\"\"\"Identified actuators of {robot} for Isaac Lab, written by regen export.\"\"\"\n\n\
         from isaaclab.actuators import ImplicitActuatorCfg\n\n\
         ACTUATORS = {{\n    \"identified\": ImplicitActuatorCfg(\n"
    );
    let names: Vec<String> = joints.iter().map(|(name, _)| format!("{name:?}")).collect();
    let _ = writeln!(out, "        joint_names_expr=[{}],", names.join(", "));
    out.push_str("        # those of the asset\n        stiffness=None,\n        damping=None,\n");
    let mut row = |key: &str, value: &dyn Fn(&str, &JointParameters) -> Option<f64>| {
        let entries = joints
            .iter()
            .filter_map(|(name, own)| Some(format!("{name:?}: {}", value(name, own)?)));
        let entries: Vec<String> = entries.collect();
        if !entries.is_empty() {
            let _ = writeln!(out, "        {key}={{{}}},", entries.join(", "));
        }
    };
    row("armature", &|_, own| own.armature);
    row("friction", &|_, own| own.coulomb);
    row("dynamic_friction", &|_, own| own.coulomb);
    row("viscous_friction", &|_, own| own.viscous);
    let limits = |name: &str| {
        let mut all = spec.limbs.iter().flat_map(|limb| &limb.joints);
        let own = all.find(|joint| joint.name.as_ref().is_some_and(|own| own.value == name))?;
        Some(&own.limits)
    };
    let largest = |own: &Option<Interval>| {
        let own = own.as_ref()?;
        Some(
            own.iter()
                .fold(0.0_f64, |most, own| most.max(own.value.to_f64().abs())),
        )
    };
    row("effort_limit_sim", &|name, _| {
        largest(&limits(name)?.effort)
    });
    row("velocity_limit_sim", &|name, _| {
        largest(&limits(name)?.velocity)
    });
    out.push_str("    ),\n}\n");
    out
}

/// A name as USD allows it: letters, digits and `_`, no digit first.
fn identifier(name: &str) -> String {
    let fits = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let own: String = name.chars().map(fits).collect();
    if own.starts_with(|c: char| c.is_ascii_digit()) || own.is_empty() {
        format!("_{own}")
    } else {
        own
    }
}

/// The principal moments of a tensor `xx xy xz yy yz zz` and its principal axes as the columns of a rotation, by
/// Jacobi's method (Golub and Van Loan, Matrix Computations, section 8.5).
pub(crate) fn principal(tensor: [f64; 6]) -> ([f64; 3], M3) {
    let [xx, xy, xz, yy, yz, zz] = tensor;
    let mut own = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let mut axes = UNIT;
    let size = tensor.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    // three sweeps are enough; the bound is for tensors that are no numbers
    for _ in 0..12 {
        for (p, q, rest) in [(0, 1, 2), (0, 2, 1), (1, 2, 0)] {
            if own[p][q].abs() <= f64::EPSILON * f64::EPSILON * size {
                continue;
            }
            let theta = (own[q][q] - own[p][p]) / (2.0 * own[p][q]);
            let t = theta.signum() / (theta.abs() + libm::sqrt(theta * theta + 1.0));
            let c = 1.0 / libm::sqrt(t * t + 1.0);
            let mut turn = UNIT;
            (turn[p][p], turn[q][q], turn[p][q], turn[q][p]) = (c, c, t * c, -t * c);
            own = product(&product(&transposed(&turn), &own), &turn);
            axes = product(&axes, &turn);
            own[p][q] = 0.0;
            own[q][p] = 0.0;
            own[rest][p] = own[p][rest];
            own[rest][q] = own[q][rest];
        }
    }
    ([own[0][0], own[1][1], own[2][2]], axes)
}

/// The quaternion `w, x, y, z` of a rotation, with `w` at least 0.
pub(crate) fn quaternion(r: &M3) -> [f64; 4] {
    // the largest of four times the squares decides, so that nothing cancels
    let [[a, b, c], [d, e, f], [g, h, i]] = *r;
    let squares = [
        1.0 + a + e + i,
        1.0 + a - e - i,
        1.0 - a + e - i,
        1.0 - a - e + i,
    ];
    let rows = [
        [squares[0], h - f, c - g, d - b],
        [h - f, squares[1], b + d, c + g],
        [c - g, b + d, squares[2], f + h],
        [d - b, c + g, f + h, squares[3]],
    ];
    let best = (0..4).fold(0, |m, k| if squares[k] > squares[m] { k } else { m });
    let scale = 0.5 / libm::sqrt(squares[best]);
    let sign = if rows[best][0] < 0.0 { -scale } else { scale };
    rows[best].map(|x| if x == 0.0 { 0.0 } else { sign * x })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::from_quaternion;

    #[test]
    fn moments_about_principal_axes_are_those_of_the_tensor() {
        for tensor in [
            [0.3, 0.01, -0.02, 0.25, 0.03, 0.2],
            [0.06, 0.0, 0.0, 0.06, 0.0, 0.001],
            [1.0, 0.5, 0.5, 1.0, 0.5, 1.0],
            [2.0, 0.0, -0.7, 3.0, 0.0, 2.0],
        ] {
            let (moments, axes) = principal(tensor);
            let q = quaternion(&axes);
            assert!((q.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-14 && q[0] >= 0.0);
            let Some(r) = from_quaternion(q) else {
                panic!("{q:?}")
            };
            let entry = |i: usize, j: usize| -> f64 {
                (0..3).map(|k| r[i][k] * moments[k] * r[j][k]).sum()
            };
            let found = [
                entry(0, 0),
                entry(0, 1),
                entry(0, 2),
                entry(1, 1),
                entry(1, 2),
                entry(2, 2),
            ];
            for (own, given) in found.iter().zip(&tensor) {
                assert!((own - given).abs() < 1e-14, "{found:?} {tensor:?}");
            }
        }
    }

    #[test]
    fn names_are_identifiers() {
        for (name, expected) in [
            ("arm", "arm"),
            ("arm 2/left", "arm_2_left"),
            ("3rps", "_3rps"),
            ("", "_"),
        ] {
            assert_eq!(identifier(name), expected);
        }
    }
}
