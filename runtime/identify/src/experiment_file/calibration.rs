//! Reads what an experiment file says of a calibration.

use super::shape::{Column, Sink, below, column, value};
use crate::document::Node;

/// What is measured of a robot's geometry at rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Calibration {
    /// The names of what is unknown; none for every error of a placement.
    pub unknown: Vec<String>,
    /// The standard deviation of readings of coordinates, rad or m.
    pub noise: Option<f64>,
    /// The standard deviation of errors of the geometry as it was made, rad or m.
    pub tolerance: Option<f64>,
    /// What sensors measure.
    pub measured: Vec<MeasuredFrame>,
}

/// What a sensor measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeasuredKind {
    /// Position and rotation of a frame.
    Pose,
    /// The position of a frame.
    Point,
    /// The distance of a frame from a point.
    Distance,
    /// The distance of a frame from a plane.
    Plane,
    /// The direction of gravity in a frame.
    Gravity,
}

/// A frame that a sensor observes, and the columns of what it measures.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredFrame {
    /// What is measured.
    pub kind: MeasuredKind,
    /// The name of the frame, or the label of a body.
    pub frame: String,
    /// The columns by name, or by number from 1: x, y and z, the length, or the direction; none for a
    /// plane that is touched.
    pub columns: Vec<String>,
    /// The convention of the rotation, as the file's key, and its columns.
    pub rotation: Option<(String, Vec<String>)>,
    /// A point of the world, m: that from which a distance is measured, or one of the plane.
    pub from: [f64; 3],
    /// The normal of a plane in the world.
    pub normal: [f64; 3],
    /// The factor that converts lengths to m.
    pub length_factor: f64,
    /// The factor that converts angles to rad.
    pub angle_factor: f64,
    /// Whether the place of the instrument is found.
    pub unknown_instrument: bool,
    /// The standard deviation of each length, m.
    pub noise: Option<f64>,
    /// The standard deviation of each angle, rad.
    pub noise_of_angles: Option<f64>,
    /// The byte of the frame's name in the text.
    pub at: usize,
}

/// The keys that say what is measured, with the keys that each needs and those that it may have.
const KINDS: [(&str, MeasuredKind, &[&str], &[&str]); 5] = [
    (
        "pose",
        MeasuredKind::Pose,
        &["position", "rotation"],
        &["unit", "angles", "instrument", "noise", "noise_of_angles"],
    ),
    (
        "point",
        MeasuredKind::Point,
        &["position"],
        &["unit", "instrument", "noise"],
    ),
    (
        "distance",
        MeasuredKind::Distance,
        &["length", "from"],
        &["unit", "instrument", "noise"],
    ),
    (
        "plane",
        MeasuredKind::Plane,
        &[],
        &["length", "from", "normal", "unit", "instrument", "noise"],
    ),
    (
        "gravity",
        MeasuredKind::Gravity,
        &["direction"],
        &["noise_of_angles"],
    ),
];

/// Reads `calibrate`, whose shape has been checked.
pub(super) fn read(node: &Node, sink: &mut Sink) -> Calibration {
    let unknown = node.get("unknown").map(Node::items).unwrap_or_default();
    let unknown = unknown.iter().filter_map(label);
    let mut out = Calibration {
        unknown: unknown.collect(),
        noise: node.get("noise").and_then(Node::number),
        tolerance: node.get("tolerance").and_then(Node::number),
        measured: Vec::new(),
    };
    let measured = node.get("measure").map(Node::items).unwrap_or_default();
    for (k, node) in measured.iter().enumerate() {
        let path = format!("`calibrate`, `measure`, entry {}", k + 1);
        out.measured.extend(frame(node, &path, sink));
    }
    out
}

