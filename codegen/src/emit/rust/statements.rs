//! Spells operations and statements in Rust.
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

use crate::optimize::{Op, Operand, Output, Program};

use super::super::language::{Language, Limits, Solve};
use super::super::text::Text;
use super::names::{RESERVED, literal};

/// The brackets of arrays.
const ARRAY: [&str; 2] = ["[", "]"];

/// Rust that calls a runtime.
pub(super) struct Rust<'o> {
    /// The path of the runtime crate in the emitted code.
    pub(super) runtime: &'o str,
    /// Whether the function returns a condition.
    pub(super) has_condition: bool,
}

/// The pattern to which a result is bound: its name, or `_` if nothing uses it.
fn pattern(name: Option<&str>) -> &str {
    name.unwrap_or("_")
}

/// An array of arrays, one text for each row.
fn rows(rows: &[Vec<String>]) -> Vec<String> {
    let rows = rows.iter();
    rows.map(|row| format!("[{}]", row.join(", "))).collect()
}

impl Rust<'_> {
    /// The operand with the opposite sign.
    fn negated(&self, operand: &Operand, text: &dyn Fn(&Operand) -> String) -> String {
        match operand {
            Operand::Constant(c) => self.constant(-c),
            other => format!("-{}", text(other)),
        }
    }
}

