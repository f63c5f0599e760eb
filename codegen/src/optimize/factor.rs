//! Rewrites the sums and products of a program: a factor that terms of one sum share is taken out,
//! and a product that several products share is computed once.
//!
//! Both expand only steps whose result is used once, so nothing is computed twice, and no rule adds
//! more operations than it saves.

use std::collections::{BTreeMap, BTreeSet};

use super::program::{Op, Operand, Program, Step, Temp};

/// An operand in a form that can be compared and ordered; constants by their bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Key {
    Constant(u64),
    Input(usize, usize),
    Temp(Temp),
}

fn key(operand: &Operand) -> Key {
    match *operand {
        Operand::Constant(c) => Key::Constant(c.to_bits()),
        Operand::Input { argument, element } => Key::Input(argument, element),
        Operand::Temp(t) => Key::Temp(t),
    }
}

fn operand(key: Key) -> Operand {
    match key {
        Key::Constant(bits) => Operand::Constant(f64::from_bits(bits)),
        Key::Input(argument, element) => Operand::Input { argument, element },
        Key::Temp(t) => Operand::Temp(t),
    }
}

/// A signed product, as a term of a sum.
#[derive(Clone, Debug)]
struct Term {
    negative: bool,
    factors: Vec<Key>,
}

/// The computation of a step, expanded.
#[derive(Clone, Debug)]
enum Form {
    /// An operation that is neither a sum nor a product.
    Other(Op),
    /// A sum of products with one or more terms.
    Sum(Vec<Term>),
    /// The step was expanded into the only step that uses it.
    Expanded,
}

/// Rewrites a program's sums and products with fewer operations.
pub(super) fn factor(program: &mut Program) {
    let mut work = Work::new(program);
    work.take_out_factors();
    work.share_products();
    work.write(program);
}

/// Largest number of passes that look for shared products.
const MAX_SHARING_PASSES: usize = 4;

/// The place of a sum: the index of a step, and for a new value before that step its temporary.
type Site = (usize, Option<Temp>);

struct Work {
    /// The expanded computation of each step.
    forms: Vec<Form>,
    /// The temporaries that each step computes.
    results: Vec<Vec<Temp>>,
    /// New values, by the step before which they are computed.
    before: BTreeMap<usize, Vec<(Temp, Vec<Term>)>>,
    /// The number of temporaries, new ones included.
    temps: u32,
}

/// The sum of products that a step computes; `None` for other operations.
fn terms(op: &Op) -> Option<Vec<Term>> {
    let term = |negative: bool, factors: &[&Operand]| Term {
        negative,
        factors: factors.iter().map(|o| key(o)).collect(),
    };
    Some(match op {
        Op::Add(a, b) => vec![term(false, &[a]), term(false, &[b])],
        Op::Sub(a, b) => vec![term(false, &[a]), term(true, &[b])],
        Op::Mul(a, b) => vec![term(false, &[a, b])],
        Op::MulAdd(a, b, c) => vec![term(false, &[a, b]), term(false, &[c])],
        Op::NegMulAdd(a, b, c) => vec![term(true, &[a, b]), term(false, &[c])],
        Op::MulSub(a, b, c) => vec![term(false, &[a, b]), term(true, &[c])],
        _ => return None,
    })
}

impl Work {
    fn new(program: &Program) -> Self {
        let mut uses = vec![0_u32; program.names.len()];
        let operands = program.steps.iter().flat_map(|s| s.op.operands());
        for operand in operands.chain(program.outputs.iter().copied()) {
            if let Operand::Temp(t) = operand {
                uses[t.0 as usize] += 1;
            }
        }
        // outputs must stay results of steps: further uses keep their steps from being expanded
        for t in program.outputs.iter().filter_map(|o| match o {
            Operand::Temp(t) => Some(t),
            _ => None,
        }) {
            uses[t.0 as usize] += 2;
        }
        let mut step_of = vec![usize::MAX; program.names.len()];
        let mut forms: Vec<Form> = Vec::with_capacity(program.steps.len());
        for (at, step) in program.steps.iter().enumerate() {
            for t in &step.results {
                step_of[t.0 as usize] = at;
            }
            let Some(own) = terms(&step.op) else {
                forms.push(Form::Other(step.op.clone()));
                continue;
            };
            let mut sum: Vec<Term> = Vec::new();
            for term in own {
                sum.extend(expanded(term, &mut forms, &step_of, &uses));
            }
            forms.push(Form::Sum(sum));
        }
        Work {
            forms,
            results: program.steps.iter().map(|s| s.results.clone()).collect(),
            before: BTreeMap::new(),
            temps: program.names.len() as u32,
        }
    }

