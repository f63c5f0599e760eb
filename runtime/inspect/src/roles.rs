//! Judges the role of each column from its name and from its relations to the others.

use regen_identify::data::{Assignment, Quantity};

use crate::columns::Surveyed;
use crate::names::{Meaning, Role, meaning};
use crate::relations::{Derivative, Relations};

/// Columns without names are taken for positions and efforts if the typical relative noise of the
/// positions is at most this part of that of the efforts.
const MAX_NOISE_RATIO: f64 = 0.2;
/// The least correlation at which a column counts as the derivative of another.
const MIN_CORRELATION: f64 = 0.98;

/// The factors between a column and the integral of its derivative if both have the same unit of
/// angle, or one is in degrees and the other in radians.
const SAME_UNIT: [f64; 3] = [
    1.0,
    180.0 / core::f64::consts::PI,
    core::f64::consts::PI / 180.0,
];
/// The relative difference up to which a factor counts as one of [`SAME_UNIT`].
const UNIT_TOLERANCE: f64 = 0.1;

/// The role that a column is judged to have.
#[derive(Clone, Debug, Default)]
pub(crate) struct Judged {
    pub(crate) role: Role,
    pub(crate) unit: Option<&'static str>,
    /// The reason for the role, as a clause without its full stop.
    pub(crate) reason: String,
    pub(crate) derivative: Option<Derivative>,
    /// The factor of the column's assignment; 1 without one.
    pub(crate) factor: f64,
    /// The joint that the user assigned the column to.
    pub(crate) assigned: Option<String>,
    pub(crate) meaning: Meaning,
}

impl Judged {
    /// Whether the role may still be judged from the other columns: neither name nor unit states it.
    fn is_open(&self) -> bool {
        self.role == Role::Other && !self.meaning.is_unused
    }

    /// The factor to SI units: the assigned one, or that of degrees if the name has that unit.
    pub(crate) fn unit_factor(&self) -> f64 {
        match (&self.assigned, self.unit) {
            (None, Some("deg")) => core::f64::consts::PI / 180.0,
            _ => self.factor,
        }
    }
}

/// The facts about the columns from which their roles are judged.
pub(crate) struct Known<'a> {
    /// The titles of all columns.
    pub(crate) titles: &'a [String],
    /// The units that the file states of these beside their titles.
    pub(crate) units: &'a [Option<&'static str>],
    /// Whether the log has a header with titles.
    pub(crate) named: bool,
    /// The indices of the columns that have numbers: the judged ones.
    pub(crate) numbers: &'a [usize],
    /// The index among these of the time.
    pub(crate) time: Option<usize>,
    pub(crate) surveyed: &'a Surveyed,
    /// The user's assignments of columns to quantities.
    pub(crate) assignments: &'a [Assignment],
    /// Whether the rows have times.
    pub(crate) timed: bool,
    /// The names of a robot's coordinates; empty without a robot.
    pub(crate) coordinates: &'a [String],
    /// The indices of those that are actuated.
    pub(crate) actuated: &'a [usize],
}

impl Known<'_> {
    fn is_constant(&self, k: usize) -> bool {
        let survey = self.surveyed.columns.get(k + 1);
        survey.is_some_and(crate::columns::Survey::is_constant)
    }

    /// The noise of a column over its standard deviation.
    fn roughness(&self, k: usize) -> f64 {
        let survey = self.surveyed.columns.get(k + 1);
        survey.map_or(f64::INFINITY, |s| s.encoder.noise / s.deviation.max(1e-300))
    }

    /// The role, the joint and the assignment of a column that the user assigned.
    fn assigned(&self, k: usize) -> Option<(Role, &str, &Assignment)> {
        let index = *self.numbers.get(k)?;
        let title = self.titles.get(index)?;
        let is_own = |a: &&Assignment| match a.number {
            Some(number) => number == index + 1,
            None if self.titles.contains(&a.column) => a.column == *title,
            None => a.column.parse() == Ok(index + 1),
        };
        let found = self.assignments.iter().find(is_own)?;
        let (role, joint) = match &found.quantity {
            Quantity::Position(joint) => (Role::Position, joint),
            Quantity::Velocity(joint) => (Role::Velocity, joint),
            Quantity::Acceleration(joint) => (Role::Acceleration, joint),
            Quantity::Effort(joint) if found.is_current() => (Role::Current, joint),
            Quantity::Effort(joint) => (Role::Effort, joint),
            Quantity::Time => return None,
        };
        Some((role, joint, found))
    }

    pub(crate) fn title(&self, k: usize) -> &str {
        let index = self.numbers.get(k);
        index.and_then(|i| self.titles.get(*i)).map_or("", |t| t)
    }
}

