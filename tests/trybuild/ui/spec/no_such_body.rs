regen_runtime::robot_model!("no_such_body.yaml");

fn main() {}
