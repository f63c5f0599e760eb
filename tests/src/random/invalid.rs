//! Makes invalid variants of a spec, and checks that each error points at the line of the mistake.

use std::panic::{AssertUnwindSafe, catch_unwind};

use regen_codegen::diag::{Report, Source};
use regen_codegen::pipeline::{BaseSource, DeriveError, derive_with};

use super::Sample;
use super::draw::below;
use crate::reference::Random;

/// An invalid variant of a spec.
struct Mistake {
    /// The name of the mistake.
    name: &'static str,
    text: String,
    /// The lines that the error may point at.
    lines: Vec<usize>,
    /// Words that the error must contain.
    says: &'static str,
}

/// Tries every mistake that is possible in the spec, and some random changes. Returns the number of
/// variants.
///
/// # Errors
/// The first variant that is accepted, causes a panic, or has an error that points elsewhere.
pub fn check_invalid_variants(sample: &Sample, seed: u64) -> Result<usize, String> {
    let mut random = Random::new(seed ^ 0x0bad);
    let mistakes = mistakes(&sample.text, &mut random);
    for mistake in &mistakes {
        let report = refused(&mistake.text)
            .map_err(|e| format!("{}: {e}", mistake.name))?
            .ok_or_else(|| format!("{} is accepted:\n{}", mistake.name, mistake.text))?;
        let lines: Vec<usize> = report.shown().map(|s| s.line()).collect();
        if !lines.iter().any(|l| mistake.lines.contains(l)) {
            let expected = &mistake.lines;
            return Err(format!(
                "{}: at {lines:?} and not {expected:?}:\n{report}",
                mistake.name
            ));
        }
        let text = report.to_string();
        if !text.contains(mistake.says) {
            return Err(format!(
                "{}: no `{}` in:\n{report}",
                mistake.name, mistake.says
            ));
        }
    }
    let changes = 6;
    for _ in 0..changes {
        let text = mutated(&sample.text, &mut random);
        refused(&text).map_err(|e| format!("{e} of:\n{text}"))?;
    }
    independent(sample)?;
    Ok(mistakes.len() + changes + 1)
}

/// The errors of a text, if it has any. Fails if one of them has no place in the text.
fn refused(text: &str) -> Result<Option<Report>, String> {
    let source = Source::new("altered.yaml", text);
    let derived = catch_unwind(AssertUnwindSafe(|| derive_with(&source, BaseSource::Skip)));
    let report = match derived {
        Err(_) => return Err("a panic".into()),
        Ok(Ok(_)) => return Ok(None),
        Ok(Err(DeriveError::Spec(report))) => *report,
        Ok(Err(other)) => return Err(format!("{other:?}")),
    };
    if report.diagnostics.is_empty() {
        return Err("an error without a message".into());
    }
    let count = text.split('\n').count();
    for shown in report.shown() {
        let span = shown.diagnostic().span;
        if shown.line() > count || text.get(span.start..span.end).is_none() {
            return Err(format!("a place outside the text: {span:?}"));
        }
    }
    Ok(Some(report))
}

/// Checks that a wrong number of independent coordinates is refused, and that the error gives the
/// mobility and a choice that is then accepted.
fn independent(sample: &Sample) -> Result<(), String> {
    let dof = sample.independent.len();
    let body: Vec<&str> = sample
        .text
        .split_inclusive('\n')
        .filter(|line| !line.starts_with("independent:"))
        .collect();
    let body = body.concat();
    // One too few, or, if there is only one, one too many.
    let mechanism = &sample.mechanism;
    let coupled = |k: &usize| mechanism.couplings.iter().any(|c| c.key == *k);
    let dependent = mechanism.dependent.iter().find(|k| !coupled(k));
    let wrong = match (dof, dependent) {
        (1, Some(k)) => vec![
            sample.independent[0].clone(),
            mechanism.coordinates[*k].clone(),
        ],
        // All other coordinates are coupled to this one: no other can be listed.
        (1, None) => return Ok(()),
        _ => sample.independent[1..].to_vec(),
    };
    let wrong = format!("{body}independent: [{}]\n", wrong.join(", "));
    let Some(report) = refused(&wrong)? else {
        return Err(format!(
            "a wrong number of independent coordinates is accepted:\n{wrong}"
        ));
    };
    let text = report.to_string();
    let stated = format!("has {dof} degree");
    if !text.contains(&stated) {
        return Err(format!("no `{stated}` in:\n{text}"));
    }
    let proposed = text
        .split_once("`independent: [")
        .and_then(|(_, rest)| rest.split_once("]`"))
        .map(|(list, _)| list)
        .ok_or_else(|| format!("no choice is proposed:\n{text}"))?;
    if proposed.split(", ").count() != dof {
        return Err(format!("{proposed} are not {dof} coordinates"));
    }
    let accepted = format!("{body}independent: [{proposed}]\n");
    match refused(&accepted)? {
        None => Ok(()),
        // With a home that is not closed, other independent coordinates may be unable to close it.
        Some(report)
            if sample.draft.off_home > 0.0 && report.to_string().contains("do not close") =>
        {
            Ok(())
        }
        Some(report) => Err(format!(
            "the proposed [{proposed}] is refused:\n{report}\n{accepted}"
        )),
    }
}

