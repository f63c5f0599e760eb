//! How often values are used, and what a program saves without a step.

use rustc_hash::FxHashMap;

use super::{Cost, cost};
use crate::optimize::program::{Op, Operand, Program, Temp};

/// The uses of temporaries, updated while steps change.
pub(super) struct Uses {
    /// For each temporary, how often it is an operand of a step that is not dead, or an output.
    count: Vec<u32>,
    /// For each temporary, the index of the step that computes it.
    producer: Vec<usize>,
    /// For each step, whether it is dead: its results are no longer used.
    pub(super) is_dead: Vec<bool>,
}

impl Uses {
    pub(super) fn of(program: &Program) -> Self {
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
    pub(super) fn saved_without(
        &self,
        program: &Program,
        target: usize,
        extra_uses: &[Operand],
    ) -> Cost {
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
    pub(super) fn improvement(
        &self,
        program: &Program,
        target: usize,
        op: &Op,
    ) -> Option<(i32, i32)> {
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
    pub(super) fn depends_on(&self, program: &Program, op: &Op, target: usize) -> bool {
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
    pub(super) fn replace(&mut self, program: &Program, target: usize, op: &Op) {
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
