regen_runtime::robot_model!("several_expressions.yaml");

fn main() {}
