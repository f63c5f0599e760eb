//! The interface between programs and languages: how a language spells operations and statements.
//!
//! `body` decides the order of statements and which values have names; a [`Language`] writes them.

use crate::optimize::{Op, Operand, Output, Program, SolveStep};

use super::text::Text;

/// How many values a language can bind to names before it reads them by index.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Largest number of arguments' elements, and of exported values, that are bound to names in
    /// the function's own scope.
    pub(super) scope_names: usize,
    /// Largest number of values from the array that are bound to names in a block.
    pub(super) block_imports: usize,
    /// Largest number of results of one solve that are bound to names.
    pub(super) solve_names: usize,
}

/// The texts of a linear system's operands.
#[derive(Debug)]
pub(super) struct Solve<'s> {
    /// The names of the unknowns, one row for each, with `None` for unused ones.
    pub(super) results: Vec<Vec<Option<&'s str>>>,
    /// Whether the unknowns have the names in `results`; otherwise [`Language::solved`] refers to
    /// them.
    pub(super) is_named: bool,
    /// All rows of A.
    pub(super) matrix: Vec<Vec<String>>,
    /// All rows of B.
    pub(super) rhs: Vec<Vec<String>>,
    /// The solution in the fixed order of pivots, one row for each unknown.
    pub(super) fixed: Vec<Vec<String>>,
    /// The pivots of the fixed order, each with its usual absolute value.
    pub(super) pivots: Vec<(String, f64)>,
}

/// The spelling of operations and statements in a language.
///
/// Statements are written into a [`Text`]. Those of blocks are indented by two levels if the
/// language nests blocks, and by one if it does not.
pub(super) trait Language {
    /// The language's reserved words, and names that every body uses.
    fn reserved(&self) -> &'static [&'static str];

    /// How many values are bound to names.
    fn limits(&self) -> Limits;

    /// A constant as an operand.
    fn constant(&self, value: f64) -> String;

    /// The value of an operation with one result, other than a sine and cosine or a solve.
    fn operation(&self, op: &Op, operand: &dyn Fn(&Operand) -> String) -> String;

    /// The unknown of a large solve, by row and right-hand side.
    fn solved(&self, row: usize, column: usize) -> String;

    /// An entry of the array that passes values between blocks if they are too many for names.
    fn kept(&self, entry: usize) -> String {
        format!("kept[{entry}]")
    }

    /// The statements before all blocks. `kept`: the length of the array that passes values between
    /// blocks, if there is one.
    fn begin(&self, text: &mut Text, program: &Program, kept: Option<usize>);

    /// Binds elements of an argument to names, in their order; those without a name are not used.
    fn bind_argument(&self, text: &mut Text, argument: &str, names: &[Option<&str>]);

    /// Opens a block that exports the values with these names.
    fn open_block(&self, text: &mut Text, title: &str, exports: &[String]);

    /// Closes a block that exports the values with these names.
    fn close_block(&self, text: &mut Text, exports: &[String]);

    /// Binds a value to a name.
    fn bind(&self, text: &mut Text, name: &str, value: &str);

    /// Assigns to an entry of the array that passes values between blocks.
    fn keep(&self, text: &mut Text, entry: &str, value: &str);

    /// Binds the sine and cosine of an angle.
    fn sin_cos(&self, text: &mut Text, names: [Option<&str>; 2], angle: &str);

    /// Binds the sines and cosines of several angles.
    fn sin_cos_all(&self, text: &mut Text, names: &[[Option<&str>; 2]], angles: &[String]);

    /// Solves a system in the fixed order of pivots and, if the smallest pivot is too small, again
    /// with pivoting; updates the worst condition.
    fn solve(&self, text: &mut Text, solve: &Solve<'_>);

    /// The statement that stores an entry of the output, by its index in the order of the outputs.
    fn store(&self, output: &Output, entry: usize, value: &str) -> String;

    /// Writes statements that belong on one line.
    fn stores(&self, text: &mut Text, statements: &[String]);
}

impl SolveStep {
    /// Number of right-hand sides.
    pub(super) fn rhs_count(&self) -> usize {
        self.rhs.first().map_or(1, |row| row.len().max(1))
    }
}
