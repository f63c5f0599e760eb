//! The values of a program modulo a prime, with a bound on their rounding errors.

use super::field;
use crate::optimize::program::{Op, Operand, Program, Temp};

/// A value that can be an operand.
pub(super) struct Value {
    pub(super) operand: Operand,
    /// The number of steps after which it is available: 0 for inputs and constants.
    pub(super) available_at: usize,
    /// Its value modulo the prime, for each of two sets of random numbers.
    pub(super) residues: [u64; 2],
    /// The sum of the absolute values of its terms, for inputs of about one; its rounding errors
    /// are proportional to this sum.
    pub(super) absolute_sum: f64,
    /// Whether its computation contains a division.
    pub(super) has_quotient: bool,
}

/// All values that a program's steps can have as operands, in the order of computation.
pub(super) fn values(program: &Program) -> Vec<Value> {
    let draws = [RandomValues::new(program, 0), RandomValues::new(program, 1)];
    let absolute_sums = absolute_sums(program);
    let mut values = Vec::new();
    let mut add = |operand: Operand, available_at: usize| {
        let residues = draws.each_ref().map(|draw| draw.residue(&operand));
        let (absolute_sum, has_quotient) = absolute_sum_of(&operand, &absolute_sums);
        values.push(Value {
            operand,
            available_at,
            residues,
            absolute_sum,
            has_quotient,
        });
    };
    let operands = program.steps.iter().flat_map(|s| s.op.operands());
    let mut inputs: Vec<(usize, usize)> = Vec::new();
    let mut constants: Vec<u64> = Vec::new();
    for operand in operands {
        match operand {
            Operand::Input { argument, element } => inputs.push((argument, element)),
            Operand::Constant(c) => constants.push(c.abs().to_bits()),
            Operand::Temp(_) => {}
        }
    }
    inputs.sort_unstable();
    inputs.dedup();
    constants.sort_unstable();
    constants.dedup();
    for c in constants {
        add(Operand::Constant(f64::from_bits(c)), 0);
    }
    for (argument, element) in inputs {
        add(Operand::Input { argument, element }, 0);
    }
    for (index, step) in program.steps.iter().enumerate() {
        // the operand of a sign change is among the values already
        if !matches!(step.op, Op::Neg(_)) {
            for result in &step.results {
                add(Operand::Temp(*result), index + 1);
            }
        }
    }
    values
}

/// For each temporary, the sum of the absolute values of its terms, for inputs of about one, and
/// whether its computation contains a division.
fn absolute_sums(program: &Program) -> Vec<(f64, bool)> {
    let mut absolute_sums = vec![(1.0, false); program.names.len()];
    for step in &program.steps {
        let bound = |operand: &Operand| absolute_sum_of(operand, &absolute_sums);
        let plus = |a: (f64, bool), b: (f64, bool)| (a.0 + b.0, a.1 || b.1);
        let times = |a: (f64, bool), b: (f64, bool)| (a.0 * b.0, a.1 || b.1);
        let bound_of_result = match &step.op {
            Op::Neg(a) => bound(a),
            Op::Add(a, b) | Op::Sub(a, b) => plus(bound(a), bound(b)),
            Op::Mul(a, b) => times(bound(a), bound(b)),
            Op::MulAdd(a, b, c) | Op::NegMulAdd(a, b, c) | Op::MulSub(a, b, c) => {
                plus(times(bound(a), bound(b)), bound(c))
            }
            Op::Div(a, _) => (bound(a).0, true),
            // the solution of a singular system is undefined, like a quotient
            Op::Solve(_) => (1.0, true),
            // the root of a small number is larger than the number: assume the size of an input
            Op::Sqrt(a) => (libm::sqrt(bound(a).0).max(1.0), bound(a).1),
            Op::SinCos(_) | Op::Sign(_) | Op::Positive(_) | Op::Negative(_) => continue,
        };
        for result in &step.results {
            absolute_sums[result.0 as usize] = bound_of_result;
        }
    }
    absolute_sums
}

/// The entry of [`absolute_sums`] for an operand.
fn absolute_sum_of(operand: &Operand, absolute_sums: &[(f64, bool)]) -> (f64, bool) {
    match *operand {
        Operand::Input { .. } => (1.0, false),
        Operand::Constant(c) => (c.abs(), false),
        Operand::Temp(t) => absolute_sums[t.0 as usize],
    }
}

/// The values of a program at random inputs, modulo the prime.
pub(super) struct RandomValues {
    /// The number of the set of random numbers, 0 or 1.
    draw: u64,
    /// The residue of each temporary.
    temps: Vec<u64>,
}

impl RandomValues {
    pub(super) fn new(program: &Program, draw: u64) -> Self {
        let mut drawn = RandomValues {
            draw,
            temps: vec![0; program.names.len()],
        };
        for step in &program.steps {
            let residue = |operand: &Operand| drawn.residue(operand);
            let value = match &step.op {
                Op::Neg(a) => field::neg(residue(a)),
                Op::Add(a, b) => field::add(residue(a), residue(b)),
                Op::Sub(a, b) => field::sub(residue(a), residue(b)),
                Op::Mul(a, b) => field::mul(residue(a), residue(b)),
                Op::MulAdd(a, b, c) => field::add(field::mul(residue(a), residue(b)), residue(c)),
                Op::NegMulAdd(a, b, c) => {
                    field::sub(residue(c), field::mul(residue(a), residue(b)))
                }
                Op::MulSub(a, b, c) => field::sub(field::mul(residue(a), residue(b)), residue(c)),
                Op::Div(a, b) => field::mul(residue(a), field::inverse(residue(b))),
                Op::SinCos(_) => {
                    if let [sine, cosine] = step.results[..] {
                        let (s, c) = field::sin_cos(drawn.random_residue(sine));
                        drawn.temps[sine.0 as usize] = s;
                        drawn.temps[cosine.0 as usize] = c;
                    }
                    continue;
                }
                // not rational functions: their results are random numbers
                Op::Sqrt(_) | Op::Sign(_) | Op::Positive(_) | Op::Negative(_) | Op::Solve(_) => {
                    for result in &step.results {
                        drawn.temps[result.0 as usize] = drawn.random_residue(*result);
                    }
                    continue;
                }
            };
            for result in &step.results {
                drawn.temps[result.0 as usize] = value;
            }
        }
        drawn
    }

    /// A random number for a result that is not a rational function of the inputs.
    fn random_residue(&self, result: Temp) -> u64 {
        field::drawn((1 << 60) + u64::from(result.0), self.draw)
    }

    /// The residue of an operand.
    pub(super) fn residue(&self, operand: &Operand) -> u64 {
        match *operand {
            Operand::Input { argument, element } => {
                field::drawn(((argument as u64) << 32) + element as u64, self.draw)
            }
            Operand::Constant(c) => field::residue(c),
            Operand::Temp(t) => self.temps[t.0 as usize],
        }
    }
}
