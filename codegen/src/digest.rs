//! What tells models apart: a number that a generated module carries and that files of identified
//! parameters name, so that parameters of another model are refused.
//!
//! The runtime's side of identification computes the same number from any model
//! (`regen_identify::identify::digest`); a test holds the two equal.

use crate::interpret;
use crate::robot::{FunctionKind, Robot};

/// Digits of a number that count: compiled and interpreted models agree in more.
const DIGITS: usize = 9;

/// The digest of a robot (FNV-1a, 64 bits): of its names, of the base combinations, and of the
/// base regressor at one state. Two descriptions with the same names and other lengths have
/// different digests; comments and layout do not count.
pub fn digest(robot: &Robot) -> u64 {
    let mut hash = Hash(0xcbf2_9ce4_8422_2325);
    for name in &robot.coordinates {
        hash.text(name);
    }
    for parameter in &robot.parameters {
        hash.text(&parameter.label);
    }
    for list in [&robot.independent, &robot.dependent, &robot.actuated] {
        for k in list {
            hash.text(&k.to_string());
        }
    }
    let base = robot.analysis.iter().flat_map(|a| &a.base.parameters);
    let base: Vec<_> = base.filter(|p| !p.dropped).collect();
    for parameter in &base {
        hash.text(&robot.parameters[parameter.column].label);
        for term in &parameter.terms {
            hash.text(&robot.parameters[term.column].label);
            hash.number(term.value.to_f64());
        }
    }
    // home moved a little, so that lengths show; the loops need not be closed
    let off = |k: usize, scale: f64| scale * (1.0 + 0.1 * k as f64);
    let n = robot.coordinates.len();
    let home = robot.home.iter().enumerate();
    let q: Vec<f64> = home.map(|(k, x)| x + off(k, 0.01)).collect();
    let qd: Vec<f64> = (0..n).map(|k| off(k, 0.3)).collect();
    let qdd: Vec<f64> = (0..n).map(|k| off(k, -0.7)).collect();
    let mut functions = robot.functions.iter();
    let regressor = functions.find(|f| f.kind == FunctionKind::BaseRegressor);
    if let Some(regressor) = regressor.filter(|_| !base.is_empty()) {
        for x in interpret::run(&regressor.program, &[&q, &qd, &qdd]).0 {
            hash.number(x);
        }
    }
    hash.0
}

struct Hash(u64);

impl Hash {
    fn text(&mut self, text: &str) {
        for byte in text.bytes().chain([0]) {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    fn number(&mut self, value: f64) {
        // a value that is zero but for rounding may be exactly zero in another engine
        let value = if value.abs() < 1e-12 { 0.0 } else { value };
        self.text(&format!("{value:.DIGITS$e}"));
    }
}
