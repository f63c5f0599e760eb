//! Verdicts: physical parameters are found feasible, others are proven infeasible.

use proptest::prelude::*;
use regen_identify::feasibility::{
    BaseMap, InfeasibilityCertificate, ParameterLayout, SYMBOLS, Scale, Verdict, bodies_yaml,
    pseudo_inertia, verdict,
};

use crate::robots::{Robot, robot};

/// Eq. 28 and the triangle inequality about the centre of mass, written out: an independent test of
/// whether a body is physical.
fn eq_28(ten: &[f64; 10]) -> bool {
    let [ixx, ixy, ixz, iyy, iyz, izz, mx, my, mz, m] = *ten;
    let (x, y, z) = (mx / m, my / m, mz / m);
    let (a, b, c) = (
        ixx - m * (y * y + z * z),
        iyy - m * (x * x + z * z),
        izz - m * (x * x + y * y),
    );
    let (d, e, f) = (ixy + m * x * y, ixz + m * x * z, iyz + m * y * z);
    // the triangle inequality for all axes: trace/2 - I is positive definite
    let t = (a + b + c) / 2.0;
    let minors = |a: f64, b: f64, c: f64, d: f64, e: f64, f: f64| {
        let det = a * b * c + 2.0 * d * e * f - a * f * f - b * e * e - c * d * d;
        a > 0.0 && a * b - d * d > 0.0 && det > 0.0
    };
    m > 0.0 && minors(a, b, c, d, e, f) && minors(t - a, t - b, t - c, -d, -e, -f)
}

fn tens(robot: &Robot, phi: &[f64]) -> Vec<[f64; 10]> {
    let bodies = robot.layout.bodies().iter();
    bodies.map(|b| b.columns.map(|c| phi[c])).collect()
}

