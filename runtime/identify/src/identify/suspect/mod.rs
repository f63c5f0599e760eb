//! What may be wrong with a log that was read without a fault: columns that are swapped, turned
//! round, shifted or in another unit, found effort by effort.
//!
//! One pass over a sample of the log's states makes a Gram matrix for each equation, of the base
//! regressor's columns beside every effort in the place of every other. Each hypothesis on the
//! efforts is then a small least-squares problem that reads nothing again. Hypotheses on the
//! positions take another pass each, over fewer states, and are tried only where efforts do not
//! explain what does not fit.

mod efforts;
mod facts;
mod grams;
mod judge;
mod positions;
mod words;

pub use facts::{NegativeParameter, Nominal, Shift};
pub use judge::{EffortChange, Remedy, Suspicion, suspicions};
pub use words::LogColumns;

use grams::{Fit, Grams};
use regen_runtime::BaseModel;

/// States of a log as they were measured, before the loops are closed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sample {
    /// The measured coordinates, as indices into `Info::coordinates`.
    pub measured: Vec<usize>,
    /// The states.
    pub states: Vec<Measured>,
    /// The usual step between rows of the log, s.
    pub step: f64,
    /// The states that a pass over the log has.
    pub whole: usize,
    /// Where positions were fitted by a Fourier series: the rms of what it leaves of each
    /// measured coordinate over the rms about its mean.
    pub left: Vec<f64>,
}

/// One state of a [`Sample`].
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Time, s.
    pub time: f64,
    /// Positions, velocities and accelerations of the measured coordinates, rad or m.
    pub motion: [Vec<f64>; 3],
    /// Efforts in the order of `Info::actuated`, N or N m.
    pub efforts: Vec<f64>,
}

/// Which column holds a quantity: that of another, times a factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// The one whose column it is: an index into `Info::actuated` for efforts, into the measured
    /// coordinates for positions.
    pub from: usize,
    /// What its entries are multiplied by.
    pub factor: f64,
}

impl Reading {
    /// Every quantity from its own column.
    fn plain(count: usize) -> Vec<Self> {
        let own = |from| Self { from, factor: 1.0 };
        (0..count).map(own).collect()
    }
}

/// A way to read the columns of a log with which it fits far better, or as well and without
/// nonsense.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// How each effort is read, in the order of `Info::actuated`.
    pub efforts: Vec<Reading>,
    /// How each measured coordinate is read.
    pub positions: Vec<Reading>,
    /// What is constant in each effort beside what the model says, N or N m; 0 where nothing is.
    pub offsets: Vec<f64>,
    /// The errors of the equations as the log is: the rms of the residuals over the rms of the
    /// efforts about their mean. Empty where the loops do not close.
    pub before: Vec<f64>,
    /// The same with the change.
    pub after: Vec<f64>,
    /// Whether the errors are alike, and friction or inertia is negative without the change.
    pub sign: bool,
}

/// What is said of a log.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Findings {
    /// The change of columns, if one explains what does not fit.
    pub change: Option<Change>,
    /// The efforts against those of the nominal bodies, for each equation where they can be
    /// compared; as they are read with the change.
    pub nominal: Vec<Nominal>,
    /// The errors of the equations as the log is, as in [`Change::before`].
    pub errors: Vec<f64>,
    /// The power that friction has in each coordinate's joint over the efforts' power there,
    /// where it is negative.
    pub driving: Vec<(usize, f64)>,
    /// Friction and rotors that are identified as negative, and matter; only where no change
    /// explains them.
    pub negative: Vec<NegativeParameter>,
    /// Efforts that look shifted by a constant, which friction of two directions took up; only
    /// where no change explains them.
    pub shifts: Vec<Shift>,
}

/// States that are enough for hypotheses on efforts.
pub const STATES: usize = 1000;
/// States that are enough for a hypothesis on positions.
const FEW: usize = 240;
/// Equations that a hypothesis on positions must have for each parameter.
const SPARE: usize = 3;
/// Errors that efforts alone do not explain: hypotheses on positions are tried.
const BAD: f64 = 0.25;
/// A change that halves the errors of each effort that it touches is no accident.
const HALF: f64 = 2.0;

