//! The result of a check: the statement that must hold, the largest error, its bound, and the state
//! at which the error is largest.

/// The statement that a check tests, with its names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Statement {
    /// The statement, such as `A qd = 0`.
    pub statement: &'static str,
    /// The name of the check in files.
    pub key: &'static str,
    /// The short name of the check as the heading of a column.
    pub heading: &'static str,
}

impl Statement {
    /// A statement that serves as key and heading too.
    pub const fn identity(statement: &'static str) -> Self {
        Self {
            statement,
            key: statement,
            heading: statement,
        }
    }
}

/// Result of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The error is within its bound.
    Passed,
    /// The error exceeds its bound, or one of the two is not finite.
    Failed,
    /// The check does not apply; the note gives the reason.
    NotApplicable,
    /// The check is undecided, since double precision is not accurate enough.
    Undecided,
}

/// The result of a check with its largest error and the bound.
#[derive(Clone, Debug)]
pub struct Check {
    /// The statement that must hold.
    pub what: Statement,
    /// The result.
    pub verdict: Verdict,
    /// The largest error; NaN if nothing could be computed.
    pub worst: f64,
    /// The bound of the error.
    pub bound: f64,
    /// The state with the largest error, counted from 0; `None` for checks that do not depend on a
    /// state.
    pub place: Option<usize>,
    /// The reason why the check does not apply, or additional information.
    pub note: String,
}

impl Check {
    /// A check that does not apply, with the reason.
    pub fn not_applicable(what: Statement, why: &str) -> Self {
        Self {
            verdict: Verdict::NotApplicable,
            note: why.to_owned(),
            ..Self::of(what, 0.0, 0.0)
        }
    }

    /// A check that holds if the error `worst` is at most `bound`.
    pub fn of(what: Statement, worst: f64, bound: f64) -> Self {
        Self {
            what,
            verdict: if within(worst, bound) {
                Verdict::Passed
            } else {
                Verdict::Failed
            },
            worst,
            bound,
            place: None,
            note: String::new(),
        }
    }

    /// A check of a statement that is either true or false.
    pub fn truth(what: Statement, holds: bool) -> Self {
        Self::of(what, f64::from(u8::from(!holds)), 0.0)
    }

    /// The check with a note.
    #[must_use]
    pub fn with(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Whether it failed.
    pub fn fails(&self) -> bool {
        self.verdict == Verdict::Failed
    }
}

/// Whether an error is within its bound; false for NaN and for an infinite bound.
fn within(figure: f64, bound: f64) -> bool {
    figure <= bound && bound.is_finite()
}

/// The checks of one robot.
#[derive(Clone, Debug)]
pub struct Report {
    /// The name of the robot.
    pub robot: String,
    /// Number of random closed states at which the checks were made.
    pub states: usize,
    /// The checks, in the order in which they were made.
    pub checks: Vec<Check>,
}

impl Report {
    /// The statements of the checks that failed.
    pub fn failed(&self) -> impl Iterator<Item = &'static str> {
        self.checks
            .iter()
            .filter(|c| c.fails())
            .map(|c| c.what.statement)
    }
}

/// Collects many comparisons for one check: each error is compared with its own bound; the largest
/// error and the largest bound are reported.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Worst {
    /// The largest error.
    figure: f64,
    /// The largest bound.
    bound: f64,
    /// The state with the largest error.
    place: Option<usize>,
    /// Whether an error exceeded its own bound.
    missed: bool,
    /// Whether anything was compared.
    compared: bool,
}

impl Worst {
    /// Adds a comparison at a state; error and bound are relative to the same magnitude.
    pub(crate) fn note(&mut self, place: usize, figure: f64, bound: f64) {
        if !self.compared || figure.is_nan() || figure > self.figure {
            self.figure = figure;
            self.place = Some(place);
        }
        self.compared = true;
        if bound > self.bound {
            self.bound = bound;
        }
        self.missed |= !within(figure, bound);
    }

    /// The result as a check; `NotApplicable` if nothing was compared.
    pub(crate) fn check(self, what: Statement) -> Check {
        if !self.compared {
            return Check::not_applicable(what, "none");
        }
        let mut check = Check::of(what, self.figure, self.bound);
        if self.missed {
            check.verdict = Verdict::Failed;
        }
        check.place = self.place;
        check
    }
}

/// The largest error of each identity, in the order in which identities first appear.
#[derive(Default)]
pub(crate) struct Identities {
    worst: Vec<(Statement, Worst)>,
}

impl Identities {
    /// Adds a comparison at a state.
    pub(crate) fn note(&mut self, place: usize, statement: &'static str, figure: f64, bound: f64) {
        let known = self
            .worst
            .iter_mut()
            .find(|(what, _)| what.statement == statement);
        if let Some((_, worst)) = known {
            worst.note(place, figure, bound);
            return;
        }
        let mut worst = Worst::default();
        worst.note(place, figure, bound);
        self.worst.push((Statement::identity(statement), worst));
    }

    /// One check for each identity.
    pub(crate) fn checks(self) -> Vec<Check> {
        let all = self.worst.into_iter();
        all.map(|(what, worst)| worst.check(what)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHAT: Statement = Statement::identity("a = b");

    #[test]
    fn errors_and_bounds_that_are_not_finite_fail() {
        assert_eq!(Check::of(WHAT, 1e-16, 1e-15).verdict, Verdict::Passed);
        for (figure, bound) in [
            (1e-14, 1e-15),
            (f64::NAN, 1.0),
            (0.0, f64::NAN),
            (0.0, f64::INFINITY),
        ] {
            assert!(Check::of(WHAT, figure, bound).fails());
            let mut worst = Worst::default();
            worst.note(0, 0.0, 1.0);
            worst.note(1, figure, bound);
            worst.note(2, 0.0, 1.0);
            assert!(worst.check(WHAT).fails(), "{figure} {bound}");
        }
    }

    /// An error beyond its own bound fails, even if the bound at another state is wider.
    #[test]
    fn each_figure_is_held_against_its_own_bound() {
        let mut worst = Worst::default();
        worst.note(0, 1e-3, 1.0);
        worst.note(1, 1e-6, 1e-9);
        assert!(worst.check(WHAT).fails());
    }

    #[test]
    fn the_worst_state_is_named() {
        let mut worst = Worst::default();
        worst.note(0, 0.0, 1.0);
        assert_eq!(worst.check(WHAT).place, Some(0));
        for (place, figure) in [(1, 1e-3), (2, f64::NAN), (3, 2.0)] {
            worst.note(place, figure, 1.0);
        }
        let check = worst.check(WHAT);
        assert_eq!((check.place, check.worst.is_nan()), (Some(2), true));
        assert_eq!(Worst::default().check(WHAT).verdict, Verdict::NotApplicable);
    }

    #[test]
    fn identities_keep_the_order_in_which_they_appear() {
        let mut all = Identities::default();
        for (place, statement, figure) in [(0, "b", 1.0), (0, "a", 0.0), (1, "b", 3.0)] {
            all.note(place, statement, figure, 2.0);
        }
        let checks = all.checks();
        let shown: Vec<_> = checks
            .iter()
            .map(|c| (c.what.statement, c.fails(), c.place))
            .collect();
        assert_eq!(shown, [("b", true, Some(1)), ("a", false, Some(0))]);
    }
}
