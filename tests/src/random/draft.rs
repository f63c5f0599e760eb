//! A spec as parts that can be drawn, left out and written: what shrinking works on.

use std::fmt::{self, Write as _};

use crate::reference::CutKind;

/// A placement; every entry is the text of a scalar.
#[derive(Clone, Debug, PartialEq)]
pub struct Placement {
    /// Translation.
    pub xyz: [String; 3],
    /// Roll, pitch, yaw.
    pub rpy: [String; 3],
}

impl Placement {
    /// No displacement.
    pub fn none() -> Placement {
        let zero = || [(); 3].map(|()| "0".to_owned());
        Placement {
            xyz: zero(),
            rpy: zero(),
        }
    }
}

impl fmt::Display for Placement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut keys = Vec::new();
        for (key, values) in [("xyz", &self.xyz), ("rpy", &self.rpy)] {
            if values.iter().any(|v| v != "0") {
                keys.push(format!("{key}: [{}]", values.join(", ")));
            }
        }
        f.write_str(&keys.join(", "))
    }
}

/// Where a joint stands on what comes before it.
#[derive(Clone, Debug, PartialEq)]
pub enum Frame {
    /// In place.
    Same,
    /// alpha, a, d, theta.
    Dh([String; 4]),
    /// Any placement.
    Origin(Placement),
}

/// A joint type that a limb may have, with what its coordinates slide.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// One turn.
    Revolute,
    /// One slide.
    Prismatic,
    /// A turn and a slide in proportion.
    Helical,
    /// A turn and a slide.
    Cylindrical,
    /// Two turns.
    Universal,
    /// Three turns.
    Spherical,
    /// No coordinate.
    Fixed,
}

impl Kind {
    /// All of them.
    pub const ALL: [Kind; 7] = [
        Kind::Revolute,
        Kind::Prismatic,
        Kind::Helical,
        Kind::Cylindrical,
        Kind::Universal,
        Kind::Spherical,
        Kind::Fixed,
    ];

    /// As the spec writes it.
    pub fn word(self) -> &'static str {
        match self {
            Kind::Revolute => "revolute",
            Kind::Prismatic => "prismatic",
            Kind::Helical => "helical",
            Kind::Cylindrical => "cylindrical",
            Kind::Universal => "universal",
            Kind::Spherical => "spherical",
            Kind::Fixed => "fixed",
        }
    }

    /// The number of its coordinates.
    pub fn coordinates(self) -> usize {
        match self {
            Kind::Fixed => 0,
            Kind::Revolute | Kind::Prismatic | Kind::Helical => 1,
            Kind::Cylindrical | Kind::Universal => 2,
            Kind::Spherical => 3,
        }
    }

    /// Whether coordinate k is a distance.
    pub fn slides(self, k: usize) -> bool {
        self == Kind::Prismatic || (self == Kind::Cylindrical && k == 1)
    }
}

/// A cut's joint as the spec writes it.
pub fn cut_word(kind: CutKind) -> &'static str {
    match kind {
        CutKind::Spherical => "spherical",
        CutKind::Universal => "universal",
        CutKind::Revolute => "revolute",
        CutKind::Prismatic => "prismatic",
        CutKind::Helical => "helical",
        CutKind::Cylindrical => "cylindrical",
        CutKind::Fixed => "fixed",
    }
}

/// A joint of a limb.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Its name.
    pub name: String,
    /// Its type.
    pub kind: Kind,
    /// Where it stands.
    pub frame: Frame,
    /// Its axis, with joints of one coordinate; "z" is not written.
    pub axis: &'static str,
    /// Its pitch, with helical joints.
    pub pitch: &'static str,
    /// The body carried.
    pub body: Option<String>,
    /// Whether it has a motor.
    pub actuated: bool,
    /// Its kind of friction.
    pub friction: &'static str,
    /// Whether it has a rotor.
    pub rotor: bool,
    /// More keys of the same line: limits, nominal values.
    pub more: String,
    /// The text of home, coordinate by coordinate.
    pub home: Vec<String>,
}

impl Joint {
    /// The names of its coordinates.
    pub fn coordinates(&self) -> Vec<String> {
        match self.kind.coordinates() {
            1 => vec![self.name.clone()],
            n => (1..=n).map(|k| format!("{}.{k}", self.name)).collect(),
        }
    }

    fn line(&self) -> String {
        let mut keys = vec![
            format!("name: {}", self.name),
            format!("type: {}", self.kind.word()),
        ];
        match &self.frame {
            Frame::Same => {}
            Frame::Dh([alpha, a, d, theta]) => {
                let row = [("alpha", alpha), ("a", a), ("d", d), ("theta", theta)];
                let row = row.iter().filter(|(_, v)| *v != "0");
                let row: Vec<String> = row.map(|(k, v)| format!("{k}: {v}")).collect();
                keys.push(format!("dh: {{{}}}", row.join(", ")));
            }
            Frame::Origin(placement) => keys.push(format!("origin: {{{placement}}}")),
        }
        if self.kind.coordinates() == 1 && self.axis != "z" {
            keys.push(format!("axis: {}", self.axis));
        }
        if self.kind == Kind::Helical {
            keys.push(format!("pitch: {}", self.pitch));
        }
        if let Some(body) = &self.body {
            keys.push(format!("body: {body}"));
        }
        if self.actuated {
            keys.push("actuated: true".into());
        }
        if self.friction != "none" {
            keys.push(format!("friction: {}", self.friction));
        }
        if self.rotor {
            keys.push("rotor_inertia: true".into());
        }
        if !self.more.is_empty() {
            keys.push(self.more.clone());
        }
        format!("      - {{{}}}\n", keys.join(", "))
    }
}

