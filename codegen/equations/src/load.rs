//! Programs as expressions.

use regen_codegen::optimize::{Op, Operand, Program};

use crate::graph::{Graph, Id, Node};

/// The expressions of a program's outputs. `given` replaces an element of an argument by an expression.
pub(crate) fn outputs(
    g: &mut Graph,
    program: &Program,
    given: &dyn Fn(&mut Graph, usize, usize) -> Option<Id>,
) -> Vec<Id> {
    let nothing = g.constant(0.0);
    let mut values = vec![nothing; program.names.len()];
    for step in &program.steps {
        let results = results(g, &step.op, given, &values);
        for (temp, value) in step.results.iter().zip(results) {
            if let Some(slot) = values.get_mut(temp.0 as usize) {
                *slot = value;
            }
        }
    }
    let outputs = program.outputs.iter();
    outputs.map(|o| operand(g, *o, given, &values)).collect()
}

fn operand(
    g: &mut Graph,
    operand: Operand,
    given: &dyn Fn(&mut Graph, usize, usize) -> Option<Id>,
    values: &[Id],
) -> Id {
    match operand {
        Operand::Input { argument, element } => match given(g, argument, element) {
            Some(value) => value,
            None => g.input(argument, element),
        },
        Operand::Constant(value) => g.constant(value),
        Operand::Temp(temp) => values[temp.0 as usize],
    }
}

/// The results of a step: one, or a sine and a cosine, or all unknowns of a system.
fn results(
    g: &mut Graph,
    op: &Op,
    given: &dyn Fn(&mut Graph, usize, usize) -> Option<Id>,
    values: &[Id],
) -> Vec<Id> {
    if let Op::Solve(solve) = op {
        // the solution in the fixed order of pivots, from which other orders differ by rounding
        // only
        let fixed = solve.fixed.iter().flatten();
        return fixed.map(|o| operand(g, *o, given, values)).collect();
    }
    let operands = op.operands();
    let ids: Vec<Id> = operands
        .iter()
        .map(|o| operand(g, *o, given, values))
        .collect();
    let result = match (op, ids.as_slice()) {
        (Op::Neg(_), [a]) => g.neg(*a),
        (Op::Add(..), [a, b]) => g.add(*a, *b),
        (Op::Sub(..), [a, b]) => g.sub(*a, *b),
        (Op::Mul(..), [a, b]) => g.mul(*a, *b),
        (Op::Div(..), [a, b]) => g.div(*a, *b),
        (Op::MulAdd(..), [a, b, c]) => {
            let product = g.mul(*a, *b);
            g.add(product, *c)
        }
        (Op::NegMulAdd(..), [a, b, c]) => {
            let product = g.mul(*a, *b);
            g.sub(*c, product)
        }
        (Op::MulSub(..), [a, b, c]) => {
            let product = g.mul(*a, *b);
            g.sub(product, *c)
        }
        (Op::SinCos(_), [a]) => return vec![g.call(Node::Sin(*a)), g.call(Node::Cos(*a))],
        (Op::Sqrt(_), [a]) => g.call(Node::Sqrt(*a)),
        (Op::Sign(_), [a]) => g.call(Node::Sign(*a)),
        (Op::Positive(_), [a]) => g.call(Node::Positive(*a)),
        (Op::Negative(_), [a]) => g.call(Node::Negative(*a)),
        // unreachable: an operation lists as many operands as it has
        _ => return Vec::new(),
    };
    vec![result]
}
