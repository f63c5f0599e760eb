//! Groups the columns of a log by joint.

use serde::Serialize;

use crate::names::{Role, meaning};
use crate::roles::{Judged, Known, key};

/// The columns of one joint, by their numbers from 1.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Joint {
    /// The joint's name in the description, or else in the log, or else `q` with its number.
    pub name: String,
    /// Its position.
    pub position: Option<usize>,
    /// Its velocity.
    pub velocity: Option<usize>,
    /// Its acceleration.
    pub acceleration: Option<usize>,
    /// Its effort, or the current of its motor.
    pub effort: Option<usize>,
    /// The position commanded to its controller.
    pub command: Option<usize>,
}

/// Selects one of the columns of a joint.
type Field = fn(&mut Joint) -> &mut Option<usize>;

/// The joints of assigned columns, in the order of the robot's coordinates or of the columns.
fn assigned_joints(known: &Known<'_>, judged: &[Judged]) -> Vec<Joint> {
    let column = |role: &[Role], joint: &str| {
        let own = judged
            .iter()
            .position(|j| role.contains(&j.role) && j.assigned.as_deref() == Some(joint));
        own.and_then(|k| known.numbers.get(k)).map(|i| i + 1)
    };
    let positions = judged.iter().filter(|j| j.role == Role::Position);
    let mut names: Vec<String> = positions.filter_map(|j| j.assigned.clone()).collect();
    let place = |name: &String| known.coordinates.iter().position(|c| c == name);
    names.sort_by_key(place);
    let joint = |name: String| Joint {
        position: column(&[Role::Position], &name),
        velocity: column(&[Role::Velocity], &name),
        acceleration: column(&[Role::Acceleration], &name),
        effort: column(&[Role::Effort, Role::Current], &name),
        command: None,
        name,
    };
    names.into_iter().map(joint).collect()
}

/// For each coordinate the position column whose name has its words but for those that state the
/// quantity: `/joint_states/elbow/position` is that of `elbow`. `None` unless all actuated coordinates
/// have one each.
fn by_words(
    known: &Known<'_>,
    judged: &[Judged],
    positions: &[usize],
) -> Option<Vec<Option<usize>>> {
    let words = |name: &String| key(&meaning(name).joint).to_owned();
    let keys: Vec<String> = known.coordinates.iter().map(words).collect();
    let found = keys.iter().map(|own| {
        let is_own = |k: &&usize| key(&judged[**k].meaning.joint) == *own;
        let mut columns = positions.iter().filter(is_own);
        let only = columns.next().filter(|_| columns.next().is_none());
        let is_shared = keys.iter().filter(|other| *other == own).count() > 1;
        only.copied().filter(|_| !is_shared && !own.is_empty())
    });
    let found: Vec<Option<usize>> = found.collect();
    let has_column = |c: &usize| found.get(*c).copied().flatten().is_some();
    let is_whole = !known.actuated.is_empty() && known.actuated.iter().all(has_column);
    is_whole.then_some(found)
}

/// Groups the columns by joint: by assignments, else by names, else by their order.
pub(crate) fn joints(known: &Known<'_>, judged: &[Judged]) -> Vec<Joint> {
    let of = |role: Role| -> Vec<usize> {
        (0..judged.len())
            .filter(|k| judged[*k].role == role)
            .collect()
    };
    let number = |k: usize| known.numbers.get(k).map(|i| i + 1);
    let positions = of(Role::Position);
    if positions.iter().any(|k| judged[*k].assigned.is_some()) {
        return assigned_joints(known, judged);
    }
    let mut order: Vec<Option<usize>> = positions.iter().map(|k| Some(*k)).collect();
    let mut names: Vec<String> = Vec::new();
    if known.coordinates.is_empty() {
        for (j, k) in positions.iter().enumerate() {
            let title = known.title(*k);
            let plain = known.named && !title.is_empty();
            names.push(if plain {
                title.to_owned()
            } else {
                format!("q{}", j + 1)
            });
        }
    } else {
        let named = |name: &String| {
            positions
                .iter()
                .find(|k| known.title(**k) == *name)
                .copied()
        };
        let exact: Vec<Option<usize>> = known.coordinates.iter().map(named).collect();
        // by name, by the words of the name, else in the order of all coordinates or, if there are as
        // many, the actuated ones
        let all: Vec<usize> = (0..known.coordinates.len()).collect();
        let chosen = if exact.iter().any(Option::is_some) {
            exact
        } else if let Some(by_words) = by_words(known, judged, &positions) {
            by_words
        } else {
            let order = if positions.len() == all.len() {
                &all[..]
            } else {
                known.actuated
            };
            let place = |c: &usize| {
                let place = order.iter().position(|own| own == c)?;
                (order.len() == positions.len()).then(|| positions.get(place).copied())?
            };
            all.iter().map(place).collect()
        };
        (order, names) = chosen
            .into_iter()
            .zip(known.coordinates)
            .filter(|(position, _)| position.is_some())
            .map(|(position, name)| (position, name.clone()))
            .unzip();
    }
    let mut out: Vec<Joint> = order
        .iter()
        .zip(names)
        .map(|(position, name)| Joint {
            name,
            position: position.and_then(number),
            ..Joint::default()
        })
        .collect();
    let efforts = if of(Role::Effort).is_empty() {
        of(Role::Current)
    } else {
        of(Role::Effort)
    };
    let actuated: Vec<bool> = out
        .iter()
        .map(|joint| {
            let place = known.coordinates.iter().position(|n| *n == joint.name);
            place.is_none_or(|c| known.actuated.contains(&c))
        })
        .collect();
    let commands: Vec<usize> = of(Role::Command)
        .into_iter()
        .filter(|k| matches!(judged[*k].meaning.role, Role::Position))
        .collect();
    let kinds: [(Vec<usize>, bool, Field); 4] = [
        (of(Role::Velocity), false, |joint| &mut joint.velocity),
        (of(Role::Acceleration), false, |joint| {
            &mut joint.acceleration
        }),
        (efforts, true, |joint| &mut joint.effort),
        (commands, true, |joint| &mut joint.command),
    ];
    for (columns, driven, field) in kinds {
        let places: Vec<usize> = (0..out.len()).filter(|j| !driven || actuated[*j]).collect();
        let mut matched = false;
        for j in &places {
            let own = order[*j].map_or("", |k| key(&judged[k].meaning.joint));
            let name = out[*j].name.clone();
            let same = |k: &&usize| {
                let title = known.title(**k);
                let exact = ["qd_", "qdd_", "tau_", "cmd_"]
                    .iter()
                    .any(|prefix| title.strip_prefix(prefix) == Some(name.as_str()));
                let joint = key(&judged[**k].meaning.joint);
                exact || known.named && !joint.is_empty() && joint == own
            };
            if let Some(k) = columns.iter().find(same) {
                *field(&mut out[*j]) = number(*k);
                matched = true;
            }
        }
        // if no name matches and there are as many columns as joints, they have the same order
        if !matched && columns.len() == places.len() {
            for (j, k) in places.iter().zip(&columns) {
                *field(&mut out[*j]) = number(*k);
            }
        }
        // columns without names belong to the joint whose position or velocity they differentiate
        if !known.named && !driven {
            for joint in &mut out {
                let of = [joint.position, joint.velocity];
                let own = columns.iter().find(|k| {
                    let derivative = judged[**k].derivative;
                    derivative.is_some_and(|d| of.contains(&Some(d.of)))
                });
                if let Some(k) = own {
                    *field(joint) = number(*k);
                }
            }
        }
    }
    out
}
