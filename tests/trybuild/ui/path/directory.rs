regen_runtime::robot_model!("../pass");

fn main() {}