/// A serial branch.
#[derive(Clone, Debug, PartialEq)]
pub struct Limb {
    /// The body it starts from; `None` is the world.
    pub from: Option<String>,
    /// Its placement there.
    pub base: Placement,
    /// Its joints.
    pub joints: Vec<Joint>,
}

/// One side of a cut.
#[derive(Clone, Debug, PartialEq)]
pub struct Side {
    /// The body; `None` is the world.
    pub body: Option<String>,
    /// The frame on it.
    pub placement: Placement,
}

/// A cut; the placement of its second side is computed so that it closes at home.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut {
    /// The joint.
    pub kind: CutKind,
    /// Its pitch, if it is helical.
    pub pitch: &'static str,
    /// Frame A.
    pub a: Side,
    /// The body of frame B.
    pub b: Option<String>,
    /// How far the cut's joint is moved at home: turns about x, y, z and a slide along z, of
    /// which the joint's own freedoms are used.
    pub slack: [f64; 4],
    /// Frame A is written second.
    pub swapped: bool,
    /// More keys: a cone.
    pub more: &'static str,
}

/// A coupling; its constant is computed so that it holds at home.
#[derive(Clone, Debug, PartialEq)]
pub struct Coupling {
    /// The coordinate that is tied.
    pub key: String,
    /// Multiples of others.
    pub terms: Vec<(String, String)>,
}

/// Which coordinates have motors, beside the joints' own flags.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Actuation {
    /// The joints with independent coordinates; `independent` is left out where that fits.
    Independent,
    /// As the joints say: passive freedoms, or more motors than freedoms.
    AsDrawn,
}

/// A spec in parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Draft {
    /// The module's name.
    pub name: String,
    /// How its loops hang together.
    pub topology: &'static str,
    /// The group of motions of its loops.
    pub group: &'static str,
    /// Gravity; `None` leaves it out.
    pub gravity: Option<[String; 3]>,
    /// Named constants.
    pub geometry: Vec<(String, String)>,
    /// The tree.
    pub limbs: Vec<Limb>,
    /// The cuts.
    pub cuts: Vec<Cut>,
    /// The couplings.
    pub couplings: Vec<Coupling>,
    /// The motors.
    pub actuation: Actuation,
    /// Where the choice of independent coordinates starts.
    pub choice: u64,
    /// How far home's dependent coordinates are from closed.
    pub off_home: f64,
}

impl Draft {
    /// All joints, limb by limb.
    pub fn joints(&self) -> impl Iterator<Item = &Joint> {
        self.limbs.iter().flat_map(|l| &l.joints)
    }

    /// The labels of all bodies, limb by limb.
    pub fn bodies(&self) -> impl Iterator<Item = &String> {
        self.joints().filter_map(|j| j.body.as_ref())
    }

    /// The spec down to its limbs.
    pub(super) fn tree_text(&self) -> String {
        let mut out = format!("name: {}\n", self.name);
        if let Some(gravity) = &self.gravity {
            let _ = writeln!(out, "gravity: [{}]", gravity.join(", "));
        }
        if !self.geometry.is_empty() {
            let pairs = self.geometry.iter().map(|(k, v)| format!("{k}: {v}"));
            let _ = writeln!(
                out,
                "geometry: {{{}}}",
                pairs.collect::<Vec<_>>().join(", ")
            );
        }
        out.push_str("limbs:\n");
        for (i, limb) in self.limbs.iter().enumerate() {
            let _ = writeln!(out, "  - name: limb{i}");
            if let Some(from) = &limb.from {
                let _ = writeln!(out, "    from: {from}");
            }
            let base = limb.base.to_string();
            if !base.is_empty() {
                let _ = writeln!(out, "    base: {{{base}}}");
            }
            out.push_str("    joints:\n");
            for joint in &limb.joints {
                out.push_str(&joint.line());
            }
        }
        out
    }

    /// Home as drawn, over all coordinates.
    pub(super) fn home_pairs(&self) -> Vec<(String, String)> {
        let pairs = self
            .joints()
            .flat_map(|j| j.coordinates().into_iter().zip(j.home.iter().cloned()));
        pairs.collect()
    }
}

/// `home: {...}`, zeros left out.
pub(super) fn home_text(pairs: &[(String, String)]) -> String {
    let given = pairs.iter().filter(|(_, v)| v != "0");
    let given: Vec<String> = given.map(|(k, v)| format!("{k}: {v}")).collect();
    if given.is_empty() {
        String::new()
    } else {
        format!("home: {{{}}}\n", given.join(", "))
    }
}

/// One side of a cut as written.
pub(super) fn side_text(body: Option<&String>, placement: &Placement) -> String {
    let body = body.map_or("world", String::as_str);
    let placement = placement.to_string();
    if placement.is_empty() {
        format!("{{body: {body}}}")
    } else {
        format!("{{body: {body}, {placement}}}")
    }
}
