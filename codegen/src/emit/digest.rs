//! A short summary of a module's text, for snapshots that people do not have to read in full.

use std::fmt::Write as _;

use sha2::{Digest, Sha256};

use crate::optimize::Operations;
use crate::robot::Robot;

/// Summarises a module: a line with the robot's name, the number of lines of the text and its
/// SHA-256, which differs for every other text; then a line per function with its operations, so
/// that a change of the text can be judged without reading it.
#[must_use]
pub fn digest(robot: &Robot, text: &str) -> String {
    let mut out = format!("{}: {} lines, sha256 ", robot.name, text.lines().count());
    for byte in Sha256::digest(text.as_bytes()) {
        let _ = write!(out, "{byte:02x}");
    }
    out.push('\n');
    for function in &robot.functions {
        let Operations {
            add,
            mul,
            div,
            sincos,
        } = function.program.operations();
        let name = function.kind.name();
        let _ = writeln!(
            out,
            "    {name}: {add} add, {mul} mul, {div} div, {sincos} sin and cos"
        );
    }
    out
}
