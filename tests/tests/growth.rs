//! Programs grow linearly with the mechanism: products are not multiplied out, and loops are solved
//! in an order of their own. Operations are counted, not timed; `benches/growth.rs` measures times.
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

/// The number of additions, multiplications, divisions and pairs of sine and cosine of each
/// function.
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
fn every_further_leg_costs_about_as_much_as_the_one_before() {
    let counts: Vec<Vec<usize>> = [3, 6, 12].map(operations).into();
    for (at, kind) in COUNTED.iter().enumerate() {
        let [three, six, twelve] = [0, 1, 2].map(|n| counts[n][at]);
        println!("{}: {three} {six} {twelve}", kind.name());
        // One more leg costs the same for every number of legs, up to some percent, because pivots
        // are chosen anew for each platform. If cost grew with the square of the legs, a leg would
        // cost twice as much between six and twelve as between three and six.
        let (early, late) = ((six - three) * 2, twelve - six);
        assert!(late * 2 <= early * 3, "{}: {early}, {late}", kind.name());
    }
}
