//! Spells operations and statements in C99. All values of a function are in one scope: compilers
//! keep no variable longer than it is used, and the plan's names are unique in the function.

use std::cell::Cell;

use crate::optimize::{Op, Operand, Output, Program};

use super::super::language::{Language, Limits, Solve};
use super::super::text::Text;
use super::angles::LANES;
use super::names::{RESERVED, literal, literal_f};
use super::support::{Helper, Helpers, macro_name};

/// The brackets of initialisers.
const LIST: [&str; 2] = ["{ ", " }"];

/// The type of the numbers of a function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Precision {
    /// `double`.
    Double,
    /// `float`.
    Float,
}

impl Precision {
    pub(super) const ALL: [Precision; 2] = [Precision::Double, Precision::Float];

    /// The C type.
    pub(super) fn type_name(self) -> &'static str {
        match self {
            Precision::Double => "double",
            Precision::Float => "float",
        }
    }

    /// The end of the names of functions with this type.
    pub(super) fn suffix(self) -> &'static str {
        match self {
            Precision::Double => "",
            Precision::Float => "_f",
        }
    }

    /// The end of the names of the C library's functions with this type.
    pub(super) fn library_suffix(self) -> &'static str {
        match self {
            Precision::Double => "",
            Precision::Float => "f",
        }
    }

    /// A number of this type.
    pub(super) fn literal(self, value: f64) -> String {
        match self {
            Precision::Double => literal(value),
            Precision::Float => literal_f(value),
        }
    }
}

/// C in one precision. It counts the helpers that bodies call, and the arrays that they need.
pub(super) struct C<'r> {
    /// What names of helpers begin with.
    pub(super) prefix: &'r str,
    pub(super) precision: Precision,
    /// Whether the function returns a condition.
    pub(super) has_condition: bool,
    /// The helpers that were called.
    pub(super) helpers: &'r Helpers,
    /// Number of statements so far that need a number in the names of their arrays.
    pub(super) numbered: Cell<usize>,
    /// Number of entries of arrays so far, and of local variables.
    pub(super) entries: Cell<usize>,
}

impl C<'_> {
    /// The name of a helper, which is emitted then.
    fn helper(&self, helper: Helper) -> String {
        self.helpers.call(helper);
        helper.name(self.prefix, self.precision)
    }

    /// A product and a sum that are fused by this macro.
    fn fused(&self, word: &str, operands: &[String; 3]) -> String {
        self.helpers.call(Helper::Fused);
        let name = macro_name(self.prefix, word, self.precision);
        format!("{name}({})", operands.join(", "))
    }

    /// Counts variables and entries of arrays, for the bound of the stack.
    fn count(&self, entries: usize) {
        self.entries.set(self.entries.get() + entries);
    }

    /// A number that no array of this function has in its name yet.
    fn next(&self) -> usize {
        self.numbered.set(self.numbered.get() + 1);
        self.numbered.get()
    }

    /// Binds the sines and cosines of angles to these entries of arrays with these names.
    fn unpack(&self, text: &mut Text, names: &[[Option<&str>; 2]], number: usize, first: usize) {
        let number_type = self.precision.type_name();
        for (index, pair) in names.iter().enumerate() {
            let entry = first + index;
            let arrays = ["sines", "cosines"].iter().zip(pair);
            let bound: Vec<String> = arrays
                .filter_map(|(array, name)| {
                    Some(format!("{} = {array}_{number}_[{entry}]", (*name)?))
                })
                .collect();
            if !bound.is_empty() {
                text.line(1, &format!("const {number_type} {};", bound.join(", ")));
                self.count(bound.len());
            }
        }
    }

    /// Binds the sines and cosines of up to [`LANES`] angles, of which the first ones have sines and
    /// cosines already.
    fn sin_cos_group(
        &self,
        text: &mut Text,
        names: &[[Option<&str>; 2]],
        angles: &[String],
        bound: usize,
    ) {
        let number_type = self.precision.type_name();
        let helper = self.helper(Helper::SinCosLanes);
        let number = self.next();
        let mut filled = angles.to_vec();
        filled.resize(LANES, angles.last().cloned().unwrap_or_default());
        let head = format!("const {number_type} angles_{number}_[{LANES}] = ");
        text.list(1, &head, LIST, &filled, ";");
        text.line(
            1,
            &format!("{number_type} sines_{number}_[{LANES}], cosines_{number}_[{LANES}];"),
        );
        text.line(
            1,
            &format!("{helper}(angles_{number}_, sines_{number}_, cosines_{number}_);"),
        );
        // three arrays, and the variables of the helper, which is part of the function
        self.count(3 * LANES + 8);
        self.unpack(text, &names[bound..], number, bound);
    }
}

