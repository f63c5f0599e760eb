regen_runtime::robot_model!("several_errors.yaml");

fn main() {}
