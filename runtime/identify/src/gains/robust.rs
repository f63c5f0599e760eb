//! Huber's estimate of parameters, gains and payloads: residuals are weighted in the units in which
//! the efforts were measured.

use super::problem::Problem;
use super::rows::{Rows, Sample};
use super::unknowns::Point;
use super::{GainError, Source};
use crate::data::DataError;
use crate::estimate::{Accumulator, FactorSet, Origin, Weighting, huber};
use regen_runtime::BaseModel;

/// The bound of Huber's loss, and what residuals are compared with.
#[derive(Clone)]
pub(super) struct Huber {
    /// The standard deviation of each effort's residuals: N m, N or A.
    sigmas: Vec<f64>,
    /// The bound in standard deviations.
    bound: f64,
}

impl Huber {
    /// The weight of an equation with this residual.
    pub(super) fn weight(&self, effort: usize, residual: f64) -> f64 {
        let sigma = self.sigmas.get(effort).copied().unwrap_or(1.0);
        huber::weight(residual, sigma, self.bound)
    }

    /// The standard deviations of the efforts' residuals: N m, N or A.
    pub(super) fn sigmas(&self) -> &[f64] {
        &self.sigmas
    }
}

/// Values from which Huber's weights are computed.
pub(super) struct Previous<'a> {
    /// All base parameters, SI.
    x: Vec<f64>,
    /// 1/k of each effort.
    inverse_gains: Vec<f64>,
    huber: &'a Huber,
}

impl Previous<'_> {
    fn residual(&self, sample: &Sample<'_>, effort: usize) -> f64 {
        let column = sample.w.iter().skip(effort).step_by(sample.measured.len());
        let fitted: f64 = column.zip(&self.x).map(|(w, x)| w * x).sum();
        (sample.measured[effort] - self.inverse_gains[effort] * fitted) * sample.weights[effort]
    }
}

/// Reduces the runs to a QR factor for each effort. With the values of a previous estimate the
/// equations have Huber's weights, and the second result is, for each effort, the sum of the squares
/// of the weight times the residual.
pub(super) fn reduce<M, S>(
    rows: &mut Rows<'_, M, S>,
    origin: &Origin,
    previous: Option<&Previous<'_>>,
) -> Result<(FactorSet, Vec<f64>), GainError>
where
    M: BaseModel<f64> + ?Sized,
    S: Source + ?Sized,
    S::Error: Into<DataError>,
{
    let mut all = Accumulator::new(origin);
    let mut psi_squares = vec![0.0; rows.efforts.len()];
    rows.visit(&mut |sample| {
        let count = sample.measured.len();
        for (effort, measured) in sample.measured.iter().enumerate() {
            let mut weight = sample.weights[effort];
            if weight == 0.0 {
                continue;
            }
            if let Some(previous) = previous {
                let residual = previous.residual(sample, effort);
                let own = previous.huber.weight(effort, residual);
                psi_squares[effort] += (own * residual).powi(2);
                // the cost of a row is the square of its factor
                weight *= own.sqrt();
            }
            all.push(effort, &sample.w[effort..], count, *measured, weight)?;
        }
        Ok(())
    })?;
    Ok((all.finish()?, psi_squares))
}

/// Huber's estimate.
pub(super) struct Robust {
    /// The QR factors of the equations with Huber's weights.
    pub(super) set: FactorSet,
    pub(super) point: Point,
    /// The weights of the efforts.
    pub(super) weights: Vec<f64>,
    pub(super) huber: Huber,
}

/// Finds Huber's estimate from that of least squares, by least squares with weights that follow from
/// the residuals of the estimate before.
///
/// - `start`: the least-squares estimate, how efforts are weighted, and Huber's bound.
pub(super) fn reweighted<M, S>(
    problem: &Problem<'_>,
    rows: &mut Rows<'_, M, S>,
    origin: &Origin,
    start: (Point, Weighting, f64),
) -> Result<Robust, GainError>
where
    M: BaseModel<f64> + ?Sized,
    S: Source + ?Sized,
    S::Error: Into<DataError>,
{
    let (mut point, weighting, bound) = start;
    let mut huber = Huber {
        sigmas: problem.sigmas(&point),
        bound,
    };
    for pass in 1.. {
        let efforts = 0..problem.unknowns.gains.len();
        let previous = Previous {
            x: problem.unknowns.base(&point),
            inverse_gains: efforts
                .map(|e| problem.unknowns.inverse_gain(e, &point))
                .collect(),
            huber: &huber,
        };
        let (set, psi_squares) = reduce(rows, origin, Some(&previous))?;
        let sigmas = huber::scales(
            &set,
            &psi_squares,
            &huber.sigmas,
            problem.unknowns.count(),
            bound,
        );
        let weights: Vec<f64> = match weighting {
            Weighting::Equal => vec![1.0; sigmas.len()],
            Weighting::PerEffort => sigmas.iter().map(|sigma| 1.0 / sigma).collect(),
        };
        huber.sigmas = sigmas;
        let own = Problem {
            set: &set,
            unknowns: problem.unknowns,
        };
        let (next, converged) = own.search(point.clone(), &weights)?;
        if !converged {
            return Err(GainError::NotConverged);
        }
        let change = own.deviations_between(&point, &next, &weights)?;
        point = next;
        if change < huber::TOLERANCE_DEVIATIONS || pass == huber::MAX_PASSES {
            return Ok(Robust {
                set,
                point,
                weights,
                huber,
            });
        }
    }
    Err(GainError::NotConverged)
}
