//! Coordinates that are not measured and follow measured ones by constant factors: their reversals.

use nalgebra::DMatrix;

use crate::states::depends_on_direction;
use regen_runtime::{Model, SizeError};

/// Singular values below this part of the largest one count as 0; factors of couplings are far from it.
const RANK_TOLERANCE: f64 = 1e-9;

/// A coordinate with friction that depends on the direction, which is not measured and whose velocity
/// is a sum of measured ones: that of a joint behind a coupling or drive, or of the drive itself.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Unmeasured {
    /// The coordinate's index.
    pub(super) coordinate: usize,
    /// The factors of the measured velocities.
    factors: Vec<f64>,
}

impl Unmeasured {
    /// The coordinates of this kind; none of a model with cuts, where velocities depend on the
    /// positions, and none if the measured velocities do not determine the others.
    ///
    /// - `measured`: the indices of the measured coordinates.
    ///
    /// # Errors
    /// When a length does not fit the model.
    pub(super) fn all<M: Model<f64> + ?Sized>(
        model: &M,
        measured: &[usize],
    ) -> Result<Vec<Self>, SizeError> {
        let info = model.info();
        let (n, dof) = (info.coordinates.len(), info.dof());
        let sought: Vec<usize> = (0..n)
            .filter(|c| !measured.contains(c))
            .filter(|c| info.joints.get(*c).is_some_and(depends_on_direction))
            .collect();
        if sought.is_empty() || !info.cuts.is_empty() {
            return Ok(Vec::new());
        }
        let mut velocities = DMatrix::<f64>::zeros(n, dof);
        let (mut unit, mut qd) = (vec![0.0; dof], vec![0.0; n]);
        for i in 0..dof {
            unit.fill(0.0);
            unit[i] = 1.0;
            let _ = model.velocities(info.home, &unit, &mut qd)?;
            for (c, v) in qd.iter().enumerate() {
                velocities[(c, i)] = *v;
            }
        }
        let of_measured = velocities.select_rows(measured);
        let singular = of_measured.clone().svd(true, true);
        let largest = singular.singular_values.max();
        if singular.rank(RANK_TOLERANCE * largest) < dof {
            return Ok(Vec::new());
        }
        let Ok(back) = singular.pseudo_inverse(RANK_TOLERANCE * largest) else {
            return Ok(Vec::new());
        };
        let factors = velocities.select_rows(&sought) * back;
        let rows = sought.into_iter().enumerate();
        Ok(rows
            .map(|(row, coordinate)| Self {
                coordinate,
                factors: factors.row(row).iter().copied().collect(),
            })
            .collect())
    }

    /// The root of the sum of the squares of the measured coordinates' values, each times its factor:
    /// the standard deviation of independent errors.
    pub(super) fn combined(&self, of_measured: &[f64]) -> f64 {
        let parts = self.factors.iter().zip(of_measured);
        parts.map(|(f, x)| (f * x).powi(2)).sum::<f64>().sqrt()
    }

    /// The largest value of the measured coordinates that it follows.
    pub(super) fn largest(&self, of_measured: impl Iterator<Item = f64>) -> f64 {
        let own = self.factors.iter().zip(of_measured);
        let own = own.filter(|(f, _)| f.abs() > RANK_TOLERANCE);
        own.fold(0.0, |most: f64, (_, x)| most.max(x))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use regen_runtime::{Arguments, Condition, Friction, Function, Info, Joint};

    /// Two joints, and a drive with friction that turns by three times the first less the second.
    struct Drive;

    const WITH_FRICTION: Joint = Joint {
        friction: Friction::Coulomb,
        ..Joint::ROTATION
    };

    impl Model for Drive {
        fn info(&self) -> Info<'_> {
            Info {
                coordinates: &["q1", "q2", "motor"],
                independent: &[0, 1],
                dependent: &[2],
                actuated: &[0, 1],
                home: &[0.0; 3],
                joints: &[Joint::ROTATION, Joint::ROTATION, WITH_FRICTION],
                ..Info::EMPTY
            }
        }

        fn eval(
            &self,
            _: Function,
            x: Arguments<'_, f64>,
            out: &mut [f64],
        ) -> Result<Condition<f64>, SizeError> {
            out.copy_from_slice(&[x.qd_i[0], x.qd_i[1], 3.0 * x.qd_i[0] - x.qd_i[1]]);
            Ok(Condition::regular(0.0))
        }
    }

    #[test]
    fn a_drive_that_is_not_measured_follows_the_measured_joints() {
        let found = Unmeasured::all(&Drive, &[0, 1]).unwrap_or_default();
        assert_eq!(found.len(), 1);
        let own = &found[0];
        assert_eq!(own.coordinate, 2);
        assert!((own.combined(&[1.0, 0.0]) - 3.0).abs() < 1e-9);
        assert!((own.combined(&[1.0, 4.0]) - 5.0).abs() < 1e-9);
        assert!((own.largest([0.2, 0.7].into_iter()) - 0.7).abs() < 1e-12);
        // one joint alone does not tell the drive's motion
        assert_eq!(Unmeasured::all(&Drive, &[0]), Ok(Vec::new()));
        assert_eq!(Unmeasured::all(&Drive, &[0, 1, 2]), Ok(Vec::new()));
    }
}
