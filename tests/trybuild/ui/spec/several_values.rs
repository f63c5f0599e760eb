regen_runtime::robot_model!("several_values.yaml");

fn main() {}
