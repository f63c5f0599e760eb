regen_runtime::robot_model!("adjustable.yaml");

fn main() {}
