//! How the signals of an experiment file's runs are read and processed.

use regen_runtime::Info;

use super::Delay;
use super::shape::{Sink, below, did_you_mean};
use crate::data::{Checks, Decimal, Decision, Format, Gaps, Header, Policy, Separator, Settings};
use crate::document::{Node, NodeKind};
use crate::identify::EquationKind;
use crate::signals::Method;
use crate::states::Standstill;

/// How a file says that signals are processed.
pub(super) struct Process {
    /// The settings, without columns.
    pub(super) settings: Settings,
    pub(super) kind: EquationKind,
    pub(super) delay: Delay,
}

/// Reads all keys except those of columns and runs.
pub(super) fn read(root: &Node, info: &Info<'_>, sink: &mut Sink) -> Process {
    let process = root.get("process");
    let of = |key: &str| process.and_then(|process| process.get(key));
    let number = |key: &str| of(key).and_then(Node::number);
    let mut settings = Settings {
        format: format(root, sink),
        rate: root.get("rate").and_then(Node::number),
        poses: of("motion").and_then(Node::text) == Some("poses"),
        resample: number("resample"),
        measured_rates: of("velocities")
            .and_then(Node::text)
            .map(|word| word != "computed"),
        method: of("filter").and_then(method).unwrap_or(Method::Central),
        // poses are not differentiated
        method_by: match of("filter").or_else(|| of("motion")) {
            Some(_) => Decision::Given,
            None => Decision::Open,
        },
        decimation: of("decimate").and_then(count).unwrap_or(1),
        period: number("period"),
        ..Settings::default()
    };
    if settings.poses {
        let without = [
            "resample",
            "filter",
            "velocities",
            "decimate",
            "period",
            "energy",
            "delay",
        ];
        let given = without.iter().filter_map(|key| Some((*key, of(key)?)));
        let at_top = ["time", "rate"]
            .iter()
            .filter_map(|key| Some((*key, root.get(key)?)));
        for (key, node) in given.chain(at_top) {
            let message = format!("'{key}' is for motion, and these rows are poses at rest");
            sink.push(
                node.at,
                &format!("`{key}`"),
                message,
                "leave one of both out",
            );
        }
    }
    if let Some(checks) = root.get("checks") {
        let policy = |key: &str| checks.get(key).and_then(Node::text).and_then(policy);
        settings.policy = policy("rows").unwrap_or_default();
        settings.checks = Checks {
            outliers: policy("outliers"),
            saturated: policy("saturated"),
            stuck: policy("stuck"),
            gaps: match checks.get("gaps").and_then(Node::text) {
                Some("drop") => Gaps::Drop,
                Some("keep") => Gaps::Keep,
                Some("fail") => Gaps::Fail,
                None if policy("rows") == Some(Policy::Fail) => Gaps::Fail,
                _ => Gaps::Bridge,
            },
        };
    }
    if let Some(standstill) = of("standstill") {
        let speed = standstill.get("velocity").and_then(Node::number);
        settings.rest_speed = speed.unwrap_or(0.0);
        let effort = standstill.get("effort");
        settings.standstill = match effort.and_then(Node::text) {
            Some("keep") => Standstill::Keep,
            Some("down-weight") => Standstill::Weigh,
            _ => Standstill::Drop,
        };
        if let (Some(own), Standstill::Keep) = (standstill.get("velocity"), settings.standstill) {
            let message = "a speed below which joints rest has no effect where equations of joints \
                           at rest are used like all others (keep)";
            let path = "`process`, `standstill`, `velocity`";
            sink.push(own.at, path, message.to_owned(), "leave one of them out");
        }
        if let (Some(effort), Standstill::Weigh) = (effort, settings.standstill)
            && settings.method.smoothing().is_none()
        {
            let message = "down-weight weighs equations by how long their joints moved within \
                           the memory of a filter, and there is none";
            let remedy = "give `filter` with butterworth or local, or write leave-out or keep";
            let path = "`process`, `standstill`, `effort`";
            sink.push(effort.at, path, message.to_owned(), remedy);
        }
    }
    let named = |key: &str, only: &[usize], sink: &mut Sink| {
        let path = below("`process`", key);
        by_name(of(key), info, only, &path, sink)
    };
    let all: Vec<usize> = (0..info.coordinates.len()).collect();
    settings.deviations = named("deviations", &all, sink);
    settings.delays = named("delay", info.actuated, sink);
    let delay = match of("delay") {
        Some(node) if node.text() == Some("auto") => Delay::Auto,
        Some(node) => {
            if let Some(seconds) = node.number() {
                let names = info
                    .actuated
                    .iter()
                    .filter_map(|k| info.coordinates.get(*k));
                settings.delays = names.map(|name| ((*name).to_owned(), seconds)).collect();
            }
            Delay::Stated
        }
        None => Delay::Stated,
    };
    let kind = match number("energy") {
        Some(window) => EquationKind::Energy { window },
        None => EquationKind::Forces,
    };
    if let (Some(node), Delay::Auto, EquationKind::Energy { .. }) = (of("delay"), delay, kind) {
        let message = "delays are found from the equations of motion, not from energy".to_owned();
        sink.push(node.at, "`process`, `delay`", message, "leave out `energy`");
    }
    Process {
        settings,
        kind,
        delay,
    }
}

