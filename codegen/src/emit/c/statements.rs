//! Spells operations and statements in C99. All values of a function are in one scope: compilers
//! keep no variable longer than it is used, and the plan's names are unique in the function.

use std::cell::Cell;

use crate::optimize::{Op, Operand, Output, Program};

use super::super::language::{Language, Limits, Solve};
use super::super::text::Text;
use super::names::{RESERVED, literal, literal_f};
use super::support::{Helper, Helpers, LANES};

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

    /// Counts variables and entries of arrays, for the bound of the stack.
    fn count(&self, entries: usize) {
        self.entries.set(self.entries.get() + entries);
    }

    /// A number that no array of this function has in its name yet.
    fn next(&self) -> usize {
        self.numbered.set(self.numbered.get() + 1);
        self.numbered.get()
    }

    /// Binds the sines and cosines of angles to entries of arrays with these names.
    fn unpack(&self, text: &mut Text, names: &[[Option<&str>; 2]], number: usize) {
        let number_type = self.precision.type_name();
        for (index, pair) in names.iter().enumerate() {
            let arrays = ["sines", "cosines"].iter().zip(pair);
            let bound: Vec<String> = arrays
                .filter_map(|(array, name)| {
                    Some(format!("{} = {array}_{number}_[{index}]", (*name)?))
                })
                .collect();
            if !bound.is_empty() {
                text.line(1, &format!("const {number_type} {};", bound.join(", ")));
                self.count(bound.len());
            }
        }
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
            Op::MulAdd(a, b, c) => format!("{} * {} + {}", o(a), o(b), o(c)),
            Op::NegMulAdd(a, b, c) => format!("{} - {} * {}", o(c), o(a), o(b)),
            Op::MulSub(a, b, c) => format!("{} * {} - {}", o(a), o(b), o(c)),
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
        if program.solves() {
            let number_type = self.precision.type_name();
            let one = self.constant(1.0);
            text.line(1, &format!("{number_type} condition = {one};"));
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
        self.unpack(text, &[names], number);
    }

    /// Sines and cosines in groups that fill vector registers; the C library's in single precision,
    /// where they are quick.
    fn sin_cos_all(&self, text: &mut Text, names: &[[Option<&str>; 2]], angles: &[String]) {
        if self.precision == Precision::Float {
            for (pair, angle) in names.iter().zip(angles) {
                self.sin_cos(text, *pair, angle);
            }
            return;
        }
        let number_type = self.precision.type_name();
        let helper = self.helper(Helper::SinCosLanes);
        let number = self.next();
        // one angle that is left over takes longer in registers that are filled up
        let single = angles.len() % LANES == 1;
        let lanes = if single {
            angles.len()
        } else {
            angles.len().next_multiple_of(LANES)
        };
        let zero = self.constant(0.0);
        let padding = std::iter::repeat_n(zero, lanes - angles.len());
        let padded: Vec<String> = angles.iter().cloned().chain(padding).collect();
        let head = format!("const {number_type} angles_{number}_[{lanes}] = ");
        text.list(1, &head, LIST, &padded, ";");
        let arrays = ["sines", "cosines"].map(|array| format!("{array}_{number}_[{lanes}]"));
        text.line(1, &format!("{number_type} {};", arrays.join(", ")));
        let offset = |array: &str, first: usize| {
            if first > 0 {
                format!("{array}_{number}_ + {first}")
            } else {
                format!("{array}_{number}_")
            }
        };
        for first in (0..lanes - usize::from(single)).step_by(LANES) {
            let arrays = ["angles", "sines", "cosines"].map(|array| offset(array, first));
            text.line(1, &format!("{helper}({});", arrays.join(", ")));
        }
        if single {
            let last = lanes - 1;
            let helper = self.helper(Helper::SinCos);
            let [sines, cosines] = ["sines", "cosines"].map(|array| offset(array, last));
            let angle = format!("angles_{number}_[{last}]");
            text.line(1, &format!("{helper}({angle}, {sines}, {cosines});"));
        }
        self.count(3 * lanes);
        self.unpack(text, names, number);
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
