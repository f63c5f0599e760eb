//! The runs of an experiment file.

use regen_runtime::Info;
use serde_json::{Map, Value};

use super::shape::{Sink, below};
use super::{Payload, PlannedRun, Purpose, columns};
use crate::data::{Join, ParsedFiles, Run};
use crate::document::Node;

/// Where the parts of a run stand in the file, for messages that later checks give; a part that is
/// missing has the place of the run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Places {
    pub(super) payload: usize,
    pub(super) controller: usize,
}

/// Reads the runs under `runs`, each with the places of its parts.
pub(super) fn read(root: &Node, info: &Info<'_>, sink: &mut Sink) -> Vec<(PlannedRun, Places)> {
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
            commands: {
                let path = below(&path, "commands");
                columns::commands(node.get("commands"), info, &path, sink)
            },
            controller: {
                let own = node.get("controller");
                own.map(|own| controller(own, info, &below(&path, "controller"), sink))
            },
        };
        let at = |part: Option<&Node>| part.map_or(node.at, |part| part.at);
        let places = Places {
            payload: at(payload),
            controller: at(node.get("controller")),
        };
        (planned, places)
    };
    runs.iter().enumerate().map(one).collect()
}

/// Reads the log of a run: its files, and which rows, times, topic or episode of them.
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
            let message = "the end is before the start".to_owned();
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
        let message = format!("{index} is not an index of an episode");
        let remedy = "episodes are counted by whole numbers from 0";
        sink.push(node.at, &format!("{path}, `episode`"), message, remedy);
    }
    #[allow(
        clippy::cast_sign_loss,
        reason = "the shape of the file admits no negative number here"
    )]
    let episode = index.map(|index| index as u64);
    #[allow(
        clippy::cast_sign_loss,
        reason = "the shape of the file admits only whole numbers from 0 here"
    )]
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
        parsed: ParsedFiles::default(),
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

/// The contents of `controller` as JSON; each pattern of joints is replaced with one key for each
/// joint that it matches.
fn controller(node: &Node, info: &Info<'_>, path: &str, sink: &mut Sink) -> Value {
    let is_joint = |key: &str| !["action", "latency", "velocity_latency", "signals"].contains(&key);
    let mut out = Map::new();
    for (key, own) in node.entries() {
        if !is_joint(&key.text) {
            out.insert(key.text.clone(), own.to_json());
            continue;
        }
        let names = columns::actuated(&key.text, info);
        if names.is_empty() {
            columns::not_actuated(key, info, path, sink);
        }
        for name in names {
            // a key that names one joint takes precedence over a pattern
            if key.text == name || node.get(&name).is_none() {
                out.insert(name, own.to_json());
            }
        }
        let ends: Vec<f64> = own
            .get("limit")
            .map(|limit| limit.items().iter().filter_map(Node::number).collect())
            .unwrap_or_default();
        if let ([low, high], Some(limit)) = (&ends[..], own.get("limit"))
            && low >= high
        {
            let path = below(&below(path, &key.text), "limit");
            let message = "the first number must be below the second".to_owned();
            sink.push(limit.at, &path, message, "");
        }
    }
    Value::Object(out)
}
