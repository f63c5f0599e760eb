//! Replaces values by expressions of others that take fewer operations.
//!
//! A program may compute one value in two ways that look different: the moment that an offset adds
//! is the offset times an entry that is computed already; a sum of two products is one product of
//! other sums. Such relations are found by value. The program is evaluated modulo a prime, at
//! random inputs and at random points of the unit circle for sines and cosines, and each value is
//! compared with sums, products, and products plus or minus a third value, of values computed
//! before it. All are rational functions of the random numbers, so a relation that does not hold
//! everywhere holds at random numbers with a probability of at most their degree over the prime,
//! some 1e-16 (Schwartz, 1980; Zippel, 1979), and a second set of random numbers has to agree.
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
    /// The number of steps after which it is computed.
    available_at: usize,
    /// Its value modulo the prime, for each of two sets of random numbers.
    residues: [u64; 2],
    /// The sum of the absolute values of all its terms; rounding errors are proportional to it.
    size: f64,
    /// Whether a quotient contributes to it.
    quotient: bool,
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
        let at = |place: usize| values[place].residues[draw];
        match self {
            Rewrite::Sum(a, b) => field::add(at(a), at(b)),
            Rewrite::Difference(a, b) => field::sub(at(a), at(b)),
            Rewrite::Product(a, b) => field::mul(at(a), at(b)),
            Rewrite::NegMul(a, b) => field::neg(field::mul(at(a), at(b))),
            Rewrite::MulAdd(a, b, c) => field::add(field::mul(at(a), at(b)), at(c)),
            Rewrite::NegMulAdd(a, b, c) => field::sub(at(c), field::mul(at(a), at(b))),
            Rewrite::MulSub(a, b, c) => field::sub(field::mul(at(a), at(b)), at(c)),
        }
    }

    /// The bound on the sum of the absolute values of its terms.
    fn size(self, values: &[Value]) -> f64 {
        let at = |place: usize| values[place].size;
        match self {
            Rewrite::Sum(a, b) | Rewrite::Difference(a, b) => at(a) + at(b),
            Rewrite::Product(a, b) | Rewrite::NegMul(a, b) => at(a) * at(b),
            Rewrite::MulAdd(a, b, c) | Rewrite::NegMulAdd(a, b, c) | Rewrite::MulSub(a, b, c) => {
                at(a) * at(b) + at(c)
            }
        }
    }

    /// The operation, and whether its result must still be negated, as [`Rewrite::NegMul`] does.
    fn op(self, values: &[Value]) -> (Op, bool) {
        let at = |place: usize| values[place].operand;
        match self {
            Rewrite::Sum(a, b) => (Op::Add(at(a), at(b)), false),
            Rewrite::Difference(a, b) => (Op::Sub(at(a), at(b)), false),
            Rewrite::Product(a, b) => (Op::Mul(at(a), at(b)), false),
            Rewrite::NegMul(a, b) => match at(a) {
                Operand::Constant(c) => (Op::Mul(Operand::Constant(-c), at(b)), false),
                factor => (Op::Mul(factor, at(b)), true),
            },
            Rewrite::MulAdd(a, b, c) => (Op::MulAdd(at(a), at(b), at(c)), false),
            Rewrite::NegMulAdd(a, b, c) => (Op::NegMulAdd(at(a), at(b), at(c)), false),
            Rewrite::MulSub(a, b, c) => (Op::MulSub(at(a), at(b), at(c)), false),
        }
    }
}

/// The number of products and of sums of an operation.
fn cost(op: &Op) -> [i32; 2] {
    match op {
        Op::Add(..) | Op::Sub(..) => [0, 1],
        Op::Mul(..) => [1, 0],
        Op::MulAdd(..) | Op::NegMulAdd(..) | Op::MulSub(..) => [1, 1],
        _ => [0, 0],
    }
}

/// Whether an operation is a sum or a product, which may be replaced.
fn is_arithmetic(op: &Op) -> bool {
    cost(op) != [0, 0]
}

