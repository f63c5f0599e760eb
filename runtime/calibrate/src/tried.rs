//! Mistakes in measurements are found: each is tried, and told only where the nominal geometry fits far
//! better without it.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::closure::Split;
use crate::equations::{Group, Pose, Problem};
use crate::fit::{Fit, aligned};
use crate::kinematics::View;
use crate::placed::Placed;
use crate::sensor::{Convention, Kind, Sensor};
use crate::suspect::{Doubt, OtherWay};

/// A change is told where it leaves this part of the misfit.
const BETTER: f64 = 0.25;
/// The number of poses with which changes are tried.
const POSES: usize = 24;
/// The numbers of poses after which a change is given up that leaves too much already.
const LOOKS: [usize; 2] = [5, 10];
/// A fit that leaves more than this, rad or a part of the spread of positions or of a distance, is none.
const BAD: f64 = 0.02;
/// Zeros that controllers have, degrees from those of descriptions.
const ZEROS: [i32; 3] = [-90, 90, 180];

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
        let tried = Tried {
            problem: Problem {
                poses: &poses,
                ..*self
            },
            placed: Placed::new(self.kinematics, &start.scalars),
            split: &start.split,
        };
        let seen = tried.seen(&|_| {}, None);
        let plain = seen.as_ref().and_then(Sight::total);
        // angles in other units make sensors' sizes look wrong
        if let Some(units) = tried.other_units(plain) {
            out.push(units);
            return out;
        }
        if let Some(seen) = &seen {
            let each = self.sensors.iter().enumerate();
            out.extend(each.filter_map(|(k, sensor)| doubt_about(sensor, seen.of(k))));
        }
        // a sensor that is misread makes every comparison of readings meaningless
        let is_sound = out.iter().all(|doubt| matches!(doubt, Doubt::Repeated(_)));
        if is_sound {
            let late = plain.and_then(|plain| self.late(&tried, step, plain));
            out.extend(late.or_else(|| tried.doubt_about_readings(plain)));
        }
        out
    }

    /// Whether measurements fit the readings of a row beside theirs.
    fn late(&self, tried: &Tried<'_>, step: usize, plain: f64) -> Option<Doubt> {
        let mut best: Option<(f64, i32)> = None;
        for rows in [-1, 1] {
            let shifted = self.poses.iter().enumerate().filter_map(|(k, pose)| {
                let at = k.checked_add_signed(rows as isize)?;
                let readings = self.poses.get(at)?.readings.clone();
                Some(Pose {
                    readings,
                    ..pose.clone()
                })
            });
            let poses: Vec<Pose> = shifted.step_by(step).collect();
            let tried = Tried {
                problem: Problem {
                    poses: &poses,
                    ..tried.problem
                },
                placed: Placed::new(self.kinematics, tried.placed.scalars),
                split: tried.split,
            };
            let bound = best.map_or(BETTER * plain, |best| best.0);
            let seen = tried.seen(&|_| {}, Some(bound));
            if let Some(found) = seen.as_ref().and_then(Sight::total)
                && found < bound
            {
                best = Some((found, rows));
            }
        }
        best.map(|(_, rows)| Doubt::Late { rows })
    }

    /// What a fit leaves that no noise does.
    pub fn doubts_about(&self, fit: &Fit) -> Vec<Doubt> {
        let mut out = Vec::new();
        for group in &fit.groups {
            let (size, angles) = match group.group {
                Group::Angles(_) | Group::ReadAngles => (1.0, true),
                Group::Lengths(sensor) => {
                    let kind = self.sensors.get(sensor).map(|own| own.kind);
                    let values = self.poses.iter().filter_map(|pose| pose.values.get(sensor));
                    let points = values.flatten().map(|own| match own[..] {
                        [.., x, y, z] => Vector3::new(x, y, z),
                        _ => Vector3::new(own.first().copied().unwrap_or(0.0), 0.0, 0.0),
                    });
                    let points: Vec<Vector3<f64>> = points.collect();
                    // ball bars have one length, and what touches a plane none
                    let size = match kind {
                        Some(Kind::Distance) => points.iter().map(|own| own.x).fold(0.0, f64::max),
                        Some(Kind::Plane) | None => continue,
                        Some(_) => spread(&points),
                    };
                    (size, false)
                }
                Group::ReadLengths => continue,
            };
            let rest = group.after / size;
            if rest.is_finite() && rest > BAD {
                out.push(Doubt::Misfit { rest, angles });
            }
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

/// A change of the readings of a pose.
type Change<'c> = Box<dyn Fn(&mut [f64]) + 'c>;

/// Some of the poses, with the nominal geometry.
struct Tried<'a> {
    problem: Problem<'a>,
    placed: Placed<'a>,
    split: &'a Split,
}

/// What is expected and measured at poses.
#[derive(Clone, Debug, Default)]
struct Sight {
    /// The points and rotations of each sensor, wherever its instrument is; none of other kinds.
    points: Vec<Vec<Seen>>,
    /// Lengths and angles, each with the sensor; none for redundant readings.
    numbers: Vec<Number>,
}

/// A number that is expected and measured.
#[derive(Clone, Copy, Debug)]
struct Number {
    sensor: Option<usize>,
    expected: f64,
    measured: f64,
}

impl Sight {
    fn of(&self, sensor: usize) -> (&[Seen], Vec<Number>) {
        let numbers = self.numbers.iter();
        let numbers = numbers.filter(|own| own.sensor == Some(sensor)).copied();
        let points = self.points.get(sensor).map_or(&[][..], Vec::as_slice);
        (points, numbers.collect())
    }

    /// The sum of the misfits, m: angles count with the arm that positions have, else with 1 m.
    fn total(&self) -> Option<f64> {
        let mut sum = 0.0;
        for seen in self.points.iter().filter(|own| !own.is_empty()) {
            let own = misfit(seen, 1.0)?;
            let arm = spread(&seen.iter().map(|s| s.expected).collect::<Vec<_>>());
            sum += libm::hypot(own.length, arm * own.angle);
        }
        Some(sum + self.numbers_off(self.numbers.len() as f64))
    }

    /// The rms of what numbers are off, if there are so many in the end and others fit.
    fn numbers_off(&self, count: f64) -> f64 {
        let squares = self.numbers.iter();
        let squares = squares.map(|own| (own.expected - own.measured).powi(2));
        libm::sqrt(squares.sum::<f64>() / count.max(1.0))
    }

    /// The least that [`Self::total`] is with so many more poses, wherever instruments are then.
    fn least(&self, poses: usize, left: usize) -> f64 {
        let part = poses as f64 / (poses + left) as f64;
        let points = self.points.iter();
        let points = points.filter_map(|seen| Some(misfit(seen, 1.0)?.length * libm::sqrt(part)));
        let count = self.numbers.len() as f64 / part;
        points.sum::<f64>() + self.numbers_off(count)
    }
}

impl Tried<'_> {
    /// What is seen where the readings are changed; `None` where few poses are reached, or where the misfit is
    /// above a bound, which it often is with a few poses already.
    fn seen(&self, change: &dyn Fn(&mut [f64]), bound: Option<f64>) -> Option<Sight> {
        let problem = &self.problem;
        let mut out = Sight {
            points: vec![Vec::new(); problem.sensors.len()],
            numbers: Vec::new(),
        };
        let (mut reached, mut lost) = (0, 0);
        for pose in problem.poses {
            let mut readings = pose.readings.clone();
            change(&mut readings);
            let Some((state, frames)) = self.frames(&readings) else {
                lost += 1;
                if 2 * lost > problem.poses.len() {
                    return None;
                }
                continue;
            };
            reached += 1;
            for (index, sensor) in problem.sensors.iter().enumerate() {
                match sensor.kind {
                    Kind::Pose | Kind::Point => {
                        let seen = Seen::at(pose, &frames, index, sensor);
                        out.points[index].extend(seen);
                    }
                    _ => out.numbers.extend(self.number(pose, &frames, index)),
                }
            }
            for (c, reading) in problem.measured.iter().zip(&readings) {
                if self.split.driving.contains(c) || !reading.is_finite() {
                    continue;
                }
                let mut off = state[*c] - reading;
                if problem.turns(*c) {
                    off = libm::remainder(off, core::f64::consts::TAU);
                }
                out.numbers.push(Number {
                    sensor: None,
                    expected: off,
                    measured: 0.0,
                });
            }
            if let Some(bound) = bound
                && LOOKS.contains(&reached)
                && out.least(reached, problem.poses.len() - lost - reached) > bound
            {
                return None;
            }
        }
        Some(out)
    }

    /// A length, or the cosine of the angle from the expected direction of gravity to the measured one.
    fn number(&self, pose: &Pose, frames: &[View], index: usize) -> Option<Number> {
        let sensor = self.problem.sensors.get(index)?;
        let values = pose.values.get(index)?.as_ref()?;
        let expected = sensor.predict(frames, &self.problem.kinematics.gravity);
        let number = |expected, measured| Number {
            sensor: Some(index),
            expected,
            measured,
        };
        if sensor.kind != Kind::Gravity {
            return Some(number(*expected.first()?, *values.first()?));
        }
        let [a, b] = [&expected, values].map(|own| Vector3::from_iterator(own.iter().copied()));
        Some(number(1.0, a.dot(&b) / (a.norm() * b.norm())))
    }

    /// The state and the frames with these readings and the nominal geometry.
    fn frames(&self, readings: &[f64]) -> Option<(Vec<f64>, Vec<View>)> {
        let driving = self.split.driving.iter();
        let target: Option<Vec<f64>> = driving
            .map(|c| {
                let at = self.problem.measured.iter().position(|own| own == c)?;
                readings.get(at).copied().filter(|r| r.is_finite())
            })
            .collect();
        let home = &self.problem.kinematics.home;
        let q = self.placed.reach(self.split, home, &target?)?;
        let mut state = self.placed.at(&q, None);
        let frames = state.frames(|frame| self.problem.is_seen(frame));
        Some((q, frames))
    }

    /// The change of readings that leaves least of the misfit, if it leaves a small part of what there is
    /// without one.
    fn best<'c>(
        &self,
        plain: Option<f64>,
        changes: impl Iterator<Item = (Change<'c>, Doubt)>,
    ) -> Option<Doubt> {
        let mut best: Option<Doubt> = None;
        let mut bound = BETTER * plain.unwrap_or_else(|| self.size());
        for (change, doubt) in changes {
            let found = self.seen(&*change, Some(bound));
            if let Some(found) = found.as_ref().and_then(Sight::total)
                && found < bound
            {
                (best, bound) = (Some(doubt), found);
            }
        }
        best
    }

    /// What measured points vary by, which is a misfit where readings reach nothing; 1 without points.
    fn size(&self) -> f64 {
        let points = |sensor: usize| {
            let values = self
                .problem
                .poses
                .iter()
                .filter_map(|pose| pose.values.get(sensor));
            let points = values.flatten().filter_map(|own| match own[..] {
                [.., x, y, z] => Some(Vector3::new(x, y, z)),
                _ => None,
            });
            points.collect::<Vec<_>>()
        };
        let sensors = self.problem.sensors.iter().enumerate();
        let sensors = sensors.filter(|(_, own)| matches!(own.kind, Kind::Pose | Kind::Point));
        let largest = sensors.map(|(k, _)| spread(&points(k))).fold(0.0, f64::max);
        if largest > 0.0 { largest } else { 1.0 }
    }

    /// Whether the readings of angles have another unit.
    fn other_units(&self, plain: Option<f64>) -> Option<Doubt> {
        let scaled = |factor: f64| -> Change<'_> {
            Box::new(move |readings: &mut [f64]| {
                for (reading, c) in readings.iter_mut().zip(self.problem.measured) {
                    if self.problem.turns(*c) {
                        *reading *= factor;
                    }
                }
            })
        };
        let degree = 1_f64.to_radians();
        let changes = [
            (scaled(degree), Doubt::Degrees),
            (scaled(1.0 / degree), Doubt::Radians),
        ];
        let mut measured = self.problem.measured.iter();
        if measured.any(|c| self.problem.turns(*c)) {
            self.best(plain, changes.into_iter())
        } else {
            None
        }
    }

    /// What is wrong with the readings, whose misfit is `plain` as they are.
    fn doubt_about_readings(&self, plain: Option<f64>) -> Option<Doubt> {
        let problem = &self.problem;
        let name = |k: usize| problem.kinematics.coordinates[problem.measured[k]].clone();
        let mut changes: Vec<(Change<'_>, Doubt)> = Vec::new();
        for (k, c) in problem.measured.iter().enumerate() {
            let doubt = Doubt::Sign {
                coordinate: name(k),
            };
            changes.push((Box::new(move |readings| readings[k] = -readings[k]), doubt));
            for j in 0..k {
                let doubt = Doubt::Exchanged {
                    coordinates: [name(j), name(k)],
                };
                changes.push((Box::new(move |readings| readings.swap(j, k)), doubt));
            }
            for degrees in ZEROS.into_iter().filter(|_| problem.turns(*c)) {
                let doubt = Doubt::Turned {
                    coordinate: name(k),
                    degrees,
                };
                let angle = f64::from(degrees).to_radians();
                changes.push((Box::new(move |readings| readings[k] += angle), doubt));
            }
        }
        self.best(plain, changes.into_iter())
    }
}

