//! Estimates the delays of efforts a second time, from slower motion or away from reversals of friction.

use regen_runtime::BaseModel;

use super::delay::{DelayFit, Delays};
use super::replay::Replay;
use crate::estimate::{Estimate, EstimateError};
use crate::signals::Smoothing;
use crate::states::Filtering;
use crate::states::Source;
use crate::states::StateSample;

/// The half width of the regression that smooths equations without a filter, in samples: it leaves
/// about the lower quarter of their frequencies.
const HALF_WIDTH_SAMPLES: f64 = 8.0;

/// A log with another filter of its equations.
struct Refiltered<'a, S: ?Sized> {
    source: &'a mut S,
    filtering: Filtering,
}

impl<S: Source + ?Sized> Source for Refiltered<'_, S> {
    type Error = S::Error;

    fn visit(
        &mut self,
        each: &mut dyn FnMut(&StateSample<'_>) -> Result<(), EstimateError>,
    ) -> Result<(), S::Error> {
        self.source.visit(each)
    }

    fn filtering(&self) -> Filtering {
        self.filtering
    }
}

/// The equations from which delays are estimated a second time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum OtherEquations {
    /// Those that pass a filter with half the cutoff of the log's filter. Both sides pass it and stay equal, so that
    /// it changes a delay only by its error. Noise of positions that a controller answers is in the efforts and,
    /// differentiated three times, in their rates: what it adds to a delay falls with a high power of the cutoff.
    Slower,
    /// Those beside none that is left out, where friction may change its sign: when it does is not known to a
    /// fraction of a sample.
    AwayFromReversals,
}

/// The delays of the efforts behind the motion, from other equations; `None` where the filter does not suit the log,
/// or too little of it is left.
///
/// - `solved`: the estimate, and the names and weights of the efforts;
/// - `bandwidth`: the number of samples in which the residuals of the log's own filter are correlated;
/// - `step`: the time between samples, s.
pub(super) fn delays_of<M: BaseModel<f64> + ?Sized, S: Source + ?Sized>(
    which: OtherEquations,
    replay: &mut Replay<'_, M, S>,
    (estimate, names, weights): (&Estimate, &[String], &[f64]),
    bandwidth: usize,
    step: f64,
) -> Option<Delays> {
    let (model, kind) = (replay.model(), replay.kind());
    let static_friction = replay.static_friction().to_vec();
    let (source, columns) = replay.source_and_columns();
    let own = source.filtering();
    let (filtering, times) = match which {
        OtherEquations::Slower => (slower(own, step), 2),
        OtherEquations::AwayFromReversals => (own, 1),
    };
    let mut other = Refiltered { source, filtering };
    let mut replay = Replay::with_columns(model, kind, &mut other, Box::new(columns)).shared(2);
    let mut fit = DelayFit::new(&estimate.labels, &estimate.values, names, weights);
    if which == OtherEquations::AwayFromReversals {
        replay.set_static_friction(static_friction);
        fit = fit.away_from_reversals();
    }
    replay.visit(&mut |equations| fit.push(equations)).ok()?;
    let mut scores = fit.finish(times * bandwidth).ok()??;
    replay.visit(&mut |equations| scores.push(equations)).ok()?;
    let delays = scores.finish();
    (!delays.efforts.is_empty()).then_some(delays)
}

/// The filter that leaves the slower half of the motion.
///
/// - `step`: the time between samples, s.
fn slower(filtering: Filtering, step: f64) -> Filtering {
    let smoothing = match filtering.smoothing {
        Smoothing::Butterworth { order, cutoff } => Smoothing::Butterworth {
            order,
            cutoff: 0.5 * cutoff,
        },
        Smoothing::Local { half_width } => Smoothing::Local {
            half_width: 2.0 * half_width,
        },
        Smoothing::None => Smoothing::Local {
            half_width: HALF_WIDTH_SAMPLES * step,
        },
    };
    Filtering {
        smoothing,
        decimation: if filtering.smoothing.is_none() {
            // the log passes only every so many samples already
            1
        } else {
            filtering.decimation
        },
        ..filtering
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::states::Standstill;

    #[test]
    fn half_of_the_motion_passes_the_slower_filter() {
        let of = |smoothing: Smoothing| {
            let filtering = Filtering {
                smoothing,
                decimation: 7,
                standstill: Standstill::Drop,
            };
            let found = slower(filtering, 0.01);
            (found.smoothing, found.decimation)
        };
        let butterworth = |cutoff: f64| Smoothing::Butterworth { order: 4, cutoff };
        let local = |half_width: f64| Smoothing::Local { half_width };
        assert_eq!(of(butterworth(20.0)), (butterworth(10.0), 7));
        assert_eq!(of(local(0.03)), (local(0.06), 7));
        // of equations that are not filtered all are used
        assert_eq!(of(Smoothing::None), (local(0.08), 1));
    }
}
