//! Reversals of coordinates that are not logged and follow logged ones by constant factors.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fmt::Write as _;
use std::path::PathBuf;

use regen_codegen::diag::Source;
use regen_codegen::pipeline::derive;
use regen_codegen::robot::Robot;
use regen_identify::data::{Logs, Run, Settings};
use regen_identify::identify::{EquationKind, NoColumns, equations};
use regen_identify::states::Source as LogSource;
use regen_interpreted::{BaseTerms, Interpreted};
use regen_runtime::Model;

/// An arm whose second joint is moved by a motor at the base.
const BELT: &str = "\
name: belt
gravity: [0, -9.81, 0]
limbs:
  - name: arm
    joints:
      - {name: q1, type: revolute, body: a, actuated: true}
      - {name: p, type: revolute, dh: {a: 0.4}, body: b, friction: coulomb}
  - name: motor
    joints:
      - {name: q2, type: revolute, actuated: true, rotor_inertia: true}
couplings: {p: q2 - q1}
independent: [q1, q2]
bodies:
  a: {mass: 2, com: [0.2, 0, 0], inertia: [0.01, 0, 0, 0.02, 0, 0.02]}
  b: {mass: 1, com: [0.1, 0, 0], inertia: [0.01, 0, 0, 0.02, 0, 0.02]}
";

/// The velocity of p.
fn rate(t: f64) -> f64 {
    0.3 * (2.0 * t).cos()
}

/// The position and the velocity of q1 at a mean speed: a straight line would look like the steps of an
/// encoder.
fn first(speed: f64, t: f64) -> [f64; 2] {
    let (s, c) = (1.3 * t).sin_cos();
    [speed * (t + 0.4 * s), speed * (1.0 + 0.52 * c)]
}

/// A log of q1 and of p, or of q2, which is the sum of both.
fn log(name: &str, second: &str, speed: f64) -> PathBuf {
    let mut text = format!("t,q1,{second},tau_q1,tau_q2\n");
    for k in 0..800 {
        let t = 0.01 * f64::from(k);
        let (q1, p) = (first(speed, t)[0], 0.15 * (2.0 * t).sin());
        let other = if second == "p" { p } else { q1 + p };
        writeln!(text, "{t:.2},{q1},{other},{},{p}", t.cos()).unwrap();
    }
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&path, text).unwrap();
    path
}

/// For each row its time, which coordinates rest, and which equations are used.
fn rows(spec: &str, log: PathBuf) -> Vec<(f64, Vec<bool>, Vec<bool>)> {
    let robot: Robot = derive(&Source::new("belt.yaml", spec)).unwrap();
    let terms = BaseTerms::new(&robot);
    let model = Interpreted::with_terms(&robot, &terms);
    let info = Model::<f64>::info(&model);
    assert_eq!(info.coordinates, ["q1", "p", "q2"]);
    let mut logs = Logs::open(&model, &[Run::from(log)], &Settings::default()).unwrap();
    let mut out = Vec::new();
    logs.visit(&mut |row| {
        out.push((row.time, row.at_standstill.to_vec(), Vec::new()));
        Ok(())
    })
    .unwrap();
    let mut place = 0;
    let forces = EquationKind::Forces;
    equations(&model, forces, &mut logs, &mut NoColumns, &mut |found| {
        out[place].2 = found.weights.iter().map(|weight| *weight > 0.0).collect();
        place += 1;
        Ok(())
    })
    .unwrap();
    assert_eq!(place, out.len());
    out
}

#[test]
fn a_coupled_joint_rests_where_it_reverses_and_its_equations_are_left_out() {
    let found = rows(BELT, log("belt.csv", "q2", 1.0));
    let mut rested = 0;
    for (t, rests, used) in &found {
        let [q1, p, q2] = rests[..] else { panic!() };
        assert!(!q1 && !q2, "{t}");
        rested += usize::from(p);
        // a twentieth of the root of 1.14 and 1.18, the mean squares of both measured velocities, is 0.076
        if rate(*t).abs() < 0.07 {
            assert!(p, "{t}");
        } else if rate(*t).abs() > 0.085 {
            assert!(!p, "{t}");
        }
        // its friction acts on both
        assert_eq!(used, &[!p, !p], "{t}");
    }
    // five reversals, at each a change of the velocity by 0.15 rad/s at 0.6 rad/s^2
    assert!((100..150).contains(&rested), "{rested}");
}

#[test]
fn without_friction_no_coupled_joint_rests() {
    let bare = BELT.replace(", friction: coulomb", "");
    for (_, rests, used) in rows(&bare, log("belt_bare.csv", "q2", 1.0)) {
        assert!(!rests.contains(&true) && used == [true; 2]);
    }
}

/// The motor rubs, and the joint's position is logged in place of its own.
#[test]
fn a_motor_rests_by_the_positions_of_the_joints() {
    let bare = BELT.replace(", friction: coulomb", "");
    let motor = bare.replace(
        "rotor_inertia: true}",
        "rotor_inertia: true, friction: coulomb}",
    );
    for (t, rests, _) in rows(&motor, log("belt_fast.csv", "p", 1.0)) {
        assert!(!rests[2], "{t}");
    }
    // at this speed it reverses
    let mut rested = 0;
    for (t, rests, used) in rows(&motor, log("belt_motor.csv", "p", 0.3)) {
        let slow = (first(0.3, t)[1] + rate(t)).abs();
        rested += usize::from(rests[2]);
        // a twentieth of the root of 0.10 and 0.045 is 0.019, and derivatives mix 0.03 s at 0.8 rad/s^2
        if !(0.015..0.03).contains(&slow) {
            assert_eq!(rests[2], slow < 0.015, "{t}");
        }
        assert_eq!(used, [true, !rests[2]], "{t}");
    }
    assert!(rested > 10, "{rested}");
}
