//! The runs of an experiment file.

use super::shape::Sink;
use super::tree::Node;
use super::{Payload, PlannedRun, Purpose};
use crate::data::{Join, Run};

/// Reads `runs`; each with the place of its payload.
pub(super) fn read(root: &Node, sink: &mut Sink) -> Vec<(PlannedRun, usize)> {
    let runs = root.get("runs").map(Node::items).unwrap_or_default();
    let one = |(k, node): (usize, &Node)| {
        let path = format!("`runs`, entry {}", k + 1);
        let payload = node.get("payload");
        let planned = PlannedRun {
            run: run(node, &path, sink),
            purpose: match node.get("use").and_then(Node::text) {
                Some("validate") => Purpose::Validate,
                _ => Purpose::Identify,
            },
            payload: payload.map_or(Payload::None, self::payload),
        };
        (planned, payload.map_or(node.at, |payload| payload.at))
    };
    runs.iter().enumerate().map(one).collect()
}

fn run(node: &Node, path: &str, sink: &mut Sink) -> Run {
    let files = node.get("files");
    let texts = files.map(|files| match files.text() {
        Some(text) => vec![text],
        None => files.items().iter().filter_map(Node::text).collect(),
    });
    let mut pair = |key: &str| {
        let node = node.get(key)?;
        let [first, last] = node.items() else {
            return None;
        };
        let (first, last) = (first.number()?, last.number()?);
        if last < first {
            let message = "the last one is before the first".to_owned();
            sink.push(node.at, &format!("{path}, `{key}`"), message, "");
        }
        Some((first, last))
    };
    let rows = pair("rows");
    let times = pair("times");
    let episode = node.get("episode");
    let index = episode.and_then(Node::number);
    if let (Some(node), Some(index)) = (episode, index)
        && index.fract() != 0.0
    {
        let message = format!("{index} is no index of an episode");
        let remedy = "episodes are counted by whole numbers from 0";
        sink.push(node.at, &format!("{path}, `episode`"), message, remedy);
    }
    #[allow(
        clippy::cast_sign_loss,
        reason = "the shape says that they are not negative"
    )]
    let episode = index.map(|index| index as u64);
    #[allow(clippy::cast_sign_loss, reason = "the shape says that they are whole")]
    let rows = rows.map(|(first, last)| (first as u64, last as u64));
    Run {
        files: texts
            .unwrap_or_default()
            .into_iter()
            .map(Into::into)
            .collect(),
        join: match node.get("join").and_then(Node::text) {
            Some("rows") => Join::Rows,
            Some("time") => Join::Time,
            _ => Join::Auto,
        },
        topic: node.get("topic").and_then(Node::text).map(str::to_owned),
        episode,
        rows,
        times,
    }
}

fn payload(node: &Node) -> Payload {
    match node.text() {
        Some("none") => return Payload::None,
        Some(_) => return Payload::UNKNOWN,
        None => {}
    }
    let numbers = |key: &str| -> Option<Vec<f64>> {
        node.get(key)?.items().iter().map(Node::number).collect()
    };
    Payload::Carried {
        body: node.get("body").and_then(Node::text).map(str::to_owned),
        mass: node.get("m").and_then(Node::number),
        com: numbers("com").and_then(|list| list.try_into().ok()),
        inertia: numbers("inertia").and_then(|list| list.try_into().ok()),
    }
}
