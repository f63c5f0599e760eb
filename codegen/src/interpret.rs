//! Programs run without being compiled, in double precision. The same result on
//! every machine: plain arithmetic, and sines and cosines from a software
//! library.

use crate::numeric::solve_pivoted;
use crate::optimize::{Op, Operand, Program, SolveStep, Temp};

/// Below this part of their usual size the fixed pivots are not trusted, and
/// the system is solved anew with pivoting.
pub const PIVOT_BOUND: f64 = 1e-3;

/// The program's outputs for these arguments, and its condition: the smallest
/// pivot relative to its usual size (1 where nothing is solved).
///
/// Missing arguments and elements count as NaN.
pub fn run(program: &Program, inputs: &[&[f64]]) -> (Vec<f64>, f64) {
    let mut machine = Machine {
        inputs,
        temps: vec![f64::NAN; program.names.len()],
        condition: 1.0,
    };
    for step in &program.steps {
        machine.step(&step.op, &step.results);
    }
    let outputs = program.outputs.iter().map(|o| machine.at(o)).collect();
    (outputs, machine.condition)
}

struct Machine<'a> {
    inputs: &'a [&'a [f64]],
    temps: Vec<f64>,
    condition: f64,
}

impl Machine<'_> {
    fn at(&self, operand: &Operand) -> f64 {
        match *operand {
            Operand::Input { argument, element } => self
                .inputs
                .get(argument)
                .and_then(|a| a.get(element))
                .copied()
                .unwrap_or(f64::NAN),
            Operand::Constant(c) => c,
            Operand::Temp(Temp(t)) => self.temps[t as usize],
        }
    }

    fn step(&mut self, op: &Op, results: &[Temp]) {
        let value = match op {
            Op::Neg(a) => -self.at(a),
            Op::Add(a, b) => self.at(a) + self.at(b),
            Op::Sub(a, b) => self.at(a) - self.at(b),
            Op::Mul(a, b) => self.at(a) * self.at(b),
            Op::MulAdd(a, b, c) => self.at(a) * self.at(b) + self.at(c),
            Op::NegMulAdd(a, b, c) => self.at(c) - self.at(a) * self.at(b),
            Op::MulSub(a, b, c) => self.at(a) * self.at(b) - self.at(c),
            Op::Div(a, b) => self.at(a) / self.at(b),
            Op::Sign(a) => {
                let a = self.at(a);
                if a == 0.0 { 0.0 } else { a.signum() }
            }
            Op::Positive(a) => f64::from(u8::from(self.at(a) > 0.0)),
            Op::Negative(a) => f64::from(u8::from(self.at(a) < 0.0)),
            Op::SinCos(a) => {
                let a = self.at(a);
                if let [sin, cos] = results {
                    self.temps[sin.0 as usize] = libm::sin(a);
                    self.temps[cos.0 as usize] = libm::cos(a);
                }
                return;
            }
            Op::Solve(solve) => {
                let values = self.solve(solve);
                for (result, value) in results.iter().zip(values) {
                    self.temps[result.0 as usize] = value;
                }
                return;
            }
        };
        if let [result] = results {
            self.temps[result.0 as usize] = value;
        }
    }

    fn solve(&mut self, solve: &SolveStep) -> Vec<f64> {
        // min that keeps NaN
        let margin = solve
            .pivots
            .iter()
            .map(|(p, size)| (self.at(p) / size).abs())
            .fold(1.0, |m: f64, x| if x.is_nan() || x < m { x } else { m });
        if margin > PIVOT_BOUND {
            self.condition = self.condition.min(margin);
            return solve.fixed.iter().flatten().map(|o| self.at(o)).collect();
        }
        let numbers = |rows: &[Vec<Operand>]| -> Vec<Vec<f64>> {
            rows.iter()
                .map(|row| row.iter().map(|o| self.at(o)).collect())
                .collect()
        };
        let anew = solve_pivoted(numbers(&solve.matrix), numbers(&solve.rhs));
        self.condition = self.condition.min(anew.pivot_ratio);
        anew.solution.into_iter().flatten().collect()
    }
}
