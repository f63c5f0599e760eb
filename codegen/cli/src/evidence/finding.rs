//! What a check came to.

use serde::Serialize;

/// An independent check.
pub(crate) struct Check {
    /// In JSON.
    pub(crate) key: &'static str,
    /// Over a column.
    pub(crate) head: &'static str,
    /// In a sentence.
    pub(crate) title: &'static str,
}

/// All checks, in the order of the table.
pub(crate) const CHECKS: [Check; 9] = [
    Check {
        key: "second_derivation",
        head: "second",
        title: "regressor = Newton-Euler's, closed by singular values",
    },
    Check {
        key: "peer",
        head: "peer",
        title: "forces = those of another program (vectors)",
    },
    Check {
        key: "power",
        head: "power",
        title: "power of the forces = d/dt of the bodies' energy",
    },
    Check {
        key: "drift",
        head: "drift",
        title: "loops stay closed along a motion, to order 4",
    },
    Check {
        key: "rank",
        head: "rank",
        title: "base parameters, singular values and certificate agree",
    },
    Check {
        key: "span",
        head: "span",
        title: "angle between exact and numeric null space, rad",
    },
    Check {
        key: "gap",
        head: "gap",
        title: "certificate: largest number dropped, of the smallest kept",
    },
    Check {
        key: "way_back",
        head: "back",
        title: "to base parameters and back: same forces",
    },
    Check {
        key: "single_precision",
        head: "f32",
        title: "regressor in single precision",
    },
];

/// What came of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Verdict {
    /// The figure is within its bound.
    Holds,
    /// It is not.
    Fails,
    /// There is nothing to check, as `word` says.
    Absent,
    /// Double precision cannot tell.
    Open,
}

/// A check's figure and bound.
#[derive(Clone, Debug)]
pub(crate) struct Finding {
    pub(crate) verdict: Verdict,
    /// What is missed at worst; NaN where nothing could be computed.
    pub(crate) figure: f64,
    /// What may be missed at most.
    pub(crate) bound: f64,
    /// Why there is no figure, or a count that goes with it.
    pub(crate) word: String,
}

impl Finding {
    /// Nothing to check.
    pub(crate) fn absent(word: &str) -> Self {
        Self {
            verdict: Verdict::Absent,
            figure: 0.0,
            bound: 0.0,
            word: word.to_owned(),
        }
    }

    /// A figure beside its bound.
    pub(crate) fn of(figure: f64, bound: f64) -> Self {
        Self {
            // NaN fails, and so does an infinite bound: it says nothing
            verdict: if figure <= bound && bound.is_finite() {
                Verdict::Holds
            } else {
                Verdict::Fails
            },
            figure,
            bound,
            word: String::new(),
        }
    }

    /// A count beside the check.
    pub(crate) fn with(mut self, word: impl Into<String>) -> Self {
        self.word = word.into();
        self
    }
}

/// Figures over many comparisons: the one nearest to its bound decides, the largest are shown.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Worst {
    figure: f64,
    bound: f64,
    missed: bool,
    seen: bool,
}

impl Worst {
    /// One comparison, both relative to the same size.
    pub(crate) fn note(&mut self, figure: f64, bound: f64) {
        self.seen = true;
        if figure.is_nan() || figure > self.figure {
            self.figure = figure;
        }
        if bound > self.bound {
            self.bound = bound;
        }
        // NaN is beyond any bound
        let within = figure <= bound;
        self.missed |= !within || !bound.is_finite();
    }

    pub(crate) fn finding(self) -> Finding {
        if !self.seen {
            return Finding::absent("none");
        }
        let mut found = Finding::of(self.figure, self.bound);
        if self.missed {
            found.verdict = Verdict::Fails;
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_number_or_has_no_bound_fails() {
        assert_eq!(Finding::of(1e-16, 1e-15).verdict, Verdict::Holds);
        for (figure, bound) in [
            (1e-14, 1e-15),
            (f64::NAN, 1.0),
            (0.0, f64::NAN),
            (0.0, f64::INFINITY),
        ] {
            assert_eq!(Finding::of(figure, bound).verdict, Verdict::Fails);
            let mut worst = Worst::default();
            worst.note(0.0, 1.0);
            worst.note(figure, bound);
            worst.note(0.0, 1.0);
            assert_eq!(worst.finding().verdict, Verdict::Fails, "{figure} {bound}");
        }
    }

    /// A figure beyond its own bound fails beside a wider bound elsewhere.
    #[test]
    fn each_figure_is_held_against_its_own_bound() {
        let mut worst = Worst::default();
        worst.note(1e-3, 1.0);
        worst.note(1e-6, 1e-9);
        assert_eq!(worst.finding().verdict, Verdict::Fails);
    }
}
