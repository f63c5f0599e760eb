//! Mistakes in measurements that poses show: each is tried, and told only where the nominal geometry
//! fits far better without it.

use core::fmt;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::closure::Split;
use crate::equations::{Pose, Problem};
use crate::fit::aligned;
use crate::kinematics::View;
use crate::placed::Placed;
use crate::sensor::{Kind, Sensor};

/// A change is told where it leaves this part of the misfit.
const BETTER: f64 = 0.25;
/// The number of poses with which changes are tried.
const POSES: usize = 24;
/// The numbers of poses after which a change is given up that leaves too much already.
const LOOKS: [usize; 2] = [5, 10];

/// A mistake that the measurements show.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Doubt {
    /// Rows that repeat others, with the rows that they repeat: each counts as a measurement of its
    /// own.
    Repeated(Vec<(u64, u64)>),
    /// The lengths of a sensor are this many times what the mechanism's size says.
    Scaled {
        /// The sensor's name.
        sensor: String,
        /// The power of ten.
        factor: f64,
    },
    /// The positions of a sensor fit its mirror image.
    Mirrored {
        /// The sensor's name.
        sensor: String,
    },
    /// The rotations of a sensor fit read in another way.
    Rotations {
        /// The sensor's name.
        sensor: String,
        /// The other way.
        way: OtherWay,
    },
    /// The readings of a coordinate fit with the other sign.
    Sign {
        /// The coordinate's name.
        coordinate: String,
    },
    /// The readings of two coordinates fit exchanged.
    Exchanged {
        /// Their names.
        coordinates: [String; 2],
    },
    /// The readings of angles fit as degrees.
    Degrees,
}

/// Another way to read a rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OtherWay {
    /// As its inverse: of the instrument in the frame.
    Inverse,
    /// As a quaternion whose scalar is the last of its numbers and not the first.
    ScalarLast,
    /// As a quaternion whose scalar is the first of its numbers and not the last.
    ScalarFirst,
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Repeated(rows) => {
                let shown: Vec<String> = rows
                    .iter()
                    .take(4)
                    .map(|(row, before)| format!("row {row} repeats row {before}"))
                    .collect();
                let more = rows.len().saturating_sub(4);
                let more = if more > 0 {
                    format!(", and {more} more")
                } else {
                    String::new()
                };
                write!(
                    f,
                    "{}{more}: a pose that is logged twice counts as two measurements; leave one out",
                    shown.join(", ")
                )
            }
            Self::Scaled { sensor, factor } => write!(
                f,
                "the positions of '{sensor}' are {factor} times as large as the mechanism's own: look at \
                 their `unit`, with which they fit far better"
            ),
            Self::Mirrored { sensor } => write!(
                f,
                "the positions of '{sensor}' fit their mirror image far better: two of its columns are \
                 exchanged, or one has the other sign"
            ),
            Self::Rotations { sensor, way } => write!(
                f,
                "the rotations of '{sensor}' fit far better {}",
                match way {
                    OtherWay::Inverse => "as their inverse: they are those of the instrument in the frame",
                    OtherWay::ScalarLast => "as `quaternion_xyzw`: their scalar is the last number",
                    OtherWay::ScalarFirst => "as `quaternion_wxyz`: their scalar is the first number",
                }
            ),
            Self::Sign { coordinate } => write!(
                f,
                "everything fits far better with the other sign of '{coordinate}': give it `factor: -1`"
            ),
            Self::Exchanged { coordinates: [a, b] } => write!(
                f,
                "everything fits far better with the columns of '{a}' and '{b}' exchanged"
            ),
            Self::Degrees => f.write_str(
                "everything fits far better with angles in degrees: give the coordinates `unit: deg`",
            ),
        }
    }
}

/// How far the measurements of a sensor are from what the nominal geometry predicts, wherever the
/// instrument is.
#[derive(Clone, Copy, Debug)]
struct Misfit {
    /// rms of the distances, m.
    length: f64,
    /// rms of the angles, rad; 0 without rotations.
    angle: f64,
}

