//! Evaluation of expressions in multiple precision.

use crate::sym::{AngleId, Ex, Graph, Node};

use super::float320::Float320;
use super::linear::solve;

/// Evaluates a fixed set of expressions many times.
#[derive(Debug)]
pub(super) struct Evaluator<'g> {
    graph: &'g Graph,
    /// The expressions needed for the roots, children first.
    order: Vec<Ex>,
    roots: Vec<Ex>,
    constants: Vec<Float320>,
    angles: Vec<Option<LinearForm>>,
}

/// An angle as a linear form: coefficients by symbol, and a constant, rad.
#[derive(Clone, Debug)]
struct LinearForm {
    terms: Vec<(usize, Float320)>,
    constant: Float320,
}

impl<'g> Evaluator<'g> {
    /// Prepares the evaluation of `roots`.
    pub(super) fn new(graph: &'g Graph, roots: Vec<Ex>) -> Self {
        let mut visited = vec![false; graph.len()];
        let mut order = Vec::new();
        let mut stack = roots.clone();
        while let Some(ex) = stack.pop() {
            if !std::mem::replace(&mut visited[ex.index()], true) {
                order.push(ex);
                stack.extend(graph.children(ex));
            }
        }
        // children have smaller indices than their parents
        order.sort();
        let mut constants = Vec::new();
        let mut angles = Vec::new();
        for &ex in &order {
            match graph.node(ex) {
                Node::Constant(id) => {
                    let value = Float320::from_number(graph.number(id));
                    put(&mut constants, id as usize, value, Float320::ZERO);
                }
                Node::Sin(id) | Node::Cos(id) => {
                    let angle = graph.angle(id);
                    let terms = angle.terms.iter();
                    let form = LinearForm {
                        terms: terms
                            .map(|(symbol, c)| (symbol.index(), Float320::from_number(c)))
                            .collect(),
                        constant: Float320::from_number(&angle.constant),
                    };
                    put(&mut angles, id.index(), Some(form), None);
                }
                _ => {}
            }
        }
        Evaluator {
            graph,
            order,
            roots,
            constants,
            angles,
        }
    }

    /// Evaluates the roots. `symbols` has a value for each symbol in order of creation (missing
    /// ones are 0). `None` if a divisor is 0, a number under a square root is negative, or a linear
    /// system is singular.
    pub(super) fn run(&self, symbols: &[Float320]) -> Option<Vec<Float320>> {
        let mut values = vec![Float320::ZERO; self.graph.len()];
        let mut sines_and_cosines: Vec<Option<(Float320, Float320)>> =
            vec![None; self.angles.len()];
        let mut solutions: Vec<Option<Vec<Vec<Float320>>>> = Vec::new();
        let zero_or_one = |yes: bool| if yes { Float320::ONE } else { Float320::ZERO };
        for &ex in &self.order {
            let at = |e: Ex| values[e.index()];
            let mut sin_cos = |id: AngleId| {
                *sines_and_cosines[id.index()].get_or_insert_with(|| self.sin_cos(id, symbols))
            };
            let value = match self.graph.node(ex) {
                Node::Constant(id) => self.constants[id as usize],
                Node::Symbol(id) => symbols.get(id.index()).copied().unwrap_or(Float320::ZERO),
                Node::Neg(a) => -at(a),
                Node::Add(a, b) => at(a) + at(b),
                Node::Sub(a, b) => at(a) - at(b),
                Node::Mul(a, b) => at(a) * at(b),
                Node::Div(a, b) => at(a).checked_div(at(b))?,
                Node::Sin(id) => sin_cos(id).0,
                Node::Cos(id) => sin_cos(id).1,
                Node::SinOf(a) => at(a).sin_cos().0,
                Node::CosOf(a) => at(a).sin_cos().1,
                Node::Sqrt(a) => at(a).sqrt()?,
                Node::Sign(a) => {
                    zero_or_one(at(a) > Float320::ZERO) - zero_or_one(at(a).is_negative())
                }
                Node::Positive(a) => zero_or_one(at(a) > Float320::ZERO),
                Node::Negative(a) => zero_or_one(at(a).is_negative()),
                Node::Solved(id, row, column) => {
                    if solutions.len() <= id.index() {
                        solutions.resize(id.index() + 1, None);
                    }
                    let solution = &mut solutions[id.index()];
                    if solution.is_none() {
                        let system = self.graph.system(id);
                        let wide = |rows: &[Vec<Ex>]| -> Vec<Vec<Float320>> {
                            rows.iter()
                                .map(|row| row.iter().map(|e| at(*e)).collect())
                                .collect()
                        };
                        *solution = Some(solve(wide(&system.matrix), wide(&system.rhs))?);
                    }
                    solution.as_ref()?[row as usize][column as usize]
                }
            };
            values[ex.index()] = value;
        }
        Some(self.roots.iter().map(|r| values[r.index()]).collect())
    }

