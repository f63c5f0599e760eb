//! A spec as parts that can be drawn, left out and written: shrinking works on them.

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

/// The placement of a joint on the preceding body.
#[derive(Clone, Debug, PartialEq)]
pub enum Frame {
    /// The same frame.
    Same,
    /// Denavit-Hartenberg parameters: alpha, a, d, theta.
    Dh([String; 4]),
    /// An arbitrary placement.
    Origin(Placement),
}

/// A joint type of a limb.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// One rotation.
    Revolute,
    /// One translation.
    Prismatic,
    /// A rotation and a proportional translation: a screw.
    Helical,
    /// A rotation and a translation.
    Cylindrical,
    /// Two rotations.
    Universal,
    /// Three rotations.
    Spherical,
    /// No coordinate.
    Fixed,
}

impl Kind {
    /// All joint types.
    pub const ALL: [Kind; 7] = [
        Kind::Revolute,
        Kind::Prismatic,
        Kind::Helical,
        Kind::Cylindrical,
        Kind::Universal,
        Kind::Spherical,
        Kind::Fixed,
    ];

    /// The name in the spec.
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

/// The name of a cut's joint type in the spec.
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
    /// Its placement on the preceding body.
    pub frame: Frame,
    /// The axis of a joint of one coordinate; "z" is not written.
    pub axis: &'static str,
    /// The pitch of a helical joint.
    pub pitch: &'static str,
    /// The label of the body that it carries.
    pub body: Option<String>,
    /// Whether it is actuated.
    pub actuated: bool,
    /// Its kind of friction.
    pub friction: &'static str,
    /// Whether it has a rotor.
    pub rotor: bool,
    /// More keys of the same line: limits, nominal values.
    pub more: String,
    /// The home value of each coordinate, as text.
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
    /// The body that the limb starts from; `None` is the world.
    pub from: Option<String>,
    /// The placement of its first frame on that body.
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

/// A cut joint. The placement of its second side is computed so that the loop closes at home.
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
    /// The displacement of the cut's joint at home: rotations about x, y, z and a translation along
    /// z, of which the joint's own freedoms are used.
    pub displacement: [f64; 4],
    /// Whether frame A is written second.
    pub swapped: bool,
    /// Further keys: a cone.
    pub more: &'static str,
}

/// A coupling. Its constant is computed so that the coupling is satisfied at home.
#[derive(Clone, Debug, PartialEq)]
pub struct Coupling {
    /// The coordinate that the coupling determines.
    pub key: String,
    /// The other coordinates and their factors, as text.
    pub terms: Vec<(String, String)>,
}

/// Which coordinates are actuated, besides those of joints marked as actuated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Actuation {
    /// The joints with independent coordinates; the spec omits `independent` where that is the
    /// default.
    Independent,
    /// Only the joints marked as actuated: there may be passive freedoms, or more actuators than
    /// freedoms.
    AsDrawn,
}

/// A spec in parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Draft {
    /// The module's name.
    pub name: String,
    /// The topology of its loops, see `TOPOLOGIES`.
    pub topology: &'static str,
    /// The displacement group of its loops.
    pub group: &'static str,
    /// Gravity, m/s^2; `None` omits the key.
    pub gravity: Option<[String; 3]>,
    /// Named constants.
    pub geometry: Vec<(String, String)>,
    /// The tree.
    pub limbs: Vec<Limb>,
    /// The cuts.
    pub cuts: Vec<Cut>,
    /// The couplings.
    pub couplings: Vec<Coupling>,
    /// The actuated coordinates.
    pub actuation: Actuation,
    /// The seed of the choice of independent coordinates.
    pub choice: u64,
    /// The distance of home's dependent coordinates from closed ones.
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

    /// The text of the spec up to its limbs.
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

    /// Home as drawn, for all coordinates.
    pub(super) fn home_pairs(&self) -> Vec<(String, String)> {
        let pairs = self
            .joints()
            .flat_map(|j| j.coordinates().into_iter().zip(j.home.iter().cloned()));
        pairs.collect()
    }
}

/// The line `home: {...}`, without zeros.
pub(super) fn home_text(pairs: &[(String, String)]) -> String {
    let given = pairs.iter().filter(|(_, v)| v != "0");
    let given: Vec<String> = given.map(|(k, v)| format!("{k}: {v}")).collect();
    if given.is_empty() {
        String::new()
    } else {
        format!("home: {{{}}}\n", given.join(", "))
    }
}

/// One side of a cut as text.
pub(super) fn side_text(body: Option<&String>, placement: &Placement) -> String {
    let body = body.map_or("world", String::as_str);
    let placement = placement.to_string();
    if placement.is_empty() {
        format!("{{body: {body}}}")
    } else {
        format!("{{body: {body}, {placement}}}")
    }
}
