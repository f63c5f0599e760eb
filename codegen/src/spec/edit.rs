//! Replaces values in a spec's text; every other byte of it stays the same.

use super::{Quantity, Spanned, Spec};
use crate::diag::Span;

/// A replacement in a text: the bytes of `span` become `text`.
struct Change {
    span: Span,
    text: String,
}

/// Returns a spec's text with other `nominal:` values at its joints and springs, and notes on values
/// that could not be written.
///
/// - `value`: the value of a symbol, such as `Fv`, at a coordinate or spring; joints and springs
///   without any known value are not changed.
///
/// A joint has one nominal value for all its coordinates: where their values differ, none is
/// written.
///
/// ```
/// use regen_codegen::diag::Source;
/// use regen_codegen::spec::{edit::with_nominal, parse};
///
/// let text = "\
/// name: arm
/// limbs:
///   - name: arm
///     joints:
///       - {name: q1, type: revolute, body: link, actuated: true, friction: viscous}
/// ";
/// let spec = parse(&Source::new("arm.yaml", text))?;
/// let (text, notes) = with_nominal(text, &spec, &|_, symbol| (symbol == "Fv").then_some(0.5));
/// assert!(text.contains("{name: q1, type: revolute, nominal: {Fv: 0.5}, body: link,"));
/// assert!(notes.is_empty());
/// # Ok::<(), regen_codegen::diag::Report>(())
/// ```
pub fn with_nominal(
    text: &str,
    spec: &Spec,
    value: &dyn Fn(&str, &str) -> Option<f64>,
) -> (String, Vec<String>) {
    let mut changes = Vec::new();
    let mut notes = Vec::new();
    for joint in spec.limbs.iter().flat_map(|limb| &limb.joints) {
        let coordinates = joint.coordinates();
        let symbols = joint.friction.symbols().iter().copied();
        let mut wanted: Vec<(&str, f64)> = Vec::new();
        let symbols = symbols
            .chain(joint.offset.then_some("Fo"))
            .chain(joint.rotor_inertia.then_some("J"))
            .chain(joint.spring.as_ref().map(|_| "K"))
            .chain(joint.terms.iter().map(|(name, _)| name.value.as_str()));
        for symbol in symbols {
            let values: Vec<Option<f64>> = coordinates.iter().map(|c| value(c, symbol)).collect();
            match values.split_first() {
                Some((Some(first), rest)) if rest.iter().all(|v| *v == Some(*first)) => {
                    wanted.push((symbol, *first));
                }
                Some((Some(_), _)) => notes.push(format!(
                    "{symbol} of {} is not written: a spec has one nominal value for all \
                     coordinates of a joint, and theirs differ",
                    coordinates.join(", ")
                )),
                _ => {}
            }
        }
        nominal(text, &joint.nominal, joint.kind.span, &wanted, &mut changes);
    }
    for spring in &spec.springs {
        let symbols = spring.force.symbols().iter();
        let wanted =
            symbols.filter_map(|symbol| Some((*symbol, value(&spring.name.value, symbol)?)));
        let wanted: Vec<(&str, f64)> = wanted.collect();
        nominal(
            text,
            &spring.nominal,
            spring.name.span,
            &wanted,
            &mut changes,
        );
    }
    (changed(text, changes), notes)
}