fn frame(node: &Node, path: &str, sink: &mut Sink) -> Option<MeasuredFrame> {
    let stated = KINDS.iter().filter(|kind| node.get(kind.0).is_some());
    let stated: Vec<_> = stated.collect();
    let &[(word, kind, needed, possible)] = &stated[..] else {
        let message = match stated.len() {
            0 => "it does not say what is measured".to_owned(),
            _ => "it says several things that are measured".to_owned(),
        };
        let remedy =
            "give one of pose, point, distance, plane and gravity with the name of a frame";
        sink.push(node.at, path, message, remedy);
        return None;
    };
    for key in *needed {
        if node.get(key).is_none() {
            let message = format!("'{word}' needs the key '{key}'");
            sink.push(node.at, path, message, "");
        }
    }
    for (key, _) in node.entries() {
        let own = key.text.as_str();
        if own != *word && !needed.contains(&own) && !possible.contains(&own) {
            let message = format!("'{own}' has no effect beside '{word}'");
            sink.push(key.at, &below(path, own), message, "leave it out");
        }
    }
    let named = node.get(word)?;
    let three = |key: &str| -> Option<[f64; 3]> {
        let items = node.get(key)?.items();
        let values: Option<Vec<f64>> = items.iter().map(|own| value(own, false).ok()).collect();
        values?.try_into().ok()
    };
    let normal = three("normal").unwrap_or([0.0, 0.0, 1.0]);
    if normal.iter().all(|x| *x == 0.0) {
        let at = node.get("normal").map_or(node.at, |own| own.at);
        let message = "a normal of length 0 has no direction".to_owned();
        sink.push(at, &below(path, "normal"), message, "");
    }
    let list = |key: &str| node.get(key).map(columns).unwrap_or_default();
    let rotation = node.get("rotation").and_then(|own| own.entries().first());
    let factor = match node.get("unit").and_then(Node::text) {
        Some("cm") => 1e-2,
        Some("mm") => 1e-3,
        Some("um") => 1e-6,
        _ => 1.0,
    };
    let degrees = node.get("angles").and_then(Node::text) == Some("deg");
    Some(MeasuredFrame {
        kind: *kind,
        frame: label(named)?,
        columns: match kind {
            MeasuredKind::Pose | MeasuredKind::Point => list("position"),
            MeasuredKind::Distance | MeasuredKind::Plane => list("length"),
            MeasuredKind::Gravity => list("direction"),
        },
        rotation: rotation.map(|(key, own)| (key.text.clone(), columns(own))),
        from: three("from").unwrap_or_default(),
        normal,
        length_factor: factor,
        angle_factor: if degrees { 1_f64.to_radians() } else { 1.0 },
        unknown_instrument: node.get("instrument").and_then(Node::text) != Some("known"),
        noise: node.get("noise").and_then(Node::number),
        noise_of_angles: node.get("noise_of_angles").and_then(Node::number),
        at: named.at,
    })
}

/// A name, or a label that is a number.
fn label(node: &Node) -> Option<String> {
    let text = node.text().map(str::to_owned);
    text.or_else(|| Some(node.whole()?.to_string()))
}

/// The columns that a node names, each by its name or its number.
fn columns(node: &Node) -> Vec<String> {
    let one = |column: Column| match column {
        Column::Name(name) => vec![name],
        Column::Number(number) => vec![number.to_string()],
        Column::Range(first, last) => (first..=last).map(|k| k.to_string()).collect(),
        Column::List(_) => Vec::new(),
    };
    match column(node) {
        Some(Column::List(all)) => all.into_iter().flat_map(one).collect(),
        Some(own) => one(own),
        None => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::ExperimentFile;
    use super::*;
    use regen_runtime::Info;

    #[test]
    fn measurements_are_read_with_their_columns_and_units() {
        let text = "
calibrate:
  unknown: [q1, tool.x]
  measure:
    - {pose: tool, position: [x, y, z], rotation: {quaternion_xyzw: [4, 5, 6, 7]}, unit: mm, noise: 5e-5}
    - {plane: tool, normal: [0, 1, 0], from: [0, 1/2, 0], instrument: known}
";
        let file = ExperimentFile::read(text, &Info::EMPTY).unwrap();
        let found = file.calibration.unwrap();
        assert_eq!(found.unknown, ["q1", "tool.x"]);
        let [pose, plane] = &found.measured[..] else {
            panic!("{found:?}")
        };
        assert_eq!(
            (pose.kind, &*pose.columns.join(" ")),
            (MeasuredKind::Pose, "x y z")
        );
        let (convention, columns) = pose.rotation.as_ref().unwrap();
        assert_eq!(
            (&**convention, &*columns.join(" ")),
            ("quaternion_xyzw", "4 5 6 7")
        );
        assert_eq!((pose.length_factor, pose.noise), (1e-3, Some(5e-5)));
        assert_eq!(
            (plane.from, plane.normal),
            ([0.0, 0.5, 0.0], [0.0, 1.0, 0.0])
        );
        assert!(pose.unknown_instrument && !plane.unknown_instrument);
    }

    #[test]
    fn what_is_missing_or_without_effect_is_told() {
        let text = "calibrate:\n  measure:\n    - {point: tool, length: 3}\n    - {unit: mm}\n";
        let wrong = ExperimentFile::read(text, &Info::EMPTY).unwrap_err();
        let messages: Vec<&str> = wrong.0.iter().map(|mistake| &*mistake.message).collect();
        assert_eq!(
            messages,
            [
                "'point' needs the key 'position'",
                "'length' has no effect beside 'point'",
                "it does not say what is measured",
            ]
        );
    }
}
