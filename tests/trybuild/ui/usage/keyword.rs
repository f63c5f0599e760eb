regen_runtime::robot_model!("../pass/arm.yaml", mod match);

fn main() {}
