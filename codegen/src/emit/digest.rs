//! A short summary of a generated module. `generated/digests.txt` has one for each robot whose
//! module is not checked in, so that a change of the module shows up there.
//!
//! It is not the digest by which parameter files are matched with models: see [`crate::digest`].

use std::fmt::Write as _;

use sha2::{Digest, Sha256};

use crate::optimize::Operations;
use crate::robot::Robot;

/// Summarises a module: a line with the robot's name, the number of lines of the text and its
/// SHA-256; then a line for each function with its numbers of operations (see
/// `Program::operations`), which show the effect of a change on the computational cost.
///
/// - `robot`: the robot whose functions are counted;
/// - `text`: the source of its module.
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
            sqrt,
        } = function.program.operations();
        let name = function.kind.name();
        let _ = write!(
            out,
            "    {name}: {add} add, {mul} mul, {div} div, {sincos} sin and cos"
        );
        if sqrt > 0 {
            let _ = write!(out, ", {sqrt} sqrt");
        }
        out.push('\n');
    }
    out
}
