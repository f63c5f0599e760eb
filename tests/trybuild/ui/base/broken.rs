regen_runtime::robot_model!("broken.yaml");

fn main() {}
