//! The shapes from which the search for a friction law's shape starts.

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

/// The shape of start number `which` in SI units; `fastest` is the highest velocity.
pub(super) fn start(law: Friction, which: usize, fastest: f64) -> [f64; SHAPES] {
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
    shape
}