impl Problem<'_> {
    /// The mistakes that measurements show, each tried with the nominal geometry.
    pub fn doubts(&self) -> Vec<Doubt> {
        let mut out = Vec::new();
        let repeated = self.repeated();
        if !repeated.is_empty() {
            out.push(Doubt::Repeated(repeated));
        }
        let Ok(start) = self.start() else {
            return out;
        };
        let step = self.poses.len().div_ceil(POSES).max(1);
        let poses: Vec<Pose> = self.poses.iter().step_by(step).cloned().collect();
        let instruments = self.sensors.iter().enumerate().filter(|(_, sensor)| {
            matches!(sensor.kind, Kind::Pose | Kind::Point) && sensor.mounting.unknown
        });
        let tried = Tried {
            problem: Problem {
                poses: &poses,
                ..*self
            },
            placed: Placed::new(self.kinematics, &start.scalars),
            split: &start.split,
            instruments: instruments.collect(),
        };
        if tried.instruments.is_empty() {
            return out;
        }
        let seen = tried.seen(&|_| {}, None);
        if let Some(seen) = &seen {
            let each = tried.instruments.iter().zip(seen);
            out.extend(each.filter_map(|((_, sensor), seen)| doubt_about(sensor, seen)));
        }
        // a sensor that is misread makes every comparison of readings meaningless
        let is_sound = out.iter().all(|doubt| matches!(doubt, Doubt::Repeated(_)));
        if is_sound {
            out.extend(tried.doubt_about_readings(seen.as_deref().and_then(total)));
        }
        out
    }

    /// Rows that repeat the readings and measurements of earlier ones.
    fn repeated(&self) -> Vec<(u64, u64)> {
        let mut out = Vec::new();
        for (k, pose) in self.poses.iter().enumerate() {
            let same = |own: &&Pose| own.readings == pose.readings && own.values == pose.values;
            if let Some(before) = self.poses[..k].iter().find(same) {
                out.push((pose.row, before.row));
            }
        }
        out
    }
}

/// Some of the poses, with the nominal geometry and the sensors whose instruments it places.
struct Tried<'a> {
    problem: Problem<'a>,
    placed: Placed<'a>,
    split: &'a Split,
    instruments: Vec<(usize, &'a Sensor)>,
}