/// An offset is told from this part of the rms of its effort on.
const SHIFTED: f64 = 0.05;
/// An error with which an effort is explained after a change.
const EXPLAINED: f64 = 0.5;

/// Looks for a change of columns with which a log fits far better.
///
/// - `own`: a factor for each effort that belongs to its joint and not to its column, such as a
///   torque constant: it stays where columns are exchanged. 1 where there is none.
/// - `estimate`: the base parameters identified from the whole log, with their deviations.
/// - `step`: is called with the number of hypotheses tried and of all.
pub fn look<M: BaseModel<f64> + ?Sized>(
    model: &M,
    sample: &Sample,
    own: &[f64],
    estimate: Option<(&[f64], &[f64])>,
    step: &mut dyn FnMut(usize, usize),
) -> Findings {
    let info = model.info();
    let plain = Reading::plain(sample.measured.len());
    let mut out = Findings::default();
    let every = sample.states.len().div_ceil(STATES).max(1);
    let grams = Grams::of(model, sample, &plain, every);
    let mut best: Option<Change> = None;
    let mut fits = None;
    if let Some(grams) = &grams {
        let start = Reading::plain(info.actuated.len());
        if let Some(now) = grams.fit(&start, &[]) {
            out.errors.clone_from(&now.errors);
            best = efforts::search(model, grams, own, &now);
            fits = Some(now);
        }
    }
    let worst = |errors: &[f64]| errors.iter().fold(0.0, |m: f64, e| m.max(*e));
    let open = grams.as_ref().is_none_or(|grams| !grams.closes()) || fits.is_none();
    let wrong = open || worst(&out.errors) > BAD || facts::absurd(model, sample);
    if wrong && let Some(found) = positions::search(model, sample, own, open, best.as_ref(), step) {
        best = Some(found);
    }
    if let (None, Some(grams), Some(now)) = (&best, &grams, &fits) {
        best = efforts::signs(model, grams, now);
    }
    let changed = best.as_ref().filter(|c| !c.positions.is_empty());
    let again = changed.and_then(|c| Grams::of(model, sample, &c.positions, every));
    let read = best.as_ref().map_or_else(
        || Reading::plain(info.actuated.len()),
        |c| c.efforts.clone(),
    );
    if let Some(grams) = again.as_ref().or(grams.as_ref()) {
        out.nominal = facts::nominal(model, grams, &read);
        if let Some(fit) = grams.fit(&read, &[]) {
            out.driving = facts::driving(model, grams, &fit);
        }
    }
    if let (None, Some(grams), Some(now), Some((values, sigmas))) = (&best, &grams, &fits, estimate)
    {
        out.negative = facts::negative(model, grams, now, values, sigmas);
        out.shifts = facts::shifts(model, grams, now, values, sigmas);
    }
    if let Some(change) = &mut best
        && change.positions.is_empty()
    {
        change.positions = plain;
    }
    out.change = best;
    out
}

/// The product of errors; what is below a percent is as good as a percent.
fn quality(errors: &[f64]) -> f64 {
    errors.iter().map(|e| e.max(0.01)).product()
}

/// How many coordinates have negative inertia at home or friction that drives.
fn nonsense<M: BaseModel<f64> + ?Sized>(model: &M, grams: &Grams, fit: &Fit) -> usize {
    let info = model.info();
    let dof = info.dof();
    let mut mass = vec![0.0; dof * dof];
    let beta = fit.values.get(..grams.columns()).unwrap_or_default();
    let light = match model.base_mass_matrix(info.home, beta, &mut mass) {
        Ok(_) => mass.iter().step_by(dof + 1).filter(|m| **m < 0.0).count(),
        Err(_) => 0,
    };
    light + facts::driving(model, grams, fit).len()
}