/// Appends the changes that give a joint or a spring these nominal values.
///
/// - `stated`: the values that it has;
/// - `anchor`: the place of a value of the mapping, behind which new values are inserted.
fn nominal(
    text: &str,
    stated: &[(Spanned<String>, Quantity)],
    anchor: Span,
    wanted: &[(&str, f64)],
    changes: &mut Vec<Change>,
) {
    if wanted.is_empty() {
        return;
    }
    let mut remaining: Vec<(&str, f64)> = wanted.to_vec();
    for (symbol, quantity) in stated {
        let entry = Span::new(symbol.span.start, quantity.span.end);
        if let Some(k) = remaining.iter().position(|(s, _)| *s == symbol.value) {
            let (_, value) = remaining.remove(k);
            changes.push(Change {
                span: quantity.span,
                text: number(value),
            });
            continue;
        }
        // an unsigned `Fc` gave the values of both directions
        let signs = ["+", "-"].map(|sign| format!("{}{sign}", symbol.value));
        let (own, others): (Vec<_>, Vec<_>) = remaining
            .iter()
            .partition(|(s, _)| signs.iter().any(|sign| sign == s));
        if !own.is_empty() {
            remaining = others;
            changes.push(Change {
                span: entry,
                text: own
                    .iter()
                    .map(pair)
                    .collect::<Vec<_>>()
                    .join(&separator(text, &entry)),
            });
        }
    }
    if remaining.is_empty() {
        return;
    }
    let pairs: Vec<String> = remaining.iter().map(pair).collect();
    let (span, added) = if let Some((symbol, quantity)) = stated.last() {
        let entry = Span::new(symbol.span.start, quantity.span.end);
        let separator = separator(text, &entry);
        let more = pairs.iter().map(|pair| format!("{separator}{pair}"));
        (quantity.span, more.collect::<String>())
    } else {
        let separator = separator(text, &anchor);
        let map = format!("{separator}nominal: {{{}}}", pairs.join(", "));
        (anchor, map)
    };
    changes.push(Change {
        span: Span::new(behind_quote(text, span.end), behind_quote(text, span.end)),
        text: added,
    });
}

/// The separator between two entries of the mapping that contains this entry (or value): a comma,
/// or a new line with the same indentation.
fn separator(text: &str, entry: &Span) -> String {
    let behind = text
        .get(behind_quote(text, entry.end)..)
        .unwrap_or_default();
    if in_braces(behind) {
        return ", ".to_owned();
    }
    let before = text.get(..entry.start).unwrap_or_default();
    let line = before.rfind('\n').map_or(0, |k| k + 1);
    let line = text.get(line..).unwrap_or_default();
    let indent = line.find(|c: char| c != ' ' && c != '-').unwrap_or(0);
    // a list's dash counts as indentation: the entry begins after it
    format!("\n{:indent$}", "")
}

/// Whether the text continues, after blanks and comments, with a comma or a closing brace.
fn in_braces(behind: &str) -> bool {
    let mut rest = behind.trim_start();
    while rest.starts_with('#') {
        rest = rest
            .split_once('\n')
            .map_or("", |(_, next)| next)
            .trim_start();
    }
    rest.starts_with([',', '}'])
}

/// The position after the quote that may close a scalar at `end`.
fn behind_quote(text: &str, end: usize) -> usize {
    let quoted = text.get(end..).is_some_and(|t| t.starts_with(['"', '\'']));
    if quoted { end + 1 } else { end }
}

fn pair((symbol, value): &(&str, f64)) -> String {
    format!("{symbol}: {}", number(*value))
}

/// A number that reads back to the same double; adding zero turns a negative zero into zero.
fn number(value: f64) -> String {
    format!("{:?}", value + 0.0)
}

/// The text with all changes made; changes must not overlap.
fn changed(text: &str, mut changes: Vec<Change>) -> String {
    changes.sort_by_key(|change| (change.span.start, change.span.end));
    let mut out = String::with_capacity(text.len());
    let mut at = 0;
    for change in changes {
        out.push_str(text.get(at..change.span.start).unwrap_or_default());
        out.push_str(&change.text);
        at = change.span.end;
    }
    out.push_str(text.get(at..).unwrap_or_default());
    out
}

