//! The digest that identifies a model: generated modules carry it and files of identified
//! parameters name it, so that parameters of another model are refused.
//!
//! The runtime computes the same number from any model (`regen_identify::identify::digest`); a test
//! compares the two.

use crate::interpret;
use crate::robot::{FunctionKind, Robot};

/// Decimals of a number's mantissa in the digest: compiled and interpreted models agree in more.
const DECIMALS: usize = 9;

/// The digest of a robot (FNV-1a, 64 bits) over its names, its base combinations, and its base
/// regressor at one state. Two descriptions with the same names but different lengths have
/// different digests; comments and layout of the spec have no effect.
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
    // a state away from home, so that every length affects the regressor; the loops need not be
    // closed there
    let offset = |k: usize, scale: f64| scale * (1.0 + 0.1 * k as f64);
    let n = robot.coordinates.len();
    let home = robot.home.iter().enumerate();
    let q: Vec<f64> = home.map(|(k, x)| x + offset(k, 0.01)).collect();
    let qd: Vec<f64> = (0..n).map(|k| offset(k, 0.3)).collect();
    let qdd: Vec<f64> = (0..n).map(|k| offset(k, -0.7)).collect();
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
        // rounding in one engine may be an exact zero in another
        let value = if value.abs() < 1e-12 { 0.0 } else { value };
        self.text(&format!("{value:.DECIMALS$e}"));
    }
}
