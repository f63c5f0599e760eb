regen_runtime::robot_model!("../pass/amr.yaml");

fn main() {}
