//! Converts the columns of an experiment file, keys and patterns, to assignments.

use regen_runtime::Info;

use super::quantity_kind::{QUANTITY_KINDS, QuantityKind, matched, meant};
use super::shape::{Column, Sink, below, column, did_you_mean, value};
use crate::data::{Assignment, Quantity, UNITS};
use crate::document::{Key, Node};
use crate::text::counted;

/// The content of `columns` and `time`.
#[derive(Debug, Default)]
pub(super) struct Columns {
    pub(super) assignments: Vec<Assignment>,
    /// The efforts whose gain is unknown, each with the place of that word.
    pub(super) unknown_gains: Vec<(String, usize)>,
}

/// The coordinates that the keys of `columns` name.
pub(super) fn coordinates(root: &Node) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    let columns = root.get("columns").map(Node::entries).unwrap_or_default();
    let runs = root.get("runs").map(Node::items).unwrap_or_default();
    let of_runs = runs.iter().flat_map(|run| {
        let of = |key: &str| run.get(key).map(Node::entries).unwrap_or_default();
        let own = |(key, _): &&(Key, Node)| {
            !["action", "latency", "velocity_latency", "signals"].contains(&key.text.as_str())
        };
        of("commands")
            .iter()
            .chain(of("controller").iter().filter(own))
    });
    for (key, node) in columns.iter().chain(of_runs) {
        let text = key.text.as_str();
        let long = ["qdd_", "qd_", "tau_"];
        let short = ["qdd", "qd", "tau"];
        let number = |rest: &&str| {
            let digits = rest.chars().all(|c| c.is_ascii_digit());
            !rest.is_empty() && (digits || *rest == "*")
        };
        let stripped = long.iter().find_map(|prefix| text.strip_prefix(prefix));
        let shortened = short.iter().find_map(|prefix| text.strip_prefix(prefix));
        let name = match (stripped, shortened.filter(number)) {
            (Some(name), _) => name.to_owned(),
            (None, Some(rest)) => format!("q{rest}"),
            (None, None) => text.to_owned(),
        };
        let names = if name.contains('*') {
            let place = node.get("column").unwrap_or(node);
            let count = match column(place) {
                Some(Column::Range(first, last)) => last.saturating_sub(first) + 1,
                Some(Column::List(all)) => all.len(),
                _ => 0,
            };
            let star = if name == "*" { "q*" } else { &name };
            let one = |k: usize| star.replacen('*', &k.to_string(), 1);
            (1..=count.min(MAX_COLUMNS)).map(one).collect()
        } else {
            vec![name]
        };
        for name in names {
            if !out.contains(&name) {
                out.push(name);
            }
        }
    }
    out
}

/// The largest number of coordinates that a pattern matches if there is no robot to count them.
const MAX_COLUMNS: usize = 256;

/// Reads `columns`, `time` and `rate` of a file.
pub(super) fn read(root: &Node, info: &Info<'_>, sink: &mut Sink) -> Columns {
    let columns = root.get("columns");
    let mut out = assigned(columns, info, "`columns`", &QUANTITY_KINDS, sink);
    if let (Some(rate), Some(_)) = (root.get("rate"), root.get("time")) {
        let message = "a rate and a column of time exclude each other".to_owned();
        sink.push(
            rate.at,
            "`rate`",
            message,
            "a rate is for logs without a column of time",
        );
    }
    if let Some(node) = root.get("time") {
        out.assignments.extend(time(node, sink));
    }
    out
}

/// Reads the columns of commanded positions.
pub(super) fn commands(
    node: Option<&Node>,
    info: &Info<'_>,
    path: &str,
    sink: &mut Sink,
) -> Vec<Assignment> {
    // only actuated joints are commanded
    let all = info.actuated.iter();
    let names: Vec<&str> = all
        .filter_map(|k| info.coordinates.get(*k).copied())
        .collect();
    let every: Vec<usize> = (0..names.len()).collect();
    let driven = Info {
        coordinates: &names,
        actuated: &every,
        ..*info
    };
    assigned(node, &driven, path, &[QuantityKind::Position], sink).assignments
}