impl Tried<'_> {
    /// What each instrument sees where the readings are changed; `None` where few poses are reached, or
    /// where the misfit is above a bound, which it often is with a few poses already.
    fn seen(&self, change: &dyn Fn(&mut [f64]), bound: Option<f64>) -> Option<Vec<Vec<Seen>>> {
        let poses = self.problem.poses;
        let mut out: Vec<Vec<Seen>> = vec![Vec::new(); self.instruments.len()];
        let (mut reached, mut lost) = (0, 0);
        for pose in poses {
            let mut readings = pose.readings.clone();
            change(&mut readings);
            let Some(frames) = self.frames(&readings) else {
                lost += 1;
                if 2 * lost > poses.len() {
                    return None;
                }
                continue;
            };
            reached += 1;
            for ((index, sensor), seen) in self.instruments.iter().zip(&mut out) {
                seen.extend(Seen::at(pose, &frames, *index, sensor));
            }
            if let Some(bound) = bound
                && LOOKS.contains(&reached)
            {
                let left = poses.len() - lost - reached;
                let least = out.iter().filter_map(|seen| {
                    // more poses add to the squares, wherever the instrument is then
                    let part = seen.len() as f64 / (seen.len() + left) as f64;
                    Some(misfit(seen, 1.0)?.length * libm::sqrt(part))
                });
                if least.sum::<f64>() > bound {
                    return None;
                }
            }
        }
        Some(out)
    }

    /// The frames with these readings and the nominal geometry.
    fn frames(&self, readings: &[f64]) -> Option<Vec<View>> {
        let driving = self.split.driving.iter();
        let target: Option<Vec<f64>> = driving
            .map(|c| {
                let at = self.problem.measured.iter().position(|own| own == c)?;
                readings.get(at).copied().filter(|r| r.is_finite())
            })
            .collect();
        let home = &self.problem.kinematics.home;
        let state = self.placed.reach(self.split, home, &target?)?;
        let mut state = self.placed.at(&state, None);
        Some(state.frames(|frame| self.problem.is_seen(frame)))
    }

    /// What is wrong with the readings, whose misfit is `plain` as they are.
    fn doubt_about_readings(&self, plain: Option<f64>) -> Option<Doubt> {
        let problem = &self.problem;
        let mut best: Option<(f64, Doubt)> = None;
        let mut offer = |change: &dyn Fn(&mut [f64]), doubt: Doubt| {
            let least = best.as_ref().map(|(least, _)| *least);
            let bound = plain.map(|plain| BETTER * plain);
            let bound = bound.into_iter().chain(least).reduce(f64::min);
            let found = self.seen(change, bound).as_deref().and_then(total);
            if let Some(found) = found
                && bound.is_none_or(|bound| found < bound)
            {
                best = Some((found, doubt));
            }
        };
        let name = |k: usize| problem.kinematics.coordinates[problem.measured[k]].clone();
        let count = problem.measured.len();
        for k in 0..count {
            let doubt = Doubt::Sign {
                coordinate: name(k),
            };
            offer(&|readings| readings[k] = -readings[k], doubt);
            for j in 0..k {
                let doubt = Doubt::Exchanged {
                    coordinates: [name(j), name(k)],
                };
                offer(&|readings| readings.swap(j, k), doubt);
            }
        }
        let degrees = |readings: &mut [f64]| {
            for (reading, c) in readings.iter_mut().zip(problem.measured) {
                if problem.turns(*c) {
                    *reading = reading.to_radians();
                }
            }
        };
        offer(&degrees, Doubt::Degrees);
        best.map(|(_, doubt)| doubt)
    }
}

/// What is wrong with the numbers of a sensor.
fn doubt_about(sensor: &Sensor, seen: &[Seen]) -> Option<Doubt> {
    if seen.len() < 4 {
        return None;
    }
    let name = || sensor.name.clone();
    let plain = misfit(seen, 1.0)?;
    // sizes first: a factor hides everything else
    let ratio = spread(seen, &|s| s.measured) / spread(seen, &|s| s.expected);
    if ratio.is_finite() && ratio > 0.0 {
        let factor = libm::pow(10.0, libm::round(libm::log10(ratio)));
        if !(0.5..2.0).contains(&factor)
            && misfit(seen, 1.0 / factor).is_some_and(|other| other.length < BETTER * plain.length)
        {
            return Some(Doubt::Scaled {
                sensor: name(),
                factor,
            });
        }
    }
    let mirrored: Vec<Seen> = seen
        .iter()
        .map(|s| Seen {
            measured: Vector3::new(-s.measured.x, s.measured.y, s.measured.z),
            turns: None,
            ..*s
        })
        .collect();
    let unturned: Vec<Seen> = seen.iter().map(|s| Seen { turns: None, ..*s }).collect();
    let [own, other] = [&unturned, &mirrored].map(|seen| misfit(seen, 1.0));
    if other?.length < BETTER * own?.length {
        return Some(Doubt::Mirrored { sensor: name() });
    }
    if sensor.kind == Kind::Pose {
        for way in [
            OtherWay::Inverse,
            OtherWay::ScalarLast,
            OtherWay::ScalarFirst,
        ] {
            let changed: Vec<Seen> = seen
                .iter()
                .map(|s| Seen {
                    turns: s.turns.map(|(a, b)| (a, way.read(&b))),
                    ..*s
                })
                .collect();
            if misfit(&changed, 1.0).is_some_and(|other| other.angle < BETTER * plain.angle) {
                return Some(Doubt::Rotations {
                    sensor: name(),
                    way,
                });
            }
        }
    }
    None
}

