//! Emits the body of a function: temporaries in blocks, and outputs stored as soon as they are
//! computed.
//!
//! The temporaries of a block are local to it, except those that later blocks use, which it
//! exports. No scope has more than 800 variables, whatever the robot: rustc's debug-information
//! writer overflows its stack at some thousands. The function's own scope has at most 300 elements
//! of arguments and 300 exported values. A block has at most 200 imported values and the results of
//! 250 steps: two of a sine and cosine, and at most 100 of a solve, which ends the block. Where a
//! function needs more, values are read by index instead: elements from the arguments, exported
//! values and the results of a large solve from the emitted array `kept`.
//!
//! The emitted functions are generic over the scalar type T. Constants have to be made from a value
//! of T, as a scalar may have several lanes: `proto`, the first element of the first argument, is
//! that value, and `proto.splat(c)` the constant c.

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
    /// The comment above the block.
    title: String,
    /// The range of the block's steps in the program.
    steps: std::ops::Range<usize>,
    /// The range of the program's outputs that the block stores.
    outputs: std::ops::Range<usize>,
    /// Temporaries of this block that later blocks use.
    exports: Vec<Temp>,
}

/// The text of a function's body while it is written.
pub(super) struct Body<'p> {
    program: &'p Program,
    /// The path of the runtime crate in the emitted code.
    runtime: String,
    /// For each temporary, the text that refers to it: a variable, or an entry of an array.
    names: Vec<String>,
    /// For each element of each argument, the text that refers to it.
    inputs: Vec<Vec<String>>,
    /// For each temporary, whether a step or an output uses it.
    is_used: Vec<bool>,
    /// For each temporary, the index of the block that computes it.
    block_of: Vec<usize>,
    blocks: Vec<Block>,
    /// For each block, its first step.
    block_starts: Vec<usize>,
    /// For each exported temporary, its index in the emitted array `kept`; empty if the blocks
    /// export their values by variables.
    export_index: BTreeMap<Temp, usize>,
    /// The text so far.
    out: String,
}

/// The statements of a program's function, indented, without its last line. `runtime` is the path
/// of the runtime crate; `preferred_names` are those of each argument's elements.
pub(super) fn statements(
    program: &Program,
    runtime: &str,
    preferred_names: &[Vec<String>],
) -> String {
    let mut names = Names::new();
    names.reserve(&program.output.name);
    for argument in &program.arguments {
        names.reserve(&argument.name);
    }
    let mut unique = |elements: &Vec<String>| elements.iter().map(|n| names.unique(n)).collect();
    let inputs: Vec<Vec<String>> = preferred_names.iter().map(&mut unique).collect();
    let mut body = Body {
        program,
        runtime: runtime.to_owned(),
        names: Vec::new(),
        inputs,
        is_used: used_temporaries(program),
        block_of: vec![0; program.names.len()],
        blocks: Vec::new(),
        block_starts: Vec::new(),
        export_index: BTreeMap::new(),
        out: String::new(),
    };
    body.cut_into_blocks();
    body.name_temporaries(&mut names);
    body.find_exports();
    body.write();
    body.out
}