/// Makes one pass over all steps; returns whether anything changed.
fn sweep(program: &mut Program, values: &[Value]) -> bool {
    let known = ValueTable::of(values);
    let mut uses = Uses::of(program);
    let mut signs: Vec<(usize, Op)> = Vec::new();
    let mut changed = false;
    for value in values {
        let Some(at) = value.available_at.checked_sub(1) else {
            continue;
        };
        if uses.dead[at] || !is_arithmetic(&program.steps[at].op) {
            continue;
        }
        let saved = uses.saved(program, at, &[]);
        // steps of a group may be reordered
        let end = program.groups.iter().find(|g| g.steps.contains(&at));
        let end = end.map_or(at, |group| group.steps.end);
        let mut best = None;
        known.candidates(values, end, value, saved, |rewrite| {
            let operand_indices = rewrite.operand_indices();
            let is_allowed = operand_indices.iter().all(|place| {
                let other = &values[*place];
                other.available_at <= end && (value.quotient || !other.quotient)
            });
            let is_allowed = is_allowed && rewrite.size(values) <= MAX_ERROR_GROWTH * value.size;
            let agrees =
                || (0..2).all(|draw| rewrite.residue(values, draw) == value.residues[draw]);
            if !is_allowed || !agrees() {
                return;
            }
            let op = rewrite.op(values).0;
            if uses.needs(program, &op, at) {
                return;
            }
            let improvement = uses.improvement(program, at, &op);
            if improvement.is_some() && improvement > best.as_ref().and_then(|(most, _)| *most) {
                best = Some((improvement, rewrite));
            }
        });
        let Some((_, rewrite)) = best else { continue };
        let (op, sign) = rewrite.op(values);
        uses.replace(program, at, &op);
        program.steps[at].op = op.clone();
        if sign {
            signs.push((at, op));
        }
        changed = true;
    }
    program.insert_negated(signs);
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
        let mut known = ValueTable {
            values: FxHashMap::default(),
            products: FxHashMap::default(),
        };
        for (b, second) in values.iter().enumerate() {
            known.values.entry(second.residues[0]).or_insert(b);
            for (a, first) in values[..=b].iter().enumerate() {
                let product = field::mul(first.residues[0], second.residues[0]);
                known.products.entry(product).or_insert((a, b));
            }
        }
        known
    }

    /// Calls `found` for expressions that equal the value for the first set of random numbers,
    /// whose operands are computed by step `end`, and which take fewer operations than the value's
    /// own (`products` and `sums`).
    fn candidates(
        &self,
        values: &[Value],
        end: usize,
        value: &Value,
        [products, sums]: [i32; 2],
        mut found: impl FnMut(Rewrite),
    ) {
        let residue = value.residues[0];
        let product = |residue: u64| self.products.get(&residue).copied();
        if products > 0 && products + sums > 1 {
            if let Some((a, b)) = product(residue) {
                found(Rewrite::Product(a, b));
            }
            if let Some((a, b)) = product(field::neg(residue)) {
                found(Rewrite::NegMul(a, b));
            }
        }
        if sums == 0 || products + sums < 2 {
            return;
        }
        let before = values.iter().take_while(|other| other.available_at <= end);
        for (c, third) in before.enumerate() {
            let less = field::sub(residue, third.residues[0]);
            let more = field::add(residue, third.residues[0]);
            if let Some(a) = self.values.get(&less) {
                found(Rewrite::Sum(*a, c));
            }
            if let Some(a) = self.values.get(&more) {
                found(Rewrite::Difference(*a, c));
            }
            if products == 0 || products + sums < 3 {
                continue;
            }
            if let Some((a, b)) = product(less) {
                found(Rewrite::MulAdd(a, b, c));
            }
            if let Some((a, b)) = product(field::neg(less)) {
                found(Rewrite::NegMulAdd(a, b, c));
            }
            if let Some((a, b)) = product(more) {
                found(Rewrite::MulSub(a, b, c));
            }
        }
    }
}