/// Returns a spec's text with other values of some names of `geometry`, each an expression.
///
/// # Errors
/// The first name that the spec does not have.
///
/// ```
/// use regen_codegen::diag::Source;
/// use regen_codegen::spec::{edit::with_geometry, parse};
///
/// let text = "\
/// name: arm
/// geometry: {alpha: 0.7}
/// limbs:
///   - name: arm
///     joints:
///       - {name: q1, type: revolute, dh: {alpha: alpha}, body: link, actuated: true}
/// ";
/// let spec = parse(&Source::new("arm.yaml", text))?;
/// let other = with_geometry(text, &spec, &[("alpha", "pi/2")]);
/// assert!(other.is_ok_and(|text| text.contains("geometry: {alpha: pi/2}")));
/// assert_eq!(with_geometry(text, &spec, &[("beta", "0")]), Err("beta"));
/// # Ok::<(), regen_codegen::diag::Report>(())
/// ```
pub fn with_geometry<'n>(
    text: &str,
    spec: &Spec,
    values: &[(&'n str, &str)],
) -> Result<String, &'n str> {
    let mut changes = Vec::new();
    for (name, value) in values {
        let mut names = spec.geometry.iter();
        let (_, quantity) = names.find(|(own, _)| own.value == *name).ok_or(*name)?;
        changes.push(Change {
            span: quantity.span,
            text: (*value).to_owned(),
        });
    }
    Ok(changed(text, changes))
}

/// Where a spec holds a placement.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Spot {
    /// Before the joint of this name, as a fixed joint of its own.
    Before(String),
    /// At side A (0) or B (1) of the cut with this index.
    Side(usize, usize),
    /// At the named frame.
    Frame(String),
}

/// A placement to be written.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedFrame {
    /// Where.
    pub spot: Spot,
    /// x, y, z, m, then roll, pitch, yaw, rad: R = Rz(y) Ry(p) Rx(r).
    pub at: [f64; 6],
}

/// Returns a spec's text with other placements: a fixed joint is inserted before a joint, and those of
/// frames and of sides of cuts are replaced.
///
/// # Errors
/// The first place that is not found in the text.
///
/// ```
/// use regen_codegen::diag::Source;
/// use regen_codegen::spec::edit::{PlacedFrame, Spot, with_placements};
/// use regen_codegen::spec::parse;
///
/// let text = "\
/// name: arm
/// limbs:
///   - name: arm
///     joints:
///       - {name: q1, type: revolute, body: link, actuated: true}
/// frames:
///   - {name: tip, body: link, xyz: [1/2, 0, 0]}
/// ";
/// let spec = parse(&Source::new("arm.yaml", text))?;
/// let at = [0.0, 0.001, 0.0, 0.0, 0.0, 0.002];
/// let before = PlacedFrame { spot: Spot::Before("q1".to_owned()), at };
/// let tip = PlacedFrame { spot: Spot::Frame("tip".to_owned()), at };
/// let text = with_placements(text, &spec, &[before, tip]).unwrap_or_default();
/// assert!(text.contains("- {type: fixed, origin: {xyz: [0.0, 0.001, 0.0], rpy: [0.0, 0.0, 0.002]}}"));
/// assert!(text.contains("body: link, rpy: [0.0, 0.0, 0.002], xyz: [0.0, 0.001, 0.0]}"));
/// # Ok::<(), regen_codegen::diag::Report>(())
/// ```
pub fn with_placements(
    text: &str,
    spec: &Spec,
    placements: &[PlacedFrame],
) -> Result<String, Spot> {
    let mut changes = Vec::new();
    for PlacedFrame { spot, at } in placements {
        let side = match spot {
            Spot::Before(name) => {
                let joints = spec.limbs.iter().flat_map(|limb| &limb.joints);
                let mut names = joints.filter_map(|joint| joint.name.as_ref());
                let joint = names.find(|own| own.value == *name);
                let change = joint.and_then(|own| fixed_joint(text, own.span.start, name, at));
                changes.push(change.ok_or_else(|| spot.clone())?);
                continue;
            }
            Spot::Side(cut, side) => spec.cuts.get(*cut).and_then(|own| own.sides.get(*side)),
            Spot::Frame(name) => {
                let mut frames = spec.frames.iter();
                frames
                    .find(|own| own.name.value == *name)
                    .map(|own| &own.on)
            }
        };
        let side = side.ok_or_else(|| spot.clone())?;
        let (xyz, rpy) = (&side.placement.xyz, &side.placement.rpy);
        let mut missing = Vec::new();
        for (key, old, new) in [("xyz", xyz, &at[..3]), ("rpy", rpy, &at[3..])] {
            if old
                .windows(2)
                .all(|pair| pair[0].span.end < pair[1].span.start)
            {
                let new = old.iter().zip(new).map(|(old, new)| Change {
                    span: old.span,
                    text: number(*new),
                });
                changes.extend(new);
            } else if new.iter().any(|x| *x != 0.0) {
                missing.push(format!("{key}: [{}]", numbers(new)));
            }
        }
        if !missing.is_empty() {
            let body = side.body.as_ref().ok_or_else(|| spot.clone())?;
            let separator = separator(text, &body.span);
            let end = behind_quote(text, body.span.end);
            let keys = missing.iter().map(|own| format!("{separator}{own}"));
            changes.push(Change {
                span: Span::new(end, end),
                text: keys.collect(),
            });
        }
    }
    Ok(changed(text, changes))
}