/// The power of ten by which measured sizes are those that are expected, if it is not 1.
fn power_of_ten(measured: f64, expected: f64) -> Option<f64> {
    let ratio = measured / expected;
    if !(ratio.is_finite() && ratio > 0.0) {
        return None;
    }
    let factor = libm::pow(10.0, libm::round(libm::log10(ratio)));
    (!(0.5..2.0).contains(&factor)).then_some(factor)
}

/// What is wrong with the numbers of a sensor.
fn doubt_about(sensor: &Sensor, (seen, numbers): (&[Seen], Vec<Number>)) -> Option<Doubt> {
    let name = || sensor.name.clone();
    if !numbers.is_empty() {
        let mean = |of: &dyn Fn(&Number) -> f64| {
            numbers.iter().map(of).sum::<f64>() / numbers.len() as f64
        };
        if sensor.kind == Kind::Gravity {
            let is_up = mean(&|own| own.measured) < -0.5;
            return is_up.then(|| Doubt::Upward { sensor: name() });
        }
        let factor = power_of_ten(
            mean(&|own| own.measured.abs()),
            mean(&|own| own.expected.abs()),
        )?;
        let off =
            |scale: f64| libm::sqrt(mean(&|own| (own.measured / scale - own.expected).powi(2)));
        return (off(factor) < BETTER * off(1.0)).then(|| Doubt::Scaled {
            sensor: name(),
            factor,
        });
    }
    if seen.len() < 4 {
        return None;
    }
    let plain = misfit(seen, 1.0)?;
    // sizes first: a factor hides everything else
    let [measured, expected] = [
        seen.iter().map(|s| s.measured).collect::<Vec<_>>(),
        seen.iter().map(|s| s.expected).collect(),
    ];
    if let Some(factor) = power_of_ten(spread(&measured), spread(&expected))
        && misfit(seen, 1.0 / factor).is_some_and(|other| other.length < BETTER * plain.length)
    {
        return Some(Doubt::Scaled {
            sensor: name(),
            factor,
        });
    }
    let changed = |change: &dyn Fn(&Seen) -> Seen| seen.iter().map(change).collect::<Vec<_>>();
    let mirrored = changed(&|s| Seen {
        measured: Vector3::new(-s.measured.x, s.measured.y, s.measured.z),
        turns: None,
        ..*s
    });
    let unturned = changed(&|s| Seen { turns: None, ..*s });
    let [own, other] = [&unturned, &mirrored].map(|seen| misfit(seen, 1.0));
    if other?.length < BETTER * own?.length {
        return Some(Doubt::Mirrored { sensor: name() });
    }
    if sensor.kind != Kind::Pose {
        return None;
    }
    let mut best = (BETTER * plain.angle, None);
    let mut offer = |seen: &[Seen], doubt: &dyn Fn() -> Doubt| {
        if let Some(found) = misfit(seen, 1.0)
            && found.angle < best.0
        {
            best = (found.angle, Some(doubt()));
        }
    };
    for way in OtherWay::ALL {
        let seen = changed(&|s| Seen {
            turns: s.turns.map(|(a, b)| (a, way.read(&b))),
            ..*s
        });
        offer(&seen, &|| Doubt::Rotations {
            sensor: name(),
            way,
        });
    }
    for axes in right_handed() {
        let seen = changed(&|s| Seen {
            measured: axes * s.measured,
            ..*s
        });
        offer(&seen, &|| Doubt::Axes { sensor: name() });
    }
    best.1
}

