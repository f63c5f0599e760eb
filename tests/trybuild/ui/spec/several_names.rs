regen_runtime::robot_model!("several_names.yaml");

fn main() {}