fn numbers(values: &[f64]) -> String {
    let texts: Vec<String> = values.iter().map(|x| number(*x)).collect();
    texts.join(", ")
}

/// A fixed joint before the joint whose name is at this byte.
fn fixed_joint(text: &str, name_at: usize, name: &str, at: &[f64; 6]) -> Option<Change> {
    let (xyz, rpy) = (numbers(&at[..3]), numbers(&at[3..]));
    let joint = format!("{{type: fixed, origin: {{xyz: [{xyz}], rpy: [{rpy}]}}}}");
    let before = text.get(..name_at)?;
    let mut line = before.rfind('\n').map_or(0, |k| k + 1);
    // the bracket that holds the name, if it is one of this line
    let mut depth = 0;
    let brace = before.get(line..)?.char_indices().rev().find(|(_, c)| {
        match c {
            '}' | ']' => depth += 1,
            '{' | '[' if depth > 0 => depth -= 1,
            '{' | '[' => return true,
            _ => {}
        }
        false
    });
    if let Some((column, '{')) = brace {
        let brace = line + column;
        let dash = before.get(line..brace)?;
        if dash.trim() != "-" {
            return Some(Change {
                span: Span::new(brace, brace),
                text: format!("{joint}, "),
            });
        }
    } else {
        // an entry in block style begins at a dash, in this line or above
        let is_own = |line: &str| line.trim_start().starts_with("- ");
        while !is_own(text.get(line..)?.lines().next()?) {
            line = text
                .get(..line.checked_sub(1)?)?
                .rfind('\n')
                .map_or(0, |k| k + 1);
        }
    }
    let indent = text.get(line..)?.find('-')?;
    let start = line + indent;
    Some(Change {
        span: Span::new(start, start),
        text: format!("- {joint} # errors of {name}\n{:indent$}", ""),
    })
}

