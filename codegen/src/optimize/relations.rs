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

use super::program::{Op, Operand, Program, Step, Temp};

mod field;

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

/// A value that can be an operand.
struct Value {
    operand: Operand,
    /// The number of steps after which it is available: 0 for inputs and constants.
    available_at: usize,
    /// Its value modulo the prime, for each of two sets of random numbers.
    residues: [u64; 2],
    /// The sum of the absolute values of its terms, for inputs of about one; its rounding errors
    /// are proportional to this sum.
    absolute_sum: f64,
    /// Whether its computation contains a division.
    has_quotient: bool,
}

/// An expression that may replace a value; its operands are indices of other values.
#[derive(Clone, Copy)]
enum Rewrite {
    /// `a + b`
    Sum(usize, usize),
    /// `a - b`
    Difference(usize, usize),
    /// `a b`
    Product(usize, usize),
    /// `-a b`
    NegMul(usize, usize),
    /// `a b + c`
    MulAdd(usize, usize, usize),
    /// `c - a b`
    NegMulAdd(usize, usize, usize),
    /// `a b - c`
    MulSub(usize, usize, usize),
}

impl Rewrite {
    /// The indices of its operands in the list of values.
    fn operand_indices(self) -> Vec<usize> {
        match self {
            Rewrite::Sum(a, b)
            | Rewrite::Difference(a, b)
            | Rewrite::Product(a, b)
            | Rewrite::NegMul(a, b) => {
                vec![a, b]
            }
            Rewrite::MulAdd(a, b, c) | Rewrite::NegMulAdd(a, b, c) | Rewrite::MulSub(a, b, c) => {
                vec![a, b, c]
            }
        }
    }

    /// Its value modulo the prime, for one set of random numbers.
    fn residue(self, values: &[Value], draw: usize) -> u64 {
        let residue = |index: usize| values[index].residues[draw];
        match self {
            Rewrite::Sum(a, b) => field::add(residue(a), residue(b)),
            Rewrite::Difference(a, b) => field::sub(residue(a), residue(b)),
            Rewrite::Product(a, b) => field::mul(residue(a), residue(b)),
            Rewrite::NegMul(a, b) => field::neg(field::mul(residue(a), residue(b))),
            Rewrite::MulAdd(a, b, c) => field::add(field::mul(residue(a), residue(b)), residue(c)),
            Rewrite::NegMulAdd(a, b, c) => {
                field::sub(residue(c), field::mul(residue(a), residue(b)))
            }
            Rewrite::MulSub(a, b, c) => field::sub(field::mul(residue(a), residue(b)), residue(c)),
        }
    }

    /// The bound on the sum of the absolute values of its terms.
    fn absolute_sum(self, values: &[Value]) -> f64 {
        let absolute_sum = |index: usize| values[index].absolute_sum;
        match self {
            Rewrite::Sum(a, b) | Rewrite::Difference(a, b) => absolute_sum(a) + absolute_sum(b),
            Rewrite::Product(a, b) | Rewrite::NegMul(a, b) => absolute_sum(a) * absolute_sum(b),
            Rewrite::MulAdd(a, b, c) | Rewrite::NegMulAdd(a, b, c) | Rewrite::MulSub(a, b, c) => {
                absolute_sum(a) * absolute_sum(b) + absolute_sum(c)
            }
        }
    }

    /// The operation of the step, and whether a second step must negate its result, as for
    /// [`Rewrite::NegMul`].
    fn op(self, values: &[Value]) -> (Op, bool) {
        let operand = |index: usize| values[index].operand;
        match self {
            Rewrite::Sum(a, b) => (Op::Add(operand(a), operand(b)), false),
            Rewrite::Difference(a, b) => (Op::Sub(operand(a), operand(b)), false),
            Rewrite::Product(a, b) => (Op::Mul(operand(a), operand(b)), false),
            Rewrite::NegMul(a, b) => match operand(a) {
                Operand::Constant(c) => (Op::Mul(Operand::Constant(-c), operand(b)), false),
                factor => (Op::Mul(factor, operand(b)), true),
            },
            Rewrite::MulAdd(a, b, c) => (Op::MulAdd(operand(a), operand(b), operand(c)), false),
            Rewrite::NegMulAdd(a, b, c) => {
                (Op::NegMulAdd(operand(a), operand(b), operand(c)), false)
            }
            Rewrite::MulSub(a, b, c) => (Op::MulSub(operand(a), operand(b), operand(c)), false),
        }
    }
}

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