impl Language for Rust<'_> {
    fn reserved(&self) -> &'static [&'static str] {
        &RESERVED
    }

    fn limits(&self) -> Limits {
        Limits {
            scope_names: 300,
            block_imports: 200,
            solve_names: 100,
        }
    }

    fn constant(&self, value: f64) -> String {
        format!("proto.splat({})", literal(value))
    }

    fn operation(&self, op: &Op, o: &dyn Fn(&Operand) -> String) -> String {
        match op {
            Op::Neg(a) => self.negated(a, o),
            Op::Add(a, b) => format!("{} + {}", o(a), o(b)),
            Op::Sub(a, b) => format!("{} - {}", o(a), o(b)),
            Op::Mul(a, b) => format!("{} * {}", o(a), o(b)),
            Op::Div(a, b) => format!("{} / {}", o(a), o(b)),
            Op::MulAdd(a, b, c) => format!("{}.mul_add({}, {})", o(a), o(b), o(c)),
            Op::NegMulAdd(a @ Operand::Constant(_), b, c) => {
                format!("{}.mul_add({}, {})", self.negated(a, o), o(b), o(c))
            }
            Op::NegMulAdd(a, b, c) => {
                format!("({}).mul_add({}, {})", self.negated(a, o), o(b), o(c))
            }
            Op::MulSub(a, b, c) => {
                format!("{}.mul_add({}, {})", o(a), o(b), self.negated(c, o))
            }
            Op::Sqrt(a) => format!("{}.sqrt()", o(a)),
            Op::Sign(a) => format!("{}.sign()", o(a)),
            Op::Positive(a) => format!(
                "T::select(proto.splat(0.0).less({}), proto.splat(1.0), proto.splat(0.0))",
                o(a)
            ),
            Op::Negative(a) => format!(
                "T::select({}.less(proto.splat(0.0)), proto.splat(1.0), proto.splat(0.0))",
                o(a)
            ),
            // written by statements of their own
            Op::SinCos(_) | Op::Solve(_) => String::new(),
        }
    }

    fn solved(&self, row: usize, column: usize) -> String {
        format!("solved[{row}][{column}]")
    }

    fn begin(&self, text: &mut Text, program: &Program, kept: Option<usize>) {
        let first = &program.arguments[0].name;
        text.line(1, &format!("let proto = {first}[0];"));
        let motion = program.arguments.iter().filter(|a| a.is_motion());
        let motion: Vec<&str> = motion.map(|a| a.name.as_str()).collect();
        let of_state = format!("Condition::of_state(proto, &[{}])", motion.join(", "));
        match (program.solves(), self.has_condition) {
            (true, true) => text.line(1, &format!("let mut condition = {of_state}.pivot;")),
            (true, false) => text.line(1, "let mut condition = proto.splat(1.0);"),
            (false, true) => text.line(1, &format!("let condition = {of_state};")),
            (false, false) => {}
        }
        if let Some(length) = kept {
            text.line(1, &format!("let mut kept = [proto; {length}];"));
        }
    }

    fn bind_argument(&self, text: &mut Text, argument: &str, names: &[Option<&str>]) {
        let items: Vec<String> = names.iter().map(|n| pattern(*n).to_owned()).collect();
        text.list(1, "let ", ARRAY, &items, &format!(" = *{argument};"));
    }

    fn open_block(&self, text: &mut Text, title: &str, exports: &[String]) {
        text.line(1, &format!("// {title}"));
        if exports.is_empty() {
            text.line(1, "{");
        } else {
            text.list(1, "let ", ARRAY, exports, " = {");
        }
    }

    fn close_block(&self, text: &mut Text, exports: &[String]) {
        if exports.is_empty() {
            text.line(1, "}");
        } else {
            text.list(2, "", ARRAY, exports, "");
            text.line(1, "};");
        }
    }

    fn bind(&self, text: &mut Text, name: &str, value: &str) {
        text.line(2, &format!("let {name} = {value};"));
    }

    fn keep(&self, text: &mut Text, entry: &str, value: &str) {
        text.line(2, &format!("{entry} = {value};"));
    }

    fn sin_cos(&self, text: &mut Text, names: [Option<&str>; 2], angle: &str) {
        let names = names.map(pattern).join(", ");
        text.line(2, &format!("let ({names}) = {angle}.sin_cos();"));
    }

    fn sin_cos_all(&self, text: &mut Text, names: &[[Option<&str>; 2]], angles: &[String]) {
        let pairs = names.iter();
        let pairs: Vec<String> = pairs
            .map(|pair| format!("({})", pair.map(pattern).join(", ")))
            .collect();
        text.list(2, "let ", ARRAY, &pairs, " =");
        text.list(3, "T::sin_cos_all(", ARRAY, angles, ");");
    }

    /// Writes the solution of a system in the fixed order of pivots. The runtime's `solve_guarded`
    /// solves it again, with pivoting, where the smallest pivot is too small.
    fn solve(&self, text: &mut Text, solve: &Solve<'_>) {
        let mut margins = solve
            .pivots
            .iter()
            .map(|(pivot, size)| format!("({pivot} * {}).abs()", self.constant(1.0 / size)));
        let first = margins.next().unwrap_or_else(|| self.constant(1.0));
        text.line(2, "// the smallest pivot relative to its usual size");
        text.line(2, &format!("let margin = {first}"));
        for margin in margins {
            text.line(3, &format!(".min({margin})"));
        }
        // end the statement after its last line
        text.append(";");
        if solve.is_named {
            let results = solve.results.iter();
            let results: Vec<String> = results
                .map(|row| {
                    let names: Vec<&str> = row.iter().copied().map(pattern).collect();
                    format!("[{}]", names.join(", "))
                })
                .collect();
            text.list(2, "let (", ARRAY, &results, ", found) = ");
        } else {
            text.line(2, "let (solved, found) = ");
        }
        text.append(&format!("{}::solve_guarded(", self.runtime));
        text.list(3, "", ARRAY, &rows(&solve.fixed), ",");
        text.line(3, "margin,");
        text.line(3, "|| (");
        text.list(4, "", ARRAY, &rows(&solve.matrix), ",");
        text.list(4, "", ARRAY, &rows(&solve.rhs), ",");
        text.line(3, "),");
        text.line(2, ");");
        text.line(2, "condition = condition.min(found);");
    }

    fn store(&self, output: &Output, entry: usize, value: &str) -> String {
        let subscript = match output.shape.get(1) {
            Some(&inner) => format!("[{}][{}]", entry / inner.max(1), entry % inner.max(1)),
            None => format!("[{entry}]"),
        };
        format!("{}{subscript} = {value};", output.name)
    }

    fn stores(&self, text: &mut Text, statements: &[String]) {
        text.line(2, &statements.join(" "));
    }
}
