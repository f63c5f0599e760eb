//! Programs grow in proportion to the mechanism: products are not multiplied out, loops are
//! solved in their own order. Counted, not timed; `benches/growth.rs` has the times.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_codegen::robot::FunctionKind;
use regen_tests::derived::Derived;
use regen_tests::platform;

const COUNTED: [FunctionKind; 4] = [
    FunctionKind::Constraints,
    FunctionKind::Regressor,
    FunctionKind::InverseDynamics,
    FunctionKind::MassMatrix,
];

/// Additions, multiplications, divisions and pairs of sine and cosine of each function.
fn operations(legs: usize) -> Vec<usize> {
    let derived = Derived::without_base("ups.yaml", &platform::ups(legs)).unwrap();
    let count = |kind: &FunctionKind| {
        let function = derived.robot.function(*kind).unwrap();
        let o = function.program.operations();
        o.add + o.mul + o.div + o.sincos
    };
    COUNTED.iter().map(count).collect()
}

#[test]
fn operations_grow_nearly_in_proportion_to_the_number_of_legs() {
    let counts: Vec<Vec<usize>> = [3, 6, 12].map(operations).into();
    for (at, kind) in COUNTED.iter().enumerate() {
        let [three, six, twelve] = [0, 1, 2].map(|n| counts[n][at]);
        println!("{}: {three} {six} {twelve}", kind.name());
        // Twice the legs may take two and a half times the operations: pivots are chosen anew for
        // each platform, which moves a count by some percent. Products that were multiplied out,
        // or loops solved as one dense system, would take four to eight times as many.
        for (few, many) in [(three, six), (six, twelve)] {
            assert!(many * 2 <= few * 5, "{}: {few}, {many}", kind.name());
        }
    }
}
