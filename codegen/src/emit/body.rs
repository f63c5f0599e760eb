//! Emits the body of a function: temporaries in blocks, and outputs stored as soon as they are
//! computed. The order of statements is the same in all languages.

use std::collections::BTreeMap;

use crate::optimize::{Op, Operand, Program, SolveStep, Step, Temp};

use super::language::{Language, Solve};
use super::plan::{Plan, is_angle};
use super::text::Text;

/// An argument with the names of its elements, where they are used.
type Binding = (String, Vec<Option<String>>);

/// A function's body while it is written.
struct Body<'p, L> {
    program: &'p Program,
    language: &'p L,
    plan: Plan,
    /// For each exported temporary, its index in the emitted array of kept values; empty if the
    /// blocks export their values by variables.
    export_index: BTreeMap<Temp, usize>,
    text: Text,
}

/// The statements of a program's function, indented, without its last line. `preferred_names` are
/// those of each argument's elements.
pub(super) fn statements(
    program: &Program,
    language: &impl Language,
    preferred_names: &[Vec<String>],
) -> String {
    let mut body = Body {
        program,
        language,
        plan: Plan::new(program, language, preferred_names),
        export_index: BTreeMap::new(),
        text: Text::default(),
    };
    body.write();
    body.text.into_string()
}

