//! Random topologies: trees, single and several loops, nested ones, loops that share bodies, loops
//! on moving bodies, branches closed on their own ancestors, overconstrained ones.

use super::draft::{Coupling, Cut, Draft, Frame, Kind, Placement, Side};
use super::draw::{Drawing, Group, below};
use crate::reference::{CutKind, Random};

const GROUPS: [Group; 8] = [
    Group::Space,
    Group::Space,
    Group::Space,
    Group::Space,
    Group::Plane,
    Group::Sphere,
    Group::Translation,
    Group::Schoenflies,
];

/// The kinds of mechanisms that are drawn.
pub const TOPOLOGIES: [&str; 8] = [
    "tree",
    "single",
    "several",
    "nested",
    "shared",
    "ancestor",
    "moving",
    "overconstrained",
];

/// Draws a mechanism; most of the drafts can be completed.
pub(super) fn draft(seed: u64, attempt: u64) -> Draft {
    let mut random = Random::new(seed.wrapping_mul(0x0100_0193).wrapping_add(attempt));
    // Further attempts of a seed keep its topology and group, so that rejects do not change the
    // mixture.
    let mut first = Random::new(seed.wrapping_mul(0x0100_0193));
    let topology = TOPOLOGIES[below(&mut first, TOPOLOGIES.len())];
    let group = GROUPS[below(&mut first, GROUPS.len())];
    // The first number of the generator is nearly the same for neighbouring seeds: skip it.
    let _ = random.uniform(0.0, 1.0);
    let mut d = Drawing::new(random, format!("r{seed}"));
    d.draft.topology = topology;
    d.draft.group = group.word();
    match topology {
        "tree" => tree(&mut d),
        "single" => {
            single(&mut d, None, group);
        }
        "several" => several(&mut d, group),
        "nested" => nested(&mut d, group),
        "shared" => shared(&mut d, group),
        "ancestor" => ancestor(&mut d, group),
        "moving" => moving(&mut d, group),
        _ => overconstrained(&mut d),
    }
    if d.draft.topology == "tree" {
        d.draft.group = "space";
    }
    if topology == "overconstrained" {
        d.draft.group = "plane";
    }
    if d.chance(0.25) {
        couple(&mut d);
    }
    screws(&mut d.draft, seed ^ attempt.rotate_right(8));
    // A limb may start from a body that is written after it.
    if d.chance(0.15) {
        d.draft.limbs.reverse();
    }
    d.draft
}

/// The pitches of helical joints, right-handed and left-handed.
const PITCHES: [&str; 5] = ["0.5", "-1.3", "2*a", "pi/2", "-4*c + 0.1"];

/// Replaces revolute joints by helical ones in every third draft whose group contains screws. It
/// draws from a separate generator, so that the other drafts do not change.
fn screws(draft: &mut Draft, seed: u64) {
    let mut random = Random::new(seed.wrapping_mul(0x9E37_79B9) ^ 0x5c4e);
    let _ = random.uniform(0.0, 1.0);
    if below(&mut random, 3) != 0 || !["space", "schoenflies"].contains(&draft.group) {
        return;
    }
    let joints = draft.limbs.iter_mut().flat_map(|limb| &mut limb.joints);
    for joint in joints.filter(|j| j.kind == Kind::Revolute) {
        if below(&mut random, 3) == 0 {
            joint.kind = Kind::Helical;
            joint.pitch = PITCHES[below(&mut random, PITCHES.len())];
        }
    }
    // prismatic cuts too if all directions are allowed: they leave as much freedom as a screw
    let rails = draft.group == "space";
    for cut in &mut draft.cuts {
        if cut.kind == CutKind::Revolute || (rails && cut.kind == CutKind::Prismatic) {
            cut.kind = CutKind::Helical;
            cut.pitch = PITCHES[below(&mut random, PITCHES.len())];
        }
    }
}

