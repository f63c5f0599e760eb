regen_runtime::robot_model!(rps3);

fn main() {}
