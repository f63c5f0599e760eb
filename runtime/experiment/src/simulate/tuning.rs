//! Automatic tuning of the controllers of a simulated robot: gains from its inertia, and constant
//! efforts that balance gravity.

use nalgebra::{DMatrix, DVector};
use regen_runtime::{ClosureError, Info, LoopClosure, Model, Outcome, SizeError};

use super::Pid;

/// Given gains of the controller of one joint, or of all joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Gains {
    /// The name of the actuated joint; `None` for all.
    pub name: Option<String>,
    /// kp, ki and kd, in the units of [`Pid`].
    pub values: [f64; 3],
}

impl Gains {
    /// Whether these are the gains of the controllers of all actuated joints.
    ///
    /// ```
    /// use regen_experiment::simulate::Gains;
    /// use regen_runtime::Info;
    ///
    /// let info = Info { coordinates: &["q1", "q2"], actuated: &[0, 1], ..Info::EMPTY };
    /// let of = |name: Option<&str>| Gains { name: name.map(str::to_owned), values: [9.0, 0.0, 1.0] };
    /// assert!(Gains::are_of_all(&[of(None)], &info));
    /// assert!(Gains::are_of_all(&[of(Some("q2")), of(Some("q1"))], &info));
    /// assert!(!Gains::are_of_all(&[of(Some("q2"))], &info));
    /// ```
    pub fn are_of_all(given: &[Self], info: &Info<'_>) -> bool {
        let names = info.actuated.iter();
        let mut names = names.map(|k| info.coordinates.get(*k).copied());
        let is_given = |name: Option<&str>| given.iter().any(|own| own.name.as_deref() == name);
        given.iter().any(|own| own.name.is_none()) || names.all(is_given)
    }
}

/// Why controllers cannot be tuned.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum TuningError {
    /// The start cannot be reached from home.
    Unreachable(Outcome),
    /// No efforts balance gravity at the start, with the reason.
    NoEfforts(&'static str),
    /// The mass matrix at the start is not positive definite: the parameters are not physically
    /// possible.
    NotPositiveDefinite,
    /// Gains are given for a joint that is not actuated.
    NotActuated {
        /// The given name.
        name: String,
        /// The names of the actuated joints.
        actuated: Vec<String>,
    },
    /// The loops of the model cannot be closed, or an argument does not fit the model.
    Model(ClosureError),
}

impl std::fmt::Display for TuningError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unreachable(why) => {
                write!(f, "the motion's start cannot be reached from home: {why}")
            }
            Self::NoEfforts(why) => write!(f, "no efforts hold the start: {why}"),
            Self::NotPositiveDefinite => f.write_str(
                "the mass matrix at the start is not positive definite: the parameters are not \
                 those of bodies",
            ),
            Self::NotActuated { name, actuated } => write!(
                f,
                "`{name}` is not an actuated joint; these are {}",
                actuated.join(", ")
            ),
            Self::Model(why) => write!(f, "{why}"),
        }
    }
}

impl std::error::Error for TuningError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Model(why) => Some(why),
            _ => None,
        }
    }
}

impl From<ClosureError> for TuningError {
    fn from(why: ClosureError) -> Self {
        Self::Model(why)
    }
}

impl From<SizeError> for TuningError {
    fn from(why: SizeError) -> Self {
        Self::Model(ClosureError::Size(why))
    }
}

/// One controller per actuated joint, and the constant effort to which its command is added.
#[derive(Clone, Debug, PartialEq)]
pub struct Control {
    /// The controllers, in the order of `Info::actuated`.
    pub pid: Vec<Pid>,
    /// The efforts that balance gravity at the start, N or N m, in the same order.
    pub offset: Vec<f64>,
    /// How many times slower than the bandwidth the slowest mode of the controlled robot is, at least 1: joints
    /// that act on each other differ in it, and states of the motion.
    pub spread: f64,
}

/// The derivative gain of a sampled controller at most, in inertias per time between samples; from 1.05 on it
/// does not damp.
const MOST_DAMPING: f64 = 0.5;

