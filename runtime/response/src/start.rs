//! The first states of windows, from measured positions.

use regen_identify::estimate::QrFactor;
use regen_identify::states::{Completed, Completion};
use regen_runtime::BaseModel;

use crate::ResponseError;
use crate::setup::{Run, Setup, SignalKind};

/// The span at the beginning of a window from which its first state is estimated, s.
const SPAN: f64 = 0.05;
/// The least and the greatest number of rows in it.
const ROWS: [usize; 2] = [6, 60];

/// Positions and velocities of the independent coordinates at the first of `rows`, from a cubic that
/// is fitted to the measured positions of the rows after it; `None` where the loops do not close
/// there.
pub(crate) fn state<M: BaseModel<f64> + ?Sized>(
    model: &M,
    setup: &Setup,
    run: &Run,
    rows: &core::ops::Range<usize>,
) -> Result<Option<Vec<f64>>, ResponseError> {
    let info = model.info();
    let measured: Vec<usize> = run.positions.iter().map(|(c, _)| *c).collect();
    let mut completion = Completion::new(model, &measured, &vec![1.0; measured.len()])?;
    let first = run.times[rows.start];
    let near = |row: &usize| run.times[*row] - first <= SPAN;
    let count = rows.clone().take_while(near).count();
    let count = count.clamp(ROWS[0], ROWS[1]).min(rows.len());
    let mut positions = Vec::with_capacity(measured.len());
    let mut velocities = Vec::with_capacity(measured.len());
    for (coordinate, values) in &run.positions {
        let model = setup.signal(SignalKind::Position(*coordinate));
        let (gain, bias) = (model.gain.value, model.bias.value);
        let labels = ["position", "velocity", "half", "sixth"].map(str::to_owned);
        let mut fit = QrFactor::new(labels[..4.min(count)].to_vec());
        let span = (run.times[rows.start + count - 1] - first).max(f64::MIN_POSITIVE);
        let mut w = Vec::new();
        for power in 0..4.min(count) {
            w.extend((0..count).map(|k| {
                let s = (run.times[rows.start + k] - first) / span;
                (0..power).fold(1.0, |x, _| x * s)
            }));
        }
        let side: Vec<f64> = (0..count)
            .map(|k| (values[rows.start + k] - bias) / gain)
            .collect();
        fit.push_block(&w, &side)?;
        let coefficients = crate::search::substitute(fit.r(), fit.z());
        positions.push(coefficients.first().copied().unwrap_or(0.0));
        velocities.push(coefficients.get(1).copied().unwrap_or(0.0) / span);
    }
    let still = vec![0.0; measured.len()];
    Ok(
        match completion.complete(&positions, &velocities, &still)? {
            Completed::State(state) => {
                let pick = |all: &[f64]| -> Vec<f64> {
                    info.independent.iter().map(|c| all[*c]).collect()
                };
                let mut out = pick(&state.q);
                out.extend(pick(&state.qd));
                Some(out)
            }
            _ => None,
        },
    )
}
