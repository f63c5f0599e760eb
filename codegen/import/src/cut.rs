//! Loops given on the command line, for file formats that cannot describe loops:
//! `NAME:JOINT:BODY@x,y,z[,r,p,y]:BODY[@x,y,z[,r,p,y]]`.

use std::f64::consts::PI;

use regen_codegen::diag::{Source, Span};

use crate::log::{Log, Place};
use crate::names::spec_name;
use crate::pose::Pose;
use crate::tree::{LoopCut, Side, Tree};

const KINDS: [&str; 6] = [
    "spherical",
    "universal",
    "revolute",
    "prismatic",
    "cylindrical",
    "fixed",
];

const EXAMPLE: &str = "for instance pin:revolute:coupler@0.35,0,0:rocker@0.3,0,0";

/// Adds the loop that `text` describes; errors name `name` as their source.
pub(crate) fn add(name: &str, text: &str, tree: &mut Tree, log: &mut Log) {
    let file = log.add(Source::new(name, text));
    let mut reading = Reading { file, tree, log };
    if let Some(closure) = reading.closure(text) {
        tree.closures.push(closure);
    }
}

struct Reading<'a> {
    file: usize,
    tree: &'a Tree,
    log: &'a mut Log,
}

/// A part of the text and its start in bytes.
#[derive(Clone, Copy)]
struct Part<'t>(&'t str, usize);

impl<'t> Part<'t> {
    fn split(self, by: char) -> impl Iterator<Item = Part<'t>> {
        let mut at = self.1;
        self.0.split(by).map(move |text| {
            let part = Part(text, at);
            at += text.len() + by.len_utf8();
            part
        })
    }
}

impl Reading<'_> {
    fn error(&mut self, part: Part<'_>, message: String, hint: &str) {
        let span = Span::new(part.1, part.1 + part.0.len());
        self.log.error(Place::new(self.file, span), message, hint);
    }

    fn closure(&mut self, text: &str) -> Option<LoopCut> {
        let whole = Part(text, 0);
        let parts: Vec<Part<'_>> = whole.split(':').collect();
        let [name, kind, a, b] = parts.as_slice() else {
            let message = format!("a cut has four parts between colons, not {}", parts.len());
            self.error(whole, message, EXAMPLE);
            return None;
        };
        if name.0.is_empty() || spec_name(name.0) != name.0 {
            let message = format!("'{}' cannot be a cut's name", name.0);
            self.error(*name, message, "use letters, digits and '_'");
        }
        if !KINDS.contains(&kind.0) {
            let message = format!("unknown joint type '{}'", kind.0);
            let hint = format!("cuts are {}", KINDS.join(", "));
            self.error(*kind, message, &hint);
        }
        let (first, pose) = self.side(*a)?;
        let (mut second, other) = self.side(*b)?;
        // names alone are the frames themselves
        let are_names = pose.is_none() && first.link.is_some() && second.link.is_some();
        let first = pose.map_or(first, |pose| first.then(&pose));
        if let Some(other) = other {
            second = second.then(&other);
        } else if !are_names {
            // the default: the pose of the first frame, with all coordinates at zero
            let world = self.tree.at_zero(first.link).then(&first.pose);
            second.pose = self.tree.at_zero(second.link).inverse().then(&world);
        }
        Some(LoopCut {
            name: name.0.to_owned(),
            kind: kind.0.to_owned(),
            sides: [first, second],
        })
    }

    /// The frame of a name, and the frame in it if one is given.
    fn side(&mut self, part: Part<'_>) -> Option<(Side, Option<Pose>)> {
        let mut halves = part.split('@');
        let name = halves.next()?;
        let side = if name.0 == "world" {
            Side::default()
        } else {
            let links = &self.tree.links;
            let by_spec = || {
                let link = links.iter().position(|l| spec_name(&l.name) == name.0)?;
                self.tree.frame(&links[link].name)
            };
            let Some(found) = self.tree.frame(name.0).or_else(by_spec) else {
                let links = links.iter().map(|l| l.name.as_str());
                let frames = self.tree.frames.iter().map(|(name, _)| name.as_str());
                let names: Vec<&str> = links.chain(frames).collect();
                let hint = format!(
                    "the file's bodies and frames are world, {}",
                    names.join(", ")
                );
                self.error(name, format!("no body is called '{}'", name.0), &hint);
                return None;
            };
            found
        };
        let Some(frame) = halves.next() else {
            return Some((side, None));
        };
        let mut numbers = Vec::new();
        for word in frame.split(',') {
            let Some(number) = value(word.0) else {
                let message = format!("'{}' is not a number", word.0);
                let hint = "write decimals, or multiples of pi as -2*pi/3";
                self.error(word, message, hint);
                return None;
            };
            numbers.push(number);
        }
        let pose = match numbers.as_slice() {
            [x, y, z] => Pose::shift([*x, *y, *z]),
            [x, y, z, roll, pitch, yaw] => Pose::from_rpy([*x, *y, *z], [*roll, *pitch, *yaw]),
            _ => {
                let message = format!("a frame has 3 or 6 numbers, not {}", numbers.len());
                self.error(frame, message, "write x,y,z or x,y,z,roll,pitch,yaw");
                return None;
            }
        };
        if let Some(more) = halves.next() {
            let message = "a second '@'".to_owned();
            self.error(more, message, EXAMPLE);
            return None;
        }
        Some((side, Some(pose)))
    }
}

/// Parses a decimal number or a multiple of pi: `pi`, `-pi/2`, `2*pi/3`.
pub(crate) fn value(text: &str) -> Option<f64> {
    let text = text.trim();
    if let Some((before, after)) = text.split_once("pi") {
        let factor = match before.trim() {
            "" | "+" => 1.0,
            "-" => -1.0,
            other => other.strip_suffix('*')?.trim().parse().ok()?,
        };
        let divisor = match after.trim() {
            "" => 1.0,
            other => other.strip_prefix('/')?.trim().parse().ok()?,
        };
        return Some(factor * PI / divisor).filter(|x: &f64| x.is_finite());
    }
    text.parse().ok().filter(|x: &f64| x.is_finite())
}

#[cfg(test)]
mod tests {
    use super::value;
    use std::f64::consts::PI;

    #[test]
    fn values_are_decimals_and_multiples_of_pi() {
        for (text, expected) in [
            ("0.35", Some(0.35)),
            (" -1e-3", Some(-1e-3)),
            ("pi", Some(PI)),
            ("-pi/2", Some(-PI / 2.0)),
            ("2*pi/3", Some(2.0 * PI / 3.0)),
            ("pi/0", None),
            ("pie", None),
            ("inf", None),
            ("", None),
        ] {
            assert_eq!(value(text), expected, "{text}");
        }
    }
}