    fn temp(&mut self) -> Temp {
        self.temps += 1;
        Temp(self.temps - 1)
    }

    /// Rewrites `a b + a c` as `a (b + c)`, starting with the factor that most terms of the sum
    /// share.
    fn take_out_factors(&mut self) {
        for at in 0..self.forms.len() {
            let Form::Sum(mut sum) = self.forms[at].clone() else {
                continue;
            };
            while let Some((shared, members)) = most_shared(&sum) {
                let first = members[0];
                let negative = sum[first].negative;
                let inner: Vec<Term> = members
                    .iter()
                    .map(|&m| {
                        let mut factors = sum[m].factors.clone();
                        if let Some(place) = factors.iter().position(|f| *f == shared) {
                            factors.remove(place);
                        }
                        Term {
                            negative: sum[m].negative != negative,
                            factors,
                        }
                    })
                    .collect();
                let t = self.temp();
                self.before.entry(at).or_default().push((t, inner));
                sum[first] = Term {
                    negative,
                    factors: vec![shared, Key::Temp(t)],
                };
                let mut place = 0;
                sum.retain(|_| {
                    place += 1;
                    place - 1 == first || !members.contains(&(place - 1))
                });
            }
            self.forms[at] = Form::Sum(sum);
        }
    }

    /// Computes products of two factors that several products share once, starting with the most
    /// frequent pair.
    fn share_products(&mut self) {
        for _ in 0..MAX_SHARING_PASSES {
            let mut sites: BTreeMap<(Key, Key), Vec<Site>> = BTreeMap::new();
            let mut long: BTreeSet<(Key, Key)> = BTreeSet::new();
            for (site, sum) in self.sums() {
                for term in sum {
                    for pair in pairs(&term.factors) {
                        sites.entry(pair).or_default().push(site);
                        if term.factors.len() > 2 {
                            long.insert(pair);
                        }
                    }
                }
            }
            let shared =
                |(pair, sites): &((Key, Key), Vec<Site>)| sites.len() > 1 && long.contains(pair);
            let mut order: Vec<_> = sites.into_iter().filter(shared).collect();
            if order.is_empty() {
                return;
            }
            order.sort_by_key(|(_, sites)| usize::MAX - sites.len());
            for (pair, sites) in order {
                self.share(pair, &sites);
            }
        }
    }

    /// All sums with their places, in the order of computation.
    fn sums(&self) -> Vec<(Site, &[Term])> {
        let mut all = Vec::new();
        for (at, form) in self.forms.iter().enumerate() {
            for (t, sum) in self.before.get(&at).into_iter().flatten() {
                all.push(((at, Some(*t)), sum.as_slice()));
            }
            if let Form::Sum(sum) = form {
                all.push(((at, None), sum.as_slice()));
            }
        }
        all
    }

    fn sum_at(&mut self, (at, value): Site) -> Option<&mut Vec<Term>> {
        match (value, &mut self.forms[at]) {
            (Some(value), _) => {
                let values = self.before.get_mut(&at)?;
                let found = values.iter_mut().find(|(t, _)| *t == value)?;
                Some(&mut found.1)
            }
            (None, Form::Sum(sum)) => Some(sum),
            (None, _) => None,
        }
    }