/// All values that a program's steps can have as operands, in the order of computation.
fn values(program: &Program) -> Vec<Value> {
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
            // the square root of a number at most 1 larger: of the size of a length
            Op::Sqrt(a) => (libm::sqrt(bound(a).0).max(1.0), bound(a).1),
            Op::SinCos(_) | Op::Sign(_) | Op::Positive(_) | Op::Negative(_) => continue,
        };
        for result in &step.results {
            absolute_sums[result.0 as usize] = bound_of_result;
        }
    }
    absolute_sums
}

/// The same of an operand.
fn absolute_sum_of(operand: &Operand, absolute_sums: &[(f64, bool)]) -> (f64, bool) {
    match *operand {
        Operand::Input { .. } => (1.0, false),
        Operand::Constant(c) => (c.abs(), false),
        Operand::Temp(t) => absolute_sums[t.0 as usize],
    }
}

/// The values of a program at random inputs, modulo the prime.
struct RandomValues {
    /// The number of the set of random numbers, 0 or 1.
    draw: u64,
    /// The residue of each temporary.
    temps: Vec<u64>,
}

impl RandomValues {
    fn new(program: &Program, draw: u64) -> Self {
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
    fn residue(&self, operand: &Operand) -> u64 {
        match *operand {
            Operand::Input { argument, element } => {
                field::drawn(((argument as u64) << 32) + element as u64, self.draw)
            }
            Operand::Constant(c) => field::of(c),
            Operand::Temp(t) => self.temps[t.0 as usize],
        }
    }
}

/// The uses of temporaries, updated while steps change.
struct Uses {
    /// For each temporary, how often it is an operand of a step that is not dead, or an output.
    count: Vec<u32>,
    /// For each temporary, the index of the step that computes it.
    producer: Vec<usize>,
    /// For each step, whether it is dead: its results are no longer used.
    is_dead: Vec<bool>,
}

impl Uses {
    fn of(program: &Program) -> Self {
        let mut uses = Uses {
            count: vec![0; program.names.len()],
            producer: vec![usize::MAX; program.names.len()],
            is_dead: vec![false; program.steps.len()],
        };
        for (index, step) in program.steps.iter().enumerate() {
            for result in &step.results {
                uses.producer[result.0 as usize] = index;
            }
        }
        let operands = program.steps.iter().flat_map(|s| s.op.operands());
        for operand in operands.chain(program.outputs.iter().copied()) {
            if let Operand::Temp(t) = operand {
                uses.count[t.0 as usize] += 1;
            }
        }
        uses
    }

    /// The steps that are dead if the step `target` is dropped: `target` itself, then the steps
    /// whose results only these use. Each value in `extra_uses` counts as used once more, as by the
    /// operation that replaces the step.
    fn steps_dead_without(
        &self,
        program: &Program,
        target: usize,
        extra_uses: &[Operand],
    ) -> Vec<usize> {
        let mut removed_uses: FxHashMap<Temp, i64> = FxHashMap::default();
        for operand in extra_uses {
            if let Operand::Temp(t) = operand {
                *removed_uses.entry(*t).or_default() -= 1;
            }
        }
        let mut steps = vec![target];
        let mut position = 0;
        while let Some(&step) = steps.get(position) {
            position += 1;
            for operand in program.steps[step].op.operands() {
                let Operand::Temp(t) = operand else { continue };
                let removed_uses = removed_uses.entry(t).or_default();
                *removed_uses += 1;
                let producer_step = self.producer[t.0 as usize];
                let has_one_result = program.steps[producer_step].results.len() == 1;
                if has_one_result && i64::from(self.count[t.0 as usize]) == *removed_uses {
                    steps.push(producer_step);
                }
            }
        }
        steps
    }

    /// The operations that the program saves if the step `target` is dropped with all steps that
    /// are dead without it.
    fn saved_without(&self, program: &Program, target: usize, extra_uses: &[Operand]) -> Cost {
        let steps = self.steps_dead_without(program, target, extra_uses);
        let costs = steps.iter().map(|step| cost(&program.steps[*step].op));
        costs.fold(Cost::default(), |sum, cost| Cost {
            products: sum.products + cost.products,
            sums: sum.sums + cost.sums,
        })
    }

    /// The number of operations that the program saves if `op` replaces the operation of the step
    /// `target`, and the number of products among them; `None` if it saves nothing, or if an
    /// operand of `op` is the result of a dead step.
    fn improvement(&self, program: &Program, target: usize, op: &Op) -> Option<(i32, i32)> {
        let operands = op.operands();
        let uses_dead_value = operands
            .iter()
            .any(|o| matches!(o, Operand::Temp(t) if self.is_dead[self.producer[t.0 as usize]]));
        let (savings, needed) = (self.saved_without(program, target, &operands), cost(op));
        let products = savings.products - needed.products;
        let sums = savings.sums - needed.sums;
        let saves_operations = products >= 0 && sums >= 0 && products + sums > 0;
        (saves_operations && !uses_dead_value).then_some((products + sums, products))
    }

