//! A check: what must hold, by how much it is missed at worst, what may be missed, and where.

/// What a check states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct What {
    /// As a statement, such as `A qd = 0`.
    pub statement: &'static str,
    /// A word for files.
    pub key: &'static str,
    /// A word over a column.
    pub heading: &'static str,
}

impl What {
    /// A statement that is its own key and heading.
    pub const fn identity(statement: &'static str) -> Self {
        Self {
            statement,
            key: statement,
            heading: statement,
        }
    }
}

/// What came of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The figure is within its bound.
    Holds,
    /// The figure is beyond its bound, or one of them is no finite number.
    Fails,
    /// There is nothing to check, as the note says.
    Absent,
    /// Double precision cannot decide.
    Open,
}

/// A check with its worst figure and its bound.
#[derive(Clone, Debug)]
pub struct Check {
    /// What must hold.
    pub what: What,
    /// What came of it.
    pub verdict: Verdict,
    /// By how much it is missed at worst; NaN where nothing could be computed.
    pub worst: f64,
    /// By how much it may be missed.
    pub bound: f64,
    /// The state with the worst figure, counted from 0; `None` for what is not about states.
    pub place: Option<usize>,
    /// Why there is no figure, or a word that goes with it.
    pub note: String,
}

impl Check {
    /// A check that has nothing to look at, and why.
    pub fn absent(what: What, why: &str) -> Self {
        Self {
            verdict: Verdict::Absent,
            note: why.to_owned(),
            ..Self::of(what, 0.0, 0.0)
        }
    }

    /// A figure beside its bound.
    pub fn of(what: What, worst: f64, bound: f64) -> Self {
        Self {
            what,
            verdict: if within(worst, bound) {
                Verdict::Holds
            } else {
                Verdict::Fails
            },
            worst,
            bound,
            place: None,
            note: String::new(),
        }
    }

    /// A statement that is true or not.
    pub fn truth(what: What, holds: bool) -> Self {
        Self::of(what, f64::from(u8::from(!holds)), 0.0)
    }

    /// The same with a note.
    #[must_use]
    pub fn with(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Whether it failed.
    pub fn fails(&self) -> bool {
        self.verdict == Verdict::Fails
    }
}

/// NaN is within no bound, and an infinite bound says nothing.
fn within(figure: f64, bound: f64) -> bool {
    figure <= bound && bound.is_finite()
}

/// The checks of one robot.
#[derive(Clone, Debug)]
pub struct Report {
    /// The robot's name.
    pub robot: String,
    /// Random closed states that the checks looked at.
    pub states: usize,
    /// In the order in which they were made.
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

/// The worst of many comparisons of one check: each figure is held against its own bound; the
/// largest figure and the largest bound are reported.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Worst {
    figure: f64,
    bound: f64,
    place: Option<usize>,
    missed: bool,
    compared: bool,
}

impl Worst {
    /// One comparison at a state, figure and bound relative to the same size.
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

    /// The check; absent where nothing was compared.
    pub(crate) fn check(self, what: What) -> Check {
        if !self.compared {
            return Check::absent(what, "none");
        }
        let mut check = Check::of(what, self.figure, self.bound);
        if self.missed {
            check.verdict = Verdict::Fails;
        }
        check.place = self.place;
        check
    }
}

/// The worst comparison of each identity, in the order in which identities first appear.
#[derive(Default)]
pub(crate) struct Identities {
    worst: Vec<(What, Worst)>,
}

impl Identities {
    /// One comparison at a state.
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
        self.worst.push((What::identity(statement), worst));
    }

    pub(crate) fn checks(self) -> Vec<Check> {
        let all = self.worst.into_iter();
        all.map(|(what, worst)| worst.check(what)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHAT: What = What::identity("a = b");

    #[test]
    fn what_is_no_number_or_has_no_bound_fails() {
        assert_eq!(Check::of(WHAT, 1e-16, 1e-15).verdict, Verdict::Holds);
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

    /// A figure beyond its own bound fails beside a wider bound elsewhere.
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
        assert_eq!(Worst::default().check(WHAT).verdict, Verdict::Absent);
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