/// All values that a program's steps can have as operands, in the order of computation.
fn values(program: &Program) -> Vec<Value> {
    let draws = [RandomValues::new(program, 0), RandomValues::new(program, 1)];
    let sizes = sizes(program);
    let mut values = Vec::new();
    let mut add = |operand: Operand, available_at: usize| {
        let residues = draws.each_ref().map(|draw| draw.at(&operand));
        let (size, quotient) = size_of(&operand, &sizes);
        values.push(Value {
            operand,
            available_at,
            residues,
            size,
            quotient,
        });
    };
    let operands = program.steps.iter().flat_map(|s| s.op.operands());
    let mut given: Vec<(usize, usize)> = Vec::new();
    let mut constants: Vec<u64> = Vec::new();
    for operand in operands {
        match operand {
            Operand::Input { argument, element } => given.push((argument, element)),
            Operand::Constant(c) => constants.push(c.abs().to_bits()),
            Operand::Temp(_) => {}
        }
    }
    given.sort_unstable();
    given.dedup();
    constants.sort_unstable();
    constants.dedup();
    for c in constants {
        add(Operand::Constant(f64::from_bits(c)), 0);
    }
    for (argument, element) in given {
        add(Operand::Input { argument, element }, 0);
    }
    for (at, step) in program.steps.iter().enumerate() {
        // the operand of a sign change is among the values already
        if !matches!(step.op, Op::Neg(_)) {
            for result in &step.results {
                add(Operand::Temp(*result), at + 1);
            }
        }
    }
    values
}

/// For each temporary, the sum of the absolute values of its terms, with inputs of about one, and
/// whether a quotient contributes to it.
fn sizes(program: &Program) -> Vec<(f64, bool)> {
    let mut sizes = vec![(1.0, false); program.names.len()];
    for step in &program.steps {
        let at = |operand: &Operand| size_of(operand, &sizes);
        let plus = |a: (f64, bool), b: (f64, bool)| (a.0 + b.0, a.1 || b.1);
        let times = |a: (f64, bool), b: (f64, bool)| (a.0 * b.0, a.1 || b.1);
        let size = match &step.op {
            Op::Neg(a) => at(a),
            Op::Add(a, b) | Op::Sub(a, b) => plus(at(a), at(b)),
            Op::Mul(a, b) => times(at(a), at(b)),
            Op::MulAdd(a, b, c) | Op::NegMulAdd(a, b, c) | Op::MulSub(a, b, c) => {
                plus(times(at(a), at(b)), at(c))
            }
            Op::Div(a, _) => (at(a).0, true),
            // the solution of a singular system is undefined, like a quotient
            Op::Solve(_) => (1.0, true),
            Op::SinCos(_) | Op::Sign(_) | Op::Positive(_) | Op::Negative(_) => continue,
        };
        for result in &step.results {
            sizes[result.0 as usize] = size;
        }
    }
    sizes
}

fn size_of(operand: &Operand, sizes: &[(f64, bool)]) -> (f64, bool) {
    match *operand {
        Operand::Input { .. } => (1.0, false),
        Operand::Constant(c) => (c.abs(), false),
        Operand::Temp(t) => sizes[t.0 as usize],
    }
}

/// The values of a program at random inputs, modulo the prime.
struct RandomValues {
    draw: u64,
    temps: Vec<u64>,
}

