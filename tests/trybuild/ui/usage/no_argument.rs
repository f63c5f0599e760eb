regen_runtime::robot_model!();

fn main() {}
