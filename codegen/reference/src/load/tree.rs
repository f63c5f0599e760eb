//! Reads limbs, joints, drives, cuts and springs into a tree of bodies.

use std::collections::BTreeMap;

use crate::expr::evaluate;
use crate::friction::Friction;
use crate::load_fields::{
    Names, dh, entries, list, pitch, placement, scalar, scalar_at, text, vector,
};
use crate::mechanism::{
    Axis, Body, Coupling, Cut, CutKind, CutSide, JointMotion, Node, PARAMETERS_PER_BODY, Parameter,
    SwingLimit,
};
use crate::random::PhysicalBody;
use crate::scalar::identity;
use crate::springs::{EffortTerm, Point, Spring, Stored};
use crate::yaml::Value;

use super::in_item;

fn pick<T: Clone>(items: &[T], which: &[usize]) -> Vec<T> {
    which.iter().map(|k| items[*k].clone()).collect()
}

/// Parses a linear form such as `-q2 + pi`: the constant, and the coefficient of each name.
fn linear_form(
    form: &str,
    names: &[String],
    constants: &BTreeMap<String, f64>,
) -> Result<(f64, Vec<f64>), String> {
    let at = |unit: Option<usize>| {
        evaluate(form, &|name| match names.iter().position(|n| n == name) {
            Some(k) => Some(if unit == Some(k) { 1.0 } else { 0.0 }),
            None => constants.get(name).copied(),
        })
    };
    let constant = at(None)?;
    let coefficients = (0..names.len())
        .map(|k| Ok(at(Some(k))? - constant))
        .collect::<Result<_, String>>()?;
    Ok((constant, coefficients))
}

/// The bodies, coordinates and parameters that have been read so far.
#[derive(Default)]
pub(super) struct Tree {
    pub(super) nodes: Vec<Node>,
    pub(super) bodies: Vec<Body>,
    pub(super) coordinates: Vec<String>,
    pub(super) actuated: Vec<usize>,
    pub(super) friction: Vec<Friction>,
    pub(super) offset: Vec<bool>,
    pub(super) rotor: Vec<bool>,
    pub(super) springs: Vec<Spring>,
    pub(super) terms: Vec<EffortTerm>,
    pub(super) nominal: BTreeMap<String, f64>,
    pub(super) cones: Vec<SwingLimit>,
}

impl Tree {
    pub(super) fn coordinate(&self, name: &str) -> Result<usize, String> {
        self.coordinates
            .iter()
            .position(|c| c == name)
            .ok_or_else(|| format!("no coordinate {name}"))
    }

    /// The node of a body, `None` for the world or a missing label.
    pub(super) fn node_of(&self, label: Option<&Value>) -> Result<Option<usize>, String> {
        let Some(label) = label else { return Ok(None) };
        let label = text(label)?;
        if label == "world" {
            return Ok(None);
        }
        match self.bodies.iter().find(|b| b.label == label) {
            Some(body) => Ok(Some(body.node)),
            None => Err(format!("no body {label}")),
        }
    }

    /// Renumbers coordinates and bodies in the order of the file: limbs may have been added in
    /// another order.
    pub(super) fn number_as_written(&mut self, coordinates: &[usize], bodies: &[usize]) {
        let place = |old: usize| coordinates.iter().position(|k| *k == old).unwrap_or(old);
        self.coordinates = pick(&self.coordinates, coordinates);
        self.friction = pick(&self.friction, coordinates);
        self.offset = pick(&self.offset, coordinates);
        self.rotor = pick(&self.rotor, coordinates);
        self.actuated = self.actuated.iter().map(|k| place(*k)).collect();
        self.actuated.sort_unstable();
        for spring in &mut self.springs {
            if let Stored::Joint { coordinate, .. } = &mut spring.stored {
                *coordinate = place(*coordinate);
            }
        }
        for term in &mut self.terms {
            term.coordinate = place(term.coordinate);
        }
        let of_spring = |spring: &Spring| match spring.stored {
            Stored::Joint { coordinate, .. } => coordinate,
            _ => usize::MAX,
        };
        self.springs.sort_by_key(of_spring);
        self.terms.sort_by_key(|term| term.coordinate);
        self.bodies = pick(&self.bodies, bodies);
        for node in &mut self.nodes {
            if let Some(motion) = &mut node.motion {
                motion.coordinate = place(motion.coordinate);
            }
        }
    }