impl Language for C<'_> {
    fn reserved(&self) -> &'static [&'static str] {
        RESERVED
    }

    fn limits(&self) -> Limits {
        Limits {
            scope_names: usize::MAX,
            block_imports: usize::MAX,
            solve_names: usize::MAX,
        }
    }

    fn constant(&self, value: f64) -> String {
        self.precision.literal(value)
    }

    fn operation(&self, op: &Op, o: &dyn Fn(&Operand) -> String) -> String {
        let [zero, one] = [0.0, 1.0].map(|x| self.constant(x));
        match op {
            Op::Neg(a) => format!("-{}", o(a)),
            Op::Add(a, b) => format!("{} + {}", o(a), o(b)),
            Op::Sub(a, b) => format!("{} - {}", o(a), o(b)),
            Op::Mul(a, b) => format!("{} * {}", o(a), o(b)),
            Op::Div(a, b) => format!("{} / {}", o(a), o(b)),
            Op::MulAdd(a, b, c) => self.fused("FMA", &[a, b, c].map(o)),
            Op::NegMulAdd(a, b, c) => self.fused("FNMA", &[a, b, c].map(o)),
            Op::MulSub(a, b, c) => self.fused("FMS", &[a, b, c].map(o)),
            Op::Sqrt(a) => format!("sqrt{}({})", self.precision.library_suffix(), o(a)),
            Op::Sign(a) => format!("{}({})", self.helper(Helper::Sign), o(a)),
            Op::Positive(a) => format!("{} > {zero} ? {one} : {zero}", o(a)),
            Op::Negative(a) => format!("{} < {zero} ? {one} : {zero}", o(a)),
            // written by statements of their own
            Op::SinCos(_) | Op::Solve(_) => String::new(),
        }
    }

    fn solved(&self, row: usize, column: usize) -> String {
        format!("solved_[{row}][{column}]")
    }

    fn begin(&self, text: &mut Text, program: &Program, _kept: Option<usize>) {
        if !(program.solves() || self.has_condition) {
            return;
        }
        let number_type = self.precision.type_name();
        let kept = if program.solves() { "" } else { "const " };
        let mut sum = vec![self.constant(1.0)];
        if self.has_condition {
            let zero = self.helper(Helper::Finite);
            let motion = program.arguments.iter().filter(|a| a.is_motion());
            sum.extend(motion.map(|a| format!("{zero}({}, {})", a.name, a.len)));
        }
        let sum = sum.join(" + ");
        let flat = format!("{kept}{number_type} condition = {sum};");
        if flat.len() <= 96 {
            text.line(1, &flat);
        } else {
            text.line(1, &format!("{kept}{number_type} condition ="));
            text.line(2, &format!("{sum};"));
        }
    }

    fn bind_argument(&self, text: &mut Text, argument: &str, names: &[Option<&str>]) {
        let number_type = self.precision.type_name();
        for (index, name) in names.iter().enumerate() {
            if let Some(name) = name {
                let value = format!("const {number_type} {name} = {argument}[{index}];");
                text.line(1, &value);
                self.count(1);
            }
        }
    }

    fn open_block(&self, text: &mut Text, title: &str, _exports: &[String]) {
        let title = super::names::comment(title);
        text.line(0, "");
        text.line(1, &format!("/* {title} */"));
    }

    fn close_block(&self, _text: &mut Text, _exports: &[String]) {}

    fn bind(&self, text: &mut Text, name: &str, value: &str) {
        let number_type = self.precision.type_name();
        text.line(1, &format!("const {number_type} {name} = {value};"));
        self.count(1);
    }

    fn keep(&self, text: &mut Text, entry: &str, value: &str) {
        text.line(1, &format!("{entry} = {value};"));
    }

    fn sin_cos(&self, text: &mut Text, names: [Option<&str>; 2], angle: &str) {
        let number_type = self.precision.type_name();
        if self.precision == Precision::Float {
            let functions = ["sinf", "cosf"].iter().zip(names);
            for (function, name) in functions {
                if let Some(name) = name {
                    self.bind(text, name, &format!("{function}({angle})"));
                }
            }
            return;
        }
        let number = self.next();
        let [sine, cosine] = ["sines", "cosines"].map(|array| format!("{array}_{number}_"));
        text.line(1, &format!("{number_type} {sine}[1], {cosine}[1];"));
        let helper = self.helper(Helper::SinCos);
        text.line(1, &format!("{helper}({angle}, {sine}, {cosine});"));
        self.count(2);
        self.unpack(text, &[names], number, 0);
    }

    /// Sines and cosines in groups that fill vector registers, of which the last overlaps the one
    /// before; the C library's in single precision, where they are quick.
    fn sin_cos_all(&self, text: &mut Text, names: &[[Option<&str>; 2]], angles: &[String]) {
        if self.precision == Precision::Float {
            for (pair, angle) in names.iter().zip(angles) {
                self.sin_cos(text, *pair, angle);
            }
            return;
        }
        // one angle that is left over takes longer in a register of its own
        let together = angles.len() - usize::from(angles.len() % LANES == 1);
        let last = together.saturating_sub(LANES);
        for group in (0..together).step_by(LANES) {
            let first = group.min(last);
            let end = together.min(first + LANES);
            self.sin_cos_group(text, &names[first..end], &angles[first..end], group - first);
        }
        for (pair, angle) in names.iter().zip(angles).skip(together) {
            self.sin_cos(text, *pair, angle);
        }
    }

    fn solve(&self, text: &mut Text, solve: &Solve<'_>) {
        let number_type = self.precision.type_name();
        let [smaller, size] = [Helper::Smaller, Helper::Size].map(|h| self.helper(h));
        let pivoted = self.helper(Helper::SolvePivoted);
        let one = self.constant(1.0);
        let number = self.next();
        let margin = format!("margin_{number}_");
        let mut margins = solve
            .pivots
            .iter()
            .map(|(pivot, usual)| format!("{size}({pivot} * {})", self.constant(1.0 / usual)));
        let first = margins.next().unwrap_or_else(|| one.clone());
        text.line(1, "/* the smallest pivot relative to its usual size */");
        text.line(1, &format!("{number_type} {margin} = {first};"));
        for other in margins {
            text.line(1, &format!("{margin} = {smaller}({margin}, {other});"));
        }
        let unknowns = solve.results.iter().flatten();
        let named: Vec<(usize, &str, &str)> = unknowns
            .zip(solve.fixed.iter().flatten())
            .enumerate()
            .filter_map(|(index, (name, fixed))| Some((index, (*name)?, fixed.as_str())))
            .collect();
        let unknowns = solve.results.iter().flatten();
        for (name, fixed) in unknowns.zip(solve.fixed.iter().flatten()) {
            if name.is_none() {
                text.line(1, &format!("(void){fixed};"));
            }
        }
        for (_, name, fixed) in &named {
            text.line(1, &format!("{number_type} {name} = {fixed};"));
        }
        let bound = self.constant(super::PIVOT_BOUND);
        text.line(1, &format!("if ({margin} > {bound}) {{"));
        let worst = format!("condition = {smaller}(condition, {smaller}({margin}, {one}));");
        text.line(2, &worst);
        text.line(1, "} else {");
        let rows = solve.matrix.len();
        let count = solve.results.len();
        let sides = solve.results.first().map_or(0, Vec::len);
        for (array, entries) in [("a_", &solve.matrix), ("b_", &solve.rhs)] {
            let entries: Vec<String> = entries.iter().flatten().cloned().collect();
            let head = format!("{number_type} {array}[{}] = ", entries.len());
            text.list(2, &head, LIST, &entries, ";");
            self.count(entries.len());
        }
        let scales = rows + count;
        let length = count * sides;
        text.line(
            2,
            &format!("{number_type} x_[{length}], scales_[{scales}];"),
        );
        text.line(2, &format!("int order_[{count}];"));
        text.line(
            2,
            &format!("const {number_type} ratio_ = {pivoted}({rows}, {count}, {sides}, a_, b_, x_, scales_, order_);"),
        );
        for (index, name, _) in &named {
            text.line(2, &format!("{name} = x_[{index}];"));
        }
        let worst = format!("condition = {smaller}(condition, {smaller}(ratio_, {one}));");
        text.line(2, &worst);
        text.line(1, "}");
        // order_ has entries of the size of a float or less
        self.count(length + scales + count + named.len() + 2);
    }

    fn store(&self, output: &Output, entry: usize, value: &str) -> String {
        format!("{}[{entry}] = {value};", output.name)
    }

    fn stores(&self, text: &mut Text, statements: &[String]) {
        for statement in statements {
            text.line(1, statement);
        }
    }
}