/// Reads a mapping from quantities to columns.
fn assigned(
    columns: Option<&Node>,
    info: &Info<'_>,
    place: &str,
    kinds: &[QuantityKind],
    sink: &mut Sink,
) -> Columns {
    let mut out = Columns::default();
    // for each assignment, whether its key is a pattern, and the key
    let mut origins: Vec<(bool, String)> = Vec::new();
    for (key, node) in columns.map(Node::entries).unwrap_or_default() {
        let path = below(place, &key.text);
        if key.text == "t" || key.text == "time" {
            let message = "the column of time has a key of its own".to_owned();
            sink.push(
                key.at,
                place,
                message,
                "write `time: {column: ...}` at the top level",
            );
            continue;
        }
        let before = out.assignments.len();
        add_assignments(key, node, (info, kinds), [place, &path], sink, &mut out);
        let pattern = key.text.contains('*');
        let mut k = before;
        while let Some(assignment) = out.assignments.get(k) {
            let quantity = &assignment.quantity;
            let other = out.assignments[..before]
                .iter()
                .position(|own| own.quantity == *quantity);
            match other {
                // a key for one coordinate takes precedence over a pattern
                Some(other) if origins[other].0 && !pattern => {
                    out.assignments.swap(other, k);
                    origins[other] = (pattern, key.text.clone());
                    out.assignments.remove(k);
                }
                Some(other) if pattern && !origins[other].0 => {
                    out.assignments.remove(k);
                }
                Some(other) => {
                    let message =
                        format!("{quantity} has a column by '{}' already", origins[other].1);
                    sink.push(key.at, place, message, "keep one of the two keys");
                    out.assignments.remove(k);
                }
                None => {
                    origins.push((pattern, key.text.clone()));
                    k += 1;
                }
            }
        }
    }
    out
}

/// The assignment of the time.
fn time(node: &Node, sink: &mut Sink) -> Option<Assignment> {
    let place = node.get("column").unwrap_or(node);
    let found = match column(place)? {
        Column::Name(name) => Assignment::new(Quantity::Time, &name),
        Column::Number(number) => Assignment {
            number: Some(number),
            ..Assignment::new(Quantity::Time, &number.to_string())
        },
        Column::Range(..) | Column::List(_) => {
            let message = "the time is in one column".to_owned();
            sink.push(place.at, "`time`", message, "");
            return None;
        }
    };
    let unit = node.get("unit").and_then(Node::text).and_then(unit);
    Some(Assignment {
        factor: unit.map_or(1.0, |unit| unit.1),
        unit: unit.map(|unit| unit.0),
        ..found
    })
}

fn unit(text: &str) -> Option<(&'static str, f64)> {
    UNITS.iter().find(|(name, _)| *name == text).copied()
}