/// Number of right-hand sides of a system.
fn rhs_count(solve: &SolveStep) -> usize {
    solve.rhs.first().map_or(1, |row| row.len().max(1))
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

impl Body<'_> {
    /// The pattern to which a result is bound: its name, or `_` if nothing uses it.
    fn pattern(&self, t: Temp) -> &str {
        if self.is_used[t.0 as usize] {
            &self.names[t.0 as usize]
        } else {
            "_"
        }
    }

    /// Divides the groups of the program into blocks: after every solve, and after
    /// [`MAX_BLOCK_STEPS`].
    fn cut_into_blocks(&mut self) {
        for group in &self.program.groups {
            let mut start = group.steps.start;
            let mut part_number = 0;
            for step in group.steps.clone() {
                let solves = matches!(self.program.steps[step].op, Op::Solve(_));
                let is_full = step + 1 - start >= MAX_BLOCK_STEPS;
                if (solves || is_full) && step + 1 < group.steps.end {
                    part_number += 1;
                    let title = if solves {
                        "loops: solve with A_e (Eq. 8, 10)".to_owned()
                    } else {
                        format!("{}, part {part_number}", group.title)
                    };
                    self.push_block(
                        title,
                        start..step + 1,
                        group.outputs.start..group.outputs.start,
                    );
                    start = step + 1;
                }
            }
            let Group { title, outputs, .. } = group;
            self.push_block(title.clone(), start..group.steps.end, outputs.clone());
        }
        self.block_starts = self.blocks.iter().map(|b| b.steps.start).collect();
        // the block of each result decides which temporaries are exported
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
                    let rhs_count = rhs_count(solve);
                    for (i, result) in step.results.iter().enumerate() {
                        self.names[result.0 as usize] =
                            format!("solved[{}][{}]", i / rhs_count, i % rhs_count);
                    }
                    continue;
                }
                for result in &step.results {
                    let temp = result.0 as usize;
                    self.names[temp] = if let Some(name) = &self.program.names[temp] {
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

    /// Writes one line at an indentation of `depth` levels.
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

    /// Writes all statements.
    fn write(&mut self) {
        let first = &self.program.arguments[0].name;
        self.line(1, &format!("let proto = {first}[0];"));
        let mut input_bindings = self.input_bindings();
        if self.program.solves() {
            self.line(1, "let mut condition = proto.splat(1.0);");
        }
        let exported: Vec<Temp> = self.blocks.iter().flat_map(|b| b.exports.clone()).collect();
        let unnamed =
            |step: &Step| matches!(step.op, Op::Solve(_)) && step.results.len() > MAX_SOLVE_NAMES;
        if exported.len() > MAX_SCOPE_NAMES || self.program.steps.iter().any(unnamed) {
            self.line(1, &format!("let mut kept = [proto; {}];", exported.len()));
            self.export_index = exported.into_iter().zip(0..).collect();
        }
        for index in 0..self.blocks.len() {
            for (items, tail) in input_bindings.remove(&index).unwrap_or_default() {
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

    /// The statements that destructure the arguments (items of the pattern, and the end of the
    /// statement), by the block before which they are written: the first one that uses an element.
    /// Elements bound at the start of the function would not stay in registers while the sines and
    /// cosines are computed, but be written to memory and read again.
    fn input_bindings(&mut self) -> BTreeMap<usize, Vec<(Vec<String>, String)>> {
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
        let exports_to_array = !self.export_index.is_empty();
        self.line(1, &format!("// {title}"));
        if exports.is_empty() || exports_to_array {
            self.line(1, "{");
        } else {
            let names = names(self);
            self.list(1, "let ", &names, " = {");
        }
        let renamed = self.import_from_array(index);
        let mut stores = self.stores(index, outputs);
        // `stores` has the key `None` for outputs that need none of the block's steps
        if let Some(stores) = stores.remove(&None) {
            self.line(2, &stores.join(" "));
        }
        let end = steps.end;
        for step in steps {
            let angles = self.angles_from(step, end);
            if angles > 1 {
                self.write_angles(step..step + angles);
            } else if angles == 1 || !self.is_angle(step) {
                self.write_step(step);
            }
            if let Some(stores) = stores.remove(&Some(step)) {
                self.line(2, &stores.join(" "));
            }
        }
        let names = names(self);
        if names.is_empty() {
            self.line(1, "}");
        } else if exports_to_array {
            for (t, name) in exports.iter().zip(names) {
                let text = format!("kept[{}] = {name};", self.export_index[t]);
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

    /// Names the values that a block imports from the array `kept`: by variables, or, if these are
    /// too many, by the entries of the array. Returns the names to be restored after the block.
    fn import_from_array(&mut self, index: usize) -> Vec<(Temp, String)> {
        let block = &self.blocks[index];
        let operands = self.program.steps[block.steps.clone()]
            .iter()
            .flat_map(|s| s.op.operands())
            .chain(self.program.outputs[block.outputs.clone()].iter().copied());
        let imports: BTreeMap<Temp, usize> = operands
            .filter_map(|o| match o {
                Operand::Temp(t) if self.block_of[t.0 as usize] != index => {
                    self.export_index.get(&t).map(|entry| (t, *entry))
                }
                _ => None,
            })
            .collect();
        let mut renamed = Vec::new();
        let few = imports.len() <= MAX_BLOCK_IMPORTS;
        for (t, entry) in imports {
            let name = self.names[t.0 as usize].clone();
            let in_array = format!("kept[{entry}]");
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

    /// The statements that store outputs, by the step after which they can be written (`None`:
    /// before the block's first step). Each entry is stored as soon as it is computed, so that it
    /// does not occupy a register until its column is complete.
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
            .flat_map(|(index, step)| step.results.iter().map(move |t| (*t, index)));
        let step_of: BTreeMap<Temp, usize> = results.collect();
        let mut stores: BTreeMap<Option<usize>, Vec<String>> = BTreeMap::new();
        for entry in outputs {
            let operand = &self.program.outputs[entry];
            // the zeros of the output are stored before the body
            if matches!(operand, Operand::Constant(c) if *c == 0.0) {
                continue;
            }
            let after = match operand {
                Operand::Temp(t) => step_of.get(t).copied(),
                Operand::Input { .. } | Operand::Constant(_) => None,
            };
            let subscript = match output.shape.get(1) {
                Some(&inner) => format!("[{}][{}]", entry / inner.max(1), entry % inner.max(1)),
                None => format!("[{entry}]"),
            };
            let text = format!("{}{subscript} = {};", output.name, self.operand(operand));
            stores.entry(after).or_default().push(text);
        }
        stores
    }

    /// The expression for an operand.
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

    /// Writes the statement of a step, given by its index.
    fn write_step(&mut self, index: usize) {
        let program = self.program;
        let step = &program.steps[index];
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
            Op::Sqrt(a) => format!("{}.sqrt()", o(a)),
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
                let names: Vec<&str> = step.results.iter().map(|t| self.pattern(*t)).collect();
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

    /// Number of consecutive sines and cosines before the step `end` that can be computed together,
    /// if the first of them is step `index`; else 0.
    fn angles_from(&self, index: usize, end: usize) -> usize {
        // a sequence that started before this block starts anew in it
        let begins = self.block_starts.contains(&index) || !self.is_angle(index - 1);
        if !begins {
            return 0;
        }
        (index..end).take_while(|step| self.is_angle(*step)).count()
    }

    /// Whether a step is a sine and cosine that can be computed together with those just before it:
    /// its angle is none of their results.
    fn is_angle(&self, index: usize) -> bool {
        let steps = &self.program.steps;
        let Op::SinCos(angle) = &steps[index].op else {
            return false;
        };
        let before = steps[..index].iter().rev();
        let neighbours = before.take_while(|s| matches!(s.op, Op::SinCos(_)));
        !neighbours
            .flat_map(|s| &s.results)
            .any(|t| *angle == Operand::Temp(*t))
    }

    /// Writes the sines and cosines of several angles as one call.
    fn write_angles(&mut self, steps: std::ops::Range<usize>) {
        let (mut names, mut angles) = (Vec::new(), Vec::new());
        for step in &self.program.steps[steps] {
            if let Op::SinCos(angle) = &step.op {
                let pair: Vec<&str> = step.results.iter().map(|t| self.pattern(*t)).collect();
                names.push(format!("({})", pair.join(", ")));
                angles.push(self.operand(angle));
            }
        }
        self.list(2, "let ", &names, " =");
        self.list(3, "T::sin_cos_all(", &angles, ");");
    }

    /// Writes the solution of a system in the fixed order of pivots. The runtime's `solve_guarded`
    /// solves it anew with pivoting where the smallest pivot is too small.
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
            .chunks(rhs_count(solve))
            .map(|row| {
                let names: Vec<&str> = row.iter().map(|t| self.pattern(*t)).collect();
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
