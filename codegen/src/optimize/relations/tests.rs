use super::values::*;
use super::*;
use crate::optimize::program::{Operand, Step, Temp};
use crate::optimize::{Group, Output};

/// An element of the only argument.
fn given(element: usize) -> Operand {
    Operand::Input {
        argument: 0,
        element,
    }
}

fn temp(t: u32) -> Operand {
    Operand::Temp(Temp(t))
}

/// A program whose steps are in groups of these sizes.
fn program(steps: Vec<Step>, groups: &[usize], outputs: Vec<Operand>) -> Program {
    let names = steps.iter().map(|s| s.results.len()).sum();
    let mut start = 0;
    let groups = groups.iter().map(|count| {
        let steps = start..start + count;
        start += count;
        Group {
            title: String::new(),
            steps,
            outputs: 0..0,
        }
    });
    Program {
        arguments: Vec::new(),
        groups: groups.collect(),
        steps,
        output: Output {
            name: "y".to_owned(),
            shape: vec![outputs.len()],
            doc: String::new(),
        },
        outputs,
        names: vec![None; names],
    }
}

/// Steps with one result each, which are `t0`, `t1` and so on.
fn steps(ops: Vec<Op>) -> Vec<Step> {
    let step = |(op, t)| Step {
        op,
        results: vec![Temp(t)],
    };
    ops.into_iter().zip(0..).map(step).collect()
}

fn one_group(ops: Vec<Op>, outputs: Vec<Operand>) -> Program {
    let count = ops.len();
    program(steps(ops), &[count], outputs)
}

fn counted(program: &Program) -> (usize, usize) {
    let o = program.operations();
    (o.mul, o.add)
}

#[test]
fn an_offset_times_an_entry_is_found() {
    let offset = Operand::Constant(0.2435);
    let mut program = one_group(
        vec![
            Op::Mul(given(0), given(1)),
            Op::Mul(offset, given(0)),
            Op::Mul(temp(1), given(1)),
        ],
        vec![temp(0), temp(2)],
    );
    relate(&mut program);
    assert_eq!(counted(&program), (2, 0));
    assert_eq!(program.steps[1].op, Op::Mul(offset, temp(0)));
}

#[test]
fn a_sum_of_products_becomes_a_product_of_a_sum_that_comes_later() {
    let mut program = one_group(
        vec![
            Op::Mul(given(0), given(2)),
            Op::MulAdd(given(1), given(2), temp(0)),
            Op::Add(given(0), given(1)),
        ],
        vec![temp(1), temp(2)],
    );
    relate(&mut program);
    assert_eq!(counted(&program), (1, 1));
    assert_eq!(program.steps[0].op, Op::Add(given(0), given(1)));
}

#[test]
fn squares_of_sine_and_cosine_are_one() {
    let (sine, cosine) = (Temp(0), Temp(1));
    let mut steps = vec![Step {
        op: Op::SinCos(given(0)),
        results: vec![sine, cosine],
    }];
    let rest = [
        Op::Mul(temp(1), given(1)),
        Op::Mul(temp(0), given(1)),
        // x - x s s = x c c
        Op::NegMulAdd(temp(3), temp(0), given(1)),
    ];
    steps.extend(rest.into_iter().zip(2..).map(|(op, t)| Step {
        op,
        results: vec![Temp(t)],
    }));
    let mut program = program(steps, &[4], vec![temp(2), temp(4)]);
    relate(&mut program);
    assert_eq!(counted(&program), (2, 0));
}

#[test]
fn a_product_with_the_other_sign_is_used() {
    // b a - c a is -(c - b) a, where c - b is computed already; its negative is an output
    let mut program = one_group(
        vec![
            Op::Sub(given(2), given(1)),
            Op::Mul(given(2), given(0)),
            Op::MulSub(given(1), given(0), temp(1)),
            Op::Neg(temp(2)),
        ],
        vec![temp(0), temp(3)],
    );
    relate(&mut program);
    assert_eq!(counted(&program), (1, 1));
    // the negative of the negative is the product itself
    assert!(!program.steps.iter().any(|s| matches!(s.op, Op::Neg(_))));
}

#[test]
fn values_that_other_steps_need_are_not_counted_as_saved() {
    // both products are outputs, so that replacing their sum would save nothing
    let ops = vec![
        Op::Add(given(0), given(1)),
        Op::Mul(given(0), given(2)),
        Op::Mul(given(1), given(2)),
        Op::Add(temp(1), temp(2)),
    ];
    let outputs = vec![temp(0), temp(1), temp(2), temp(3)];
    let mut program = one_group(ops, outputs);
    let before = program.clone();
    relate(&mut program);
    assert_eq!(program, before);
}

