regen_runtime::robot_model!("excavator.yaml");

fn main() {}