fn count(node: &Node) -> Option<usize> {
    node.whole().and_then(|value| usize::try_from(value).ok())
}

fn policy(word: &str) -> Option<Policy> {
    match word {
        "fail" => Some(Policy::Fail),
        "tell" => Some(Policy::Tell),
        "keep" => Some(Policy::Keep),
        "drop" => Some(Policy::Drop),
        _ => None,
    }
}

fn format(root: &Node, sink: &mut Sink) -> Format {
    let word = |key: &str| root.get(key).and_then(Node::text);
    let found = Format {
        header: match word("header") {
            Some("none") => Header::None,
            _ => Header::Auto,
        },
        separator: match word("separator") {
            Some(",") => Some(Separator::Comma),
            Some(";") => Some(Separator::Semicolon),
            Some("tab") => Some(Separator::Tab),
            Some("blank") => Some(Separator::Blank),
            _ => None,
        },
        decimal: match word("decimal") {
            Some(".") => Some(Decimal::Point),
            Some(",") => Some(Decimal::Comma),
            _ => None,
        },
    };
    if let (Some(Separator::Comma), Some(Decimal::Comma), Some(node)) =
        (found.separator, found.decimal, root.get("decimal"))
    {
        let message = "a comma cannot stand between columns and before decimals".to_owned();
        sink.push(node.at, "`decimal`", message, "");
    }
    found
}

fn method(node: &Node) -> Option<Method> {
    let part = |key: &str| node.get(key);
    if let Some(filter) = part("butterworth") {
        return Some(Method::Butterworth {
            order: filter.get("order").and_then(count)?,
            cutoff: filter.get("cutoff").and_then(Node::number)?,
        });
    }
    if let Some(local) = part("local") {
        let half_width = local.get("half_width").and_then(Node::number)?;
        return Some(Method::Local { half_width });
    }
    let series = part("fourier")?;
    Some(Method::Fourier {
        frequency: series.get("frequency").and_then(Node::number)?,
        harmonics: series.get("harmonics").and_then(count)?,
    })
}

/// The numbers of a mapping by coordinate.
///
/// - `only`: the coordinates that it may name, as indices.
fn by_name(
    node: Option<&Node>,
    info: &Info<'_>,
    only: &[usize],
    path: &str,
    sink: &mut Sink,
) -> Vec<(String, f64)> {
    let Some(NodeKind::Map(entries)) = node.map(|node| &node.kind) else {
        return Vec::new();
    };
    let known: Vec<&str> = only
        .iter()
        .filter_map(|k| info.coordinates.get(*k).copied())
        .collect();
    let mut out = Vec::new();
    for (key, value) in entries {
        if known.contains(&key.text.as_str()) {
            out.extend(value.number().map(|value| (key.text.clone(), value)));
        } else {
            let near = did_you_mean(&key.text, known.iter().copied());
            let message = format!("'{}' is none of {}{near}", key.text, known.join(" "));
            sink.push(key.at, path, message, "");
        }
    }
    out
}
