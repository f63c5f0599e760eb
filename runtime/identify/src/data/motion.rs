//! Position, velocity and acceleration of a measured coordinate over consecutive rows: measured,
//! from a series, or differentiated.

use super::logs::Log;
use super::stretch::Stretch;
use crate::signals::{Derivatives, Method, SignalError, differences};

/// The motion of all measured coordinates, each as by [`derivatives`].
///
/// # Errors
/// When the rows do not suit the method.
pub(super) fn all_derivatives(
    log: &Log,
    method: Method,
    rows: &Stretch,
) -> Result<Vec<Derivatives>, SignalError> {
    let layout = &log.file.layout;
    let mut others = layout.velocities.iter().chain(&layout.accelerations);
    let only_positions = others.all(Option::is_none) && log.series.is_none();
    if only_positions && method != Method::Central {
        let positions: Vec<&[f64]> = layout.positions().map(|entry| rows.column(entry)).collect();
        return method.differentiate_all(rows.times(), &positions);
    }
    let places = 0..layout.measured.len();
    places
        .map(|place| derivatives(log, method, place, rows))
        .collect()
}

/// The motion of the measured coordinate with index `place`.
///
/// Measured accelerations and velocities are used as they are. Where velocities alone are
/// measured, they pass the method's filter as the positions do, and accelerations are their first
/// derivative: a difference of velocities has less noise than a second difference of positions.
/// With a Fourier series all of the motion is the series'.
///
/// - `method`: how positions are differentiated, unless `log` has a series.
///
/// # Errors
/// When the rows do not suit the method.
pub(super) fn derivatives(
    log: &Log,
    method: Method,
    place: usize,
    rows: &Stretch,
) -> Result<Derivatives, SignalError> {
    let layout = &log.file.layout;
    let (times, column) = (rows.times(), |entry: usize| rows.column(entry));
    let positions = column(layout.positions().start + place);
    let velocity = layout.velocities.get(place).copied().flatten();
    let acceleration = layout.accelerations.get(place).copied().flatten();
    if let (Some(velocity), Some(acceleration)) = (velocity, acceleration) {
        return Ok(Derivatives {
            value: positions.to_vec(),
            rate: column(velocity).to_vec(),
            acceleration: column(acceleration).to_vec(),
            valid: 0..rows.len(),
        });
    }
    if let Some(series) = &log.series {
        let late = log.late().nth(layout.positions().start + place);
        let late = late.unwrap_or(0.0);
        let at = times.iter().map(|t| series.at(place, *t + late));
        let at: Vec<[f64; 3]> = at.collect();
        let [value, rate, acceleration] = [0, 1, 2].map(|d| at.iter().map(|p| p[d]).collect());
        return Ok(Derivatives {
            value,
            rate,
            acceleration,
            valid: 0..rows.len(),
        });
    }
    let differentiate = |values: &[f64], neighbours: usize| match method {
        Method::Central => differences(times, values, neighbours),
        _ => method.differentiate(times, values),
    };
    let neighbours = log.encoders.get(place).map_or(1, |e| e.neighbours);
    let mut found = differentiate(positions, neighbours)?;
    if let Some(velocity) = velocity {
        let noise = log.velocity_noise.get(place);
        let own = differentiate(column(velocity), noise.map_or(1, |e| e.neighbours))?;
        found.valid = found.valid.start.max(own.valid.start)..found.valid.end.min(own.valid.end);
        (found.rate, found.acceleration) = (own.value, own.rate);
    }
    if let Some(acceleration) = acceleration {
        found.acceleration = column(acceleration).to_vec();
    }
    Ok(found)
}
