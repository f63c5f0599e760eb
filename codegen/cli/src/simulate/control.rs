//! Controllers for a robot that nobody has tuned: gains from its inertia, efforts that hold it.

use nalgebra::{DMatrix, DVector};
use regen_experiment::simulate::Pid;
use regen_runtime::{Closure, Model};

use super::args::Gains;
use crate::exit::Failure;
use regen_interpreted::Interpreted;

/// One controller per actuated joint and the constant effort under each.
pub(crate) struct Control {
    pub(crate) pid: Vec<Pid>,
    pub(crate) offset: Vec<f64>,
}

/// Controllers for a start at these independent coordinates, of this bandwidth in Hz but for those
/// whose gains are given.
pub(crate) fn control(
    bandwidth: f64,
    given: &[Gains],
    model: &Interpreted<'_>,
    phi: &[f64],
    start: &[f64],
) -> Result<Control, Failure> {
    let info = model.info();
    let (dof, actuated) = (info.dof(), info.actuated.len());
    let found = Closure::new(model)?.solve(start)?;
    if !found.outcome.is_closed() {
        return Err(Failure::Numeric(format!(
            "the motion's start cannot be reached from home: {}",
            found.outcome
        )));
    }
    let q = &found.q;

    // gravity, carried by the actuated joints with the least squares of efforts
    let mut gravity = vec![0.0; dof];
    let _condition = model.gravity(q, phi, &mut gravity)?;
    let mut shares = DMatrix::zeros(dof, actuated);
    let mut unit = vec![0.0; actuated];
    let mut column = vec![0.0; dof];
    for k in 0..actuated {
        unit.fill(0.0);
        unit[k] = 1.0;
        let _condition = model.efforts(q, &unit, &mut column)?;
        shares.column_mut(k).copy_from_slice(&column);
    }
    let offset = shares
        .clone()
        .svd(true, true)
        .solve(&DVector::from_vec(gravity), 1e-9)
        .map_err(|why| Failure::Numeric(format!("no efforts hold the start: {why}")))?;

    let mut mass = vec![0.0; dof * dof];
    let _condition = model.mass_matrix(q, phi, &mut mass)?;
    let own = inertias(&DMatrix::from_vec(dof, dof, mass), &shares);
    let Some(own) = own else {
        return Err(Failure::Numeric(
            "the mass matrix at the start is not positive definite: the parameters are not those \
             of bodies; correct `bodies:` of the spec, or --parameters"
                .to_owned(),
        ));
    };
    let w = std::f64::consts::TAU * bandwidth;
    let mut pid: Vec<Pid> = own
        .iter()
        .map(|m| Pid {
            kp: m * w * w,
            ki: 0.2 * m * w * w * w,
            kd: 1.4 * m * w,
        })
        .collect();
    for gains in given {
        let [kp, ki, kd] = gains.values;
        let mut known = gains.name.is_none();
        for (pid, joint) in pid.iter_mut().zip(info.actuated) {
            let name = info.coordinates.get(*joint).copied();
            if gains.name.is_none() || gains.name.as_deref() == name {
                *pid = Pid { kp, ki, kd };
                known = true;
            }
        }
        if !known {
            let names = info.actuated.iter();
            let names: Vec<&str> = names
                .filter_map(|j| info.coordinates.get(*j).copied())
                .collect();
            return Err(Failure::Input(format!(
                "--pid: `{}` is no actuated joint; these are {}",
                gains.name.as_deref().unwrap_or(""),
                names.join(", ")
            )));
        }
    }
    Ok(Control {
        pid,
        offset: offset.iter().copied().collect(),
    })
}

/// The inertia that each actuated joint feels while the others are free, made smaller together
/// until controllers that are tuned for it are at most that fast all at once.
fn inertias(mass: &DMatrix<f64>, shares: &DMatrix<f64>) -> Option<Vec<f64>> {
    let inverse = mass.clone().cholesky()?.inverse();
    // rates of the actuated joints under unit efforts of each other
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
