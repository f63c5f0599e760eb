//! Orders the steps within a group so that as few values as possible are live at a time, since a
//! processor has few registers and other live values go through memory.
//!
//! List scheduling: of the steps whose operands are computed, the next is the one after which the
//! fewest values are live, looking one step ahead. It changes no result: every step has the same
//! operands as before.

use super::program::{Op, Operand, Program, Step, Temp};

/// Groups of more steps are not ordered: ordering takes time with the square of the steps, and only
/// bodies at the end of very long chains have such groups.
const MAX_GROUP_STEPS: usize = 4000;

/// Orders the steps of every group.
pub(super) fn order(program: &mut Program) {
    let operands: Vec<Vec<Temp>> = program.steps.iter().map(values_of).collect();
    let mut uses_left = vec![0_u32; program.names.len()];
    for value in operands.iter().flatten() {
        uses_left[value.0 as usize] += 1;
    }
    let mut all = Vec::with_capacity(program.steps.len());
    for group in &program.groups {
        let steps = &program.steps[group.steps.clone()];
        let operands = &operands[group.steps.clone()];
        // sines and cosines are computed in sequence
        let angles = |step: &&Step| matches!(step.op, Op::SinCos(_));
        if steps.iter().filter(angles).count() > 1 || steps.len() > MAX_GROUP_STEPS {
            for value in operands.iter().flatten() {
                uses_left[value.0 as usize] -= 1;
            }
            all.extend(group.steps.clone());
            continue;
        }
        let schedule = Schedule::new(steps, operands, &mut uses_left).run();
        all.extend(schedule.into_iter().map(|at| group.steps.start + at));
    }
    let mut steps: Vec<Option<Step>> = program.steps.drain(..).map(Some).collect();
    program.steps = all.into_iter().filter_map(|at| steps[at].take()).collect();
}

/// The temporaries among a step's operands, each once.
fn values_of(step: &Step) -> Vec<Temp> {
    let operands = step.op.operands().into_iter();
    let mut values: Vec<Temp> = operands
        .filter_map(|o| match o {
            Operand::Temp(t) => Some(t),
            Operand::Input { .. } | Operand::Constant(_) => None,
        })
        .collect();
    values.sort_unstable();
    values.dedup();
    values
}

/// A group's steps while they are being ordered.
struct Schedule<'a> {
    steps: &'a [Step],
    /// For each step, its temporary operands.
    operands: &'a [Vec<Temp>],
    /// For each temporary, the number of steps, of all groups, that still have to use it.
    uses_left: &'a mut [u32],
    /// For each step, the steps of the group that use one of its results, each once.
    users: Vec<Vec<usize>>,
    /// For each step, how many steps of the group it still waits for.
    waits: Vec<usize>,
}