fn tree(d: &mut Drawing) {
    for limb in 0..=d.below(4) {
        let from = if limb == 0 { None } else { d.anywhere() };
        let base = d.placement(Group::Space);
        let at = d.limb(from.as_deref(), base);
        let n = 1 + d.below(3);
        d.chain(at, Group::Space, n);
    }
}

/// Draws a kind of cut that makes sense in a group; returns it with the freedom it leaves in the
/// group.
fn cut_kind(d: &mut Drawing, group: Group) -> (CutKind, usize) {
    use CutKind::{Cylindrical, Fixed, Prismatic, Revolute, Spherical, Universal};
    let kinds: &[(CutKind, usize)] = match group {
        Group::Space => &[
            (Spherical, 3),
            (Universal, 2),
            (Universal, 2),
            (Cylindrical, 2),
            (Revolute, 1),
            (Prismatic, 1),
            (Fixed, 0),
        ],
        Group::Plane => &[
            (Revolute, 1),
            (Revolute, 1),
            (Spherical, 1),
            (Cylindrical, 1),
            (Prismatic, 1),
            (Fixed, 0),
        ],
        Group::Sphere => &[(Revolute, 1), (Universal, 2), (Fixed, 0)],
        Group::Translation => &[
            (Prismatic, 1),
            (Cylindrical, 1),
            (Spherical, 0),
            (Revolute, 0),
            (Fixed, 0),
        ],
        Group::Schoenflies => &[
            (Revolute, 1),
            (Prismatic, 1),
            (Cylindrical, 2),
            (Spherical, 1),
            (Fixed, 0),
        ],
    };
    kinds[d.below(kinds.len())]
}

/// The frame of a cut in a group: in the plane, its z is normal for a revolute joint and in the
/// plane for a prismatic joint.
fn cut_frame(d: &mut Drawing, group: Group, kind: CutKind) -> Placement {
    let mut placement = d.placement(group);
    match (group, kind) {
        // A prismatic joint in the plane: z is rotated into it.
        (Group::Plane, CutKind::Prismatic) => {
            placement.rpy = ["pi/2".into(), "0".into(), d.angle()];
        }
        (Group::Schoenflies, CutKind::Prismatic) | (Group::Translation, _) => {
            placement.rpy = [d.angle(), d.angle(), d.angle()];
        }
        _ => {}
    }
    placement
}

fn add_cut(d: &mut Drawing, group: Group, kind: CutKind, a: Option<String>, b: Option<String>) {
    let placement = cut_frame(d, group, kind);
    // In a smaller group, the displacement of the cut's joint at home must belong to it too.
    let turn = |d: &mut Drawing| match d.below(3) {
        0 => 0.0,
        _ => d.random.uniform(-1.2, 1.2),
    };
    let (x, y, z) = (turn(d), turn(d), turn(d));
    let free = matches!(group, Group::Space | Group::Sphere);
    let hinge = free || matches!(group, Group::Plane | Group::Schoenflies);
    let slides = !matches!(group, Group::Plane | Group::Sphere) || kind == CutKind::Prismatic;
    let displacement = [
        if free { x } else { 0.0 },
        if free { y } else { 0.0 },
        if hinge { z } else { 0.0 },
        if slides {
            d.random.uniform(-0.3, 0.3)
        } else {
            0.0
        },
    ];
    let cone = matches!(kind, CutKind::Spherical | CutKind::Universal) && d.chance(0.2);
    let swapped = d.chance(0.5);
    // A universal cut is not swapped: its two axes are different, and it closes only from A to B.
    let swapped = swapped && kind != CutKind::Universal;
    d.draft.cuts.push(Cut {
        kind,
        pitch: "",
        a: Side { body: a, placement },
        b,
        displacement,
        swapped,
        more: if cone { ", limits: {cone: 1.4}" } else { "" },
    });
}

/// A body fixed on `from` whose frame is that of the group; in the group of all motions, `from`
/// itself.
fn ground(d: &mut Drawing, from: Option<&str>, group: Group) -> Option<String> {
    if group == Group::Space || (from.is_none() && d.chance(0.3)) {
        return from.map(String::from);
    }
    let base = d.placement(Group::Space);
    let limb = d.limb(from, base);
    d.joint(limb, Group::Space, Kind::Fixed, true)
}