/// Tunes the controllers of all actuated joints to the states of a motion.
///
/// - `bandwidth`: of the controllers without given gains, Hz; with these at all joints, no mode of the
///   controlled robot is faster without damping, at any of the states.
/// - `period`: the time between samples of the controllers, s.
/// - `given`: gains that replace the tuned ones.
/// - `phi`: p, in `Info::parameters` order.
/// - `states`: the independent coordinates, dof, rad or m, of the start and of further states of the motion;
///   of these, states at which the loops cannot be closed are left out.
///
/// # Errors
/// When no efforts balance gravity at the start, the mass matrix is not positive definite, or gains
/// are given for a joint that is not actuated.
pub fn control<M: Model<f64> + ?Sized>(
    (bandwidth, period): (f64, f64),
    given: &[Gains],
    model: &M,
    phi: &[f64],
    states: &[Vec<f64>],
) -> Result<Control, TuningError> {
    let info = model.info();
    let dof = info.dof();
    let mut closure = LoopClosure::new(model)?;
    let (start, others) = states
        .split_first()
        .map_or((&[][..], &[][..]), |(start, others)| (start, others));
    let found = closure.solve(start)?;
    if !found.outcome.is_closed() {
        return Err(TuningError::Unreachable(found.outcome));
    }
    let q = &found.q;

    // the efforts of the actuated joints that balance gravity, of least norm
    let mut gravity = vec![0.0; dof];
    let _condition = model.gravity(q, phi, &mut gravity)?;
    let shares = shares_at(model, q)?;
    let offset = shares
        .clone()
        .svd(true, true)
        .solve(&DVector::from_vec(gravity), 1e-9)
        .map_err(TuningError::NoEfforts)?;

    let mut mobilities = vec![mobility_at(model, phi, q, &shares)?];
    for state in others {
        let found = closure.solve(state)?;
        if found.outcome.is_closed() {
            let shares = shares_at(model, &found.q)?;
            mobilities.push(mobility_at(model, phi, &found.q, &shares)?);
        }
    }
    let (own, spread) = inertias(&mobilities).ok_or(TuningError::NotPositiveDefinite)?;
    let w = std::f64::consts::TAU * bandwidth;
    // the damping of the slowest mode, as far as sampling damps the fastest one with it
    let damping = spread.min(MOST_DAMPING / (1.4 * w * period)).max(1.0);
    let mut pid: Vec<Pid> = own
        .iter()
        .map(|m| Pid {
            kp: m * w * w,
            // of the slowest mode too a seventh of what it is stable with
            ki: 0.2 * m * w * w * w * damping / (spread * spread),
            kd: 1.4 * m * w * damping,
            ..Pid::default()
        })
        .collect();
    for gains in given {
        let [kp, ki, kd] = gains.values;
        let mut known = gains.name.is_none();
        for (pid, joint) in pid.iter_mut().zip(info.actuated) {
            let name = info.coordinates.get(*joint).copied();
            if gains.name.is_none() || gains.name.as_deref() == name {
                *pid = Pid {
                    kp,
                    ki,
                    kd,
                    ..Pid::default()
                };
                known = true;
            }
        }
        if !known {
            let names = info.actuated.iter();
            let names = names.filter_map(|j| info.coordinates.get(*j));
            return Err(TuningError::NotActuated {
                name: gains.name.clone().unwrap_or_default(),
                actuated: names.map(|name| (*name).to_owned()).collect(),
            });
        }
    }
    Ok(Control {
        pid,
        offset: offset.iter().copied().collect(),
        spread,
    })
}

/// The generalised forces of unit efforts of the actuated joints at a closed state, as columns.
fn shares_at<M: Model<f64> + ?Sized>(model: &M, q: &[f64]) -> Result<DMatrix<f64>, TuningError> {
    let (dof, actuated) = (model.info().dof(), model.info().actuated.len());
    let mut shares = DMatrix::zeros(dof, actuated);
    let mut column = vec![0.0; dof];
    for k in 0..actuated {
        let mut unit = vec![0.0; actuated];
        unit[k] = 1.0;
        let _condition = model.generalized_forces(q, &unit, &mut column)?;
        shares.column_mut(k).copy_from_slice(&column);
    }
    Ok(shares)
}