impl<'a> Schedule<'a> {
    fn new(steps: &'a [Step], operands: &'a [Vec<Temp>], uses_left: &'a mut [u32]) -> Schedule<'a> {
        let results = steps.iter().enumerate();
        let made: rustc_hash::FxHashMap<Temp, usize> = results
            .flat_map(|(at, step)| step.results.iter().map(move |t| (*t, at)))
            .collect();
        let mut users = vec![Vec::new(); steps.len()];
        let mut waits = vec![0; steps.len()];
        for (at, values) in operands.iter().enumerate() {
            let mut makers: Vec<usize> =
                values.iter().filter_map(|t| made.get(t).copied()).collect();
            makers.sort_unstable();
            makers.dedup();
            waits[at] = makers.len();
            for maker in makers {
                users[maker].push(at);
            }
        }
        Schedule {
            steps,
            operands,
            uses_left,
            users,
            waits,
        }
    }

    fn run(mut self) -> Vec<usize> {
        let mut ready: Vec<usize> = (0..self.steps.len())
            .filter(|&at| self.waits[at] == 0)
            .collect();
        let mut order = Vec::with_capacity(self.steps.len());
        while let Some(place) =
            (0..ready.len()).min_by_key(|&place| (self.growth_ahead(ready[place]), ready[place]))
        {
            let at = ready.swap_remove(place);
            order.push(at);
            for value in &self.operands[at] {
                self.uses_left[value.0 as usize] -= 1;
            }
            for &user in &self.users[at] {
                self.waits[user] -= 1;
                if self.waits[user] == 0 {
                    ready.push(user);
                }
            }
        }
        order
    }

    /// The growth of the number of live values with a step: the results that other steps use, less
    /// the operands that this step is the last to use. Values in `done` count as used once less:
    /// they are the operands of a step that is computed before this one.
    fn growth(&self, at: usize, done: &[Temp]) -> i32 {
        let uses_left = |t: &Temp| self.uses_left[t.0 as usize] - u32::from(done.contains(t));
        let made = self.steps[at].results.iter();
        let made = made.filter(|t| self.uses_left[t.0 as usize] > 0).count();
        let last = self.operands[at]
            .iter()
            .filter(|t| uses_left(t) == 1)
            .count();
        count(made) - count(last)
    }

    /// The growth with a step and the best of the steps that it makes ready, then the growth with
    /// the step alone.
    fn growth_ahead(&self, at: usize) -> (i32, i32) {
        let own = self.growth(at, &[]);
        let freed = self.users[at].iter().filter(|&&user| self.waits[user] == 1);
        let ahead = freed.map(|&user| self.growth(user, &self.operands[at]));
        (own + ahead.min().unwrap_or(0).min(0), own)
    }
}

fn count(values: usize) -> i32 {
    i32::try_from(values).unwrap_or(i32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimize::{Group, Output};

    /// A program of sums of two earlier values each; a pair gives their numbers, 0 being the input.
    fn sums(pairs: &[(u32, u32)], outputs: &[u32]) -> Program {
        let input = Operand::Input {
            argument: 0,
            element: 0,
        };
        let value = |at: u32| match at {
            0 => input,
            at => Operand::Temp(Temp(at - 1)),
        };
        let step = |(at, (a, b)): (usize, &(u32, u32))| Step {
            op: Op::Add(value(*a), value(*b)),
            results: vec![Temp(at as u32)],
        };
        Program {
            arguments: Vec::new(),
            steps: pairs.iter().enumerate().map(step).collect(),
            groups: vec![Group {
                title: String::new(),
                steps: 0..pairs.len(),
                outputs: 0..outputs.len(),
            }],
            output: Output {
                name: "y".to_owned(),
                shape: vec![outputs.len()],
                doc: String::new(),
            },
            outputs: outputs.iter().map(|at| value(*at)).collect(),
            names: vec![None; pairs.len()],
        }
    }

    /// The largest number of live values.
    fn max_live_values(program: &Program) -> usize {
        let uses: Vec<Vec<Temp>> = program.steps.iter().map(values_of).collect();
        let last = |t: Temp| uses.iter().rposition(|values| values.contains(&t));
        let waiting = |now: usize| {
            let made = program.steps[..=now].iter().flat_map(|s| &s.results);
            made.filter(|t| last(**t).is_some_and(|last| last > now))
                .count()
        };
        (0..program.steps.len()).map(waiting).max().unwrap_or(0)
    }

    #[test]
    fn each_pair_is_summed_before_the_next_pair_is_computed() {
        // eight doubled values, computed first and then summed in pairs as a tree
        let mut pairs = vec![(0, 0); 8];
        pairs.extend([(1, 2), (3, 4), (5, 6), (7, 8), (9, 10), (11, 12), (13, 14)]);
        let mut program = sums(&pairs, &[15]);
        assert_eq!(max_live_values(&program), 8);
        order(&mut program);
        // log2 of the number of leaves, and the value being computed
        assert_eq!(max_live_values(&program), 4);
    }

    proptest::proptest! {
        #[test]
        fn every_step_remains_and_follows_its_operands(
            picks in proptest::collection::vec((0_u32..1000, 0_u32..1000), 1..60),
            cut in 0_usize..60,
        ) {
            let pairs: Vec<(u32, u32)> = (1..)
                .zip(&picks)
                .map(|(many, (a, b))| (a % many, b % many))
                .collect();
            let mut program = sums(&pairs, &[pairs.len() as u32]);
            let cut = cut.min(pairs.len());
            let whole = program.groups.remove(0);
            let first = Group { steps: 0..cut, outputs: 0..0, ..whole.clone() };
            program.groups = vec![first, Group { steps: cut..pairs.len(), ..whole }];
            let before = program.clone();
            order(&mut program);
            let mut made = Vec::new();
            for step in &program.steps {
                for value in values_of(step) {
                    proptest::prop_assert!(made.contains(&value));
                }
                made.extend(&step.results);
            }
            // the steps are the same, and each is still in its group
            for group in &before.groups {
                for step in &before.steps[group.steps.clone()] {
                    proptest::prop_assert!(program.steps[group.steps.clone()].contains(step));
                }
            }
            proptest::prop_assert_eq!(made.len(), pairs.len());
        }
    }
}