    /// Replaces a pair of factors by its product in these sums, if that still saves a product.
    fn share(&mut self, pair: (Key, Key), sites: &[Site]) {
        let has = |t: &Term| pairs(&t.factors).contains(&pair);
        let (mut count, mut long, mut first) = (0, false, None);
        for &site in sites {
            for term in self.sum_at(site).into_iter().flatten().filter(|t| has(t)) {
                count += 1;
                long |= term.factors.len() > 2;
                first = first.or(Some(site));
            }
        }
        let Some((at, _)) = first.filter(|_| count > 1 && long) else {
            return;
        };
        let t = self.temp();
        for &site in sites {
            for term in self.sum_at(site).into_iter().flatten().filter(|t| has(t)) {
                for factor in [pair.0, pair.1] {
                    if let Some(place) = term.factors.iter().position(|f| *f == factor) {
                        term.factors.remove(place);
                    }
                }
                term.factors.push(Key::Temp(t));
            }
        }
        let product = Term {
            negative: false,
            factors: vec![pair.0, pair.1],
        };
        // insert before all sums that use the product, and after the values that it is made of
        let values = self.before.entry(at).or_default();
        let own = |(t, _): &(Temp, Vec<Term>)| [pair.0, pair.1].contains(&Key::Temp(*t));
        let place = values.iter().rposition(own).map_or(0, |place| place + 1);
        values.insert(place, (t, vec![product]));
    }

    /// Writes the steps to the program, in the same groups.
    fn write(mut self, program: &mut Program) {
        let mut same: BTreeMap<Temp, Key> = BTreeMap::new();
        let mut steps: Vec<Step> = Vec::with_capacity(program.steps.len());
        // for each old step, the index of the first new step written for it
        let mut new_start = Vec::with_capacity(program.steps.len() + 1);
        let mut names = std::mem::take(&mut program.names);
        names.resize(self.temps as usize, None);
        let forms = std::mem::take(&mut self.forms);
        for (at, form) in forms.into_iter().enumerate() {
            new_start.push(steps.len());
            let mut out = Writer {
                steps: &mut steps,
                names: &mut names,
                same: &mut same,
            };
            for (t, sum) in self.before.remove(&at).unwrap_or_default() {
                out.sum(t, &sum);
            }
            match form {
                Form::Expanded => {}
                Form::Sum(sum) => out.sum(self.results[at][0], &sum),
                Form::Other(op) => out.other(op, self.results[at].clone()),
            }
        }
        new_start.push(steps.len());
        for group in &mut program.groups {
            group.steps = new_start[group.steps.start]..new_start[group.steps.end];
        }
        let out = Writer {
            steps: &mut steps,
            names: &mut names,
            same: &mut same,
        };
        let outputs = std::mem::take(&mut program.outputs);
        program.outputs = outputs
            .iter()
            .map(|o| out.current_operand(key(o)))
            .collect();
        program.steps = steps;
        program.names = names;
    }
}

/// Expands into a term the steps that only this term uses: either the terms of a sum, or the
/// factors of products.
fn expanded(term: Term, forms: &mut [Form], step_of: &[usize], uses: &[u32]) -> Vec<Term> {
    let inner = |k: &Key| match k {
        Key::Temp(t) if uses[t.0 as usize] == 1 => Some(step_of[t.0 as usize]),
        _ => None,
    };
    if let [single] = term.factors[..]
        && let Some(at) = inner(&single)
        && let Form::Sum(sum) = &forms[at]
    {
        let sum = sum.iter().map(|t| Term {
            negative: t.negative != term.negative,
            factors: t.factors.clone(),
        });
        let sum = sum.collect();
        forms[at] = Form::Expanded;
        return sum;
    }
    let mut negative = term.negative;
    let mut factors = Vec::new();
    for factor in term.factors {
        if let Some(at) = inner(&factor)
            && let Form::Sum(sum) = &forms[at]
            && let [product] = &sum[..]
        {
            negative ^= product.negative;
            factors.extend(&product.factors);
            forms[at] = Form::Expanded;
        } else {
            factors.push(factor);
        }
    }
    vec![Term { negative, factors }]
}

/// The factor that the most products among the terms share, with the indices of those terms.
fn most_shared(sum: &[Term]) -> Option<(Key, Vec<usize>)> {
    let mut members: BTreeMap<Key, Vec<usize>> = BTreeMap::new();
    for (at, term) in sum.iter().enumerate() {
        if term.factors.len() < 2 {
            continue;
        }
        let factors: BTreeSet<Key> = term.factors.iter().copied().collect();
        for factor in factors {
            members.entry(factor).or_default().push(at);
        }
    }
    let mut best: Option<(Key, Vec<usize>)> = None;
    for (factor, terms) in members {
        let more = best.as_ref().is_none_or(|b| terms.len() > b.1.len());
        if terms.len() > 1 && more {
            best = Some((factor, terms));
        }
    }
    best
}