/// The accelerations of the actuated joints under unit efforts of each of them, at a closed state.
fn mobility_at<M: Model<f64> + ?Sized>(
    model: &M,
    phi: &[f64],
    q: &[f64],
    shares: &DMatrix<f64>,
) -> Result<DMatrix<f64>, TuningError> {
    let dof = model.info().dof();
    let mut mass = vec![0.0; dof * dof];
    let _condition = model.mass_matrix(q, phi, &mut mass)?;
    let mass = DMatrix::from_vec(dof, dof, mass).cholesky();
    let inverse = mass.ok_or(TuningError::NotPositiveDefinite)?.inverse();
    Ok(shares.transpose() * inverse * shares)
}

/// The least effective inertia of each actuated joint, while the other ones are free, at states with these
/// mobilities. All are reduced by a common factor so that, with all controllers active at once, no mode is
/// faster at any of the states than the bandwidth for which they are tuned; also returned is how many times
/// slower the slowest mode is. `None` where an inertia is not positive.
fn inertias(mobilities: &[DMatrix<f64>]) -> Option<(Vec<f64>, f64)> {
    let joints = mobilities.first()?.nrows();
    let greatest = |k: usize| {
        let all = mobilities.iter().map(move |own| own[(k, k)]);
        all.fold(0.0, f64::max)
    };
    let own: Vec<f64> = (0..joints).map(|k| 1.0 / greatest(k)).collect();
    let roots = own.iter().map(|m| m.sqrt());
    let roots = DMatrix::from_diagonal(&DVector::from_iterator(joints, roots));
    let (mut fastest, mut slowest): (f64, f64) = (1.0, 1.0);
    for mobility in mobilities {
        let scaled = &roots * mobility * &roots;
        if scaled.iter().any(|x| !x.is_finite()) {
            return None;
        }
        let modes = scaled.symmetric_eigenvalues();
        fastest = fastest.max(modes.max());
        // further actuators than degrees of freedom move nothing
        let moving = modes.iter().filter(|mode| **mode > 1e-9 * modes.max());
        slowest = moving.fold(slowest, |least, mode| least.min(*mode));
    }
    let own: Vec<f64> = own.iter().map(|m| m / fastest).collect();
    let is_possible = own.iter().all(|m| m.is_finite() && *m > 0.0);
    is_possible.then(|| (own, (fastest / slowest).sqrt()))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    /// The mobility of a robot whose joints are its coordinates.
    fn of(mass: &DMatrix<f64>) -> DMatrix<f64> {
        mass.clone().try_inverse().unwrap()
    }

    #[test]
    fn masses_that_do_not_meet_are_felt_as_they_are() {
        let mass = DMatrix::from_diagonal(&DVector::from_vec(vec![2.0, 5.0]));
        let (own, spread) = inertias(&[of(&mass)]).unwrap();
        assert!((spread - 1.0).abs() < 1e-14);
        assert!((own[0] - 2.0).abs() < 1e-14 && (own[1] - 5.0).abs() < 1e-14);
    }

    #[test]
    fn no_mode_of_coupled_masses_is_faster_than_asked_at_any_state() {
        let there = DMatrix::from_row_slice(2, 2, &[2.0, 1.9, 1.9, 2.0]);
        let here = DMatrix::from_row_slice(2, 2, &[9.0, 0.1, 0.1, 0.3]);
        let (own, spread) = inertias(&[of(&here), of(&there)]).unwrap();
        let gains = DMatrix::from_diagonal(&DVector::from_vec(own));
        let squares = [here, there].map(|mass| (of(&mass) * &gains).complex_eigenvalues());
        let squares = squares
            .iter()
            .flat_map(|own| own.iter().map(|mode| mode.norm()));
        let squares: Vec<f64> = squares.collect();
        let most = squares.iter().fold(0.0, |most: f64, own| most.max(*own));
        let least = squares.iter().fold(most, |least, own| least.min(*own));
        // one mode is as fast as that, and one as slow as the spread says
        assert!((most - 1.0).abs() < 1e-12, "{squares:?}");
        assert!(
            (least.sqrt() * spread - 1.0).abs() < 1e-12,
            "{squares:?} {spread}"
        );
    }

    #[test]
    fn inertia_that_no_body_has_is_refused() {
        let mobility = DMatrix::from_row_slice(2, 2, &[f64::INFINITY, 0.0, 0.0, 1.0]);
        assert!(inertias(&[mobility]).is_none());
    }
}
