//! Checks references to limbs, joints and bodies: in cuts, independent coordinates, couplings,
//! home, bodies, and base choices.

use std::collections::BTreeMap;

use super::super::expression::{Ast, AstKind};
use super::super::labels::ParameterName;
use super::super::raw::RawCut;
use super::super::shape::{Choice, Scalar, Word};
use super::super::suggest::{did_you_mean, nearest};
use super::cycles::cycles;
use super::{Checker, duplicates, joint_name, listing, unknown, unknown_body, without_body};
use crate::diag::Diagnostic;

impl Checker<'_> {
    pub(super) fn cuts(&mut self) {
        let raw = self.raw;
        let cuts = raw.cuts.iter().flatten();
        duplicates("cut name", cuts.clone().map(|cut| &cut.name.0), self.sink);
        for cut in cuts {
            self.cut(cut);
        }
    }

    fn cut(&mut self, cut: &RawCut) {
        let [a, b] = [&cut.between[0].body.0, &cut.between[1].body.0];
        let known = self.known_bodies(&[a, b]);
        if known && a.text == b.text {
            let what = if a.text == "world" {
                "the world".into()
            } else {
                format!("body '{}'", a.text)
            };
            self.sink.push(
                b.error(format!("the cut joins {what} to itself"))
                    .secondary(a.span, "frame A is on it too")
                    .hint("a cut joins two different bodies, or a body and the world"),
            );
        }
        if let Some(cone) = cut.limits.as_ref().and_then(|limits| limits.cone.as_ref())
            && !cut.joint.value.joint().takes_cone()
        {
            let word = cut.joint.value.word();
            self.sink.push(
                Diagnostic::new(cone.ast.span, format!("a {word} cut takes no cone"))
                    .path(&*cone.path)
                    .secondary(cut.joint.span, format!("the cut is {word}"))
                    .hint("only spherical and universal cuts do"),
            );
        }
    }

    pub(super) fn frames(&mut self) {
        let frames = self.raw.frames.iter().flatten();
        let names = frames.clone().map(|frame| &frame.name.0);
        duplicates("frame name", names, self.sink);
        for frame in frames {
            self.known_bodies(&[&frame.body.0]);
        }
    }

    /// Whether bodies exist, or are the world; reports an error for each that does not.
    pub(super) fn known_bodies(&mut self, bodies: &[&Word]) -> bool {
        let mut known = true;
        for body in bodies {
            if body.text != "world" && !self.bodies.contains(&body.text) {
                known = false;
                self.sink
                    .push(unknown_body(body, &self.inventory.bodies, self.raw));
            }
        }
        known
    }

    /// Whether a coordinate exists; reports an error if not.
    fn coordinate(&mut self, word: &Word) -> bool {
        let known = self.coordinates.contains(&word.text);
        if !known {
            let fault = self.unknown_coordinate(word, &self.inventory.coordinates);
            self.sink.push(fault);
        }
        known
    }

    fn unknown_coordinate(&self, word: &Word, known: &[String]) -> Diagnostic {
        let joint = word.text.split('.').next().unwrap_or_default();
        let joints = self.raw.limbs.iter().flat_map(|limb| &limb.joints);
        let named = joints.clone().find(|other| joint_name(other) == joint);
        match named {
            None => unknown("coordinate", word, known),
            Some(named) => {
                let kind = named.kind.value;
                let own = super::super::labels::coordinates_of(joint, kind);
                word.error(format!("unknown coordinate '{}'", word.text))
                    .hint(match own.as_slice() {
                        [] => format!("joint '{joint}' is fixed and has no coordinate"),
                        [one] => format!(
                            "the {} joint '{joint}' has the one coordinate '{one}'",
                            kind.word()
                        ),
                        all => {
                            format!("the {} joint '{joint}' has {}", kind.word(), all.join(", "))
                        }
                    })
            }
        }
    }

    pub(super) fn independent(&mut self) {
        let raw = self.raw;
        let Some(independent) = &raw.independent else {
            self.default_independent();
            return;
        };
        duplicates(
            "coordinate",
            independent.value.iter().map(|name| &name.0),
            self.sink,
        );
        for name in &independent.value {
            if self.sink.is_full() {
                break;
            }
            self.coordinate(&name.0);
            let coupled = raw.couplings.iter().flat_map(|couplings| &couplings.0);
            for (key, _) in coupled {
                if key.0.text == name.0.text {
                    let message =
                        format!("'{}' is coupled, so it cannot be independent", name.0.text);
                    self.sink.push(
                        name.0
                            .error(message)
                            .secondary(key.0.span, "it follows the others here"),
                    );
                }
            }
        }
        if independent.value.is_empty() {
            self.sink.push(
                Diagnostic::new(independent.span, "no coordinate is independent")
                    .path("independent")
                    .hint("list at least one, or leave the field out to take the actuated ones"),
            );
        }
    }

    /// Checks the default: without `independent`, the actuated coordinates are independent.
    fn default_independent(&mut self) {
        let raw = self.raw;
        let joints = || raw.limbs.iter().flat_map(|limb| &limb.joints);
        let driven = joints().any(|joint| joint.actuated.value) || raw.drives().next().is_some();
        if !driven && !self.inventory.coordinates.is_empty() {
            self.sink.push(
                Diagnostic::new(raw.name.0.span, "no joint is actuated, so no coordinate is independent")
                    .hint("mark the driven joints `actuated: true`, or list coordinates under `independent:`"),
            );
        }
        for (key, _) in raw.couplings.iter().flat_map(|couplings| &couplings.0) {
            let joint = key.0.text.split('.').next().unwrap_or_default();
            let driven = joints().find(|known| known.actuated.value && joint_name(known) == joint);
            if let Some(driven) = driven {
                self.sink.push(
                    key.0
                        .error(format!(
                            "'{}' is coupled, but actuated and so independent by default",
                            key.0.text
                        ))
                        .secondary(driven.actuated.span, "actuated here")
                        .hint("name the independent coordinates under `independent:`"),
                );
            }
        }
    }

    pub(super) fn couplings(&mut self) {
        let raw = self.raw;
        let couplings = raw
            .couplings
            .as_ref()
            .map_or(&[][..], |couplings| &couplings.0);
        let places = couplings
            .iter()
            .enumerate()
            .map(|(index, (key, _))| (key.0.text.as_str(), index));
        let places: BTreeMap<&str, usize> = places.collect();
        let mut sources: Vec<Vec<usize>> = Vec::new();
        for (key, form) in couplings {
            if let Some(fault) = self.drive_in_coupling(&key.0) {
                self.sink.push(fault);
            } else {
                self.coordinate(&key.0);
            }
            let mut faults = Vec::new();
            let mut used = Vec::new();
            form.0.ast.names(&mut |ast, name| {
                used.extend(places.get(name).copied());
                if !self.sink.is_full() {
                    faults.extend(self.coupling_name(ast, name, &form.0));
                }
            });
            sources.push(used);
            for fault in faults {
                self.sink.push(fault);
            }
        }
        for cycle in cycles(&sources) {
            let members = cycle.iter().filter_map(|member| couplings.get(*member));
            let mut keys = members.map(|(key, _)| &key.0);
            if let Some(first) = keys.clone().next() {
                let names: Vec<&str> = keys.by_ref().map(|key| key.text.as_str()).collect();
                let message = format!("cyclic couplings: {} <- {}", names.join(" <- "), first.text);
                self.sink.push(
                    Diagnostic::new(first.span, message)
                        .hint("a coupled coordinate follows others that do not follow it"),
                );
            }
        }
    }

    /// Checks that a name in the form of a coupling or a drive is a joint's coordinate or a geometry
    /// name, but not both.
    pub(super) fn coupling_name(
        &self,
        ast: &Ast,
        name: &str,
        scalar: &Scalar,
    ) -> Option<Diagnostic> {
        let is_coordinate = self.coordinates.contains(name);
        let constant = self
            .geometry_index(name)
            .filter(|_| matches!(ast.kind, AstKind::Name(_)));
        let word = Word {
            text: name.to_owned(),
            span: ast.span,
            path: scalar.path.clone(),
        };
        if let Some(fault) = self.drive_in_coupling(&word) {
            return Some(fault);
        }
        match (is_coordinate, constant) {
            (true, None) | (false, Some(_)) => None,
            (true, Some(index)) => {
                let fault = word
                    .error(format!("'{name}' is both a coordinate and a geometry name"))
                    .hint("rename one of them");
                let geometry = self
                    .raw
                    .geometry
                    .as_ref()
                    .and_then(|geometry| geometry.0.get(index));
                Some(match geometry {
                    Some((key, _)) => fault.secondary(key.0.span, "the geometry name"),
                    None => fault,
                })
            }
            (false, None) => {
                let geometry = self.geometry_names();
                let joints = self.joint_coordinates();
                let known = joints.iter().chain(&geometry).map(String::as_str);
                let near = did_you_mean(name, known);
                Some(if near.is_empty() {
                    self.unknown_coordinate(&word, &joints)
                } else {
                    word.error(format!("unknown coordinate '{name}'{near}"))
                })
            }
        }
    }

    pub(super) fn home(&mut self) {
        for (key, _) in self.raw.home.iter().flat_map(|home| &home.value.0) {
            if self.sink.is_full() {
                break;
            }
            self.coordinate(&key.0);
        }
    }

    pub(super) fn bodies(&mut self) {
        for (label, _) in self.raw.bodies.iter().flat_map(|bodies| &bodies.0) {
            if self.sink.is_full() {
                break;
            }
            self.body(&label.0);
        }
    }

    fn body(&mut self, word: &Word) {
        if !self.bodies.contains(&word.text) {
            let fault = unknown("body", word, &self.inventory.bodies);
            self.sink.push(without_body(fault, word, self.raw));
        }
    }

    pub(super) fn base(&mut self) {
        let Some(base) = &self.raw.base else {
            return;
        };
        for list in [&base.eliminate, &base.drop] {
            let words: Vec<Word> = list.iter().map(|label| canonical(&label.0)).collect();
            duplicates("parameter", &words, self.sink);
            for word in &words {
                if self.sink.is_full() {
                    break;
                }
                if !self.parameters.contains(&word.text) {
                    self.sink.push(self.unknown_parameter(word));
                }
            }
        }
        for form in &base.zero {
            if self.sink.is_full() {
                break;
            }
            let mut faults = Vec::new();
            form.0
                .ast
                .names(&mut |ast, name| faults.extend(self.zero_name(ast, name, &form.0)));
            for fault in faults {
                self.sink.push(fault);
            }
        }
        duplicates(
            "body",
            base.equal.iter().flatten().map(|label| &label.0),
            self.sink,
        );
        for group in &base.equal {
            for label in group {
                self.body(&label.0);
            }
            if let [only] = group.as_slice() {
                self.sink.push(
                    only.0
                        .error(format!("body '{}' is alone in its group", only.0.text))
                        .hint("a group lists two or more bodies that are identical"),
                );
            }
        }
    }

    /// The error about an unknown parameter, which suggests another symbol if its label is known,
    /// else another label.
    fn unknown_parameter(&self, word: &Word) -> Diagnostic {
        let known = &self.inventory.parameters;
        let (symbol, label) = ParameterName::read(&word.text)
            .map(|written| (written.symbol, written.owner))
            .unwrap_or_default();
        let symbols: Vec<&str> = known
            .iter()
            .filter(|parameter| parameter.owner == label)
            .map(|parameter| parameter.symbol.as_str())
            .collect();
        let fault = |near: Option<String>| {
            let near = near.map_or_else(String::new, |near| format!("; did you mean '{near}'?"));
            word.error(format!("unknown parameter '{}'{near}", word.text))
        };
        if symbols.is_empty() {
            let labels = known
                .iter()
                .filter(|parameter| parameter.symbol == symbol)
                .map(|parameter| parameter.owner.as_str());
            let near = nearest(&label, labels.clone()).map(|near| format!("{symbol}({near})"));
            let owners: Vec<String> = labels.map(|label| format!("{symbol}({label})")).collect();
            return match (near, owners.as_slice()) {
                (Some(near), _) => fault(Some(near)),
                (None, []) => {
                    fault(None).hint("parameters are written 'Ixx(1)', 'Fv(q2)', 'J(q2)'")
                }
                (None, owners) => fault(None).hint(listing("parameter", owners)),
            };
        }
        let near = nearest(&symbol, symbols.iter().copied()).map(|near| format!("{near}({label})"));
        let own: Vec<String> = symbols
            .iter()
            .map(|symbol| format!("{symbol}({label})"))
            .collect();
        match near {
            Some(near) => fault(Some(near)),
            None => fault(None).hint(listing("parameter", &own)),
        }
    }

    /// Checks that a name in `zero` is a parameter with its label, or a geometry name.
    fn zero_name(&self, ast: &Ast, name: &str, scalar: &Scalar) -> Option<Diagnostic> {
        let word = Word {
            text: name.to_owned(),
            span: ast.span,
            path: scalar.path.clone(),
        };
        if matches!(ast.kind, AstKind::Variable(_)) {
            let known = self.parameters.contains(name);
            return (!known).then(|| self.unknown_parameter(&word));
        }
        if self.geometry_index(name).is_some() {
            return None;
        }
        let mut known = self.inventory.parameters.iter();
        Some(if known.any(|parameter| parameter.symbol == name) {
            word.error(format!("parameter '{name}' without a label"))
                .hint(format!(
                    "write '{name}(...)' with the body or coordinate it belongs to"
                ))
        } else {
            self.unknown_name(ast.span, name).path(&*scalar.path)
        })
    }
}

/// A parameter's label without blanks.
pub(in crate::spec) fn canonical(word: &Word) -> Word {
    Word {
        text: word.text.chars().filter(|c| !c.is_whitespace()).collect(),
        ..word.clone()
    }
}
