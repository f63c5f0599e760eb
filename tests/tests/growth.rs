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
fn operations_per_leg_do_not_grow_with_the_number_of_legs() {
    let counts: Vec<Vec<usize>> = [6, 9, 12].map(operations).into();
    for (at, kind) in COUNTED.iter().enumerate() {
        let [six, nine, twelve] = [0, 1, 2].map(|n| counts[n][at]);
        println!("{}: {six} {nine} {twelve}", kind.name());
        // Beyond six, each leg adds the same three bodies' worth of work; pivots are chosen anew
        // for each platform, which moves it by some percent.
        let (early, late) = (nine - six, twelve - nine);
        assert!(
            late * 4 <= early * 5,
            "{}: {six}, {nine}, {twelve}",
            kind.name()
        );
        assert!(twelve * 10 <= six * 25, "{}: {six}, {twelve}", kind.name());
    }
}
