//! Replaces the expression that computes a value by another expression of other values of the
//! program, if this takes fewer operations.
//!
//! For example, `a*c + a*d` takes two products and a sum; where `c + d` is computed for another
//! purpose, `a*(c + d)` takes one product. Likewise, the moment that an offset adds is the offset
//! times an entry that is computed already. Such relations are found by value. The program is
//! evaluated modulo a prime, at random inputs and at random points of the unit circle for sines and
//! cosines, and each value is compared with sums, products, and products plus or minus a third
//! value, of values that are available before it. All are rational functions of the random numbers,
//! so a relation that does not hold everywhere holds at random numbers with a probability of at
//! most their degree over the prime, some 1e-16 (Schwartz, 1980; Zippel, 1979), and a second set of
//! random numbers has to agree.
//!
//! A relation that is exact over rational numbers may lose digits or be undefined in floating
//! point: so a value is not recovered from a sum with a far larger one, nor from quotients if it
//! was computed without a division.

use rustc_hash::FxHashMap;

use super::program::{Op, Program};

mod field;
mod rewrite;
mod steps;
mod uses;
mod values;

use rewrite::Rewrite;
use uses::Uses;
use values::{Value, values};

/// Programs of more values are not searched: the products of all pairs are stored.
const MAX_VALUES: usize = 800;

/// Largest number of passes over all steps: a step that is saved leaves other values with fewer
/// uses.
const MAX_PASSES: usize = 4;

/// Applies relations until there are none, or [`MAX_PASSES`] times.
pub(super) fn relate(program: &mut Program) {
    for _ in 0..MAX_PASSES {
        let values = values(program);
        if values.len() > MAX_VALUES || !sweep(program, &values) {
            return;
        }
        program.drop_double_negations();
        program.drop_unused();
    }
}

/// Largest factor by which the bound on a value's rounding errors may grow.
const MAX_ERROR_GROWTH: f64 = 2.0;

/// The number of products and of sums (additions and subtractions) of one or more operations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Cost {
    products: i32,
    sums: i32,
}

/// The cost of an operation; zero for operations that are never replaced.
fn cost(op: &Op) -> Cost {
    let (products, sums) = match op {
        Op::Add(..) | Op::Sub(..) => (0, 1),
        Op::Mul(..) => (1, 0),
        Op::MulAdd(..) | Op::NegMulAdd(..) | Op::MulSub(..) => (1, 1),
        _ => (0, 0),
    };
    Cost { products, sums }
}

/// Whether an operation is a sum or a product, which may be replaced.
fn is_arithmetic(op: &Op) -> bool {
    cost(op) != Cost::default()
}

/// Makes one pass over all steps; returns whether anything changed.
fn sweep(program: &mut Program, values: &[Value]) -> bool {
    let table = ValueTable::of(values);
    let mut uses = Uses::of(program);
    let mut negated_operations: Vec<(usize, Op)> = Vec::new();
    let mut changed = false;
    for value in values {
        let Some(target) = value.available_at.checked_sub(1) else {
            continue;
        };
        if uses.is_dead[target] || !is_arithmetic(&program.steps[target].op) {
            continue;
        }
        let savings = uses.saved_without(program, target, &[]);
        // steps of a group may be reordered, so that values computed later in the group are allowed
        let end = program.groups.iter().find(|g| g.steps.contains(&target));
        let end = end.map_or(target, |group| group.steps.end);
        let mut best = None;
        table.candidates(values, end, value, savings, |rewrite| {
            let operand_indices = rewrite.operand_indices();
            let is_allowed = operand_indices.iter().all(|index| {
                let other = &values[*index];
                other.available_at <= end && (value.has_quotient || !other.has_quotient)
            });
            let is_allowed =
                is_allowed && rewrite.absolute_sum(values) <= MAX_ERROR_GROWTH * value.absolute_sum;
            let agrees =
                || (0..2).all(|draw| rewrite.residue(values, draw) == value.residues[draw]);
            if !is_allowed || !agrees() {
                return;
            }
            let op = rewrite.op(values).0;
            if uses.depends_on(program, &op, target) {
                return;
            }
            let improvement = uses.improvement(program, target, &op);
            if improvement.is_some()
                && improvement
                    > best
                        .as_ref()
                        .and_then(|(best_improvement, _)| *best_improvement)
            {
                best = Some((improvement, rewrite));
            }
        });
        let Some((_, rewrite)) = best else { continue };
        let (op, is_negated) = rewrite.op(values);
        uses.replace(program, target, &op);
        program.steps[target].op = op.clone();
        if is_negated {
            negated_operations.push((target, op));
        }
        changed = true;
    }
    program.insert_negated(negated_operations);
    program.sort_groups();
    changed
}

/// Index of values and of products of two values, by their value for the first set of random
/// numbers.
struct ValueTable {
    values: FxHashMap<u64, usize>,
    /// The first pair with this product.
    products: FxHashMap<u64, (usize, usize)>,
}

impl ValueTable {
    fn of(values: &[Value]) -> Self {
        let mut table = ValueTable {
            values: FxHashMap::default(),
            products: FxHashMap::default(),
        };
        for (b, second) in values.iter().enumerate() {
            table.values.entry(second.residues[0]).or_insert(b);
            for (a, first) in values[..=b].iter().enumerate() {
                let product = field::mul(first.residues[0], second.residues[0]);
                table.products.entry(product).or_insert((a, b));
            }
        }
        table
    }

    /// Calls `propose` with expressions that equal the value for the first set of random numbers
    /// and take fewer operations than `products` and `sums` together: what the program saves if the
    /// value's step is dropped with the steps that only this step uses.
    ///
    /// Only the operand `c` is restricted to values that are available by step `end`; the caller
    /// checks the others.
    fn candidates(
        &self,
        values: &[Value],
        end: usize,
        value: &Value,
        Cost { products, sums }: Cost,
        mut propose: impl FnMut(Rewrite),
    ) {
        let residue = value.residues[0];
        let product = |residue: u64| self.products.get(&residue).copied();
        if products > 0 && products + sums > 1 {
            if let Some((a, b)) = product(residue) {
                propose(Rewrite::Product(a, b));
            }
            if let Some((a, b)) = product(field::neg(residue)) {
                propose(Rewrite::NegMul(a, b));
            }
        }
        if sums == 0 || products + sums < 2 {
            return;
        }
        let available = values.iter().take_while(|other| other.available_at <= end);
        for (c, third) in available.enumerate() {
            let without_c = field::sub(residue, third.residues[0]);
            let with_c = field::add(residue, third.residues[0]);
            if let Some(a) = self.values.get(&without_c) {
                propose(Rewrite::Sum(*a, c));
            }
            if let Some(a) = self.values.get(&with_c) {
                propose(Rewrite::Difference(*a, c));
            }
            if products == 0 || products + sums < 3 {
                continue;
            }
            if let Some((a, b)) = product(without_c) {
                propose(Rewrite::MulAdd(a, b, c));
            }
            if let Some((a, b)) = product(field::neg(without_c)) {
                propose(Rewrite::NegMulAdd(a, b, c));
            }
            if let Some((a, b)) = product(with_c) {
                propose(Rewrite::MulSub(a, b, c));
            }
        }
    }
}

#[cfg(test)]
mod tests;