    /// Whether an operation depends on the result of the step `target`, directly or through others.
    fn depends_on(&self, program: &Program, op: &Op, target: usize) -> bool {
        let mut visited = vec![false; program.steps.len()];
        let mut operands = op.operands();
        while let Some(operand) = operands.pop() {
            let Operand::Temp(t) = operand else { continue };
            let producer_step = self.producer[t.0 as usize];
            if producer_step == target {
                return true;
            }
            if !std::mem::replace(&mut visited[producer_step], true) {
                operands.extend(program.steps[producer_step].op.operands());
            }
        }
        false
    }

    /// Updates the uses when a step gets another operation.
    fn replace(&mut self, program: &Program, target: usize, op: &Op) {
        let operands = op.operands();
        let steps = self.steps_dead_without(program, target, &operands);
        for operand in operands {
            if let Operand::Temp(t) = operand {
                self.count[t.0 as usize] += 1;
            }
        }
        for step in steps {
            self.is_dead[step] = step != target;
            for operand in program.steps[step].op.operands() {
                if let Operand::Temp(t) = operand {
                    self.count[t.0 as usize] -= 1;
                }
            }
        }
    }
}

impl Program {
    /// Inserts each operation as a new step before the step of the given index; that step then
    /// negates the new step's result. The indices are in increasing order.
    fn insert_negated(&mut self, operations: Vec<(usize, Op)>) {
        let step_indices: Vec<usize> = operations.iter().map(|(index, _)| *index).collect();
        // from the back, so that the indices before it stay valid
        for (index, op) in operations.into_iter().rev() {
            let temp = Temp(self.names.len() as u32);
            self.names.push(None);
            self.steps[index].op = Op::Neg(Operand::Temp(temp));
            let step = Step {
                op,
                results: vec![temp],
            };
            self.steps.insert(index, step);
        }
        let shifted = |index: usize| {
            index
                + step_indices
                    .iter()
                    .filter(|inserted| **inserted < index)
                    .count()
        };
        for group in &mut self.groups {
            group.steps = shifted(group.steps.start)..shifted(group.steps.end);
        }
    }

    /// Orders the steps of every group so that each follows its operands, with as few changes as
    /// possible.
    fn sort_groups(&mut self) {
        let mut producer = vec![usize::MAX; self.names.len()];
        for (index, step) in self.steps.iter().enumerate() {
            for result in &step.results {
                producer[result.0 as usize] = index;
            }
        }
        let mut is_ordered = vec![false; self.steps.len()];
        let mut order = Vec::with_capacity(self.steps.len());
        for group in &self.groups {
            for index in group.steps.clone() {
                let mut stack = vec![index];
                while let Some(&step) = stack.last() {
                    let operands = self.steps[step].op.operands().into_iter();
                    let producer_steps = operands.filter_map(|o| match o {
                        Operand::Temp(t) => Some(producer[t.0 as usize]),
                        Operand::Input { .. } | Operand::Constant(_) => None,
                    });
                    let unordered_producer = producer_steps
                        .filter(|producer_step| !is_ordered[*producer_step])
                        .min();
                    if let (Some(unordered_producer), false) =
                        (unordered_producer, is_ordered[step])
                    {
                        stack.push(unordered_producer);
                        continue;
                    }
                    stack.pop();
                    if !std::mem::replace(&mut is_ordered[step], true) {
                        order.push(step);
                    }
                }
            }
        }
        let mut steps: Vec<Option<Step>> = self.steps.drain(..).map(Some).collect();
        self.steps = order
            .into_iter()
            .filter_map(|index| steps[index].take())
            .collect();
    }

    /// Replaces every use of `-(-a)` by `a`.
    fn drop_double_negations(&mut self) {
        let mut negated_operand: FxHashMap<Temp, Operand> = FxHashMap::default();
        let mut replacement: FxHashMap<Temp, Operand> = FxHashMap::default();
        for step in &mut self.steps {
            let without_double_negation = |o: &Operand| match o {
                Operand::Temp(t) => replacement.get(t).copied().unwrap_or(*o),
                _ => *o,
            };
            step.op.change_operands(without_double_negation);
            if let (Op::Neg(a), [result]) = (&step.op, &step.results[..]) {
                let inner = match a {
                    Operand::Temp(t) => negated_operand.get(t).copied(),
                    _ => None,
                };
                match inner {
                    Some(value) => replacement.insert(*result, value),
                    None => negated_operand.insert(*result, *a),
                };
            }
        }
        for output in &mut self.outputs {
            if let Operand::Temp(t) = output {
                *output = replacement.get(t).copied().unwrap_or(*output);
            }
        }
    }
}

#[cfg(test)]
mod tests;