/// Whether parameters have these base parameters, up to the rounding of sums: free parameters may
/// be a million times larger than the observed ones, where the margin is the largest.
fn reproduces(robot: &Robot, phi: &[f64], beta: &[f64]) -> bool {
    let mut rows = robot.combinations.rows().iter().zip(beta);
    rows.all(|(row, b)| {
        let terms: Vec<f64> = row.iter().zip(phi).map(|(f, x)| f * x).collect();
        let size: f64 = terms.iter().map(|t| t.abs()).sum();
        (terms.iter().sum::<f64>() - b).abs() <= 2e-11 * size.max(b.abs())
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn every_physical_robot_is_found_feasible(robot in robot()) {
        let Verdict::Feasible { phi, margin } =
            verdict(&robot.layout, &robot.combinations, &robot.beta(), Scale::default()).unwrap()
        else {
            panic!("a physical robot has these base parameters");
        };
        prop_assert!(margin > 0.0);
        for ten in tens(&robot, &phi) {
            prop_assert!(eq_28(&ten), "Eq. 28 holds of {:?}", ten);
        }
        prop_assert!(reproduces(&robot, &phi, &robot.beta()));
    }

    /// Moves a robot out of the feasible set along a direction in which no physical robot lies.
    #[test]
    fn parameters_that_no_bodies_have_are_proven_infeasible(robot in robot(), far in 0.01..3.0_f64) {
        // with all parameters observed, the border of the set is that of the bodies themselves
        let all = BaseMap::identity(robot.layout.labels());
        let scale = Scale::default();
        let mut phi = robot.phi.clone();
        let body = &robot.layout.bodies()[0];
        let ten = body.columns.map(|c| phi[c]);
        // mass taken away until the smallest eigenvalue is -far
        let mut low = 0.0;
        let mut high = ten[9] + 10.0 * far;
        for _ in 0..80 {
            let middle = f64::midpoint(low, high);
            let mut less = ten;
            less[9] -= middle;
            if scale.smallest_eigenvalue(&less) < -far { high = middle } else { low = middle }
        }
        phi[body.columns[9]] -= high;
        let Verdict::Infeasible { certificate } =
            verdict(&robot.layout, &all, &phi, scale).unwrap()
        else {
            panic!("no physical body has these parameters");
        };
        // the functional of the proof is positive for the physical robot and negative for this one
        let sum = |phi: &[f64]| certificate.weights.iter().zip(phi).map(|(w, x)| w * x).sum::<f64>();
        prop_assert!(sum(&phi) < 0.0);
        prop_assert!(sum(&robot.phi) > 0.0);
    }

    /// For random base parameters every verdict is right.
    #[test]
    fn no_verdict_is_wrong(robot in robot(), noise in prop::collection::vec(-1.0..1.0_f64, 44), size in 0.0..3.0_f64) {
        let beta: Vec<f64> =
            robot.beta().iter().zip(&noise).map(|(b, n)| b * (1.0 + size * n)).collect();
        let scale = Scale::default();
        match verdict(&robot.layout, &robot.combinations, &beta, scale).unwrap() {
            Verdict::Feasible { phi, .. } => {
                prop_assert!(tens(&robot, &phi).iter().all(eq_28));
                prop_assert!(robot.layout.single().iter().all(|c| phi[*c] >= 0.0));
                prop_assert!(reproduces(&robot, &phi, &beta));
            }
            Verdict::Infeasible { certificate } => {
                let again = InfeasibilityCertificate::new(
                    &robot.layout, &robot.combinations, &beta, scale, certificate.weights.clone(),
                ).unwrap();
                prop_assert_eq!(&again, &certificate);
                prop_assert!(again.value < 0.0 && again.escape() >= 1e6);
                // no physical robot's base parameters make the functional negative
                let on_true: f64 =
                    certificate.weights.iter().zip(robot.beta()).map(|(w, b)| w * b).sum();
                prop_assert!(on_true > -1e-6 * certificate.value.abs());
            }
            Verdict::Undecided { margin } => {
                prop_assert!(margin.abs() < 1e-6, "only the border is undecided: {}", margin);
            }
        }
    }
}

#[test]
fn a_pseudo_inertia_is_the_integral_that_defines_it() {
    // 2 kg at (1, 2, 3) and 1 kg at (-1, 0, 1)
    let mut expected = [[0.0; 4]; 4];
    let mut ten = [0.0; 10];
    for (m, [x, y, z]) in [(2.0, [1.0, 2.0, 3.0]), (1.0, [-1.0, 0.0, 1.0])] {
        let r = [x, y, z, 1.0];
        for a in 0..4 {
            for b in 0..4 {
                expected[a][b] += m * r[a] * r[b];
            }
        }
        let more = [
            m * (y * y + z * z),
            -m * x * y,
            -m * x * z,
            m * (x * x + z * z),
            -m * y * z,
            m * (x * x + y * y),
            m * x,
            m * y,
            m * z,
            m,
        ];
        for (sum, x) in ten.iter_mut().zip(more) {
            *sum += x;
        }
    }
    assert_eq!(
        format!("{:?}", pseudo_inertia(&ten)),
        format!("{expected:?}")
    );
}

#[test]
fn negative_friction_is_infeasible_by_itself() {
    let mut labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}(1)")).collect();
    labels.push("Fv(q1)".to_owned());
    let layout = ParameterLayout::new(&labels).unwrap();
    let all = BaseMap::identity(&labels);
    let mut phi = [0.1, 0.0, 0.0, 0.1, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0, -2.0];
    let Verdict::Infeasible { certificate } =
        verdict(&layout, &all, &phi, Scale::default()).unwrap()
    else {
        panic!("negative friction");
    };
    assert!((certificate.value + 2.0).abs() < 1e-15 && certificate.escape().is_infinite());
    phi[10] = 0.0;
    assert!(
        verdict(&layout, &all, &phi, Scale::default())
            .unwrap()
            .is_feasible()
    );
}

#[test]
fn misuse_is_an_error_and_not_a_verdict() {
    let labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}(1)")).collect();
    let layout = ParameterLayout::new(&labels).unwrap();
    let all = BaseMap::identity(&labels);
    assert!(verdict(&layout, &all, &[1.0; 9], Scale::default()).is_err());
    assert!(verdict(&layout, &all, &[f64::NAN; 10], Scale::default()).is_err());
    let none = Scale {
        mass: 0.0,
        length: 1.0,
    };
    assert!(verdict(&layout, &all, &[1.0; 10], none).is_err());
    assert!(
        ParameterLayout::new(&labels[1..]).is_err(),
        "a body without Ixx"
    );
    assert!(
        ParameterLayout::new(&[labels.clone(), labels].concat()).is_err(),
        "labels twice"
    );
}

#[test]
fn a_body_in_yaml_has_its_inertia_about_its_own_centre() {
    let layout = ParameterLayout::new(&crate::robots::labels(1)).unwrap();
    // in binary fractions, so that nothing is rounded
    let (m, [x, y, z]) = (2.0, [0.5, 0.25, -0.125]);
    let own = [0.5, 0.125, -0.0625, 0.75, 0.03125, 1.0];
    let phi = [
        own[0] + m * (y * y + z * z),
        own[1] - m * x * y,
        own[2] - m * x * z,
        own[3] + m * (x * x + z * z),
        own[4] - m * y * z,
        own[5] + m * (x * x + y * y),
        m * x,
        m * y,
        m * z,
        m,
        0.0,
    ];
    let text = bodies_yaml(&layout, &phi[..layout.len()]).unwrap();
    assert_eq!(
        text,
        "bodies:\n  1: {mass: 2.0, com: [0.5, 0.25, -0.125], \
         inertia: [0.5, 0.125, -0.0625, 0.75, 0.03125, 1.0]}\n"
    );
}