fn base(d: &mut Drawing, group: Group) -> Placement {
    d.placement(group)
}

/// Adds one loop between two limbs, or between one limb and the body it starts from. Returns the
/// limbs.
fn single(d: &mut Drawing, from: Option<&str>, group: Group) -> Vec<usize> {
    let from = ground(d, from, group);
    let (kind, left) = cut_kind(d, group);
    let share = 1 + d.below(2);
    let coordinates = group.freedoms() - left + share;
    let first = if d.chance(0.5) {
        coordinates
    } else {
        1 + d.below(coordinates)
    };
    let mut limbs = Vec::new();
    for n in [first, coordinates - first] {
        if n == 0 {
            continue;
        }
        let base = base(d, group);
        let limb = d.limb(from.as_deref(), base);
        d.chain(limb, group, n);
        limbs.push(limb);
    }
    let a = d.tip(limbs[0]);
    let b = limbs.get(1).map_or(from, |l| d.tip(*l));
    add_cut(d, group, kind, a, b);
    limbs
}

fn several(d: &mut Drawing, group: Group) {
    let mut group = group;
    for _ in 0..2 + d.below(2) {
        let from = d.anywhere();
        single(d, from.as_deref(), group);
        group = GROUPS[d.below(GROUPS.len())];
    }
}

/// A loop, and further limbs from one of its bodies to another.
fn nested(d: &mut Drawing, group: Group) {
    single(d, None, group);
    for _ in 0..=d.below(2) {
        let start = d.below(d.bodies.len());
        let mut end = d.below(d.bodies.len());
        if end == start {
            end = (end + 1) % d.bodies.len();
        }
        let (start, end) = (d.bodies[start].label.clone(), d.bodies[end].label.clone());
        close_onto(d, Some(&start), Some(end), group);
    }
}

/// Adds a limb from one body whose tip is cut to another. It removes at most one degree of freedom.
fn close_onto(d: &mut Drawing, from: Option<&str>, onto: Option<String>, group: Group) {
    let (kind, left) = cut_kind(d, group);
    let share = d.below(2);
    let coordinates = (group.freedoms() - left + share).max(1);
    let base = base(d, group);
    let limb = d.limb(from, base);
    d.chain(limb, group, coordinates);
    let tip = d.tip(limb);
    add_cut(d, group, kind, tip, onto);
}

/// A platform on several legs.
fn shared(d: &mut Drawing, group: Group) {
    let moving = d.chance(0.3);
    let trunk = moving.then(|| {
        let base = d.placement(Group::Space);
        let limb = d.limb(None, base);
        d.chain(limb, Group::Space, 1);
        d.tip(limb)
    });
    let from = ground(d, trunk.flatten().as_deref(), group);
    let base = base(d, group);
    let limb = d.limb(from.as_deref(), base);
    let n = group.freedoms() - d.below(2);
    d.chain(limb, group, n);
    let platform = d.tip(limb);
    for _ in 0..=d.below(3) {
        close_onto(d, from.as_deref(), platform.clone(), group);
    }
}

/// A branch from a body that is closed on that body, or on a body before it in its own limb.
fn ancestor(d: &mut Drawing, group: Group) {
    let base = d.placement(Group::Space);
    let limb = d.limb(None, base);
    let n = 2 + d.below(2);
    d.chain(limb, group, n);
    let on_limb: Vec<String> = d.bodies.iter().map(|b| b.label.clone()).collect();
    let start = on_limb[d.below(on_limb.len())].clone();
    let end = match d.below(4) {
        0 => None,
        1 => Some(start.clone()),
        _ => Some(on_limb[d.below(on_limb.len())].clone()),
    };
    let (kind, left) = cut_kind(d, group);
    // If the branch is closed on its own start, it must be able to move by itself.
    let coordinates = (group.freedoms() - left + d.below(2)).max(1) + usize::from(d.chance(0.7));
    let placement = d.placement(group);
    let branch = d.limb(Some(&start), placement);
    d.chain(branch, group, coordinates);
    let tip = d.tip(branch);
    add_cut(d, group, kind, tip, end);
}