impl RandomValues {
    fn new(program: &Program, draw: u64) -> Self {
        let mut drawn = RandomValues {
            draw,
            temps: vec![0; program.names.len()],
        };
        for step in &program.steps {
            let at = |operand: &Operand| drawn.at(operand);
            let value = match &step.op {
                Op::Neg(a) => field::neg(at(a)),
                Op::Add(a, b) => field::add(at(a), at(b)),
                Op::Sub(a, b) => field::sub(at(a), at(b)),
                Op::Mul(a, b) => field::mul(at(a), at(b)),
                Op::MulAdd(a, b, c) => field::add(field::mul(at(a), at(b)), at(c)),
                Op::NegMulAdd(a, b, c) => field::sub(at(c), field::mul(at(a), at(b))),
                Op::MulSub(a, b, c) => field::sub(field::mul(at(a), at(b)), at(c)),
                Op::Div(a, b) => field::mul(at(a), field::inverse(at(b))),
                Op::SinCos(_) => {
                    if let [sine, cosine] = step.results[..] {
                        let (s, c) = field::sin_cos(drawn.other(sine));
                        drawn.temps[sine.0 as usize] = s;
                        drawn.temps[cosine.0 as usize] = c;
                    }
                    continue;
                }
                // not rational functions: their results are random numbers
                Op::Sign(_) | Op::Positive(_) | Op::Negative(_) | Op::Solve(_) => {
                    for result in &step.results {
                        drawn.temps[result.0 as usize] = drawn.other(*result);
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
    fn other(&self, result: Temp) -> u64 {
        field::drawn((1 << 60) + u64::from(result.0), self.draw)
    }

    fn at(&self, operand: &Operand) -> u64 {
        match *operand {
            Operand::Input { argument, element } => {
                field::drawn(((argument as u64) << 32) + element as u64, self.draw)
            }
            Operand::Constant(c) => field::of(c),
            Operand::Temp(t) => self.temps[t.0 as usize],
        }
    }
}

/// The uses of values, updated while steps change.
struct Uses {
    count: Vec<u32>,
    /// For each value, the step that computes it.
    producer: Vec<usize>,
    /// For each step, whether its results are no longer used.
    dead: Vec<bool>,
}

impl Uses {
    fn of(program: &Program) -> Self {
        let mut uses = Uses {
            count: vec![0; program.names.len()],
            producer: vec![usize::MAX; program.names.len()],
            dead: vec![false; program.steps.len()],
        };
        for (at, step) in program.steps.iter().enumerate() {
            for result in &step.results {
                uses.producer[result.0 as usize] = at;
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

    /// The steps that would have no use without the step `at`, which comes first, if the values in
    /// `kept` were used once more.
    fn steps_only_for(&self, program: &Program, at: usize, kept: &[Operand]) -> Vec<usize> {
        let mut fewer: FxHashMap<Temp, i64> = FxHashMap::default();
        for operand in kept {
            if let Operand::Temp(t) = operand {
                *fewer.entry(*t).or_default() -= 1;
            }
        }
        let mut steps = vec![at];
        let mut next = 0;
        while let Some(&step) = steps.get(next) {
            next += 1;
            for operand in program.steps[step].op.operands() {
                let Operand::Temp(t) = operand else { continue };
                let fewer = fewer.entry(t).or_default();
                *fewer += 1;
                let maker = self.producer[t.0 as usize];
                let single = program.steps[maker].results.len() == 1;
                if single && i64::from(self.count[t.0 as usize]) == *fewer {
                    steps.push(maker);
                }
            }
        }
        steps
    }

    /// The number of products and sums that the program would save without a step.
    fn saved(&self, program: &Program, at: usize, kept: &[Operand]) -> [i32; 2] {
        let steps = self.steps_only_for(program, at, kept);
        let prices = steps.iter().map(|step| cost(&program.steps[*step].op));
        prices.fold([0, 0], |sum, p| [sum[0] + p[0], sum[1] + p[1]])
    }

    /// The number of operations saved by another operation in place of a step's, and of products
    /// among them; `None` if none are saved, or if an operand is no longer computed.
    fn improvement(&self, program: &Program, at: usize, op: &Op) -> Option<(i32, i32)> {
        let operands = op.operands();
        let gone = operands
            .iter()
            .any(|o| matches!(o, Operand::Temp(t) if self.dead[self.producer[t.0 as usize]]));
        let (saved, takes) = (self.saved(program, at, &operands), cost(op));
        let [products, sums] = [saved[0] - takes[0], saved[1] - takes[1]];
        let fewer = products >= 0 && sums >= 0 && products + sums > 0;
        (fewer && !gone).then_some((products + sums, products))
    }

    /// Whether an operation depends on the result of a step.
    fn needs(&self, program: &Program, op: &Op, at: usize) -> bool {
        let mut seen = vec![false; program.steps.len()];
        let mut operands = op.operands();
        while let Some(operand) = operands.pop() {
            let Operand::Temp(t) = operand else { continue };
            let maker = self.producer[t.0 as usize];
            if maker == at {
                return true;
            }
            if !std::mem::replace(&mut seen[maker], true) {
                operands.extend(program.steps[maker].op.operands());
            }
        }
        false
    }

    /// Updates the uses when a step gets another operation.
    fn replace(&mut self, program: &Program, at: usize, op: &Op) {
        let operands = op.operands();
        let steps = self.steps_only_for(program, at, &operands);
        for operand in operands {
            if let Operand::Temp(t) = operand {
                self.count[t.0 as usize] += 1;
            }
        }
        for step in steps {
            self.dead[step] = step != at;
            for operand in program.steps[step].op.operands() {
                if let Operand::Temp(t) = operand {
                    self.count[t.0 as usize] -= 1;
                }
            }
        }
    }
}

impl Program {
    /// Inserts an operation before each of the given steps, in order; the step then negates its
    /// result.
    fn insert_negated(&mut self, operations: Vec<(usize, Op)>) {
        let operand_indices: Vec<usize> = operations.iter().map(|(at, _)| *at).collect();
        // from the back, so that the indices before it stay valid
        for (at, op) in operations.into_iter().rev() {
            let temp = Temp(self.names.len() as u32);
            self.names.push(None);
            self.steps[at].op = Op::Neg(Operand::Temp(temp));
            let step = Step {
                op,
                results: vec![temp],
            };
            self.steps.insert(at, step);
        }
        let moved = |at: usize| at + operand_indices.iter().filter(|place| **place < at).count();
        for group in &mut self.groups {
            group.steps = moved(group.steps.start)..moved(group.steps.end);
        }
    }

    /// Orders the steps of every group so that each follows its operands, with as few changes as
    /// possible.
    fn sort_groups(&mut self) {
        let mut producer = vec![usize::MAX; self.names.len()];
        for (at, step) in self.steps.iter().enumerate() {
            for result in &step.results {
                producer[result.0 as usize] = at;
            }
        }
        let mut done = vec![false; self.steps.len()];
        let mut order = Vec::with_capacity(self.steps.len());
        for group in &self.groups {
            for at in group.steps.clone() {
                let mut stack = vec![at];
                while let Some(&step) = stack.last() {
                    let operands = self.steps[step].op.operands().into_iter();
                    let makers = operands.filter_map(|o| match o {
                        Operand::Temp(t) => Some(producer[t.0 as usize]),
                        Operand::Input { .. } | Operand::Constant(_) => None,
                    });
                    let first = makers.filter(|maker| !done[*maker]).min();
                    if let (Some(first), false) = (first, done[step]) {
                        stack.push(first);
                        continue;
                    }
                    stack.pop();
                    if !std::mem::replace(&mut done[step], true) {
                        order.push(step);
                    }
                }
            }
        }
        let mut steps: Vec<Option<Step>> = self.steps.drain(..).map(Some).collect();
        self.steps = order
            .into_iter()
            .filter_map(|at| steps[at].take())
            .collect();
    }

    /// Replaces values that are negated twice by the value itself.
    fn drop_double_negations(&mut self) {
        let mut of: FxHashMap<Temp, Operand> = FxHashMap::default();
        let mut same: FxHashMap<Temp, Operand> = FxHashMap::default();
        for step in &mut self.steps {
            let plain = |o: &Operand| match o {
                Operand::Temp(t) => same.get(t).copied().unwrap_or(*o),
                _ => *o,
            };
            step.op.change_operands(plain);
            if let (Op::Neg(a), [result]) = (&step.op, &step.results[..]) {
                let before = match a {
                    Operand::Temp(t) => of.get(t).copied(),
                    _ => None,
                };
                match before {
                    Some(value) => same.insert(*result, value),
                    None => of.insert(*result, *a),
                };
            }
        }
        for output in &mut self.outputs {
            if let Operand::Temp(t) = output {
                *output = same.get(t).copied().unwrap_or(*output);
            }
        }
    }
}

#[cfg(test)]
mod tests;