/// For each column, the column whose derivative it is most likely, with the factor and the
/// correlation of [`Relations::derivative`].
fn derivatives(known: &Known<'_>, relations: &Relations) -> Vec<Option<(usize, f64, f64)>> {
    let count = known.numbers.len();
    let of = |b: usize| {
        let all = (0..count).filter(|a| Some(*a) != known.time && Some(b) != known.time);
        let found = all.filter_map(|a| Some((a, relations.derivative(a, b)?)));
        let best = found.max_by(|x, y| x.1.1.abs().total_cmp(&y.1.1.abs()));
        best.map(|(a, (factor, correlation))| (a, factor, correlation))
    };
    (0..count).map(of).collect()
}

/// The name of a joint as it is compared: `q_1` is the joint `1`.
pub(crate) fn key(joint: &str) -> &str {
    match joint.strip_prefix("q_") {
        Some(rest) if rest.chars().all(|c| c.is_ascii_digit()) => rest,
        _ => joint,
    }
}

/// Judges all columns of numbers.
pub(crate) fn judge(known: &Known<'_>, relations: &Relations) -> Vec<Judged> {
    let found = derivatives(known, relations);
    let mut out: Vec<Judged> = (0..known.numbers.len())
        .map(|k| by_name(known, k))
        .collect();
    // a column `elbow` in a log with `tau_elbow` is a position
    let of_joints: Vec<String> = out
        .iter()
        .filter(|j| matches!(j.role, Role::Velocity | Role::Effort | Role::Current))
        .map(|j| key(&j.meaning.joint).to_owned())
        .collect();
    for judged in &mut out {
        let joint = key(&judged.meaning.joint);
        if judged.is_open() && !joint.is_empty() && of_joints.iter().any(|j| j == joint) {
            judged.role = Role::Position;
            "other columns have its name".clone_into(&mut judged.reason);
        }
    }
    by_relation(known, &found, &mut out);
    if !known.named {
        by_place(known, &found, &mut out);
    }
    let has_velocity = out.iter().any(|j| j.role == Role::Velocity);
    for (judged, derivative) in out.iter_mut().zip(&found) {
        // a commanded acceleration may have the name of a measured one, but not its values
        let follows = derivative.is_some_and(|(_, _, c)| c.abs() >= MIN_CORRELATION);
        if judged.role == Role::Acceleration
            && judged.assigned.is_none()
            && known.timed
            && has_velocity
            && !follows
        {
            judged.role = Role::Other;
            "it is not the derivative of a velocity".clone_into(&mut judged.reason);
        }
        // an effort may look like the rate of a position by accident
        if matches!(judged.role, Role::Velocity | Role::Acceleration) {
            judged.derivative = derivative.map(|(a, factor, correlation)| Derivative {
                of: known.numbers.get(a).map_or(0, |i| i + 1),
                factor,
                correlation,
            });
        }
    }
    if !out.iter().any(|j| j.role == Role::Position) {
        by_order(known, &mut out);
    }
    efforts_by_order(known, &mut out);
    out
}

/// Judges a column by its assignment or its name, or as constant by its values.
fn by_name(known: &Known<'_>, k: usize) -> Judged {
    let title = known.title(k);
    let mut out = Judged {
        factor: 1.0,
        ..Judged::default()
    };
    if let Some((role, joint, assignment)) = known.assigned(k) {
        out.role = role;
        out.unit = assignment.unit;
        out.factor = assignment.factor;
        out.assigned = Some(joint.to_owned());
        "it is assigned".clone_into(&mut out.reason);
        return out;
    }
    if Some(k) == known.time {
        out.role = Role::Time;
        "it grows evenly".clone_into(&mut out.reason);
        return out;
    }
    if known.named {
        out.meaning = meaning(title);
        let stated = known.numbers.get(k).and_then(|i| *known.units.get(*i)?);
        out.unit = out.meaning.unit.or(stated);
        out.role = match out.meaning.role {
            // a second clock is of no use
            Role::Time | Role::Other | Role::Constant => Role::Other,
            _ if out.meaning.commanded => Role::Command,
            role => role,
        };
        for name in known.coordinates {
            let prefixes = [
                ("", Role::Position),
                ("qd_", Role::Velocity),
                ("qdd_", Role::Acceleration),
                ("tau_", Role::Effort),
            ];
            for (prefix, role) in prefixes {
                if title.strip_prefix(prefix) == Some(name.as_str()) {
                    out.role = role;
                    out.meaning.is_unused = false;
                }
            }
        }
        if out.role != Role::Other {
            "by its name".clone_into(&mut out.reason);
        }
    }
    if out.meaning.is_unused {
        "its name is that of a quantity that is not used".clone_into(&mut out.reason);
    }
    if out.role == Role::Other && known.is_constant(k) {
        out.role = Role::Constant;
    }
    out
}