/// Returns a spec's text with the top-level key `bodies` replaced by this block; without the key,
/// the block is added at the end.
///
/// ```
/// use regen_codegen::spec::edit::with_bodies;
///
/// let text = "name: x\nbodies:\n  1: {mass: 1}\nhome: {}\n";
/// let block = "bodies:\n  1: {mass: 2}\n";
/// assert_eq!(with_bodies(text, block), "name: x\nbodies:\n  1: {mass: 2}\nhome: {}\n");
/// ```
pub fn with_bodies(text: &str, block: &str) -> String {
    let mut out = String::with_capacity(text.len() + block.len());
    let mut inside = false;
    let mut placed = false;
    // comments and blank lines before the next key belong to that key, and stay
    let mut pending = String::new();
    for line in text.split_inclusive('\n') {
        let starts = line.starts_with(|c: char| !c.is_whitespace() && c != '#');
        if line.starts_with("bodies:") {
            inside = true;
            placed = true;
            pending.clear();
            out.push_str(block);
        } else if inside && !starts {
            if line.trim().is_empty() || line.starts_with('#') {
                pending.push_str(line);
            } else {
                pending.clear();
            }
        } else {
            inside = false;
            out.push_str(&std::mem::take(&mut pending));
            out.push_str(line);
        }
    }
    out.push_str(&pending);
    if !placed {
        if !out.ends_with('\n') {
            out.push('\n');
        }
        out.push('\n');
        out.push_str(block);
    }
    out
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::diag::Source;
    use crate::spec;

    /// A robot with joints in flow and in block style.
    const TEXT: &str = "\
name: x
limbs:
  - name: a
    joints:
      - {name: q1, type: revolute, body: 1, friction: linear, rotor_inertia: true}
      - {name: q2, type: revolute, body: 2, friction: coulomb_asymmetric, # both
         nominal: {Fc: 2, Fv: 3}, actuated: true}
      - name: q3
        type: revolute   # a comment
        body: 3
        friction: stribeck
        nominal:
          vs: 0.1  # kept
          Fc: 1
      - name: q4
        type: revolute # here
        body: 4
        friction: asymmetric
      - {name: q5, type: revolute, body: 5}
      - {name: s, type: spherical, body: 6, friction: viscous}
";

    #[test]
    fn only_the_nominal_values_of_joints_change() {
        let spec = spec::parse(&Source::new("x", TEXT)).unwrap();
        let value = |coordinate: &str, symbol: &str| {
            let place = [
                "Fv", "Fc", "Fc+", "Fc-", "Fv+", "Fv-", "J", "Fs", "vs", "delta",
            ];
            let k = place.iter().position(|s| *s == symbol)?;
            let size = coordinate.bytes().map(f64::from).sum::<f64>();
            Some(size + 0.5 * k as f64)
        };
        let (text, notes) = with_nominal(TEXT, &spec, &value);
        let expected = "\
name: x
limbs:
  - name: a
    joints:
      - {name: q1, type: revolute, nominal: {Fv: 162.0, Fc: 162.5, J: 165.0}, body: 1, friction: linear, rotor_inertia: true}
      - {name: q2, type: revolute, body: 2, friction: coulomb_asymmetric, # both
         nominal: {Fc+: 164.0, Fc-: 164.5, Fv: 163.0}, actuated: true}
      - name: q3
        type: revolute   # a comment
        body: 3
        friction: stribeck
        nominal:
          vs: 168.0  # kept
          Fc: 164.5
          Fs: 167.5
          delta: 168.5
          Fv: 164.0
      - name: q4
        type: revolute
        nominal: {Fv+: 167.0, Fc+: 166.0, Fv-: 167.5, Fc-: 166.5} # here
        body: 4
        friction: asymmetric
      - {name: q5, type: revolute, body: 5}
      - {name: s, type: spherical, body: 6, friction: viscous}
";
        assert_eq!(text, expected);
        assert_eq!(notes.len(), 1);
        assert!(
            notes[0].starts_with("Fv of s.1, s.2, s.3 is not written"),
            "{notes:?}"
        );
        // the values read back are those that were written
        let read = spec::parse(&Source::new("x", &*text)).unwrap();
        let joints = &read.limbs[0].joints;
        for joint in &joints[..4] {
            for symbol in joint.friction.symbols() {
                let own = joint.nominal_value(symbol).unwrap().value.to_f64();
                assert_eq!(Some(own), value(&joint.coordinates()[0], symbol));
            }
        }
    }

    #[test]
    fn only_the_bodies_of_a_text_are_replaced() {
        let text =
            "name: x\nbodies:\n  1: {mass: 1,\n      com: [0, 0, 0]}\n\n# about home\nhome: {}\n";
        assert_eq!(
            with_bodies(text, "bodies:\n  1: new\n"),
            "name: x\nbodies:\n  1: new\n\n# about home\nhome: {}\n"
        );
        assert_eq!(
            with_bodies("name: x", "bodies:\n  1: new\n"),
            "name: x\n\nbodies:\n  1: new\n"
        );
    }
}
