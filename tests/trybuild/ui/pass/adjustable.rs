//! A geometry that is an argument, under the names of the spec.

regen_runtime::robot_model!("../usage/adjustable.yaml");

use regen_runtime::Model;

fn main() {
    assert_eq!(arm::GEOMETRY, ["a"]);
    let robot = arm::Arm { geometry: arm::Geometry { a: 0.5 } };
    let mut poses = [0.0; 24];
    robot.poses(&[0.0; 2], &mut poses).unwrap();
    assert_eq!(poses[12 + 9], 0.5);
    assert_eq!(arm::poses(&[0.0; 2], &arm::Geometry::default().splat(0.0))[1][9], 0.4);
}