/// Adds the assignments of one key.
///
/// - `place`, `path`: the paths of the mapping and of the key, for messages.
fn add_assignments(
    key: &Key,
    node: &Node,
    (info, kinds): (&Info<'_>, &[QuantityKind]),
    [place, path]: [&str; 2],
    sink: &mut Sink,
    out: &mut Columns,
) {
    if key.text.matches('*').count() > 1 {
        sink.push(key.at, place, "a pattern has one `*`".to_owned(), "");
        return;
    }
    let Some((kind, found)) = meant(&key.text, info, kinds) else {
        if kinds.len() < QUANTITY_KINDS.len() {
            not_actuated(key, info, place, sink);
        } else {
            unknown(key, info, sink);
        }
        return;
    };
    let stated = (node.get("constant"), node.text() == Some("unmeasured"));
    if stated.0.is_some() || stated.1 {
        without_column(node, (kind, kinds), &found, path, sink, out);
        return;
    }
    if node.get("column").is_none() && !node.entries().is_empty() {
        let message = "a column lacks the key 'column'".to_owned();
        let remedy =
            "its name or its number; a position that is the same throughout has `constant`";
        sink.push(node.at, path, message, remedy);
        return;
    }
    let place = node.get("column").unwrap_or(node);
    let Some(column) = column(place) else { return };
    if let (Column::Name(name), false) = (&column, key.text.contains('*'))
        && let Some((own, factor)) = name.split_once('*')
    {
        let message = format!(
            "'*' stands for what it stands for in the key, and '{}' has none",
            key.text
        );
        let remedy = format!("a factor has a key of its own: {{column: {own}, factor: {factor}}}");
        sink.push(place.at, path, message, &remedy);
        return;
    }
    let unit_fits = fits(kind, &found, node, path, sink);
    let gain_fits = needs_gain(kind, node, place, path, sink);
    if !(unit_fits && gain_fits && suffices(&column, &found, place.at, path, sink)) {
        return;
    }
    let mut each =
        |name: &str| per_coordinate(node.get(name), found.len(), &below(path, name), sink);
    let lists = [each("factor"), each("offset"), each("late"), each("gain")];
    let [Some(factors), Some(offsets), Some(late), Some(gains)] = lists else {
        return;
    };
    let unit = node.get("unit").and_then(Node::text).and_then(unit);
    for (k, (name, star)) in found.into_iter().enumerate() {
        let number = |list: &[Entry]| match list.get(k) {
            Some(Entry::Value(value)) => Some(*value),
            _ => None,
        };
        let by_number = |number: usize| Assignment {
            number: Some(number),
            ..Assignment::new(kind.of(&name), &number.to_string())
        };
        let base = match &column {
            Column::Name(pattern) => Assignment {
                optional: key.text.contains('*'),
                ..Assignment::new(kind.of(&name), &pattern.replacen('*', &star, 1))
            },
            Column::Number(first) | Column::Range(first, _) => by_number(first + k),
            // as many as there are coordinates
            Column::List(all) => match all.get(k) {
                Some(Column::Number(number)) => by_number(*number),
                Some(Column::Name(own)) => Assignment::new(kind.of(&name), own),
                _ => continue,
            },
        };
        if let Some(Entry::Unknown(at)) = gains.get(k) {
            out.unknown_gains.push((name, *at));
        }
        let gain = number(&gains);
        let factor = number(&factors).unwrap_or(1.0) * gain.unwrap_or(1.0);
        out.assignments.push(Assignment {
            factor: unit.map_or(1.0, |unit| unit.1) * factor,
            offset: number(&offsets).unwrap_or(0.0),
            late: number(&late).unwrap_or(0.0),
            unit: unit.map(|unit| unit.0),
            gain,
            ..base
        });
    }
}

/// Adds the assignments of a key whose quantities have no column: constants, or efforts that are not
/// measured.
fn without_column(
    node: &Node,
    (kind, kinds): (QuantityKind, &[QuantityKind]),
    found: &[(String, String)],
    path: &str,
    sink: &mut Sink,
    out: &mut Columns,
) {
    if kinds.len() < QUANTITY_KINDS.len() {
        let message = "a command is in a column".to_owned();
        sink.push(node.at, path, message, "name its column");
        return;
    }
    for key in ["column", "factor", "offset", "late", "gain"] {
        if let Some(other) = node.get(key) {
            let message = format!("a constant has no '{key}'");
            sink.push(
                other.at,
                &below(path, key),
                message,
                "leave one of both out",
            );
            return;
        }
    }
    if !fits(kind, found, node, path, sink) {
        return;
    }
    let unit = node.get("unit").and_then(Node::text).and_then(unit);
    let path_of = below(path, "constant");
    let Some(values) = per_coordinate(node.get("constant"), found.len(), &path_of, sink) else {
        return;
    };
    for ((name, _), value) in found.iter().zip(values) {
        let value = match value {
            Entry::Value(value) => Some(unit.map_or(1.0, |unit| unit.1) * value),
            _ => None,
        };
        match Assignment::without_column(kind.of(name), value) {
            Ok(assignment) => out.assignments.push(assignment),
            Err(why) => {
                sink.push(node.at, path, why.to_owned(), "");
                return;
            }
        }
    }
}

/// Whether the unit of a column is one of its quantity.
fn fits(
    kind: QuantityKind,
    found: &[(String, String)],
    node: &Node,
    path: &str,
    sink: &mut Sink,
) -> bool {
    let unit = node.get("unit");
    let Some((node, word)) = unit.and_then(|unit| Some((unit, unit.text()?))) else {
        return true;
    };
    // other words are told with the shape
    if kind.units().contains(&word) || self::unit(word).is_none() {
        return true;
    }
    let what = kind.of(found.first().map_or("", |(name, _)| name));
    let message = format!("{what} is not measured in {word}");
    let remedy = format!("its units are {}", kind.units().join(" "));
    sink.push(node.at, &below(path, "unit"), message, &remedy);
    false
}

/// Whether a column has a gain if it is a current, and none otherwise.
fn needs_gain(kind: QuantityKind, node: &Node, place: &Node, path: &str, sink: &mut Sink) -> bool {
    let unit = node.get("unit").and_then(Node::text);
    let is_current = kind == QuantityKind::Effort && matches!(unit, Some("A" | "mA"));
    match (node.get("gain"), is_current) {
        (None, true) => {
            let message = "a current is not an effort".to_owned();
            let remedy = "give `gain`, the joint's torque constant with its gear in N m/A or N/A \
                          such as 0.12, or `gain: unknown`";
            sink.push(place.at, path, message, remedy);
            false
        }
        (Some(gain), false) => {
            let message = "a gain belongs to an effort in A or mA".to_owned();
            let remedy = "give `factor` where there is no current, or `unit: A`";
            sink.push(gain.at, &below(path, "gain"), message, remedy);
            false
        }
        _ => true,
    }
}

/// Whether a key says a column for each coordinate that it means.
fn suffices(
    column: &Column,
    found: &[(String, String)],
    at: usize,
    path: &str,
    sink: &mut Sink,
) -> bool {
    let count = found.len();
    let (columns, remedy) = match column {
        Column::Range(first, last) => (last - first + 1, String::new()),
        Column::List(all) => (all.len(), String::new()),
        Column::Name(name) if count == 1 || name.matches('*').count() == 1 => return true,
        Column::Name(_) => {
            let star = "write one `*` where the coordinates' part of the name stands";
            (1, format!("{star}, or numbers such as 2..7 or [2, 5, 4]"))
        }
        Column::Number(_) => (
            1,
            "write the numbers of all, such as 2..7 or [2, 5, 4]".to_owned(),
        ),
    };
    if columns == count {
        return true;
    }
    let names: Vec<&str> = found.iter().map(|(name, _)| name.as_str()).collect();
    let message = format!(
        "{} for {}: {}",
        counted(columns, "column", "columns"),
        counted(count, "coordinate", "coordinates"),
        names.join(" ")
    );
    sink.push(at, path, message, &remedy);
    false
}

/// A value of one coordinate.
#[derive(Clone, Copy)]
enum Entry {
    Missing,
    Value(f64),
    /// The word `unknown`, with its place.
    Unknown(usize),
}

/// A value for each coordinate, from one for all or a list; `None` if it is wrong.
fn per_coordinate(
    node: Option<&Node>,
    count: usize,
    path: &str,
    sink: &mut Sink,
) -> Option<Vec<Entry>> {
    let entry = |node: &Node| match node.text() {
        Some("unknown") => Some(Entry::Unknown(node.at)),
        // other mistakes are told with the shape
        _ => value(node, false).ok().map(Entry::Value),
    };
    let Some(node) = node else {
        return Some(vec![Entry::Missing; count]);
    };
    let items = node.items();
    if items.is_empty() {
        return entry(node).map(|entry| vec![entry; count]);
    }
    if items.len() != count {
        let coordinates = counted(count, "coordinate", "coordinates");
        let message = format!("{} values for {coordinates}", items.len());
        sink.push(node.at, path, message, "");
        return None;
    }
    items.iter().map(entry).collect()
}

/// Refuses a key that means no actuated coordinate of the robot.
pub(super) fn not_actuated(key: &Key, info: &Info<'_>, place: &str, sink: &mut Sink) {
    let names = info.actuated.iter();
    let names: Vec<&str> = names
        .filter_map(|k| info.coordinates.get(*k).copied())
        .collect();
    let near = did_you_mean(&key.text, names.iter().copied());
    let message = format!("'{}' is not an actuated coordinate{near}", key.text);
    let remedy = format!("actuated are {}", names.join(" "));
    sink.push(key.at, place, message, &remedy);
}

/// The actuated coordinates that a key without a prefix means; none if it means none.
pub(super) fn actuated(key: &str, info: &Info<'_>) -> Vec<String> {
    let names = info.actuated.iter();
    names
        .filter_map(|k| info.coordinates.get(*k))
        .filter(|name| matched(key, name).is_some())
        .map(|name| (*name).to_owned())
        .collect()
}

/// Refuses a key that means no quantity of the robot.
fn unknown(key: &Key, info: &Info<'_>, sink: &mut Sink) {
    let text = &key.text;
    let names = info.coordinates.iter().enumerate();
    let mut passive = names
        .filter(|(k, _)| !info.actuated.contains(k))
        .map(|(_, name)| name);
    let actuated: Vec<&str> = info
        .actuated
        .iter()
        .filter_map(|k| info.coordinates.get(*k).copied())
        .collect();
    if let Some(name) = passive.find(|name| {
        let mut spellings = QuantityKind::Effort.spellings(name).into_iter().flatten();
        spellings.any(|own| matched(text, &own).is_some())
    }) {
        let message = format!("{name} is not actuated: it has no effort");
        let remedy = format!("actuated are {}", actuated.join(" "));
        sink.push(key.at, "`columns`", message, &remedy);
        return;
    }
    let known: Vec<String> = QUANTITY_KINDS
        .into_iter()
        .flat_map(|kind| {
            info.coordinates
                .iter()
                .flat_map(move |name| kind.spellings(name))
        })
        .flatten()
        .collect();
    let near = did_you_mean(text, known.iter().map(String::as_str));
    let message = format!("'{text}' means no quantity of {}{near}", info.name);
    let remedy = format!(
        "keys are coordinates ({}), and qd_, qdd_ and tau_ with one",
        info.coordinates.join(" ")
    );
    sink.push(key.at, "`columns`", message, &remedy);
}
