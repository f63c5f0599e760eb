regen_runtime::robot_model!("home_does_not_close.yaml");

fn main() {}
