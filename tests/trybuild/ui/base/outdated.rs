regen_runtime::robot_model!("outdated.yaml");

fn main() {}
