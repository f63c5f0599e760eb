//! What is done with faulty rows, by the kind of their fault.

use super::problem::Fault;

/// The kinds of faults whose rows can still be used, because all entries are numbers and the rows
/// are in order of time.
pub(super) const USABLE_KINDS: [&str; 3] = ["outlier", SATURATION, "stuck encoder"];

/// The kind of the rows in which an effort is saturated.
pub(super) const SATURATION: &str = "saturation";

/// The kinds of faults that are treated as [`Gaps`] say.
pub(super) const GAP_KINDS: [&str; 2] = ["gap", "dropout"];

/// What to do with faulty rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Policy {
    /// Report all faults as an error, and compute nothing.
    #[default]
    Fail,
    /// Leave out the faulty rows; the log is divided into segments there. Of rows in which an effort is saturated
    /// only the equations are left out in which it acts.
    Drop,
    /// Use outliers, saturated efforts and positions of encoders that look stuck like any row;
    /// leave out rows that have no numbers or are not in order of time.
    Keep,
    /// As `Keep`, and report all faults.
    Tell,
}

impl Policy {
    /// Whether outliers, saturated efforts and positions of stuck encoders are used.
    ///
    /// ```
    /// use regen_identify::data::Policy;
    ///
    /// assert!(Policy::Keep.uses_doubtful_rows() && Policy::Tell.uses_doubtful_rows());
    /// assert!(!Policy::Fail.uses_doubtful_rows() && !Policy::Drop.uses_doubtful_rows());
    /// ```
    pub fn uses_doubtful_rows(self) -> bool {
        matches!(self, Self::Keep | Self::Tell)
    }
}

/// What to do with gaps and dropouts: places where rows are missing, and rows that repeat the one
/// before, as those of a late topic do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Gaps {
    /// Where they are shorter than the memory of the filter, interpolate the motion across them and
    /// leave the equations within out; divide the log into segments at longer ones.
    #[default]
    Bridge,
    /// Divide the log into segments at all of them.
    Drop,
    /// Report them as an error, and compute nothing.
    Fail,
    /// Use repeated rows like any row, and divide the log into segments where rows are missing.
    Keep,
}

/// What is done with doubtful rows; `None` where it is the same as with all other faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Checks {
    /// Rows in which a position is an outlier.
    pub outliers: Option<Policy>,
    /// Rows in which an effort is saturated.
    pub saturated: Option<Policy>,
    /// Rows in which an encoder looks stuck.
    pub stuck: Option<Policy>,
    /// Gaps and dropouts, which no other policy treats.
    pub gaps: Gaps,
}

/// What is done with each kind of fault.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Policies {
    /// What is done with all faults for which `checks` states nothing.
    pub all: Policy,
    /// What is done with doubtful rows.
    pub checks: Checks,
}

impl From<Policy> for Policies {
    fn from(all: Policy) -> Self {
        Self {
            all,
            checks: Checks::default(),
        }
    }
}

impl Policies {
    /// What is done with faults of a kind, see [`Fault::kind`].
    ///
    /// ```
    /// use regen_identify::data::{Checks, Policies, Policy};
    ///
    /// let checks = Checks { outliers: Some(Policy::Tell), ..Checks::default() };
    /// let policies = Policies { all: Policy::Drop, checks };
    /// assert_eq!(policies.of("outlier"), Policy::Tell);
    /// assert_eq!(policies.of("duplicate time"), Policy::Drop);
    /// // the log is divided at a gap that is too long to be bridged
    /// assert_eq!(Policies::default().of("gap"), Policy::Drop);
    /// ```
    pub fn of(&self, kind: &str) -> Policy {
        let [outlier, saturation, stuck] = USABLE_KINDS;
        let gaps = match self.checks.gaps {
            Gaps::Bridge | Gaps::Drop => Policy::Drop,
            Gaps::Fail => Policy::Fail,
            Gaps::Keep => Policy::Keep,
        };
        let own = match kind {
            _ if GAP_KINDS.contains(&kind) => Some(gaps),
            _ if kind == outlier => self.checks.outliers,
            _ if kind == saturation => self.checks.saturated,
            _ if kind == stuck => self.checks.stuck,
            _ => None,
        };
        own.unwrap_or(self.all)
    }

    pub(super) fn used_faults(self) -> UsedFaults {
        let [outliers, saturated, stuck] =
            USABLE_KINDS.map(|kind| self.of(kind).uses_doubtful_rows());
        UsedFaults {
            outliers,
            saturated,
            stuck,
            gaps: self.checks.gaps,
        }
    }
}

/// The kinds of doubtful rows that are used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct UsedFaults {
    pub(super) outliers: bool,
    pub(super) saturated: bool,
    pub(super) stuck: bool,
    /// What is done with gaps and dropouts.
    pub(super) gaps: Gaps,
}

impl UsedFaults {
    /// Whether a row with this fault is used.
    pub(super) fn uses(self, fault: &Fault) -> bool {
        match fault {
            Fault::Outlier { .. } => self.outliers,
            Fault::Saturated { .. } => self.saturated,
            Fault::Stuck { .. } => self.stuck,
            _ => false,
        }
    }
}
