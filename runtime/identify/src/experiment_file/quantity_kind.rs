//! The quantities of a coordinate, and the keys and patterns that select them.

use regen_runtime::Info;

use crate::data::Quantity;

/// A kind of quantity of a coordinate.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum QuantityKind {
    Position,
    Velocity,
    Acceleration,
    Effort,
}

pub(super) const QUANTITY_KINDS: [QuantityKind; 4] = [
    QuantityKind::Position,
    QuantityKind::Velocity,
    QuantityKind::Acceleration,
    QuantityKind::Effort,
];

impl QuantityKind {
    pub(super) fn of(self, coordinate: &str) -> Quantity {
        let name = coordinate.to_owned();
        match self {
            Self::Position => Quantity::Position(name),
            Self::Velocity => Quantity::Velocity(name),
            Self::Acceleration => Quantity::Acceleration(name),
            Self::Effort => Quantity::Effort(name),
        }
    }

    /// The keys that select this quantity of a coordinate: the short one, such as `qd1` for `q1`, if
    /// there is one, and the full one, such as `qd_q1`.
    pub(super) fn spellings(self, coordinate: &str) -> [Option<String>; 2] {
        let prefix = match self {
            Self::Position => return [None, Some(coordinate.to_owned())],
            Self::Velocity => "qd",
            Self::Acceleration => "qdd",
            Self::Effort => "tau",
        };
        let short = coordinate.strip_prefix('q').filter(|rest| !rest.is_empty());
        [
            short.map(|rest| format!("{prefix}{rest}")),
            Some(format!("{prefix}_{coordinate}")),
        ]
    }

    /// The units of this quantity.
    pub(super) fn units(self) -> &'static [&'static str] {
        self.of("").units()
    }
}

/// The part of a text that the `*` of a pattern matches, empty for a pattern without `*`; `None` if
/// the text does not match.
pub(super) fn matched<'t>(pattern: &str, text: &'t str) -> Option<&'t str> {
    match pattern.split_once('*') {
        None => (pattern == text).then_some(""),
        Some((before, after)) => text.strip_prefix(before)?.strip_suffix(after),
    }
}

/// The quantity that a key selects, and its coordinates, each with the part that a `*` matches;
/// `None` if it selects none.
pub(super) fn meant(
    key: &str,
    info: &Info<'_>,
    kinds: &[QuantityKind],
) -> Option<(QuantityKind, Vec<(String, String)>)> {
    // a pattern that matches short keys selects by these alone, so that `qd*` matches `qd1` of q1
    // but not `qd_q1`
    let mut ways = kinds.iter().flat_map(|kind| [(*kind, 0), (*kind, 1)]);
    ways.find_map(|(kind, way)| {
        let names = info.coordinates.iter().enumerate();
        let names =
            names.filter(|(k, _)| kind != QuantityKind::Effort || info.actuated.contains(k));
        let found: Vec<(String, String)> = names
            .filter_map(|(_, name)| {
                let spelling = kind.spellings(name)[way].take()?;
                let star = matched(key, &spelling)?;
                Some(((*name).to_owned(), star.to_owned()))
            })
            .collect();
        (!found.is_empty()).then(|| (kind, ordered(found)))
    })
}

/// Sorts coordinates by number if their names differ in a number only, such as q1, q2, q10; others
/// stay in the robot's order.
fn ordered(mut found: Vec<(String, String)>) -> Vec<(String, String)> {
    let parts = |name: &str| {
        let text = name
            .trim_end_matches(|c: char| c.is_ascii_digit())
            .to_owned();
        let number = name.get(text.len()..)?.parse::<u64>().ok()?;
        Some((text, number))
    };
    let first = found.first().and_then(|(name, _)| parts(name));
    let same = |(name, _): &(String, String)| {
        parts(name).map(|own| own.0) == first.as_ref().map(|first| first.0.clone())
    };
    if first.is_some() && found.iter().all(same) {
        found.sort_by_key(|(name, _)| parts(name).map(|own| own.1));
    }
    found
}
