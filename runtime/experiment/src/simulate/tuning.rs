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
}

/// The bandwidth of controllers if none is given, Hz: slow enough that efforts tell of friction and of the
/// robot's own motion.
pub const USUAL_BANDWIDTH: f64 = 3.0;

/// Faster bandwidths, Hz, to try in turn for a controller with this sampling time, s, where a robot leaves
/// its motion with the usual one until its loops cannot be kept closed. They are at most an eighth of the
/// sampling rate; faster sampled controllers are often unstable.
///
/// ```
/// use regen_experiment::simulate::faster_bandwidths;
///
/// assert_eq!(faster_bandwidths(0.01), [6.0, 12.0]);
/// assert_eq!(faster_bandwidths(0.02), [6.0]);
/// assert!(faster_bandwidths(1.0).is_empty());
/// ```
pub fn faster_bandwidths(step: f64) -> Vec<f64> {
    let mut faster = vec![6.0, 12.0];
    faster.retain(|bandwidth| bandwidth * step <= 0.125);
    faster
}

/// Tunes the controllers of all actuated joints at the state `start`.
///
/// - `bandwidth`: of the controllers without given gains, Hz.
/// - `given`: gains that replace the tuned ones.
/// - `phi`: p, in `Info::parameters` order.
/// - `start`: the independent coordinates, dof, rad or m.
///
/// # Errors
/// When no efforts balance gravity at the start, the mass matrix is not positive definite, or gains
/// are given for a joint that is not actuated.
pub fn control<M: Model<f64> + ?Sized>(
    bandwidth: f64,
    given: &[Gains],
    model: &M,
    phi: &[f64],
    start: &[f64],
) -> Result<Control, TuningError> {
    let info = model.info();
    let (dof, actuated) = (info.dof(), info.actuated.len());
    let found = LoopClosure::new(model)?.solve(start)?;
    if !found.outcome.is_closed() {
        return Err(TuningError::Unreachable(found.outcome));
    }
    let q = &found.q;

    // the efforts of the actuated joints that balance gravity, of least norm
    let mut gravity = vec![0.0; dof];
    let _condition = model.gravity(q, phi, &mut gravity)?;
    let mut shares = DMatrix::zeros(dof, actuated);
    let mut unit = vec![0.0; actuated];
    let mut column = vec![0.0; dof];
    for k in 0..actuated {
        unit.fill(0.0);
        unit[k] = 1.0;
        let _condition = model.generalized_forces(q, &unit, &mut column)?;
        shares.column_mut(k).copy_from_slice(&column);
    }
    let offset = shares
        .clone()
        .svd(true, true)
        .solve(&DVector::from_vec(gravity), 1e-9)
        .map_err(TuningError::NoEfforts)?;

    let mut mass = vec![0.0; dof * dof];
    let _condition = model.mass_matrix(q, phi, &mut mass)?;
    let own = inertias(&DMatrix::from_vec(dof, dof, mass), &shares);
    let Some(own) = own else {
        return Err(TuningError::NotPositiveDefinite);
    };
    let w = std::f64::consts::TAU * bandwidth;
    let mut pid: Vec<Pid> = own
        .iter()
        .map(|m| Pid {
            kp: m * w * w,
            ki: 0.2 * m * w * w * w,
            kd: 1.4 * m * w,
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
    })
}

/// The effective inertia of each actuated joint while the other ones are free. All are reduced by a
/// common factor so that, with all controllers active at once, no mode is faster than the bandwidth
/// for which they are tuned. `None` where an inertia is not positive.
fn inertias(mass: &DMatrix<f64>, shares: &DMatrix<f64>) -> Option<Vec<f64>> {
    let inverse = mass.clone().cholesky()?.inverse();
    // the accelerations of the actuated joints under unit efforts of each of them
    let mobility = shares.transpose() * inverse * shares;
    let own: Vec<f64> = mobility.diagonal().iter().map(|m| 1.0 / m).collect();
    let roots = DVector::from_iterator(own.len(), own.iter().map(|m| m.sqrt()));
    let scaled = DMatrix::from_diagonal(&roots) * mobility * DMatrix::from_diagonal(&roots);
    let fastest = scaled
        .row_iter()
        .map(|row| row.iter().map(|x| x.abs()).sum::<f64>())
        .fold(1.0, f64::max);
    let own: Vec<f64> = own.iter().map(|m| m / fastest).collect();
    own.iter().all(|m| m.is_finite() && *m > 0.0).then_some(own)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn masses_that_do_not_meet_are_felt_as_they_are() {
        let mass = DMatrix::from_diagonal(&DVector::from_vec(vec![2.0, 5.0]));
        let own = inertias(&mass, &DMatrix::identity(2, 2)).unwrap();
        assert!((own[0] - 2.0).abs() < 1e-14 && (own[1] - 5.0).abs() < 1e-14);
    }

    #[test]
    fn no_mode_of_coupled_masses_is_faster_than_asked() {
        let mass = DMatrix::from_row_slice(2, 2, &[2.0, 1.9, 1.9, 2.0]);
        let own = inertias(&mass, &DMatrix::identity(2, 2)).unwrap();
        let gains = DMatrix::from_diagonal(&DVector::from_vec(own));
        let modes = (mass.try_inverse().unwrap() * gains).complex_eigenvalues();
        assert!(modes.iter().all(|m| m.norm() < 1.0 + 1e-12), "{modes}");
    }

    #[test]
    fn inertia_that_no_body_has_is_refused() {
        let mass = DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0]);
        assert!(inertias(&mass, &DMatrix::identity(2, 2)).is_none());
    }
}
