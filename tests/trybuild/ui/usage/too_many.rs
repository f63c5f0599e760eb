regen_runtime::robot_model!("../pass/arm.yaml", mod manipulator, "another.yaml");

fn main() {}
