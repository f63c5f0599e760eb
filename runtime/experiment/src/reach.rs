//! Motions about home that need no trajectory file: the range of each coordinate.

use std::f64::consts::TAU;

use regen_runtime::{ClosureError, Info, LoopClosure, Model};

/// The number of steps from home to a limit.
const STEPS_TO_LIMIT: usize = 40;
/// The half range of a rotation without limits, rad.
const FREE_ROTATION: f64 = 1.0;
/// The half range of a translation without limits, relative to the mechanism's size.
const FREE_TRANSLATION: f64 = 0.25;

/// The range of each independent coordinate about home while the other ones stay at home: within it
/// the loops close on home's branch, and no limit that home itself fulfils is exceeded. Returns the
/// lowest and highest value of each, rad or m, in `Info::independent` order.
///
/// # Errors
/// When the model's home is not closed.
pub fn ranges<M: Model<f64> + ?Sized>(model: &M) -> Result<Vec<[f64; 2]>, ClosureError> {
    let info = model.info();
    let home: Vec<f64> = info.independent.iter().map(|c| info.home[*c]).collect();
    let size = size(model)?;
    let limits = LimitsFulfilledAtHome::new(model)?;
    let mut closure = LoopClosure::new(model)?;
    let mut ranges = Vec::with_capacity(home.len());
    for (k, coordinate) in info.independent.iter().enumerate() {
        let joint = info.joints.get(*coordinate);
        let free = joint.map_or(FREE_ROTATION, |j| {
            j.reach(FREE_ROTATION, FREE_TRANSLATION * size)
        });
        let limit = joint.and_then(|j| j.limits.position);
        let [lo, hi] = limit.unwrap_or([home[k] - free, home[k] + free]);
        let mut range = [home[k]; 2];
        for (end, reached) in [lo, hi].into_iter().zip(&mut range) {
            closure.restart();
            for part in 1..=STEPS_TO_LIMIT {
                let mut q = home.clone();
                q[k] += (end - home[k]) * part as f64 / STEPS_TO_LIMIT as f64;
                let state = closure.track(&q)?;
                if !state.outcome.is_closed() || !limits.allows(model, &state.q)? {
                    break;
                }
                *reached = q[k];
            }
        }
        ranges.push(range);
    }
    Ok(ranges)
}

/// The amplitudes (dof, rad or m) of a gentle periodic motion about home: independent coordinate k
/// follows a sine of k + 1 periods. Each amplitude starts at 0.4 of the distance from home to the
/// nearer end of its range; all are reduced together until every sampled state of the period closes
/// and is within the limits. They are 0 if that fails.
///
/// # Errors
/// When the model's home is not closed.
pub fn gentle<M: Model<f64> + ?Sized>(model: &M) -> Result<Vec<f64>, ClosureError> {
    let info = model.info();
    let home: Vec<f64> = info.independent.iter().map(|c| info.home[*c]).collect();
    let limits = LimitsFulfilledAtHome::new(model)?;
    let mut amplitudes: Vec<f64> = ranges(model)?
        .iter()
        .zip(&home)
        .map(|([lo, hi], home)| 0.4 * (hi - home).min(home - lo))
        .collect();
    let mut closure = LoopClosure::new(model)?;
    let samples = 40 * home.len().max(1);
    for _ in 0..20 {
        closure.restart();
        let mut allowed = true;
        for sample in 0..samples {
            let phase = sample as f64 / samples as f64;
            let q: Vec<f64> = (home.iter().zip(&amplitudes).enumerate())
                .map(|(k, (home, a))| home + a * libm::sin(TAU * (k + 1) as f64 * phase))
                .collect();
            let state = closure.track(&q)?;
            if !state.outcome.is_closed() || !limits.allows(model, &state.q)? {
                allowed = false;
                break;
            }
        }
        if allowed {
            return Ok(amplitudes);
        }
        for amplitude in &mut amplitudes {
            *amplitude *= 0.7;
        }
    }
    Ok(vec![0.0; home.len()])
}

/// The mechanism's size: the greatest distance at home between the origins of two bodies, or of a
/// body and the world, m; 1 where that is 0.
fn size<M: Model<f64> + ?Sized>(model: &M) -> Result<f64, ClosureError> {
    let info = model.info();
    let mut poses = vec![0.0; 12 * info.bodies.len()];
    model.poses(info.home, &mut poses)?;
    let (poses, _) = poses.as_chunks::<12>();
    let mut points = vec![[0.0; 3]];
    points.extend(poses.iter().map(|p| [p[9], p[10], p[11]]));
    let mut size: f64 = 0.0;
    for (i, a) in points.iter().enumerate() {
        for b in points.iter().skip(i + 1) {
            let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
            size = size.max(libm::sqrt(square));
        }
    }
    Ok(if size > 0.0 { size } else { 1.0 })
}

/// The limits that home fulfils; limits that home itself exceeds are not checked.
struct LimitsFulfilledAtHome {
    /// The limits of each coordinate, rad or m.
    positions: Vec<Option<[f64; 2]>>,
    /// The least cosine of each swing angle.
    cones: Vec<Option<f64>>,
}

impl LimitsFulfilledAtHome {
    fn new<M: Model<f64> + ?Sized>(model: &M) -> Result<Self, ClosureError> {
        let info = model.info();
        let cosines = cosines(model, &info, info.home)?;
        let inside = |limit: &[f64; 2], at: f64| (limit[0]..=limit[1]).contains(&at);
        let positions = info.joints.iter().zip(info.home);
        let cones = info.cones.iter().zip(cosines);
        Ok(Self {
            positions: positions
                .map(|(joint, at)| joint.limits.position.filter(|limit| inside(limit, *at)))
                .collect(),
            cones: cones
                .map(|(cone, at)| Some(libm::cos(cone.greatest)).filter(|least| at >= *least))
                .collect(),
        })
    }

    /// Whether all these limits hold at the closed state `q` (n).
    fn allows<M: Model<f64> + ?Sized>(&self, model: &M, q: &[f64]) -> Result<bool, ClosureError> {
        // rad or m, for the rounding errors of the last step to a limit
        const SLACK: f64 = 1e-9;
        let info = model.info();
        let positions = self.positions.iter().zip(q);
        let mut inside = positions
            .map(|(limit, at)| limit.is_none_or(|[lo, hi]| *at >= lo - SLACK && *at <= hi + SLACK));
        if !inside.all(|x| x) {
            return Ok(false);
        }
        let found = cosines(model, &info, q)?;
        let mut inside = self.cones.iter().zip(&found);
        Ok(inside.all(|(least, at)| least.is_none_or(|least| *at >= least)))
    }
}

/// The cosines of all swing angles at `q`.
fn cosines<M: Model<f64> + ?Sized>(
    model: &M,
    info: &Info<'_>,
    q: &[f64],
) -> Result<Vec<f64>, ClosureError> {
    let mut out = vec![0.0; info.cones.len()];
    model.cones(q, &mut out)?;
    Ok(out)
}
