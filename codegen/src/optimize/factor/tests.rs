use proptest::prelude::*;

use super::super::program::{Argument, Group, Output};
use super::*;

fn input(element: usize) -> Operand {
    let argument = 0;
    Operand::Input { argument, element }
}

fn temp(t: usize) -> Operand {
    Operand::Temp(Temp(t as u32))
}

/// A program of four inputs whose step k computes temporary k, all in one group.
fn program(ops: Vec<Op>, outputs: Vec<Operand>) -> Program {
    let step = |(k, op)| Step {
        op,
        results: vec![Temp(k as u32)],
    };
    let steps: Vec<Step> = ops.into_iter().enumerate().map(step).collect();
    Program {
        arguments: vec![Argument {
            name: "q".to_owned(),
            len: 4,
            doc: String::new(),
        }],
        groups: vec![Group {
            title: String::new(),
            steps: 0..steps.len(),
            outputs: 0..outputs.len(),
        }],
        output: Output {
            name: "out".to_owned(),
            shape: vec![outputs.len()],
            doc: String::new(),
        },
        names: vec![None; steps.len()],
        steps,
        outputs,
    }
}

/// The outputs for given inputs.
fn values(program: &Program, state: [f64; 4]) -> Vec<f64> {
    run(program, state).0
}

/// The outputs for given inputs, and the largest absolute value of all steps. Panics if an operand
/// is not computed yet.
fn run(program: &Program, state: [f64; 4]) -> (Vec<f64>, f64) {
    let mut temps = vec![None; program.names.len()];
    let at = |o: &Operand, temps: &[Option<f64>]| match *o {
        Operand::Input { element, .. } => state[element],
        Operand::Constant(c) => c,
        Operand::Temp(t) => temps[t.0 as usize].expect("computed before it is used"),
    };
    for step in &program.steps {
        let o = |o: &Operand| at(o, &temps);
        let value = match &step.op {
            Op::Neg(a) => -o(a),
            Op::Add(a, b) => o(a) + o(b),
            Op::Sub(a, b) => o(a) - o(b),
            Op::Mul(a, b) => o(a) * o(b),
            Op::MulAdd(a, b, c) => o(a) * o(b) + o(c),
            Op::NegMulAdd(a, b, c) => o(c) - o(a) * o(b),
            Op::MulSub(a, b, c) => o(a) * o(b) - o(c),
            other => panic!("{other:?} is not among these"),
        };
        temps[step.results[0].0 as usize] = Some(value);
    }
    let sizes = temps.iter().flatten().map(|x: &f64| x.abs());
    let most = sizes.fold(0.0, |most: f64, x| if x <= most { most } else { x });
    let outputs = program.outputs.iter();
    (outputs.map(|operand| at(operand, &temps)).collect(), most)
}

fn factored(mut program: Program) -> Program {
    factor(&mut program);
    program
}

/// Number of products and of sums.
fn count(program: &Program) -> (usize, usize) {
    let operations = program.operations();
    (operations.mul, operations.add)
}

const STATE: [f64; 4] = [1.25, -0.5, 3.0, 0.75];

#[test]
fn a_factor_that_terms_share_is_taken_out() {
    let [a, b, c, d] = [0, 1, 2, 3].map(input);
    let ops = vec![
        Op::Mul(a, b),
        Op::MulAdd(a, c, temp(0)),
        Op::NegMulAdd(a, d, temp(1)),
    ];
    let before = program(ops, vec![temp(2)]);
    let after = factored(before.clone());
    assert_eq!((count(&before), count(&after)), ((3, 2), (1, 2)));
    assert_eq!(values(&after, STATE), values(&before, STATE));
}

#[test]
fn a_pair_of_factors_that_products_share_is_multiplied_once() {
    let [a, b, c, d] = [0, 1, 2, 3].map(input);
    // (a c) b and (b d) a share no node
    let ops = vec![
        Op::Mul(a, c),
        Op::Mul(temp(0), b),
        Op::Mul(b, d),
        Op::Mul(temp(2), a),
    ];
    let before = program(ops, vec![temp(1), temp(3)]);
    let after = factored(before.clone());
    assert_eq!((count(&before), count(&after)), ((4, 0), (3, 0)));
    assert_eq!(values(&after, STATE), values(&before, STATE));
}

#[test]
fn a_value_that_another_step_needs_keeps_its_step() {
    let [a, b, c, d] = [0, 1, 2, 3].map(input);
    let ops = vec![
        Op::Mul(a, b),
        Op::MulAdd(a, c, temp(0)),
        Op::Add(temp(0), d),
    ];
    let before = program(ops, vec![temp(1), temp(2)]);
    let after = factored(before.clone());
    // a b is used on its own too, so a (b + c) would take one product more
    assert_eq!(count(&after), count(&before));
    assert_eq!(values(&after, STATE), values(&before, STATE));
}

#[test]
fn a_sum_that_is_a_single_operand_passes_its_name_on() {
    let [a, b, ..] = [0, 1, 2, 3].map(input);
    let mut before = program(
        vec![Op::Mul(a, b), Op::Neg(temp(0))],
        vec![temp(1), temp(0)],
    );
    before.names = vec![Some("ab".to_owned()), None];
    let after = factored(before.clone());
    let named = after.names.iter().flatten().collect::<Vec<_>>();
    assert_eq!(named, ["ab"]);
    assert_eq!(values(&after, STATE), values(&before, STATE));
}

/// A step on inputs and the results of earlier steps.
fn step(at: usize) -> impl Strategy<Value = Op> {
    let operand = (0..4 + at).prop_map(|k| if k < 4 { input(k) } else { temp(k - 4) });
    let three = (operand.clone(), operand.clone(), operand);
    (0..7, three).prop_map(|(kind, (a, b, c))| match kind {
        0 => Op::Neg(a),
        1 => Op::Add(a, b),
        2 => Op::Sub(a, b),
        3 => Op::Mul(a, b),
        4 => Op::MulAdd(a, b, c),
        5 => Op::NegMulAdd(a, b, c),
        _ => Op::MulSub(a, b, c),
    })
}

fn steps() -> impl Strategy<Value = Vec<Op>> {
    (1_usize..14).prop_flat_map(|count| (0..count).map(step).collect::<Vec<_>>())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn any_program_keeps_its_values_and_takes_no_more_operations(
        ops in steps(),
        picked in prop::collection::vec(0_usize..14, 1..4),
        state in [-2..=2_i32, -2..=2_i32, -2..=2_i32, -2..=2_i32],
    ) {
        let outputs = picked.iter().map(|k| temp(k % ops.len())).collect();
        let mut before = program(ops, outputs);
        before.drop_unused();
        let after = factored(before.clone());
        let (mul, add) = count(&before);
        let (new_mul, new_add) = count(&after);
        prop_assert!(new_mul + new_add <= mul + add, "{:?} to {:?}", before, after);
        // sums and products of integers are exact while they stay below 2^53
        let state = state.map(f64::from);
        let (old, most) = run(&before, state);
        if most < 1e6 {
            prop_assert_eq!(old, values(&after, state));
        }
    }
}
