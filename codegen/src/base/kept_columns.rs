//! Chooses the columns that are kept, by row reduction of the null space with the columns in order
//! of preference. Decisions depend on the exact values at the given geometry alone; expressions are
//! only carried along.

use std::collections::BTreeMap;

use crate::model::{Model, ParameterKind};

use super::field::{Element, Field};
use super::span::{Vector, add_scaled, clear};

/// The columns in the order in which elimination is tried: first those of `first`, then the others,
/// in an order that leaves simple base parameters.
///
/// All parameters of bodies that are fixed to others come first, so that they are lumped into the
/// body that carries them. Then masses, first moments along the joint's axis, and one diagonal moment
/// across it are eliminated, those of bodies far from the base before those near it (the grouping of
/// Khalil's rules, for any axis). Friction and rotors are kept as long as possible, offsets as long
/// as no friction has the same effect; Fc+ and Fc- then include the offset.
pub(super) fn preference(model: &Model, first: &[usize]) -> Vec<usize> {
    let places: Vec<Place> = (0..model.bodies.len())
        .map(|body| Place::of(model, body))
        .collect();
    let rank = |column: usize| -> (usize, usize) {
        match model.parameters[column].kind {
            ParameterKind::Inertial { body, entry } => {
                let class = match places[body] {
                    Place::Fixed => 0,
                    Place::Jointed(axis) => 1 + place_in_order(entry, axis),
                };
                (class, usize::MAX - body)
            }
            ParameterKind::Rotor { coordinate } => (20, coordinate),
            ParameterKind::Offset { coordinate } => (25, coordinate),
            ParameterKind::JointSpring { .. }
            | ParameterKind::EffortTerm { .. }
            | ParameterKind::PointSpring { .. } => (27, column),
            ParameterKind::Friction { .. } => (30, column),
        }
    };
    let mut rest: Vec<usize> = (0..model.parameters.len())
        .filter(|c| !first.contains(c))
        .collect();
    rest.sort_by_key(|c| (rank(*c), *c));
    first.iter().copied().chain(rest).collect()
}

/// How a body is connected to the body that carries it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// Rigidly, and it is not a payload, which only some runs carry.
    Fixed,
    /// By a joint about or along this axis of its frame; z if the joint has several axes.
    Jointed(usize),
}

impl Place {
    pub(super) fn of(model: &Model, body: usize) -> Place {
        const Z: usize = 2;
        let first = &model.links[model.bodies[body].link];
        let mut motions = usize::from(first.motion.is_some());
        let mut at = first.parent;
        while let Some(link) = at {
            if model.bodies.iter().any(|other| other.link == link) {
                break;
            }
            motions += usize::from(model.links[link].motion.is_some());
            at = model.links[link].parent;
        }
        match &first.motion {
            Some(motion) if motions == 1 => Place::Jointed(motion.axis.index()),
            None if motions == 0 && at.is_some() && !model.payloads.contains(&body) => Place::Fixed,
            _ => Place::Jointed(Z),
        }
    }
}

/// The place of one of a body's ten parameters in the order of elimination. If the axis of its joint
/// is z, this order is m, mz, Iyy, Izz and so on; for another axis, its name and z are exchanged.
fn place_in_order(entry: usize, axis: usize) -> usize {
    const ORDER: [usize; 10] = [9, 8, 3, 5, 4, 2, 1, 7, 6, 0];
    const MOMENTS: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
    let mut names = [0, 1, 2];
    names.swap(axis, 2);
    let renamed = match entry {
        0..6 => {
            let pairs = (0..3).flat_map(|i| (0..3).map(move |j| (i, j)));
            let mut found = pairs.filter(|(i, j)| MOMENTS[*i][*j] == entry);
            found
                .next()
                .map_or(entry, |(i, j)| MOMENTS[names[i]][names[j]])
        }
        6..9 => 6 + names[entry - 6],
        _ => entry,
    };
    ORDER.iter().position(|e| *e == renamed).unwrap_or(0)
}

/// A basis of the null space that is the identity matrix at the eliminated columns.
#[derive(Clone, Debug, Default)]
pub(super) struct Reduced {
    /// For each eliminated column, the row that is 1 there and 0 at all other eliminated columns; its
    /// other entries express the eliminated parameter in terms of kept ones.
    pub(super) rows: BTreeMap<usize, Vector>,
}

/// Row-reduces a null space. The first `requested` columns of `order` are eliminated if possible,
/// even by dividing by an expression. Of the others, those whose pivot is a constant are eliminated
/// first, since this keeps the coefficients short; then all that remain.
pub(super) fn reduce(
    field: &mut Field,
    null: &[Vector],
    order: &[usize],
    requested: usize,
) -> Reduced {
    let mut open = null.to_vec();
    let mut reduced = Reduced::default();
    let (first, rest) = order.split_at(requested.min(order.len()));
    for column in first {
        reduced.eliminate(field, &mut open, *column, usize::MAX);
    }
    for max_weight in [0, usize::MAX] {
        for column in rest {
            if !reduced.rows.contains_key(column) {
                reduced.eliminate(field, &mut open, *column, max_weight);
            }
        }
    }
    reduced
}

impl Reduced {
    /// Eliminates a column if a row of `open` has an entry there with a weight of at most
    /// `max_weight`. The entry with the shortest expression is the pivot.
    pub(super) fn eliminate(
        &mut self,
        field: &mut Field,
        open: &mut Vec<Vector>,
        column: usize,
        max_weight: usize,
    ) {
        let pivot = open
            .iter()
            .enumerate()
            .filter_map(|(r, row)| Some((row.get(&column)?.weight(), row.len(), r)))
            .min();
        let Some((weight, _, r)) = pivot else { return };
        if weight > max_weight {
            return;
        }
        let row = open.swap_remove(r);
        let inverse = row.get(&column).and_then(|p| field.div(&Element::one(), p));
        let Some(inverse) = inverse else { return };
        let mut scaled = Vector::new();
        add_scaled(field, &mut scaled, &inverse, &row);
        scaled.insert(column, Element::one());
        for other in open.iter_mut().chain(self.rows.values_mut()) {
            clear(field, other, column, &scaled);
        }
        self.rows.insert(column, scaled);
    }
}