    /// Sine and cosine of an angle.
    fn sin_cos(&self, id: AngleId, symbols: &[Float320]) -> (Float320, Float320) {
        let Some(form) = &self.angles[id.index()] else {
            return (Float320::ZERO, Float320::ONE);
        };
        let angle = form.terms.iter().fold(form.constant, |sum, (symbol, c)| {
            let value = symbols.get(*symbol).copied().unwrap_or(Float320::ZERO);
            sum + *c * value
        });
        angle.sin_cos()
    }
}

/// Writes `value` at an index; the vector is extended by `empty` where necessary.
fn put<T: Clone>(to: &mut Vec<T>, at: usize, value: T, empty: T) {
    if to.len() <= at {
        to.resize(at + 1, empty);
    }
    to[at] = value;
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::sym::{Angle, Number, System};

    #[test]
    fn values_are_those_of_double_precision() {
        let mut g = Graph::new();
        let (x, y) = (g.symbol("x"), g.symbol("y"));
        let third = g.constant(Number::ratio(-1, 3).unwrap());
        let angle = Angle {
            terms: vec![
                (g.symbol_id("x"), Number::from_i64(2)),
                (g.symbol_id("y"), Number::from_i64(-1)),
            ],
            constant: Number::parse_decimal("0.3").unwrap(),
        };
        let (sine, cosine) = g.sin_cos(&angle);
        let scaled = g.mul(third, cosine);
        let quotient = g.div(sine, y).unwrap();
        let sum = g.add(quotient, scaled);
        let difference = g.sub(x, sum);
        let system = g.add_system(System {
            matrix: vec![vec![x, sine], vec![cosine, y]],
            rhs: vec![vec![sum], vec![x]],
            fixed: vec![vec![x], vec![y]],
            pivots: vec![],
        });
        let solved = [g.solved(system, 0, 0), g.solved(system, 1, 0)];
        let signs = [g.sign(difference), g.positive(sum), g.negative(sum)];
        let mut roots = vec![difference, sum];
        roots.extend(solved);
        roots.extend(signs);
        let point = [0.7, -1.9];
        let doubles = crate::sym::eval::Evaluator::new(&g, roots.clone()).run(&point);
        let wide = Evaluator::new(&g, roots);
        let wide = wide.run(&point.map(Float320::from_f64)).unwrap();
        assert_eq!(wide.len(), doubles.len());
        for (w, d) in wide.iter().zip(&doubles) {
            assert!((w.to_f64() - d).abs() < 1e-14, "{} {d}", w.to_f64());
        }
    }

    #[test]
    fn a_division_by_zero_has_no_value() {
        let mut g = Graph::new();
        let (x, y) = (g.symbol("x"), g.symbol("y"));
        let quotient = g.div(x, y).unwrap();
        let evaluator = Evaluator::new(&g, vec![quotient]);
        assert!(evaluator.run(&[Float320::ONE, Float320::ZERO]).is_none());
    }
}
