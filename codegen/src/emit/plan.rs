//! The plan of a function's body: blocks of steps, the values that blocks export, and the names of
//! all values. It is the same for all languages except for their reserved words and limits.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::optimize::{Group, Op, Operand, Program, Step, Temp};

use super::language::Language;
use super::names::{Names, identifier};

/// Largest number of steps in a block.
const MAX_BLOCK_STEPS: usize = 250;

/// A block: consecutive steps of a group, and the outputs that are complete after them.
pub(super) struct Block {
    /// The comment above the block.
    pub(super) title: String,
    /// The range of the block's steps in the program.
    pub(super) steps: Range<usize>,
    /// The range of the program's outputs that the block stores.
    pub(super) outputs: Range<usize>,
    /// Temporaries of this block that later blocks use.
    pub(super) exports: Vec<Temp>,
}

/// The blocks of a body and the names in it.
pub(super) struct Plan {
    /// For each temporary, the text that refers to it: a variable, or an entry of an array.
    pub(super) names: Vec<String>,
    /// For each element of each argument, the text that refers to it.
    pub(super) inputs: Vec<Vec<String>>,
    /// For each temporary, whether a step or an output uses it.
    pub(super) is_used: Vec<bool>,
    /// For each temporary, the index of the block that computes it.
    pub(super) block_of: Vec<usize>,
    pub(super) blocks: Vec<Block>,
    /// For each block, its first step.
    block_starts: Vec<usize>,
}

/// For each temporary of a program, whether a step or an output uses it.
fn used_temporaries(program: &Program) -> Vec<bool> {
    let mut used = vec![false; program.names.len()];
    let operands = program.steps.iter().flat_map(|s| s.op.operands());
    for operand in operands.chain(program.outputs.iter().copied()) {
        if let Operand::Temp(t) = operand {
            used[t.0 as usize] = true;
        }
    }
    used
}

impl Plan {
    /// The plan of a program. `preferred_names` are those of each argument's elements.
    pub(super) fn new(
        program: &Program,
        language: &impl Language,
        preferred_names: &[Vec<String>],
    ) -> Plan {
        let mut names = Names::new(language.reserved());
        names.reserve(&program.output.name);
        for argument in &program.arguments {
            names.reserve(&argument.name);
        }
        let mut unique =
            |elements: &Vec<String>| elements.iter().map(|n| names.unique(n)).collect();
        let inputs: Vec<Vec<String>> = preferred_names.iter().map(&mut unique).collect();
        let blocks = cut_into_blocks(program);
        let mut plan = Plan {
            names: Vec::new(),
            inputs,
            is_used: used_temporaries(program),
            block_of: vec![0; program.names.len()],
            block_starts: blocks.iter().map(|b| b.steps.start).collect(),
            blocks,
        };
        // the block of each result decides which temporaries are exported
        for (index, block) in plan.blocks.iter().enumerate() {
            for step in &program.steps[block.steps.clone()] {
                for result in &step.results {
                    plan.block_of[result.0 as usize] = index;
                }
            }
        }
        plan.name_temporaries(program, language, &mut names);
        plan.find_exports(program);
        plan
    }

    /// Names the temporaries: by the suggested name if there is one, else by a number that starts
    /// at 1 in every block, so that a change in one block does not renumber the others.
    fn name_temporaries(&mut self, program: &Program, language: &impl Language, names: &mut Names) {
        self.names = vec![String::new(); program.names.len()];
        for (index, block) in self.blocks.iter().enumerate() {
            let mut number = 0;
            for step in &program.steps[block.steps.clone()] {
                if let Op::Solve(solve) = &step.op
                    && step.results.len() > language.limits().solve_names
                {
                    let rhs_count = solve.rhs_count();
                    for (i, result) in step.results.iter().enumerate() {
                        self.names[result.0 as usize] =
                            language.solved(i / rhs_count, i % rhs_count);
                    }
                    continue;
                }
                for result in &step.results {
                    let temp = result.0 as usize;
                    self.names[temp] = if let Some(name) = &program.names[temp] {
                        names.unique(&identifier(name))
                    } else {
                        number += 1;
                        names.unique(&format!("t{}_{number}", index + 1))
                    };
                }
            }
        }
    }

    /// Lists for each block the temporaries that other blocks use.
    fn find_exports(&mut self, program: &Program) {
        let mut used_later = vec![false; program.names.len()];
        for (index, block) in self.blocks.iter().enumerate() {
            for operand in block.operands(program) {
                if let Operand::Temp(t) = operand
                    && self.block_of[t.0 as usize] != index
                {
                    used_later[t.0 as usize] = true;
                }
            }
        }
        for block in &mut self.blocks {
            for step in &program.steps[block.steps.clone()] {
                let later = step.results.iter().filter(|t| used_later[t.0 as usize]);
                block.exports.extend(later);
            }
        }
    }

