//! Evaluation of expressions in double precision, with the same result on every machine: sines and
//! cosines are computed by the crate `libm`, not by the mathematical library of the host.

use super::graph::{Ex, Graph, Node};
use crate::numeric::solve_pivoted;

/// Evaluates a fixed set of expressions (the roots) at any number of values of the symbols.
#[derive(Debug)]
pub struct Evaluator<'g> {
    graph: &'g Graph,
    /// The nodes that the roots depend on, operands first.
    order: Vec<Ex>,
    roots: Vec<Ex>,
    /// The graph's numbers, rounded to double precision.
    constants: Vec<f64>,
}

impl<'g> Evaluator<'g> {
    /// Prepares the evaluation of `roots`.
    pub fn new(graph: &'g Graph, roots: Vec<Ex>) -> Self {
        let mut seen = vec![false; graph.len()];
        let mut stack = roots.clone();
        while let Some(ex) = stack.pop() {
            if !std::mem::replace(&mut seen[ex.index()], true) {
                stack.extend(graph.children(ex));
            }
        }
        // operands have smaller ids than the nodes that use them, so ascending order is valid
        let order = (0..graph.len())
            .filter(|i| seen[*i])
            .map(|i| Ex(i as u32))
            .collect();
        let constants = graph.numbers.iter().map(super::Number::to_f64).collect();
        Evaluator {
            graph,
            order,
            roots,
            constants,
        }
    }

    /// The values of the roots, in their order.
    ///
    /// - `symbols`: the value of each symbol in order of creation; missing ones are 0.
    ///
    /// Linear systems are solved by elimination with complete pivoting, not in the graph's fixed
    /// order of pivots. The solution of a singular system is NaN.
    pub fn run(&self, symbols: &[f64]) -> Vec<f64> {
        let mut values = vec![0.0; self.graph.len()];
        // the solution of each linear system, computed when its first entry is needed
        let mut solutions: Vec<Option<Vec<Vec<f64>>>> = Vec::new();
        for &ex in &self.order {
            let at = |e: Ex| values[e.index()];
            let value = match self.graph.node(ex) {
                Node::Constant(id) => self.constants[id as usize],
                Node::Symbol(id) => symbols.get(id.index()).copied().unwrap_or(0.0),
                Node::Neg(a) => -at(a),
                Node::Add(a, b) => at(a) + at(b),
                Node::Sub(a, b) => at(a) - at(b),
                Node::Mul(a, b) => at(a) * at(b),
                Node::Div(a, b) => at(a) / at(b),
                Node::Sin(id) => libm::sin(self.angle(id, symbols)),
                Node::Cos(id) => libm::cos(self.angle(id, symbols)),
                Node::SinOf(a) => libm::sin(at(a)),
                Node::CosOf(a) => libm::cos(at(a)),
                Node::Sqrt(a) => libm::sqrt(at(a)),
                Node::Sign(a) if at(a) == 0.0 => 0.0,
                Node::Sign(a) => at(a).signum(),
                Node::Positive(a) => f64::from(u8::from(at(a) > 0.0)),
                Node::Negative(a) => f64::from(u8::from(at(a) < 0.0)),
                Node::Solved(id, row, column) => {
                    if solutions.len() <= id.index() {
                        solutions.resize(id.index() + 1, None);
                    }
                    let solution = solutions[id.index()].get_or_insert_with(|| {
                        let system = self.graph.system(id);
                        let numbers = |rows: &[Vec<Ex>]| -> Vec<Vec<f64>> {
                            rows.iter()
                                .map(|row| row.iter().map(|e| at(*e)).collect())
                                .collect()
                        };
                        solve_pivoted(numbers(&system.matrix), numbers(&system.rhs)).solution
                    });
                    solution[row as usize][column as usize]
                }
            };
            values[ex.index()] = value;
        }
        self.roots.iter().map(|r| values[r.index()]).collect()
    }

    /// The value of an angle, rad.
    fn angle(&self, id: super::AngleId, symbols: &[f64]) -> f64 {
        let angle = self.graph.angle(id);
        angle
            .terms
            .iter()
            .fold(angle.constant.to_f64(), |sum, (symbol, coefficient)| {
                let value = symbols.get(symbol.index()).copied().unwrap_or(0.0);
                coefficient.to_f64() * value + sum
            })
    }
}
