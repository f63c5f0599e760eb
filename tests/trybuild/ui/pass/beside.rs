//! The macro twice for one spec, the second time under another name.

regen_runtime::robot_model!("arm.yaml");
regen_runtime::robot_model!("arm.yaml", mod manipulator);

fn main() {
    assert_eq!(arm::COORDINATES, ["q1", "q2"]);
    assert_eq!(manipulator::PARAMETERS, arm::PARAMETERS);
}
