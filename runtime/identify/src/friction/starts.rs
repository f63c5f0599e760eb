//! The shapes that a friction law may have, and those from which the search for them starts.

use regen_runtime::Friction;
use regen_runtime::friction::SHAPES;

/// The number of starts per law.
pub(super) const STARTS: usize = 5;

/// Initial shapes, with velocities relative to the highest velocity. The first one of the power law
/// is linear friction, which the other laws contain at any shape, so no search ends worse than
/// that.
const STRIBECK: [[f64; SHAPES]; STARTS] =
    [[0.1, 1.0], [0.03, 1.5], [0.3, 1.5], [0.1, 2.0], [0.01, 1.0]];
const ATAN: [[f64; SHAPES]; STARTS] = [
    [10.0, 1.0],
    [3.0, 1.0],
    [30.0, 1.0],
    [100.0, 1.0],
    [1.0, 1.0],
];
const POWER: [[f64; SHAPES]; STARTS] =
    [[1.0, 1.0], [0.5, 1.0], [2.0, 1.0], [0.25, 1.0], [1.5, 1.0]];
const LUGRE: [[f64; SHAPES]; STARTS] =
    [[0.1, 1.0], [0.03, 1.0], [0.3, 1.0], [0.01, 1.0], [1.0, 1.0]];

/// The exponents of velocities that a law may have: measured ones are between 0.5 and 2 (Armstrong-Helouvry, Dupont and
/// Canudas de Wit, Automatica 30(7), 1994).
const EXPONENTS: (f64, f64) = (0.25, 4.0);

/// Friction may fade at velocities up to so many times the highest one: a part of the peak shows too.
const BEYOND: f64 = 3.0;

/// The range of each shape parameter in SI units: velocities are those at which the joint moves, or somewhat higher.
///
/// - `slowest`, `fastest`: the velocity below which few samples are, and the highest one.
pub(super) fn ranges(law: Friction, slowest: f64, fastest: f64) -> [(f64, f64); SHAPES] {
    let mut out = [(1.0, 1.0); SHAPES];
    for (range, symbol) in out.iter_mut().zip(law.shape_symbols()) {
        *range = match *symbol {
            "vs" => (slowest, BEYOND * fastest),
            "Fv3" => (1.0 / (BEYOND * fastest), 1.0 / slowest),
            _ => EXPONENTS,
        };
    }
    out
}

/// The shape of start number `which` in SI units, within its ranges; `fastest` is the highest velocity.
pub(super) fn start(
    law: Friction,
    which: usize,
    fastest: f64,
    ranges: &[(f64, f64); SHAPES],
) -> [f64; SHAPES] {
    let starts = match law {
        Friction::Stribeck => &STRIBECK,
        Friction::Atan => &ATAN,
        Friction::Power => &POWER,
        Friction::Lugre => &LUGRE,
        // linear laws have no shape
        Friction::None
        | Friction::Viscous
        | Friction::Coulomb
        | Friction::Linear
        | Friction::CoulombAsymmetric
        | Friction::Asymmetric => return [1.0; SHAPES],
    };
    let mut shape = starts[which % STARTS];
    for (value, symbol) in shape.iter_mut().zip(law.shape_symbols()) {
        match *symbol {
            "vs" => *value *= fastest,
            "Fv3" => *value /= fastest,
            _ => {}
        }
    }
    within(ranges, shape)
}

/// The shape, moved into its ranges.
pub(super) fn within(ranges: &[(f64, f64); SHAPES], shape: [f64; SHAPES]) -> [f64; SHAPES] {
    let mut out = shape;
    for (value, (lowest, highest)) in out.iter_mut().zip(ranges) {
        if lowest < highest {
            *value = value.clamp(*lowest, *highest);
        }
    }
    out
}
