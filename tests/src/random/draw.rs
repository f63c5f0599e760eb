//! Draws the parts of a spec: numbers with deliberately special values, joints of a displacement
//! group.

use super::draft::{Actuation, Draft, Frame, Joint, Kind, Limb, Placement};
use crate::reference::Random;

/// The displacement group that the bodies of a loop stay in. In the smaller groups, rows of the
/// cuts are redundant, exactly or up to rounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Group {
    /// All motions.
    Space,
    /// Motions in the plane of x and y.
    Plane,
    /// Rotations about the origin.
    Sphere,
    /// Translations.
    Translation,
    /// Translations and rotations about z.
    Schoenflies,
}

impl Group {
    pub(super) fn word(self) -> &'static str {
        match self {
            Group::Space => "space",
            Group::Plane => "plane",
            Group::Sphere => "sphere",
            Group::Translation => "translation",
            Group::Schoenflies => "schoenflies",
        }
    }

    /// The dimension of the group.
    pub(super) fn freedoms(self) -> usize {
        match self {
            Group::Space => 6,
            Group::Schoenflies => 4,
            _ => 3,
        }
    }
}

/// A body from which limbs may start, or on which cuts may be.
#[derive(Clone, Debug)]
pub(super) struct Carried {
    pub(super) label: String,
    pub(super) limb: usize,
}

/// A draft being drawn.
pub(super) struct Drawing {
    pub(super) random: Random,
    pub(super) draft: Draft,
    pub(super) bodies: Vec<Carried>,
    joints: usize,
    /// The probability that a number is special.
    special: f64,
    /// The probability that a joint before the last one of a chain carries no body.
    massless: f64,
}

/// Lengths, some of them equal or related.
const LENGTHS: [&str; 10] = [
    "0",
    "0",
    "0",
    "a",
    "b",
    "-a",
    "c",
    "a/2",
    "a - b",
    "sqrt(3)*c",
];
const ANGLES: [&str; 10] = [
    "0", "0", "0", "0", "pi/2", "-pi/2", "pi", "pi/3", "-pi/4", "deg(30)",
];
const FRICTION: [&str; 9] = [
    "none",
    "viscous",
    "coulomb",
    "linear",
    "coulomb_asymmetric",
    "asymmetric",
    "stribeck",
    "atan",
    "power",
];

impl Drawing {
    pub(super) fn new(mut random: Random, name: String) -> Drawing {
        let special = [0.0, 0.3, 0.7, 0.95][below(&mut random, 4)];
        let massless = [0.0, 0.15, 0.4][below(&mut random, 3)];
        let gravity = match below(&mut random, 6) {
            0 => None,
            1 => Some(["0", "0", "0"].map(String::from)),
            2 => Some(["-9.81", "0", "0"].map(String::from)),
            3 => Some(["0", "g", "0"].map(String::from)),
            _ => {
                let g = random.vector(3, 9.0);
                Some([0, 1, 2].map(|k| format!("{:.2}", g[k])))
            }
        };
        let geometry = [("a", "0.3"), ("b", "0.3"), ("c", "0.15"), ("g", "9.81")];
        let geometry = geometry.map(|(k, v)| (k.to_owned(), v.to_owned())).into();
        let actuation = if below(&mut random, 2) == 0 {
            Actuation::Independent
        } else {
            Actuation::AsDrawn
        };
        let off_home = if below(&mut random, 3) == 0 {
            0.01
        } else {
            0.0
        };
        #[allow(clippy::cast_sign_loss, reason = "not negative")]
        let choice = random.uniform(0.0, 1e15) as u64;
        Drawing {
            random,
            draft: Draft {
                name,
                topology: "tree",
                group: "space",
                gravity,
                geometry,
                limbs: Vec::new(),
                cuts: Vec::new(),
                couplings: Vec::new(),
                actuation,
                choice,
                off_home,
            },
            bodies: Vec::new(),
            joints: 0,
            special,
            massless,
        }
    }

    pub(super) fn below(&mut self, n: usize) -> usize {
        below(&mut self.random, n)
    }

    pub(super) fn chance(&mut self, p: f64) -> bool {
        self.random.uniform(0.0, 1.0) < p
    }

    fn pick(&mut self, from: &[&str]) -> String {
        let at = self.below(from.len());
        from[at].to_owned()
    }

    pub(super) fn length(&mut self) -> String {
        if self.chance(self.special) {
            return self.pick(&LENGTHS);
        }
        format!("{:.3}", self.random.uniform(-0.4, 0.4))
    }

    pub(super) fn angle(&mut self) -> String {
        if self.chance(self.special) {
            return self.pick(&ANGLES);
        }
        format!("{:.3}", self.random.uniform(-1.5, 1.5))
    }

    /// A placement that is a displacement of the group.
    pub(super) fn placement(&mut self, group: Group) -> Placement {
        let mut out = Placement::none();
        if group != Group::Sphere {
            out.xyz = [(); 3].map(|()| self.length());
        }
        match group {
            Group::Plane | Group::Schoenflies => out.rpy[2] = self.angle(),
            _ => out.rpy = [(); 3].map(|()| self.angle()),
        }
        out
    }