    pub(super) fn limb(&mut self, limb: &Value, names: &Names) -> Result<(), String> {
        let from = self.node_of(limb.get("from"))?;
        let base = limb
            .get("base")
            .map_or(Ok(identity()), |v| placement(v, names))?;
        self.nodes.push(Node {
            parent: from,
            offset: base,
            motion: None,
        });
        for joint in list(limb, "joints")? {
            self.joint(joint, names).map_err(|e| in_item(joint, &e))?;
        }
        Ok(())
    }

    pub(super) fn joint(&mut self, joint: &Value, names: &Names) -> Result<(), String> {
        let offset = match (joint.get("dh"), joint.get("origin")) {
            (Some(row), None) => dh(row, names)?,
            (None, Some(origin)) => placement(origin, names)?,
            (None, None) => identity(),
            (Some(_), Some(_)) => return Err("both dh and origin".into()),
        };
        let axis = match joint.get("axis").map(text).transpose()?.as_deref() {
            None | Some("z") => Axis::Z,
            Some("y") => Axis::Y,
            Some("x") => Axis::X,
            Some(other) => return Err(format!("no axis {other}")),
        };
        let kind = text(joint.get("type").ok_or("no type")?)?;
        // The rotation and the translation per unit of the coordinate.
        let (turns, slides) = ((1.0, 0.0), (0.0, 1.0));
        let (single, motions) = match kind.as_str() {
            "revolute" => (true, vec![(turns, axis)]),
            "prismatic" => (true, vec![(slides, axis)]),
            "helical" => {
                let lead = pitch(joint, names)? / core::f64::consts::TAU;
                (true, vec![((1.0, lead), axis)])
            }
            "cylindrical" => (false, vec![(turns, Axis::Z), (slides, Axis::Z)]),
            "universal" => (false, vec![(turns, Axis::X), (turns, Axis::Y)]),
            "spherical" => (
                false,
                vec![(turns, Axis::Z), (turns, Axis::Y), (turns, Axis::X)],
            ),
            "fixed" => (false, Vec::new()),
            _ => return Err(format!("no joint type {kind}")),
        };
        self.nodes.push(Node {
            parent: Some(self.nodes.len() - 1),
            offset,
            motion: None,
        });
        for (k, (motion, axis)) in motions.iter().enumerate() {
            let name = text(joint.get("name").ok_or("no name")?)?;
            let name = if single {
                name
            } else {
                format!("{name}.{}", k + 1)
            };
            let coordinate = self.add_coordinate(name, joint, names)?;
            self.nodes.push(Node {
                parent: Some(self.nodes.len() - 1),
                offset: identity(),
                motion: Some(JointMotion {
                    axis: *axis,
                    coordinate,
                    turn: motion.0,
                    slide: motion.1,
                }),
            });
        }
        if let Some(cone) = joint.get("limits").and_then(|l| l.get("cone")) {
            // between the joint's frame before its motions and after all of them
            let last = self.nodes.len() - 1;
            let side = |node| CutSide {
                node: Some(node),
                offset: identity(),
            };
            self.cones.push(SwingLimit {
                name: text(joint.get("name").ok_or("no name")?)?,
                greatest: scalar(cone, names)?,
                sides: [side(last - motions.len()), side(last)],
            });
        }
        if let Some(label) = joint.get("body") {
            self.bodies.push(Body {
                label: text(label)?,
                node: self.nodes.len() - 1,
                nominal: None,
            });
        }
        Ok(())
    }

