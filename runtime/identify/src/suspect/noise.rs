//! Efforts that are mostly noise: of them no model explains more.

use regen_runtime::{BaseModel, Info};

use super::facts::needed_by_bodies;
use crate::data::{DataError, Logs};
use crate::estimate::EffortError;

/// What is left of an effort is noise if it is at most so many times the noise at high frequencies.
const MAX_NOISE_RATIO: f64 = 1.5;
/// Nominal bodies that need less than so many times what is explained of an effort do not contradict it.
const MAX_NEEDED: f64 = 3.0;
/// Of noise, this part is explained by chance.
const EXPLAINED_BY_CHANCE: f64 = 0.1;

/// The errors of efforts, those of mostly noise apart.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct NoiseAlone {
    /// The efforts that are mostly noise though the nominal bodies need more of them, or are not known.
    pub doubted: Vec<EffortError>,
    /// The efforts that are mostly noise, of which the nominal bodies need no more.
    pub expected: Vec<EffortError>,
    /// All other efforts.
    pub rest: Vec<EffortError>,
}

/// Finds the efforts that a fit does not explain as they are mostly noise.
///
/// # Errors
/// When a log cannot be read.
pub fn noise_alone<M: BaseModel<f64> + ?Sized>(
    model: &M,
    logs: &Logs<'_, M>,
    errors: Vec<EffortError>,
) -> Result<NoiseAlone, DataError> {
    if errors.iter().all(EffortError::is_explained) {
        return Ok(NoiseAlone {
            rest: errors,
            ..NoiseAlone::default()
        });
    }
    let needed = || needed_by_bodies(model, &logs.sample(0).ok()?);
    Ok(divided(
        &model.info(),
        errors,
        &logs.effort_noise()?,
        needed,
    ))
}

/// - `noise`: the standard deviations of the noise of the efforts, in the order of `Info::actuated`;
/// - `needed`: those of the efforts that the nominal bodies need, in the order of `Info::independent`.
fn divided(
    info: &Info<'_>,
    errors: Vec<EffortError>,
    noise: &[f64],
    needed: impl FnOnce() -> Option<Vec<f64>>,
) -> NoiseAlone {
    let place = |list: &[usize], name: &str| {
        let named = |c: &usize| info.coordinates.get(*c) == Some(&name);
        list.iter().position(named)
    };
    let is_noise = |own: &EffortError| {
        let noise = place(info.actuated, &own.name).and_then(|k| noise.get(k));
        let is_left = own.relative_absolute.is_finite() && !own.is_explained();
        is_left && noise.is_some_and(|noise| own.rms <= MAX_NOISE_RATIO * noise)
    };
    let (noisy, rest): (Vec<_>, Vec<_>) = errors.into_iter().partition(is_noise);
    if noisy.is_empty() {
        return NoiseAlone {
            rest,
            ..NoiseAlone::default()
        };
    }
    let needed = needed();
    let is_expected = |own: &EffortError| {
        let place = place(info.independent, &own.name);
        let needed = place.and_then(|i| needed.as_ref()?.get(i).copied());
        let explained = own.explained().max(EXPLAINED_BY_CHANCE * own.rms);
        needed.is_some_and(|needed| needed < MAX_NEEDED * explained)
    };
    let (expected, doubted) = noisy.into_iter().partition(is_expected);
    NoiseAlone {
        doubted,
        expected,
        rest,
    }
}

#[cfg(test)]
mod tests {
    use super::super::swings_for_tests::swings;
    use super::*;
    use regen_runtime::Model;

    /// An effort of which 80 % are left, with residuals of this rms.
    fn left(name: &str, rms: f64) -> EffortError {
        EffortError {
            name: name.to_owned(),
            samples: 100,
            relative_absolute: 80.0,
            rms,
            relative_rms: 80.0,
            largest: 3.0 * rms,
            autocorrelation: Vec::new(),
            whiteness_p_value: 0.5,
        }
    }

    fn names(of: &[EffortError]) -> Vec<&str> {
        of.iter().map(|own| own.name.as_str()).collect()
    }

    #[test]
    fn noise_is_expected_where_the_nominal_bodies_need_no_more_than_is_explained() {
        let model = swings(true);
        // residuals of 0.8 are all but 0.6 of an effort of 1
        let errors = || vec![left("q1", 0.8), left("q2", 0.8), left("q3", 4.0)];
        let of = |needed: Option<Vec<f64>>| divided(&model.info(), errors(), &[0.7; 3], || needed);
        let found = of(Some(vec![0.5, 5.0, 0.5]));
        assert_eq!(names(&found.expected), ["q1"]);
        assert_eq!(names(&found.doubted), ["q2"]);
        // far above the noise, what is left has another cause
        assert_eq!(names(&found.rest), ["q3"]);
        let unknown = of(None);
        assert_eq!(names(&unknown.doubted), ["q1", "q2"]);
        assert!(unknown.expected.is_empty());
    }

    #[test]
    fn efforts_that_are_explained_or_constant_are_no_noise() {
        let model = swings(true);
        let explained = EffortError {
            relative_rms: 20.0,
            relative_absolute: 20.0,
            ..left("q1", 0.8)
        };
        let constant = EffortError {
            relative_absolute: f64::INFINITY,
            ..left("q2", 0.8)
        };
        let errors = vec![explained, constant];
        let found = divided(&model.info(), errors, &[0.7; 3], || None);
        assert_eq!(names(&found.rest), ["q1", "q2"]);
    }
}