#[test]
fn a_small_value_is_not_recovered_from_a_sum_with_a_large_one() {
    let ops = |large: f64| {
        vec![
            Op::Mul(Operand::Constant(large), given(4)),
            Op::MulAdd(given(0), given(1), temp(0)),
            Op::MulAdd(given(2), given(3), temp(1)),
            // the terms that are added to the large product, without it
            Op::Mul(given(2), given(3)),
            Op::MulAdd(given(0), given(1), temp(3)),
        ]
    };
    let saves_operations = |large: f64| {
        let outputs = vec![temp(1), temp(2), temp(4)];
        // the sum with the large product comes first, so that only the small sum could be recovered
        let mut program = program(steps(ops(large)), &[3, 2], outputs);
        let before = counted(&program);
        relate(&mut program);
        before != counted(&program)
    };
    assert!(saves_operations(0.1));
    assert!(!saves_operations(1e6));
}

#[test]
fn a_value_without_a_quotient_is_not_computed_from_one() {
    // x y z = (x / w) (w y z) would be undefined at w = 0
    let ops = vec![
        Op::Div(given(0), given(3)),
        Op::Mul(given(3), given(1)),
        Op::Mul(given(0), given(1)),
        Op::Mul(temp(2), given(2)),
        Op::Mul(temp(1), given(2)),
    ];
    let outputs = vec![temp(0), temp(1), temp(3), temp(4)];
    let mut program = one_group(ops, outputs);
    relate(&mut program);
    assert_eq!(counted(&program), (4, 0));
    let quotients = |o: &Operand| matches!(o, Operand::Temp(Temp(0)));
    for step in &program.steps {
        assert!(!step.op.operands().iter().any(quotients));
    }
}

#[test]
fn values_of_later_groups_are_not_used() {
    let ops = vec![
        Op::Mul(given(0), given(2)),
        Op::MulAdd(given(1), given(2), temp(0)),
        Op::Add(given(0), given(1)),
    ];
    let mut program = program(steps(ops), &[2, 1], vec![temp(1), temp(2)]);
    let before = program.clone();
    relate(&mut program);
    assert_eq!(program, before);
}

proptest::proptest! {
    #[test]
    fn results_are_unchanged_and_take_no_more_operations(
        picks in proptest::collection::vec((0_u8..7, 0_usize..40, 0_usize..40, 0_usize..40), 1..40),
        cut in 0_usize..40,
        ends in proptest::collection::vec(0_usize..40, 1..6),
    ) {
        let mut ops = Vec::new();
        for (kind, a, b, c) in picks {
            let many = ops.len() + 4;
            // few inputs, so that equal values occur
            let pick = |k: usize| match k % many {
                3 => Operand::Constant(2.0),
                k if k < 3 => given(k),
                k => temp(k as u32 - 4),
            };
            let (a, b, c) = (pick(a), pick(b), pick(c));
            ops.push(match kind {
                0 => Op::Neg(a),
                1 => Op::Add(a, b),
                2 => Op::Sub(a, b),
                3 => Op::Mul(a, b),
                4 => Op::MulAdd(a, b, c),
                5 => Op::NegMulAdd(a, b, c),
                _ => Op::MulSub(a, b, c),
            });
        }
        let count = ops.len();
        let cut = cut.min(count);
        let outputs = ends.iter().map(|e| temp((e % count) as u32)).collect();
        let mut program = program(steps(ops), &[cut, count - cut], outputs);
        program.drop_unused();
        let (before, number) = (counted(&program), |p: &Program, draw: u64| -> Vec<u64> {
            let drawn = RandomValues::new(p, draw);
            p.outputs.iter().map(|o| drawn.residue(o)).collect()
        });
        let expected = [number(&program, 2), number(&program, 3)];
        relate(&mut program);
        let after = counted(&program);
        proptest::prop_assert!(after.0 <= before.0 && after.1 <= before.1);
        proptest::prop_assert_eq!([number(&program, 2), number(&program, 3)], expected);
        // each step must follow its operands
        let mut made: Vec<Temp> = Vec::new();
        for step in &program.steps {
            for operand in step.op.operands() {
                if let Operand::Temp(t) = operand {
                    proptest::prop_assert!(made.contains(&t));
                }
            }
            made.extend(&step.results);
        }
    }
}