/// The turns that lead coordinate axes to coordinate axes, but that which changes nothing.
fn right_handed() -> Vec<Matrix3<f64>> {
    let mut out = Vec::new();
    for order in [
        [0, 1, 2],
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
    ] {
        for signs in 0..8 {
            let sign = |row: usize| if signs >> row & 1 == 1 { -1.0 } else { 1.0 };
            let axes = Matrix3::from_fn(|i, j| if order[i] == j { sign(i) } else { 0.0 });
            if axes.determinant() > 0.0 && axes != Matrix3::identity() {
                out.push(axes);
            }
        }
    }
    out
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
fn spread(points: &[Vector3<f64>]) -> f64 {
    let count = points.len().max(1) as f64;
    let mean = points.iter().sum::<Vector3<f64>>() / count;
    let sum: f64 = points
        .iter()
        .map(|point| (point - mean).norm_squared())
        .sum();
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
            Self::YawFirst | Self::Moving => {
                let entries: [f64; 9] = core::array::from_fn(|k| rotation[(k / 3, k % 3)]);
                let numbers = Convention::Rpy.numbers(&entries);
                let &[r, p, y] = &numbers[..] else {
                    return *rotation;
                };
                if self == Self::YawFirst {
                    *Rotation3::from_euler_angles(y, p, r).matrix()
                } else {
                    // Rx(r) Ry(p) Rz(y) is the inverse of Rz(-y) Ry(-p) Rx(-r)
                    Rotation3::from_euler_angles(-r, -p, -y)
                        .matrix()
                        .transpose()
                }
            }
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