/// The sum of the misfits over instruments, m: angles count with the arm that the positions have.
fn total(seen: &[Vec<Seen>]) -> Option<f64> {
    let mut sum = 0.0;
    for seen in seen {
        let own = misfit(seen, 1.0)?;
        let arm = spread(seen, &|s| s.expected);
        sum += libm::hypot(own.length, arm * own.angle);
    }
    Some(sum)
}

/// What is expected and measured of a frame at a pose.
#[derive(Clone, Copy, Debug)]
struct Seen {
    expected: Vector3<f64>,
    measured: Vector3<f64>,
    /// Both rotations.
    turns: Option<(Matrix3<f64>, Matrix3<f64>)>,
}

/// The rms of the distances of points from their mean, m.
fn spread(seen: &[Seen], point: &dyn Fn(&Seen) -> Vector3<f64>) -> f64 {
    let count = seen.len().max(1) as f64;
    let mean = seen.iter().map(point).sum::<Vector3<f64>>() / count;
    let sum: f64 = seen.iter().map(|s| (point(s) - mean).norm_squared()).sum();
    libm::sqrt(sum / count)
}

impl Seen {
    /// What a sensor sees at a pose.
    fn at(pose: &Pose, frames: &[View], index: usize, sensor: &Sensor) -> Option<Self> {
        let values = pose.values.get(index)?.as_ref()?;
        let frame = frames.get(sensor.frame)?;
        let &[.., x, y, z] = &values[..] else {
            return None;
        };
        let turns =
            (values.len() == 12).then(|| (frame.axes, Matrix3::from_row_slice(&values[..9])));
        Some(Self {
            expected: frame.point,
            measured: Vector3::new(x, y, z),
            turns,
        })
    }
}

/// The misfit of what was seen, with the instrument where it fits best.
fn misfit(seen: &[Seen], scale: f64) -> Option<Misfit> {
    if seen.is_empty() {
        return None;
    }
    let points: Vec<(Vector3<f64>, Vector3<f64>)> = seen
        .iter()
        .map(|s| (s.expected, scale * s.measured))
        .collect();
    let placed = aligned(&points, &Matrix3::zeros())?;
    let count = seen.len() as f64;
    let sum: f64 = points
        .iter()
        .map(|(a, b)| (placed.axes.transpose() * (a - placed.point) - b).norm_squared())
        .sum();
    // rotations up to a constant one of the instrument, and one of what is fixed to the frame
    let turns: Vec<(Matrix3<f64>, Matrix3<f64>)> = seen.iter().filter_map(|s| s.turns).collect();
    let mut angle = 0.0;
    if !turns.is_empty() {
        let off: Vec<Matrix3<f64>> = turns
            .iter()
            .map(|(a, b)| a.transpose() * placed.axes * b)
            .collect();
        let sum: Matrix3<f64> = off.iter().sum();
        let svd = sum.svd(true, true);
        let mean = svd.u? * svd.v_t?;
        let squares: f64 = off
            .iter()
            .map(|own| {
                let rest = Rotation3::from_matrix_unchecked(mean.transpose() * own);
                rest.angle().powi(2)
            })
            .sum();
        angle = libm::sqrt(squares / turns.len() as f64);
    }
    Some(Misfit {
        length: libm::sqrt(sum / count),
        angle,
    })
}

impl OtherWay {
    fn read(self, rotation: &Matrix3<f64>) -> Matrix3<f64> {
        match self {
            Self::Inverse => rotation.transpose(),
            Self::ScalarLast | Self::ScalarFirst => {
                let own = Rotation3::from_matrix_unchecked(*rotation);
                let own = UnitQuaternion::from_rotation_matrix(&own);
                // the numbers in the order in which they were read as w, x, y, z or x, y, z, w
                let q = own.quaternion();
                let other = if self == Self::ScalarLast {
                    nalgebra::Quaternion::new(q.k, q.w, q.i, q.j)
                } else {
                    nalgebra::Quaternion::new(q.i, q.j, q.k, q.w)
                };
                let other = UnitQuaternion::from_quaternion(other);
                *other.to_rotation_matrix().matrix()
            }
        }
    }
}