    pub(super) fn add_coordinate(
        &mut self,
        name: String,
        joint: &Value,
        names: &Names,
    ) -> Result<usize, String> {
        let index = self.coordinates.len();
        let flag = |key: &str| joint.get(key).is_some_and(Value::is_true);
        if flag("actuated") {
            self.actuated.push(index);
        }
        self.offset.push(flag("offset"));
        self.rotor.push(flag("rotor_inertia"));
        if let Some(spring) = joint.get("spring") {
            self.springs.push(Spring {
                label: format!("K({name})"),
                stored: Stored::Joint {
                    coordinate: index,
                    rest: scalar_at(spring, "rest", names)?,
                },
            });
        }
        for (term, factor) in entries(joint, "terms")? {
            self.terms.push(EffortTerm {
                label: format!("{term}({name})"),
                coordinate: index,
                factor: match factor {
                    Value::Integer(n) => n.to_string(),
                    Value::Float(x) => x.to_string(),
                    factor => text(factor)?,
                },
                names: names.clone(),
            });
        }
        let friction = joint.get("friction").map(text).transpose()?;
        let word = friction.as_deref().unwrap_or("none");
        let law = Friction::of(word).ok_or_else(|| format!("no friction {word}"))?;
        self.friction.push(law);
        for (symbol, value) in entries(joint, "nominal")? {
            let value = scalar(value, names)?;
            self.nominal.insert(format!("{symbol}({name})"), value);
            // A symbol without a sign also gives the value of each direction that has none of its
            // own.
            for sign in ["+", "-"] {
                self.nominal
                    .entry(format!("{symbol}{sign}({name})"))
                    .or_insert(value);
            }
        }
        self.coordinates.push(name);
        Ok(index)
    }

    /// Adds a drive as a motion of its own on the world, and reads its form in the coordinates so
    /// far.
    pub(super) fn drive(
        &mut self,
        name: &str,
        drive: &Value,
        names: &Names,
    ) -> Result<Coupling, String> {
        let form = text(drive.get("of").ok_or("no form")?)?;
        let (constant, coefficients) = linear_form(&form, &self.coordinates, names)?;
        let (turn, slide) = match drive.get("type").map(text).transpose()?.as_deref() {
            None | Some("revolute") => (1.0, 0.0),
            Some("prismatic") => (0.0, 1.0),
            Some(other) => return Err(format!("no drive type {other}")),
        };
        let key = self.add_coordinate(name.to_owned(), drive, names)?;
        self.actuated.push(key);
        self.nodes.push(Node {
            parent: None,
            offset: identity(),
            motion: Some(JointMotion {
                axis: Axis::Z,
                coordinate: key,
                turn,
                slide,
            }),
        });
        Ok(Coupling {
            key,
            constant,
            coefficients,
        })
    }

    pub(super) fn cut(&self, cut: &Value, names: &Names) -> Result<Cut, String> {
        let kind = match text(cut.get("joint").ok_or("no joint")?)?.as_str() {
            "spherical" => CutKind::Spherical,
            "universal" => CutKind::Universal,
            "revolute" => CutKind::Revolute,
            "prismatic" => CutKind::Prismatic,
            "helical" => CutKind::Helical,
            "cylindrical" => CutKind::Cylindrical,
            "fixed" => CutKind::Fixed,
            other => return Err(format!("no cut joint {other}")),
        };
        let sides: Vec<CutSide> = list(cut, "between")?
            .iter()
            .map(|side| {
                Ok(CutSide {
                    node: self.node_of(Some(side.get("body").unwrap_or(side)))?,
                    offset: placement(side, names)?,
                })
            })
            .collect::<Result<_, String>>()?;
        Ok(Cut {
            name: text(cut.get("name").ok_or("no name")?)?,
            kind,
            pitch: match kind {
                CutKind::Helical => pitch(cut, names)?,
                _ => 0.0,
            },
            sides: sides.try_into().map_err(|_| "not two sides")?,
        })
    }

