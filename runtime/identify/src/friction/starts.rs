//! Where the search for a law's shape starts.

use regen_runtime::Friction;
use regen_runtime::friction::SHAPES;

/// The number of starts.
pub(super) const STARTS: usize = 5;

/// Shapes to start from, velocities as parts of the highest one. A power law's first is linear
/// friction; the others have it for any shape. So no start is worse than that.
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

/// A start's shape in SI units.
pub(super) fn start(law: Friction, which: usize, fastest: f64) -> [f64; SHAPES] {
    let starts = match law {
        Friction::Stribeck => &STRIBECK,
        Friction::Atan => &ATAN,
        Friction::Power => &POWER,
        Friction::Lugre => &LUGRE,
        // laws that are linear have no shape
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
