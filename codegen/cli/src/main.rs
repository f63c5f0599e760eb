//! regen
fn main() {}
