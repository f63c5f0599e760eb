regen_runtime::robot_model!("wrong_independent.yaml");

fn main() {}
