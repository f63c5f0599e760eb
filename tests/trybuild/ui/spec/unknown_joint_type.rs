regen_runtime::robot_model!("unknown_joint_type.yaml");

fn main() {}