/// A loop carried by an arm, sometimes with an arm on the loop.
fn moving(d: &mut Drawing, group: Group) {
    let base = d.placement(Group::Space);
    let trunk = d.limb(None, base);
    let n = 1 + d.below(3);
    d.chain(trunk, Group::Space, n);
    let from = d.tip(trunk);
    let limbs = single(d, from.as_deref(), group);
    if d.chance(0.5) {
        let wrist = d.tip(limbs[0]);
        let base = d.placement(Group::Space);
        let limb = d.limb(wrist.as_deref(), base);
        let n = 1 + d.below(2);
        d.chain(limb, Group::Space, n);
    }
}

/// Cranks of equal length under one platform: a parallelogram with redundant cranks.
fn overconstrained(d: &mut Drawing) {
    let arm = d.chance(0.4).then(|| {
        let base = d.placement(Group::Space);
        let limb = d.limb(None, base);
        d.chain(limb, Group::Space, 1);
        d.tip(limb)
    });
    let from = ground(d, arm.flatten().as_deref(), Group::Plane);
    let angle = if d.chance(0.3) {
        "pi/3".to_owned()
    } else {
        format!("{:.3}", d.random.uniform(0.4, 2.7))
    };
    let turned = d.angle();
    let cranks = 2 + d.below(3);
    let mut platform = None;
    for crank in 0..cranks {
        let mut base = Placement::none();
        base.xyz[0] = format!("{crank}*b");
        if d.chance(0.5) {
            base.xyz[1] = d.length();
        }
        let limb = d.limb(from.as_deref(), base);
        let tip = hinge(d, limb, Frame::Same, &angle);
        if crank == 0 {
            let row = ["0", "c", "0", &turned].map(String::from);
            platform = hinge(d, limb, Frame::Dh(row), "-0.2");
            continue;
        }
        let kinds = [CutKind::Revolute, CutKind::Spherical, CutKind::Cylindrical];
        let kind = kinds[d.below(3)];
        add_cut(d, Group::Plane, kind, tip, platform.clone());
        if let Some(cut) = d.draft.cuts.last_mut() {
            cut.a.placement = Placement::none();
            cut.a.placement.xyz[0] = "c".into();
        }
    }
}

/// Adds a revolute joint about z with a home angle.
fn hinge(d: &mut Drawing, limb: usize, frame: Frame, home: &str) -> Option<String> {
    let body = d.joint(limb, Group::Plane, Kind::Revolute, true);
    if let Some(joint) = d.draft.limbs[limb].joints.last_mut() {
        joint.frame = frame;
        joint.home = vec![home.to_owned()];
    }
    body
}

/// Couples coordinates to others: no coordinate twice, none in its own form.
fn couple(d: &mut Drawing) {
    let names: Vec<String> = d
        .draft
        .joints()
        .flat_map(super::draft::Joint::coordinates)
        .collect();
    if names.len() < 2 {
        return;
    }
    for _ in 0..=d.below(2) {
        // Forms contain only earlier coordinates, so there are no cycles.
        let key = 1 + d.below(names.len() - 1);
        let mut terms = Vec::new();
        for _ in 0..=d.below(2) {
            let name = names[d.below(key)].clone();
            let factors = ["1", "-1", "0.5", "-c", "2", "1/3"];
            let factor = format!("({})", factors[d.below(factors.len())]);
            if !terms.iter().any(|(_, n)| *n == name) {
                terms.push((factor, name));
            }
        }
        let key = names[key].clone();
        if !d.draft.couplings.iter().any(|c| c.key == key) {
            d.draft.couplings.push(Coupling { key, terms });
        }
    }
}