/// The distinct pairs of factors of a product, the smaller one first.
fn pairs(factors: &[Key]) -> BTreeSet<(Key, Key)> {
    let mut all = BTreeSet::new();
    for (i, a) in factors.iter().enumerate() {
        for b in &factors[i + 1..] {
            all.insert((*a.min(b), *a.max(b)));
        }
    }
    all
}

struct Writer<'a> {
    steps: &'a mut Vec<Step>,
    names: &'a mut Vec<Option<String>>,
    /// Temporaries that equal another value, which replaces them.
    same: &'a mut BTreeMap<Temp, Key>,
}

impl Writer<'_> {
    fn push(&mut self, op: Op, result: Option<Temp>) -> Operand {
        let t = result.unwrap_or_else(|| {
            self.names.push(None);
            Temp(self.names.len() as u32 - 1)
        });
        self.steps.push(Step {
            op,
            results: vec![t],
        });
        Operand::Temp(t)
    }

    /// The operand that stands for a factor after the replacements in `same`.
    fn current_operand(&self, mut key: Key) -> Operand {
        while let Key::Temp(t) = key
            && let Some(other) = self.same.get(&t)
        {
            key = *other;
        }
        operand(key)
    }

    fn other(&mut self, mut op: Op, results: Vec<Temp>) {
        op.change_operands(|o| self.current_operand(key(o)));
        self.steps.push(Step { op, results });
    }

    /// Multiplies all factors but the last; returns the product and the last factor.
    fn pair(&mut self, factors: &[Key]) -> (Operand, Operand) {
        let last = factors.len() - 1;
        let mut product = self.current_operand(factors[0]);
        for factor in &factors[1..last] {
            let factor = self.current_operand(*factor);
            product = self.push(Op::Mul(product, factor), None);
        }
        (product, self.current_operand(factors[last]))
    }

    /// Writes a sum of products: it starts with a single operand if there is one, and products are
    /// added to it.
    fn sum(&mut self, result: Temp, sum: &[Term]) {
        let all_negative = sum.iter().all(|t| t.negative);
        let negative = |t: &Term| t.negative != all_negative;
        let single = |t: &Term| t.factors.len() == 1;
        let mut rest: Vec<&Term> = sum.iter().collect();
        let mut take = |which: &dyn Fn(&Term) -> bool| {
            let place = rest.iter().position(|t| which(t));
            place.map(|place| rest.remove(place))
        };
        let plain = take(&|t| single(t) && !negative(t));
        let product = match plain {
            Some(_) => None,
            None => take(&|t| !negative(t)),
        };
        // a b - c
        let less = match product {
            Some(_) => take(&single),
            None => None,
        };
        let mut left = rest.len();
        let own = |left: usize| (left == 0 && !all_negative).then_some(result);
        let mut so_far = match (plain, product, less) {
            (Some(plain), ..) => self.current_operand(plain.factors[0]),
            (None, Some(product), Some(less)) => {
                let (a, b) = self.pair(&product.factors);
                let less = self.current_operand(less.factors[0]);
                self.push(Op::MulSub(a, b, less), own(left))
            }
            (None, Some(product), None) => {
                let (a, b) = self.pair(&product.factors);
                self.push(Op::Mul(a, b), own(left))
            }
            // unreachable: some term is positive once the signs are reversed if all were negative
            (None, None, _) => return,
        };
        for term in rest {
            left -= 1;
            let op = if single(term) {
                let value = self.current_operand(term.factors[0]);
                if negative(term) {
                    Op::Sub(so_far, value)
                } else {
                    Op::Add(so_far, value)
                }
            } else {
                let (a, b) = self.pair(&term.factors);
                if negative(term) {
                    Op::NegMulAdd(a, b, so_far)
                } else {
                    Op::MulAdd(a, b, so_far)
                }
            };
            so_far = self.push(op, own(left));
        }
        if all_negative {
            self.push(Op::Neg(so_far), Some(result));
        } else if so_far != Operand::Temp(result) {
            if let Operand::Temp(t) = so_far {
                let name = self.names[result.0 as usize].clone();
                let target = &mut self.names[t.0 as usize];
                *target = target.take().or(name);
            }
            self.same.insert(result, key(&so_far));
        }
    }
}

#[cfg(test)]
mod tests;
