//! Emits the body of a function: temporaries in blocks, and outputs stored as soon as they are
//! computed.
//!
//! The temporaries of a block are local to it, except those that later blocks use, which it
//! exports. No scope has more than 800 variables, whatever the robot: rustc's debug-information
//! writer overflows its stack at some thousands. If there were more, the exported values are stored
//! in an array and read from there by index.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::optimize::{Group, Op, Operand, Program, SolveStep, Step, Temp};

use super::names::{Names, identifier, literal};

/// Largest number of steps in a block.
const MAX_BLOCK_STEPS: usize = 250;
/// Largest number of arguments' elements, and of exported values, that are bound to names in the
/// function's own scope.
const MAX_SCOPE_NAMES: usize = 300;
/// Largest number of values from the array that are bound to names in a block.
const MAX_BLOCK_IMPORTS: usize = 200;
/// Largest number of results of one solve that are bound to names.
const MAX_SOLVE_NAMES: usize = 100;
/// Largest width of an emitted line of a list, in characters.
const MAX_LINE_WIDTH: usize = 96;

/// A block: consecutive steps of a group, and the outputs that are complete after them.
struct Block {
    title: String,
    steps: std::ops::Range<usize>,
    outputs: std::ops::Range<usize>,
    /// Temporaries of this block that later blocks use.
    exports: Vec<Temp>,
}

pub(super) struct Body<'p> {
    program: &'p Program,
    runtime: String,
    names: Vec<String>,
    inputs: Vec<Vec<String>>,
    /// For each temporary, whether a step or an output uses it.
    read: Vec<bool>,
    /// For each temporary, the index of the block that computes it.
    block_of: Vec<usize>,
    blocks: Vec<Block>,
    /// For each block, its first step.
    block_starts: Vec<usize>,
    /// For each exported temporary, its index in the array `kept`, if the blocks export through
    /// that array.
    kept: BTreeMap<Temp, usize>,
    out: String,
}

/// The statements of a program's function, indented, without its last line. `wishes` are the
/// preferred names of each argument's elements.
pub(super) fn statements(program: &Program, runtime: &str, wishes: &[Vec<String>]) -> String {
    let mut names = Names::new();
    names.reserve(&program.output.name);
    for argument in &program.arguments {
        names.reserve(&argument.name);
    }
    let mut unique = |wishes: &Vec<String>| wishes.iter().map(|w| names.unique(w)).collect();
    let inputs: Vec<Vec<String>> = wishes.iter().map(&mut unique).collect();
    let mut body = Body {
        program,
        runtime: runtime.to_owned(),
        names: Vec::new(),
        inputs,
        read: read(program),
        block_of: vec![0; program.names.len()],
        blocks: Vec::new(),
        block_starts: Vec::new(),
        kept: BTreeMap::new(),
        out: String::new(),
    };
    body.cut_into_blocks();
    body.name_temporaries(&mut names);
    body.find_exports();
    body.write();
    body.out
}

/// Number of right-hand sides of a system.
fn sides(solve: &SolveStep) -> usize {
    solve.rhs.first().map_or(1, |row| row.len().max(1))
}

/// For each temporary of a program, whether a step or an output uses it.
fn read(program: &Program) -> Vec<bool> {
    let mut read = vec![false; program.names.len()];
    let operands = program.steps.iter().flat_map(|s| s.op.operands());
    for operand in operands.chain(program.outputs.iter().copied()) {
        if let Operand::Temp(t) = operand {
            read[t.0 as usize] = true;
        }
    }
    read
}