/// The mistakes that are possible in the text.
fn mistakes(text: &str, random: &mut Random) -> Vec<Mistake> {
    let mut out = Vec::new();
    let lines: Vec<&str> = text.lines().collect();
    let mut swap = |name: &'static str, from: &str, to: &str, says: &'static str| {
        // A random line that contains it.
        let places: Vec<usize> = (0..lines.len())
            .filter(|l| lines[*l].contains(from))
            .collect();
        if places.is_empty() {
            return;
        }
        let at = places[below(random, places.len())];
        let mut altered: Vec<String> = lines.iter().map(|l| (*l).to_owned()).collect();
        altered[at] = lines[at].replacen(from, to, 1);
        out.push(Mistake {
            name,
            text: altered.join("\n") + "\n",
            lines: vec![at + 1],
            says,
        });
    };
    swap("an unknown key", "type:", "tipe:", "did you mean 'type'");
    swap(
        "an unknown joint type",
        "type: revolute",
        "type: revolut",
        "did you mean 'revolute'",
    );
    swap("an unknown axis", "axis: x", "axis: w", "'w'");
    swap("two frames", "dh: {", "origin: {}, dh: {", "origin");
    swap("a division by zero", "c: 0.15", "c: 0.15/0", "zero");
    swap("a root of a negative number", "[", "[sqrt(-1), ", "");
    swap("an unknown name", "rpy: [", "rpy: [nobody*", "nobody");
    swap(
        "a limb from nowhere",
        "joints:",
        "from: nowhere\n    joints:",
        "",
    );
    swap(
        "a cut at an unknown body",
        "between: [{body: ",
        "between: [{body: no_",
        "no_",
    );
    swap(
        "a wrong value",
        "actuated: true",
        "actuated: maybe",
        "maybe",
    );
    swap(
        "limits in descending order",
        "position: [-3, 3]",
        "position: [3, -3]",
        "above",
    );
    swap(
        "an unknown coordinate",
        "independent: [",
        "independent: [nobody, ",
        "nobody",
    );
    swap(
        "an unknown coordinate in home",
        "home: {",
        "home: {nobody: 1, ",
        "nobody",
    );
    swap("text for a number", "c: 0.15", "c: [0.15]", "");
    swap(
        "a coupling with itself",
        "couplings: {",
        "couplings: {j0: j0, ",
        "",
    );
    // if the limb already has a `from`, the new one is a duplicate, and the error may be on either
    // line
    for mistake in &mut out {
        if mistake.name == "a limb from nowhere" {
            let at = mistake.lines[0];
            mistake.lines = vec![at.saturating_sub(1), at.saturating_sub(2), at, at + 1];
        }
    }
    out
}

/// Numbers that are special cases at some place of a spec.
const NUMBERS: [&str; 12] = [
    "0", "1", "-1", "2", "1e-9", "1e9", "1e-300", "1e300", "1/3", "pi/2", "sqrt(2)", "-0.3",
];
const KINDS: [&str; 6] = [
    "revolute",
    "prismatic",
    "cylindrical",
    "universal",
    "spherical",
    "fixed",
];

/// The text with a number or joint type replaced, or without one of its lines. It may still be a
/// valid spec.
fn mutated(text: &str, random: &mut Random) -> String {
    let mut out = text.to_owned();
    for _ in 0..=below(random, 2) {
        out = match below(random, 4) {
            0 => {
                let words: Vec<(usize, &str)> =
                    KINDS.iter().flat_map(|k| out.match_indices(k)).collect();
                if words.is_empty() {
                    continue;
                }
                let (at, old) = words[below(random, words.len())];
                let new = KINDS[below(random, KINDS.len())];
                format!("{}{new}{}", &out[..at], &out[at + old.len()..])
            }
            1 => {
                let lines: Vec<&str> = out.split_inclusive('\n').collect();
                let gone = below(random, lines.len());
                let kept = lines.iter().enumerate().filter(|(i, _)| *i != gone);
                kept.map(|(_, l)| *l).collect()
            }
            _ => {
                let entries: Vec<usize> =
                    out.match_indices([' ', '[']).map(|(i, _)| i + 1).collect();
                let at = entries[below(random, entries.len())];
                let end = out[at..]
                    .find([',', ']', '}', '\n'])
                    .map_or(out.len(), |e| at + e);
                let is_number = out[at..end].parse::<f64>().is_ok();
                if !is_number {
                    continue;
                }
                let new = NUMBERS[below(random, NUMBERS.len())];
                format!("{}{new}{}", &out[..at], &out[end..])
            }
        };
    }
    out
}
