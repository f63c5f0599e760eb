regen_runtime::robot_model!("not_stored.yaml");

fn main() {}
