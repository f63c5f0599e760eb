regen_runtime::robot_model!("not_yaml.yaml");

fn main() {}