impl Body<'_> {
    /// The name to which a result is bound; `_` if nothing uses it.
    fn bound(&self, t: Temp) -> &str {
        if self.read[t.0 as usize] {
            &self.names[t.0 as usize]
        } else {
            "_"
        }
    }

    fn cut_into_blocks(&mut self) {
        for group in &self.program.groups {
            let mut start = group.steps.start;
            let mut part = 0;
            for at in group.steps.clone() {
                let solves = matches!(self.program.steps[at].op, Op::Solve(_));
                let full = at + 1 - start >= MAX_BLOCK_STEPS;
                if (solves || full) && at + 1 < group.steps.end {
                    part += 1;
                    let title = if solves {
                        "loops: solve with A_e (Eq. 8, 10)".to_owned()
                    } else {
                        format!("{}, part {part}", group.title)
                    };
                    self.push_block(
                        title,
                        start..at + 1,
                        group.outputs.start..group.outputs.start,
                    );
                    start = at + 1;
                }
            }
            let Group { title, outputs, .. } = group;
            self.push_block(title.clone(), start..group.steps.end, outputs.clone());
        }
        self.block_starts = self.blocks.iter().map(|b| b.steps.start).collect();
        // outputs can be stored only after their steps: find the block of each result
        for (index, block) in self.blocks.iter().enumerate() {
            for step in &self.program.steps[block.steps.clone()] {
                for result in &step.results {
                    self.block_of[result.0 as usize] = index;
                }
            }
        }
    }

    fn push_block(
        &mut self,
        title: String,
        steps: std::ops::Range<usize>,
        outputs: std::ops::Range<usize>,
    ) {
        self.blocks.push(Block {
            title,
            steps,
            outputs,
            exports: Vec::new(),
        });
    }

    /// Names the temporaries: by the suggested name if there is one, else by a number that starts
    /// anew in every block, so that a change in one block does not renumber the others.
    fn name_temporaries(&mut self, names: &mut Names) {
        self.names = vec![String::new(); self.program.names.len()];
        for (index, block) in self.blocks.iter().enumerate() {
            let mut number = 0;
            for step in &self.program.steps[block.steps.clone()] {
                if let Op::Solve(solve) = &step.op
                    && step.results.len() > MAX_SOLVE_NAMES
                {
                    let sides = sides(solve);
                    for (i, result) in step.results.iter().enumerate() {
                        self.names[result.0 as usize] =
                            format!("solved[{}][{}]", i / sides, i % sides);
                    }
                    continue;
                }
                for result in &step.results {
                    let at = result.0 as usize;
                    self.names[at] = if let Some(name) = &self.program.names[at] {
                        names.unique(&identifier(name))
                    } else {
                        number += 1;
                        names.unique(&format!("t{}_{number}", index + 1))
                    };
                }
            }
        }
    }

    fn find_exports(&mut self) {
        let mut used_later = vec![false; self.program.names.len()];
        for (index, block) in self.blocks.iter().enumerate() {
            let steps = self.program.steps[block.steps.clone()].iter();
            let operands = steps.flat_map(|s| s.op.operands());
            let outputs = self.program.outputs[block.outputs.clone()].iter().copied();
            for operand in operands.chain(outputs) {
                if let Operand::Temp(t) = operand
                    && self.block_of[t.0 as usize] != index
                {
                    used_later[t.0 as usize] = true;
                }
            }
        }
        for block in &mut self.blocks {
            for step in &self.program.steps[block.steps.clone()] {
                let later = step.results.iter().filter(|t| used_later[t.0 as usize]);
                block.exports.extend(later);
            }
        }
    }

    fn line(&mut self, depth: usize, text: &str) {
        for _ in 0..depth {
            self.out.push_str("    ");
        }
        self.out.push_str(text);
        self.out.push('\n');
    }

    /// Writes `head [ items ] tail`, over several lines if it is long.
    fn list(&mut self, depth: usize, head: &str, items: &[String], tail: &str) {
        let flat = format!("{head}[{}]{tail}", items.join(", "));
        if flat.len() + 4 * depth <= MAX_LINE_WIDTH {
            return self.line(depth, &flat);
        }
        self.line(depth, &format!("{head}["));
        let mut row = String::new();
        for item in items {
            if !row.is_empty() && row.len() + item.len() + 4 * depth + 6 > MAX_LINE_WIDTH {
                self.line(depth + 1, row.trim_end());
                row.clear();
            }
            let _ = write!(row, "{item}, ");
        }
        self.line(depth + 1, row.trim_end());
        self.line(depth, &format!("]{tail}"));
    }

    fn write(&mut self) {
        let first = &self.program.arguments[0].name;
        self.line(1, &format!("let proto = {first}[0];"));
        let mut inputs = self.inputs_by_block();
        if self.program.solves() {
            self.line(1, "let mut condition = proto.splat(1.0);");
        }
        let exported: Vec<Temp> = self.blocks.iter().flat_map(|b| b.exports.clone()).collect();
        let unnamed =
            |step: &Step| matches!(step.op, Op::Solve(_)) && step.results.len() > MAX_SOLVE_NAMES;
        if exported.len() > MAX_SCOPE_NAMES || self.program.steps.iter().any(unnamed) {
            self.line(1, &format!("let mut kept = [proto; {}];", exported.len()));
            self.kept = exported.into_iter().zip(0..).collect();
        }
        for index in 0..self.blocks.len() {
            for (items, tail) in inputs.remove(&index).unwrap_or_default() {
                self.list(1, "let ", &items, &tail);
            }
            self.write_block(index);
        }
    }

    /// For each argument, which of its elements are used, and the first block that uses one.
    fn used_inputs(&self) -> Vec<(Vec<bool>, Option<usize>)> {
        let unused = self.inputs.iter().map(|a| (vec![false; a.len()], None));
        let mut used: Vec<(Vec<bool>, Option<usize>)> = unused.collect();
        for (index, block) in self.blocks.iter().enumerate() {
            let steps = self.program.steps[block.steps.clone()].iter();
            let outputs = self.program.outputs[block.outputs.clone()].iter().copied();
            for operand in steps.flat_map(|s| s.op.operands()).chain(outputs) {
                if let Operand::Input { argument, element } = operand {
                    let (elements, first) = &mut used[argument];
                    elements[element] = true;
                    first.get_or_insert(index);
                }
            }
        }
        used
    }

    /// The statements that destructure the arguments, by the block before which they are written:
    /// elements that are read before the sines and cosines are computed would go through memory.
    fn inputs_by_block(&mut self) -> BTreeMap<usize, Vec<(Vec<String>, String)>> {
        let used = self.used_inputs();
        let count = used.iter().flat_map(|(u, _)| u).filter(|u| **u).count();
        let mut bindings: BTreeMap<usize, Vec<(Vec<String>, String)>> = BTreeMap::new();
        for (argument, (used, first)) in used.iter().enumerate() {
            let Some(first) = first else { continue };
            let name = &self.program.arguments[argument].name;
            if count > MAX_SCOPE_NAMES {
                let elements = (0..used.len()).map(|element| format!("{name}[{element}]"));
                self.inputs[argument] = elements.collect();
                continue;
            }
            let items = self.inputs[argument].iter().zip(used);
            let items = items.map(|(name, used)| if *used { name.clone() } else { "_".to_owned() });
            let binding = (items.collect(), format!(" = *{name};"));
            bindings.entry(*first).or_default().push(binding);
        }
        bindings
    }

    fn write_block(&mut self, index: usize) {
        let block = &self.blocks[index];
        let (steps, outputs) = (block.steps.clone(), block.outputs.clone());
        let exports = block.exports.clone();
        let title = block.title.clone();
        if steps.is_empty() && outputs.is_empty() {
            return;
        }
        let names = |body: &Self| -> Vec<String> {
            let names = exports.iter();
            names.map(|t| body.names[t.0 as usize].clone()).collect()
        };
        let in_array = !self.kept.is_empty();
        self.line(1, &format!("// {title}"));
        if exports.is_empty() || in_array {
            self.line(1, "{");
        } else {
            let names = names(self);
            self.list(1, "let ", &names, " = {");
        }
        let renamed = self.take_from_array(index);
        let mut stores = self.stores(index, outputs);
        if let Some(stores) = stores.remove(&None) {
            self.line(2, &stores.join(" "));
        }
        let last = steps.end;
        for at in steps {
            let angles = self.angles_at(at, last);
            if angles > 1 {
                self.write_angles(at..at + angles);
            } else if angles == 1 || !self.is_angle(at) {
                self.write_step(at);
            }
            if let Some(stores) = stores.remove(&Some(at)) {
                self.line(2, &stores.join(" "));
            }
        }
        let names = names(self);
        if names.is_empty() {
            self.line(1, "}");
        } else if in_array {
            for (t, name) in exports.iter().zip(names) {
                let text = format!("kept[{}] = {name};", self.kept[t]);
                self.line(2, &text);
            }
            self.line(1, "}");
        } else {
            self.list(2, "", &names, "");
            self.line(1, "};");
        }
        for (t, name) in renamed {
            self.names[t.0 as usize] = name;
        }
    }

    /// Names the values that a block takes from the array: by variables, or by the places in the
    /// array if these are too many. Returns the names to be restored after the block.
    fn take_from_array(&mut self, index: usize) -> Vec<(Temp, String)> {
        let block = &self.blocks[index];
        let operands = self.program.steps[block.steps.clone()]
            .iter()
            .flat_map(|s| s.op.operands())
            .chain(self.program.outputs[block.outputs.clone()].iter().copied());
        let imports: BTreeMap<Temp, usize> = operands
            .filter_map(|o| match o {
                Operand::Temp(t) if self.block_of[t.0 as usize] != index => {
                    self.kept.get(&t).map(|place| (t, *place))
                }
                _ => None,
            })
            .collect();
        let mut renamed = Vec::new();
        let few = imports.len() <= MAX_BLOCK_IMPORTS;
        for (t, place) in imports {
            let name = self.names[t.0 as usize].clone();
            let in_array = format!("kept[{place}]");
            // the results of a large solve have no variables
            if few && !name.contains('[') {
                self.line(2, &format!("let {name} = {in_array};"));
            } else {
                self.names[t.0 as usize] = in_array;
                renamed.push((t, name));
            }
        }
        renamed
    }

    /// The statements that store outputs, by the step after which they can be written (`None` is
    /// before the first step). Each entry is stored as soon as it is computed, so that it does not
    /// occupy a register until its column is complete.
    fn stores(
        &self,
        index: usize,
        outputs: std::ops::Range<usize>,
    ) -> BTreeMap<Option<usize>, Vec<String>> {
        let output = &self.program.output;
        let steps = self.blocks[index].steps.clone();
        let results = steps
            .clone()
            .zip(&self.program.steps[steps])
            .flat_map(|(at, step)| step.results.iter().map(move |t| (*t, at)));
        let defined: BTreeMap<Temp, usize> = results.collect();
        let mut stores: BTreeMap<Option<usize>, Vec<String>> = BTreeMap::new();
        for at in outputs {
            let operand = &self.program.outputs[at];
            // zeros are stored already
            if matches!(operand, Operand::Constant(c) if *c == 0.0) {
                continue;
            }
            let after = match operand {
                Operand::Temp(t) => defined.get(t).copied(),
                Operand::Input { .. } | Operand::Constant(_) => None,
            };
            let place = match output.shape.get(1) {
                Some(&inner) => format!("[{}][{}]", at / inner.max(1), at % inner.max(1)),
                None => format!("[{at}]"),
            };
            let text = format!("{}{place} = {};", output.name, self.operand(operand));
            stores.entry(after).or_default().push(text);
        }
        stores
    }

    fn operand(&self, operand: &Operand) -> String {
        match *operand {
            Operand::Input { argument, element } => self.inputs[argument][element].clone(),
            Operand::Constant(c) => format!("proto.splat({})", literal(c)),
            Operand::Temp(t) => self.names[t.0 as usize].clone(),
        }
    }

    /// The operand with the opposite sign.
    fn negated(&self, operand: &Operand) -> String {
        match operand {
            Operand::Constant(c) => self.operand(&Operand::Constant(-c)),
            other => format!("-{}", self.operand(other)),
        }
    }

    fn write_step(&mut self, at: usize) {
        let program = self.program;
        let step = &program.steps[at];
        let o = |operand: &Operand| self.operand(operand);
        let text = match &step.op {
            Op::Neg(a) => self.negated(a),
            Op::Add(a, b) => format!("{} + {}", o(a), o(b)),
            Op::Sub(a, b) => format!("{} - {}", o(a), o(b)),
            Op::Mul(a, b) => format!("{} * {}", o(a), o(b)),
            Op::Div(a, b) => format!("{} / {}", o(a), o(b)),
            Op::MulAdd(a, b, c) => format!("{}.mul_add({}, {})", o(a), o(b), o(c)),
            Op::NegMulAdd(a @ Operand::Constant(_), b, c) => {
                format!("{}.mul_add({}, {})", self.negated(a), o(b), o(c))
            }
            Op::NegMulAdd(a, b, c) => format!("({}).mul_add({}, {})", self.negated(a), o(b), o(c)),
            Op::MulSub(a, b, c) => format!("{}.mul_add({}, {})", o(a), o(b), self.negated(c)),
            Op::Sign(a) => format!("{}.sign()", o(a)),
            Op::Positive(a) => {
                format!(
                    "T::select(proto.splat(0.0).less({}), proto.splat(1.0), proto.splat(0.0))",
                    o(a)
                )
            }
            Op::Negative(a) => {
                format!(
                    "T::select({}.less(proto.splat(0.0)), proto.splat(1.0), proto.splat(0.0))",
                    o(a)
                )
            }
            Op::SinCos(a) => {
                let names: Vec<&str> = step.results.iter().map(|t| self.bound(*t)).collect();
                let text = format!("let ({}) = {}.sin_cos();", names.join(", "), o(a));
                return self.line(2, &text);
            }
            Op::Solve(solve) => return self.write_solve(solve, &step.results),
        };
        let name = step
            .results
            .first()
            .map_or("_", |t| self.names[t.0 as usize].as_str());
        let text = format!("let {name} = {text};");
        self.line(2, &text);
    }

    /// Number of consecutive sines and cosines that can be computed together, if the first one is
    /// step `at`; else 0.
    fn angles_at(&self, at: usize, end: usize) -> usize {
        // a sequence that started before this block starts anew in it
        let begins = self.block_starts.contains(&at) || !self.is_angle(at - 1);
        if !begins {
            return 0;
        }
        (at..end).take_while(|at| self.is_angle(*at)).count()
    }

    /// Whether a step's sine and cosine can be computed together with those just before it: its
    /// angle is none of their results.
    fn is_angle(&self, at: usize) -> bool {
        let steps = &self.program.steps;
        let Op::SinCos(angle) = &steps[at].op else {
            return false;
        };
        let before = steps[..at].iter().rev();
        let row = before.take_while(|s| matches!(s.op, Op::SinCos(_)));
        !row.flat_map(|s| &s.results)
            .any(|t| *angle == Operand::Temp(*t))
    }

    /// Writes the sines and cosines of several angles as one call.
    fn write_angles(&mut self, row: std::ops::Range<usize>) {
        let (mut names, mut angles) = (Vec::new(), Vec::new());
        for step in &self.program.steps[row] {
            if let Op::SinCos(angle) = &step.op {
                let pair: Vec<&str> = step.results.iter().map(|t| self.bound(*t)).collect();
                names.push(format!("({})", pair.join(", ")));
                angles.push(self.operand(angle));
            }
        }
        self.list(2, "let ", &names, " =");
        self.list(3, "T::sin_cos_all(", &angles, ");");
    }

    /// Writes the solution of a system in the fixed order, guarded by its pivots.
    fn write_solve(&mut self, solve: &SolveStep, results: &[Temp]) {
        let mut margins = solve.pivots.iter().map(|(pivot, size)| {
            format!(
                "({} * proto.splat({})).abs()",
                self.operand(pivot),
                literal(1.0 / size)
            )
        });
        let first = margins
            .next()
            .unwrap_or_else(|| "proto.splat(1.0)".to_owned());
        let rest: Vec<String> = margins.collect();
        self.line(2, "// the smallest pivot relative to its usual size");
        self.line(2, &format!("let margin = {first}"));
        for margin in &rest {
            self.line(3, &format!(".min({margin})"));
        }
        // end the statement after its last line
        self.out.pop();
        self.out.push_str(";\n");
        let rows: Vec<String> = results
            .chunks(sides(solve))
            .map(|row| {
                let names: Vec<&str> = row.iter().map(|t| self.bound(*t)).collect();
                format!("[{}]", names.join(", "))
            })
            .collect();
        if results.len() > MAX_SOLVE_NAMES {
            self.line(2, "let (solved, found) = ");
        } else {
            self.list(2, "let (", &rows, ", found) = ");
        }
        self.out.pop();
        let head = format!("{}::solve_guarded(\n", self.runtime);
        self.out.push_str(&head);
        let matrix = |body: &Self, rows: &[Vec<Operand>]| -> Vec<String> {
            rows.iter()
                .map(|row| {
                    let entries: Vec<String> = row.iter().map(|o| body.operand(o)).collect();
                    format!("[{}]", entries.join(", "))
                })
                .collect()
        };
        let fixed = matrix(self, &solve.fixed);
        self.list(3, "", &fixed, ",");
        self.line(3, "margin,");
        self.line(3, "|| (");
        let a = matrix(self, &solve.matrix);
        self.list(4, "", &a, ",");
        let b = matrix(self, &solve.rhs);
        self.list(4, "", &b, ",");
        self.line(3, "),");
        self.line(2, ");");
        self.line(2, "condition = condition.min(found);");
    }
}