impl<L: Language> Body<'_, L> {
    /// Writes all statements.
    fn write(&mut self) {
        let limits = self.language.limits();
        let blocks = self.plan.blocks.iter();
        let exported: Vec<Temp> = blocks.flat_map(|b| b.exports.clone()).collect();
        let unnamed = |step: &Step| {
            matches!(step.op, Op::Solve(_)) && step.results.len() > limits.solve_names
        };
        let keeps = exported.len() > limits.scope_names || self.program.steps.iter().any(unnamed);
        let kept = keeps.then_some(exported.len());
        self.language.begin(&mut self.text, self.program, kept);
        if keeps {
            self.export_index = exported.into_iter().zip(0..).collect();
        }
        let mut bindings = self.argument_bindings();
        for index in 0..self.plan.blocks.len() {
            for (argument, names) in bindings.remove(&index).unwrap_or_default() {
                let names: Vec<Option<&str>> = names.iter().map(Option::as_deref).collect();
                self.language
                    .bind_argument(&mut self.text, &argument, &names);
            }
            self.write_block(index);
        }
    }

    /// The arguments with the names of their used elements, by the block before which they are
    /// bound: the first one that uses an element. Elements bound at the start of the function would
    /// not stay in registers while the sines and cosines are computed, but be written to memory and
    /// read again.
    fn argument_bindings(&mut self) -> BTreeMap<usize, Vec<Binding>> {
        let used = self.plan.used_inputs(self.program);
        let count = used.iter().flat_map(|(u, _)| u).filter(|u| **u).count();
        let mut bindings: BTreeMap<usize, Vec<Binding>> = BTreeMap::new();
        for (argument, (used, first)) in used.iter().enumerate() {
            let Some(first) = first else { continue };
            let name = &self.program.arguments[argument].name;
            if count > self.language.limits().scope_names {
                let elements = (0..used.len()).map(|element| format!("{name}[{element}]"));
                self.plan.inputs[argument] = elements.collect();
                continue;
            }
            let items = self.plan.inputs[argument].iter().zip(used);
            let items = items.map(|(name, used)| used.then(|| name.clone()));
            let binding = (name.clone(), items.collect());
            bindings.entry(*first).or_default().push(binding);
        }
        bindings
    }

    fn write_block(&mut self, index: usize) {
        let block = &self.plan.blocks[index];
        if block.steps.is_empty() && block.outputs.is_empty() {
            return;
        }
        let steps = block.steps.clone();
        let exports = block.exports.clone();
        let title = block.title.clone();
        let names = |body: &Self| -> Vec<String> {
            let names = exports.iter();
            names
                .map(|t| body.plan.names[t.0 as usize].clone())
                .collect()
        };
        let exports_to_array = !self.export_index.is_empty();
        let by_variables = |names: Vec<String>| if exports_to_array { Vec::new() } else { names };
        let language = self.language;
        let exported = by_variables(names(self));
        language.open_block(&mut self.text, &title, &exported);
        let renamed = self.import_from_array(index);
        let mut stores = self.stores(index);
        // `stores` has the key `None` for outputs that need none of the block's steps
        if let Some(stores) = stores.remove(&None) {
            language.stores(&mut self.text, &stores);
        }
        let end = steps.end;
        for step in steps {
            let angles = self.plan.angles_from(self.program, step, end);
            if angles > 1 {
                self.write_angles(step..step + angles);
            } else if angles == 1 || !is_angle(self.program, step) {
                self.write_step(step);
            }
            if let Some(stores) = stores.remove(&Some(step)) {
                language.stores(&mut self.text, &stores);
            }
        }
        if exports_to_array {
            for (t, name) in exports.iter().zip(&names(self)) {
                let entry = language.kept(self.export_index[t]);
                language.keep(&mut self.text, &entry, name);
            }
        }
        language.close_block(&mut self.text, &exported);
        for (t, name) in renamed {
            self.plan.names[t.0 as usize] = name;
        }
    }

    /// Names the values that a block imports from the array of kept values: by variables, or, if
    /// these are too many, by the entries of the array. Returns the names to be restored after the
    /// block.
    fn import_from_array(&mut self, index: usize) -> Vec<(Temp, String)> {
        let imports: BTreeMap<Temp, usize> = self.plan.blocks[index]
            .operands(self.program)
            .filter_map(|o| match o {
                Operand::Temp(t) if self.plan.block_of[t.0 as usize] != index => {
                    self.export_index.get(&t).map(|entry| (t, *entry))
                }
                _ => None,
            })
            .collect();
        let mut renamed = Vec::new();
        let few = imports.len() <= self.language.limits().block_imports;
        for (t, entry) in imports {
            let name = self.plan.names[t.0 as usize].clone();
            let in_array = self.language.kept(entry);
            // the results of a large solve have no variables
            if few && !name.contains('[') {
                self.language.bind(&mut self.text, &name, &in_array);
            } else {
                self.plan.names[t.0 as usize] = in_array;
                renamed.push((t, name));
            }
        }
        renamed
    }

    /// The statements that store outputs, by the step after which they can be written.
    fn stores(&self, index: usize) -> BTreeMap<Option<usize>, Vec<String>> {
        let statement = |entry: usize| {
            let value = self.operand(&self.program.outputs[entry]);
            self.language.store(&self.program.output, entry, &value)
        };
        let stores = self.plan.stores(self.program, index).into_iter();
        stores
            .map(|(step, entries)| (step, entries.into_iter().map(statement).collect()))
            .collect()
    }

    /// The expression for an operand.
    fn operand(&self, operand: &Operand) -> String {
        match *operand {
            Operand::Input { argument, element } => self.plan.inputs[argument][element].clone(),
            Operand::Constant(c) => self.language.constant(c),
            Operand::Temp(t) => self.plan.names[t.0 as usize].clone(),
        }
    }

    /// The name to which a result is bound, if anything uses it.
    fn used_name(&self, t: Temp) -> Option<&str> {
        self.plan.is_used[t.0 as usize].then(|| self.plan.names[t.0 as usize].as_str())
    }

    /// Names of a sine and a cosine.
    fn pair(&self, results: &[Temp]) -> [Option<&str>; 2] {
        std::array::from_fn(|k| results.get(k).and_then(|t| self.used_name(*t)))
    }

    /// Writes the statement of a step, given by its index.
    fn write_step(&mut self, index: usize) {
        let program = self.program;
        let step = &program.steps[index];
        let mut text = std::mem::take(&mut self.text);
        match &step.op {
            Op::SinCos(a) => {
                let names = self.pair(&step.results);
                self.language.sin_cos(&mut text, names, &self.operand(a));
            }
            Op::Solve(solve) => self.write_solve(&mut text, solve, &step.results),
            op => {
                let value = self
                    .language
                    .operation(op, &|operand| self.operand(operand));
                let result = step.results.first();
                let name = result.map_or("_", |t| self.plan.names[t.0 as usize].as_str());
                self.language.bind(&mut text, name, &value);
            }
        }
        self.text = text;
    }

    /// Writes the sines and cosines of several angles together.
    fn write_angles(&mut self, steps: std::ops::Range<usize>) {
        let mut text = std::mem::take(&mut self.text);
        let (mut names, mut angles) = (Vec::new(), Vec::new());
        for step in &self.program.steps[steps] {
            if let Op::SinCos(angle) = &step.op {
                names.push(self.pair(&step.results));
                angles.push(self.operand(angle));
            }
        }
        self.language.sin_cos_all(&mut text, &names, &angles);
        self.text = text;
    }

    fn write_solve(&self, text: &mut Text, solve: &SolveStep, results: &[Temp]) {
        let rows = |rows: &[Vec<Operand>]| -> Vec<Vec<String>> {
            let rows = rows.iter();
            rows.map(|row| row.iter().map(|o| self.operand(o)).collect())
                .collect()
        };
        let pivots = solve.pivots.iter();
        let solve = Solve {
            results: results
                .chunks(solve.rhs_count())
                .map(|row| row.iter().map(|t| self.used_name(*t)).collect())
                .collect(),
            is_named: results.len() <= self.language.limits().solve_names,
            matrix: rows(&solve.matrix),
            rhs: rows(&solve.rhs),
            fixed: rows(&solve.fixed),
            pivots: pivots
                .map(|(pivot, size)| (self.operand(pivot), *size))
                .collect(),
        };
        self.language.solve(text, &solve);
    }
}
