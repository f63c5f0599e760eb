//! Functions without their geometry, a geometry without a name of it, and one that it does not have.
regen_runtime::robot_model!("adjustable.yaml");

fn main() {
    let _ = arm::poses(&[0.0; 2]);
    let _ = arm::Geometry {};
    let _ = arm::Geometry { b: 0.4, ..Default::default() };
    let _ = regen_runtime::BaseModel::<f64>::base_info(&arm::Arm::default());
}