    /// For each argument, which of its elements are used, and the first block that uses one.
    pub(super) fn used_inputs(&self, program: &Program) -> Vec<(Vec<bool>, Option<usize>)> {
        let unused = self.inputs.iter().map(|a| (vec![false; a.len()], None));
        let mut used: Vec<(Vec<bool>, Option<usize>)> = unused.collect();
        for (index, block) in self.blocks.iter().enumerate() {
            for operand in block.operands(program) {
                if let Operand::Input { argument, element } = operand {
                    let (elements, first) = &mut used[argument];
                    elements[element] = true;
                    first.get_or_insert(index);
                }
            }
        }
        used
    }

    /// Number of consecutive sines and cosines before the step `end` that can be computed together,
    /// if the first of them is step `index`; else 0.
    pub(super) fn angles_from(&self, program: &Program, index: usize, end: usize) -> usize {
        // the part of a sequence that lies in another block is computed there
        let begins = self.block_starts.contains(&index) || !is_angle(program, index - 1);
        if !begins {
            return 0;
        }
        let angles = (index..end).take_while(|step| is_angle(program, *step));
        angles.count()
    }

    /// The steps after which outputs can be stored, with the indices of these outputs (`None`:
    /// before the block's first step). Each entry is stored as soon as it is computed, so that it
    /// does not occupy a register until its column is complete.
    pub(super) fn stores(
        &self,
        program: &Program,
        index: usize,
    ) -> BTreeMap<Option<usize>, Vec<usize>> {
        let block = &self.blocks[index];
        let steps = block.steps.clone();
        let results =
            steps
                .clone()
                .zip(&program.steps[steps])
                .flat_map(|(index, step): (usize, &Step)| {
                    step.results.iter().map(move |t| (*t, index))
                });
        let step_of: BTreeMap<Temp, usize> = results.collect();
        let mut stores: BTreeMap<Option<usize>, Vec<usize>> = BTreeMap::new();
        for entry in block.outputs.clone() {
            let operand = &program.outputs[entry];
            // the zeros of the output are stored before the body
            if is_zero(operand) {
                continue;
            }
            let after = match operand {
                Operand::Temp(t) => step_of.get(t).copied(),
                Operand::Input { .. } | Operand::Constant(_) => None,
            };
            stores.entry(after).or_default().push(entry);
        }
        stores
    }
}

impl Block {
    /// The operands of all steps and outputs.
    pub(super) fn operands<'p>(&self, program: &'p Program) -> impl Iterator<Item = Operand> + 'p {
        let steps = program.steps[self.steps.clone()].iter();
        let outputs = program.outputs[self.outputs.clone()].iter().copied();
        steps.flat_map(|s| s.op.operands()).chain(outputs)
    }
}

/// Whether an output is zero at every state.
pub(super) fn is_zero(output: &Operand) -> bool {
    matches!(output, Operand::Constant(c) if *c == 0.0)
}

/// Whether the program uses an element of an argument.
pub(super) fn reads_argument(program: &Program, index: usize) -> bool {
    let reads = |o: &Operand| matches!(o, Operand::Input { argument, .. } if *argument == index);
    let mut steps = program.steps.iter().flat_map(|s| s.op.operands());
    steps.any(|o| reads(&o)) || program.outputs.iter().any(reads)
}

/// Whether a step is a sine and cosine that can be computed together with those just before it: its
/// angle is none of their results.
pub(super) fn is_angle(program: &Program, index: usize) -> bool {
    let steps = &program.steps;
    let Op::SinCos(angle) = &steps[index].op else {
        return false;
    };
    let before = steps[..index].iter().rev();
    let neighbours = before.take_while(|s| matches!(s.op, Op::SinCos(_)));
    !neighbours
        .flat_map(|s| &s.results)
        .any(|t| *angle == Operand::Temp(*t))
}

/// Divides the groups of a program into blocks: after every solve, and after [`MAX_BLOCK_STEPS`].
fn cut_into_blocks(program: &Program) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut push = |title: String, steps: Range<usize>, outputs: Range<usize>| {
        blocks.push(Block {
            title,
            steps,
            outputs,
            exports: Vec::new(),
        });
    };
    for group in &program.groups {
        let mut start = group.steps.start;
        let mut part_number = 0;
        for step in group.steps.clone() {
            let solves = matches!(program.steps[step].op, Op::Solve(_));
            let is_full = step + 1 - start >= MAX_BLOCK_STEPS;
            if (solves || is_full) && step + 1 < group.steps.end {
                part_number += 1;
                let title = if solves {
                    "loops: solve with A_e (Eq. 8, 10)".to_owned()
                } else {
                    format!("{}, part {part_number}", group.title)
                };
                let none = group.outputs.start..group.outputs.start;
                push(title, start..step + 1, none);
                start = step + 1;
            }
        }
        let Group { title, outputs, .. } = group;
        push(title.clone(), start..group.steps.end, outputs.clone());
    }
    blocks
}