    fn frame(&mut self, group: Group) -> Frame {
        let zero = || "0".to_owned();
        match self.below(8) {
            0 => Frame::Same,
            1..=4 => match group {
                Group::Space | Group::Translation => {
                    Frame::Dh([self.angle(), self.length(), self.length(), self.angle()])
                }
                Group::Sphere => Frame::Dh([self.angle(), zero(), zero(), self.angle()]),
                Group::Plane | Group::Schoenflies => {
                    Frame::Dh([zero(), self.length(), self.length(), self.angle()])
                }
            },
            _ => Frame::Origin(self.placement(group)),
        }
    }

    /// Adds a limb without joints; returns its index.
    pub(super) fn limb(&mut self, from: Option<&str>, base: Placement) -> usize {
        self.draft.limbs.push(Limb {
            from: from.map(String::from),
            base,
            joints: Vec::new(),
        });
        self.draft.limbs.len() - 1
    }

    /// Adds joints of a group with `coordinates` coordinates in all; the last carries a body.
    pub(super) fn chain(&mut self, limb: usize, group: Group, coordinates: usize) {
        let mut left = coordinates;
        while left > 0 {
            if self.chance(0.12) {
                self.joint(limb, group, Kind::Fixed, false);
            }
            let kind = self.kind(group, left);
            left -= kind.coordinates();
            self.joint(limb, group, kind, left == 0);
        }
    }

    fn kind(&mut self, group: Group, most: usize) -> Kind {
        use Kind::{Cylindrical, Prismatic, Revolute, Spherical, Universal};
        let kinds: &[Kind] = match group {
            Group::Space => &[
                Revolute,
                Revolute,
                Revolute,
                Prismatic,
                Cylindrical,
                Universal,
                Spherical,
            ],
            Group::Plane => &[Revolute, Revolute, Prismatic],
            Group::Sphere => &[Revolute, Revolute, Universal, Spherical],
            Group::Translation => &[Prismatic],
            Group::Schoenflies => &[Revolute, Revolute, Prismatic, Cylindrical],
        };
        loop {
            let kind = kinds[self.below(kinds.len())];
            if kind.coordinates() <= most {
                return kind;
            }
        }
    }

    /// Adds a joint of a group; returns the label of its body.
    pub(super) fn joint(
        &mut self,
        limb: usize,
        group: Group,
        kind: Kind,
        carries: bool,
    ) -> Option<String> {
        let at = self.joints;
        self.joints += 1;
        let frame = self.frame(group);
        let axis = match (group, kind) {
            (Group::Plane | Group::Schoenflies, Kind::Revolute) => "z",
            (Group::Plane, Kind::Prismatic) => ["x", "y"][self.below(2)],
            _ => ["x", "y", "z"][self.below(3)],
        };
        let massless = !carries && self.chance(self.massless);
        // Labels are integers or identifiers.
        let label = if at.is_multiple_of(3) {
            format!("{at}")
        } else {
            format!("b{at}")
        };
        let body = (!massless).then_some(label);
        let moves = kind != Kind::Fixed;
        let friction = if moves && self.chance(0.5) {
            FRICTION[self.below(FRICTION.len())]
        } else {
            "none"
        };
        let home: Vec<String> = (0..kind.coordinates())
            .map(|k| {
                if self.chance(self.special * 0.5) {
                    if kind.slides(k) {
                        self.pick(&["0", "c", "0.2"])
                    } else {
                        self.pick(&["0", "pi/2", "pi/6", "-pi/3", "0.5"])
                    }
                } else {
                    let reach = if kind.slides(k) { 0.3 } else { 1.3 };
                    format!("{:.3}", self.random.uniform(-reach, reach))
                }
            })
            .collect();
        let mut more = String::new();
        if moves && self.chance(0.15) {
            more = "limits: {position: [-3, 3], velocity: [-2, 2], effort: [-50, 50]}".into();
        }
        let joint = Joint {
            name: format!("j{at}"),
            kind,
            frame,
            axis,
            pitch: "",
            body: body.clone(),
            actuated: moves && self.chance(0.4),
            friction,
            rotor: moves && self.chance(0.3),
            more,
            home,
        };
        self.draft.limbs[limb].joints.push(joint);
        if let Some(label) = &body {
            self.bodies.push(Carried {
                label: label.clone(),
                limb,
            });
        }
        body
    }

    /// The last body of a limb.
    pub(super) fn tip(&self, limb: usize) -> Option<String> {
        let on_limb = self.bodies.iter().rfind(|b| b.limb == limb);
        on_limb.map(|b| b.label.clone())
    }

    /// A random body, or sometimes the world (`None`).
    pub(super) fn anywhere(&mut self) -> Option<String> {
        if self.bodies.is_empty() || self.chance(0.3) {
            return None;
        }
        let at = self.below(self.bodies.len());
        Some(self.bodies[at].label.clone())
    }
}

pub(super) fn below(random: &mut Random, n: usize) -> usize {
    #[allow(clippy::cast_sign_loss, reason = "not negative")]
    let k = random.uniform(0.0, n as f64) as usize;
    k.min(n - 1)
}
