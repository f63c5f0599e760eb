//! The macro in a function: no item may leak into the crate, and names of the prelude are
//! redefined.

#![allow(dead_code, non_camel_case_types)]

struct Result;
struct Option;
enum Ok {}
mod core {}

fn main() {
    regen_runtime::robot_model!("arm.yaml");
    assert_eq!(arm::INDEPENDENT.len(), 2);
}