    /// Adds the parameters of a spring between points.
    pub(super) fn spring(&mut self, spring: &Value, names: &Names) -> Result<(), String> {
        let name = text(spring.get("name").ok_or("no name")?)?;
        let ends: Vec<Point> = list(spring, "between")?
            .iter()
            .map(|end| {
                Ok(Point {
                    node: self.node_of(end.get("body"))?,
                    at: end.get("xyz").map_or(Ok([0.0; 3]), |v| vector(v, names))?,
                })
            })
            .collect::<Result<_, String>>()?;
        let ends: [Point; 2] = ends.try_into().map_err(|_| "not two ends")?;
        let constant = spring.get("constant").is_some_and(Value::is_true);
        let length = spring.get("length").map(|v| scalar(v, names)).transpose()?;
        let distance = |factor| Stored::Distance { ends, factor };
        let stretch = |length| Stored::Stretch { ends, length };
        let parts = match length {
            _ if constant => vec![("f", distance(1.0))],
            Some(length) => vec![("k", stretch(length))],
            None => vec![("k", stretch(0.0)), ("kl", distance(-1.0))],
        };
        for (symbol, stored) in parts {
            let label = format!("{symbol}({name})");
            self.springs.push(Spring { label, stored });
        }
        for (symbol, value) in entries(spring, "nominal")? {
            self.nominal
                .insert(format!("{symbol}({name})"), scalar(value, names)?);
        }
        Ok(())
    }

    pub(super) fn coupling(
        &self,
        key: &str,
        form: &Value,
        names: &Names,
    ) -> Result<Coupling, String> {
        let (constant, coefficients) = linear_form(&text(form)?, &self.coordinates, names)?;
        Ok(Coupling {
            key: self.coordinate(key)?,
            constant,
            coefficients,
        })
    }

    pub(super) fn nominal_body(
        &mut self,
        label: &str,
        value: &Value,
        names: &Names,
    ) -> Result<(), String> {
        let body = self
            .bodies
            .iter_mut()
            .find(|b| b.label == label)
            .ok_or_else(|| format!("no body {label}"))?;
        let mass = value.get("mass");
        let mass = mass.ok_or_else(|| format!("{label}: no mass"))?;
        let com = value.get("com").map(|com| vector(com, names));
        let inertia = value.get("inertia").map(|inertia| vector(inertia, names));
        // both may be left out, and are zero then
        let nominal = PhysicalBody {
            mass: scalar(mass, names)?,
            com: com.transpose()?.unwrap_or([0.0; 3]),
            inertia: inertia.transpose()?.unwrap_or([0.0; 6]),
        };
        body.nominal = Some(nominal.parameters());
        Ok(())
    }

    pub(super) fn parameters(&self) -> Vec<Parameter> {
        let mut out = Vec::new();
        for body in 0..self.bodies.len() {
            out.extend((0..PARAMETERS_PER_BODY).map(|k| Parameter::Inertial(body, k)));
        }
        for (coordinate, friction) in self.friction.iter().enumerate() {
            out.extend(
                friction
                    .columns
                    .iter()
                    .map(|s| Parameter::Friction(coordinate, s)),
            );
            if self.offset.get(coordinate) == Some(&true) {
                out.push(Parameter::Offset(coordinate));
            }
        }
        let rotors = self.rotor.iter().enumerate().filter(|(_, rotor)| **rotor);
        out.extend(rotors.map(|(coordinate, _)| Parameter::Rotor(coordinate)));
        let of_joint = |index: &usize| matches!(self.springs[*index].stored, Stored::Joint { .. });
        let (at_joints, between): (Vec<usize>, Vec<usize>) =
            (0..self.springs.len()).partition(of_joint);
        out.extend(at_joints.into_iter().map(Parameter::Spring));
        out.extend((0..self.terms.len()).map(Parameter::Term));
        out.extend(between.into_iter().map(Parameter::Spring));
        out
    }
}
