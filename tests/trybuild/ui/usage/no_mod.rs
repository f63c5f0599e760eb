regen_runtime::robot_model!("../pass/arm.yaml", manipulator);

fn main() {}