/// Judges columns of unknown role that are derivatives of others, and those others.
fn by_relation(known: &Known<'_>, found: &[Option<(usize, f64, f64)>], out: &mut [Judged]) {
    let positive = |b: usize| {
        let derivative = found.get(b).copied().flatten();
        derivative.filter(|(_, _, c)| *c >= MIN_CORRELATION)
    };
    for b in 0..out.len() {
        let Some((a, factor, _)) = positive(b) else {
            continue;
        };
        let second = positive(a).is_some_and(|(c, ..)| c != b);
        // the torque of a joint with little friction is proportional to its acceleration
        if second
            && known.timed
            && !SAME_UNIT
                .iter()
                .any(|u| (factor / u - 1.0).abs() < UNIT_TOLERANCE)
        {
            continue;
        }
        let (own, other) = if second {
            (Role::Acceleration, Role::Velocity)
        } else {
            (Role::Velocity, Role::Position)
        };
        let title = |k: usize| {
            if known.named {
                format!("`{}`", known.title(k))
            } else {
                format!("column {}", known.numbers.get(k).map_or(0, |i| i + 1))
            }
        };
        if out[b].is_open() && out[a].is_open() || out[a].role == other {
            if out[b].is_open() {
                out[b].role = own;
                out[b].reason = format!("it is the derivative of {}", title(a));
            }
            if out[a].is_open() {
                out[a].role = other;
                out[a].reason = format!("{} is its derivative", title(b));
            }
        }
    }
}

/// Judges the columns of joints that hardly move, in logs without names: if every velocity is the
/// same number of columns behind its position, so are those of the joints between them.
fn by_place(known: &Known<'_>, found: &[Option<(usize, f64, f64)>], out: &mut [Judged]) {
    let velocities = (0..out.len()).filter(|b| out[*b].role == Role::Velocity);
    let pairs: Vec<(usize, usize)> = velocities
        .filter_map(|b| Some((found.get(b).copied().flatten()?.0, b)))
        .collect();
    let Some((&(first, behind), &(last, _))) = pairs.first().zip(pairs.iter().max()) else {
        return;
    };
    let count = behind.saturating_sub(first);
    let low = pairs.iter().map(|pair| pair.0).min().unwrap_or(first);
    let same = pairs.iter().all(|(a, b)| *b == a + count);
    if !same || count == 0 || last - low >= count {
        return;
    }
    // the block of positions begins right after the time if it then contains all that were found
    let earliest = known.time.map_or(0, |time| time + 1);
    let start = if last < earliest + count && earliest <= low {
        earliest
    } else {
        low
    };
    let free = |role: Role| matches!(role, Role::Other | Role::Constant);
    for k in start..start + count {
        if k + count < out.len() && free(out[k].role) && free(out[k + count].role) {
            for (place, role) in [(k, Role::Position), (k + count, Role::Velocity)] {
                out[place].role = role;
                "its neighbours have this role".clone_into(&mut out[place].reason);
            }
        }
    }
}

/// Guesses positions and efforts if no position was found otherwise: the first half of the unknown
/// columns if they are smooth, and the second half if those are rough; in another order, if each of one half
/// is smooth beside each of the other.
fn by_order(known: &Known<'_>, out: &mut [Judged]) {
    let mut left: Vec<usize> = (0..out.len()).filter(|k| out[*k].is_open()).collect();
    let half = left.len() / 2;
    if half == 0 || !left.len().is_multiple_of(2) {
        return;
    }
    let rough = |k: &usize| known.roughness(*k);
    let typical = |columns: &[usize]| {
        let all: Vec<f64> = columns.iter().map(rough).collect();
        crate::clock::median(&all)
    };
    let (first, second) = left.split_at(half);
    if typical(first) > MAX_NOISE_RATIO * typical(second) {
        left.sort_by(|a, b| rough(a).total_cmp(&rough(b)));
        if rough(&left[half - 1]) > MAX_NOISE_RATIO * rough(&left[half]) {
            return;
        }
    }
    let (smooth, others) = left.split_at(half);
    for (columns, role) in [(smooth, Role::Position), (others, Role::Effort)] {
        for k in columns {
            out[*k].role = role;
            "smooth columns, and as many rough ones: a guess".clone_into(&mut out[*k].reason);
        }
    }
}

/// Guesses efforts if none was found otherwise: the first columns after the motion, as many as there
/// are joints.
fn efforts_by_order(known: &Known<'_>, out: &mut [Judged]) {
    let count = out.iter().filter(|j| j.role == Role::Position).count();
    let some = out
        .iter()
        .any(|j| matches!(j.role, Role::Effort | Role::Current));
    let last = out
        .iter()
        .rposition(|j| matches!(j.role, Role::Position | Role::Velocity | Role::Acceleration));
    let (false, false, Some(last)) = (some, count == 0, last) else {
        return;
    };
    let free = |k: &usize| {
        let own = &out[*k];
        own.is_open() || own.role == Role::Constant && !own.meaning.is_unused
    };
    // adjacent columns, not all of them constant
    let start = (last + 1..out.len()).find(|k| {
        let mut block = *k..k + count;
        let fits = block.end <= out.len() && block.clone().all(|k| free(&k));
        fits && block.any(|k| !known.is_constant(k))
    });
    let Some(start) = start else { return };
    for judged in &mut out[start..start + count] {
        judged.role = Role::Effort;
        "as many as joints, after the motion: a guess".clone_into(&mut judged.reason);
    }
}
