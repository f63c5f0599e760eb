//! Changes of a program's list of steps: signs that need a step, the order, and double signs.

use rustc_hash::FxHashMap;

use crate::optimize::program::{Op, Operand, Program, Step, Temp};

impl Program {
    /// Inserts each operation as a new step before the step of the given index; that step then
    /// negates the new step's result. The indices are in increasing order.
    pub(super) fn insert_negated(&mut self, operations: Vec<(usize, Op)>) {
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
    pub(super) fn sort_groups(&mut self) {
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
    pub(super) fn drop_double_negations(&mut self) {
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
