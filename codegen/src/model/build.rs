//! Builds the mechanism from the validated spec.

use crate::spec::{self, Axis, Joint, JointFrame, Spec};
use crate::sym::Number;

use super::{
    Body, Coordinate, Coupling, Cut, Link, Model, Motion, NamedFrame, Placement, Side, Step,
    SwingLimit, parameters, springs,
};

/// The single-axis motions of a joint, in order; `first` is the index of its first coordinate.
fn motions_of(joint: &Joint, first: usize) -> Vec<Motion> {
    let kind = joint.kind.value;
    let motions = kind.motions().iter().enumerate();
    let motions = motions.map(|(index, (motion, axis))| Motion {
        coordinate: first + index,
        kind: *motion,
        axis: if kind.takes_axis() { joint.axis } else { *axis },
        lead: joint.lead.clone(),
    });
    motions.collect()
}

/// The steps of a placement: xyz, then R = Rz(y) Ry(p) Rx(r).
fn placement(p: &spec::Placement) -> Placement {
    let [x, y, z] = p.xyz.clone();
    let [roll, pitch, yaw] = p.rpy.clone();
    vec![
        Step::Translate(Axis::X, x),
        Step::Translate(Axis::Y, y),
        Step::Translate(Axis::Z, z),
        Step::Rotate(Axis::Z, yaw),
        Step::Rotate(Axis::Y, pitch),
        Step::Rotate(Axis::X, roll),
    ]
}

/// The steps of a joint's frame: Rx(alpha) Tx(a) Rz(theta) Tz(d), or the given placement.
fn joint_frame(frame: &JointFrame) -> Placement {
    match frame {
        JointFrame::Dh { alpha, a, d, theta } => vec![
            Step::Rotate(Axis::X, alpha.clone()),
            Step::Translate(Axis::X, a.clone()),
            Step::Rotate(Axis::Z, theta.clone()),
            Step::Translate(Axis::Z, d.clone()),
        ],
        JointFrame::Origin(p) => placement(p),
    }
}

/// Builds the mechanism that a validated spec describes.
pub fn build(spec: &Spec) -> Model {
    let mut model = Model {
        gravity: spec.gravity.clone(),
        links: Vec::new(),
        coordinates: Vec::new(),
        bodies: Vec::new(),
        payloads: Vec::new(),
        cuts: Vec::new(),
        cones: Vec::new(),
        frames: Vec::new(),
        couplings: Vec::new(),
        joint_springs: Vec::new(),
        effort_terms: Vec::new(),
        point_springs: Vec::new(),
        drives: Vec::new(),
        independent: Vec::new(),
        dependent: Vec::new(),
        actuated: Vec::new(),
        home: Vec::new(),
        parameters: Vec::new(),
    };
    add_limbs(spec, &mut model);
    let find_body = |label: &str| {
        let body = model.bodies.iter().find(|b| b.label == label);
        body.map(|b| b.link)
    };
    let side = |s: &spec::CutSide| Side {
        link: s.body.as_ref().and_then(|b| find_body(&b.value)),
        placement: placement(&s.placement),
    };
    let payloads = spec.payloads();
    let of_payloads = model.bodies.iter().enumerate();
    model.payloads = of_payloads
        .filter(|(_, body)| payloads.contains(&body.label))
        .map(|(index, _)| index)
        .collect();
    model.cuts = spec
        .cuts
        .iter()
        .map(|cut| Cut {
            name: cut.name.value.clone(),
            kind: cut.kind.value,
            lead: cut.lead.clone(),
            sides: [side(&cut.sides[0]), side(&cut.sides[1])],
        })
        .collect();
    let frames = spec.frames.iter();
    model.frames = frames
        .map(|frame| NamedFrame {
            name: frame.name.value.clone(),
            side: side(&frame.on),
        })
        .collect();
    model.cones = cones(spec, &model);
    let find = |name: &str| model.coordinates.iter().position(|c| c.name == name);
    let couplings = spec.couplings.iter().filter_map(|(key, form)| {
        Some(Coupling {
            key: find(&key.value)?,
            constant: form.constant.value.clone(),
            terms: form
                .terms
                .iter()
                .filter_map(|(name, factor)| Some((find(&name.value)?, factor.value.clone())))
                .collect(),
        })
    });
    model.couplings = couplings.collect();
    let drives = spec.drives.iter().filter_map(|name| find(&name.value));
    model.drives = drives.collect();
    let all = model.coordinates.iter().enumerate();
    model.actuated = all.filter(|(_, c)| c.actuated).map(|(i, _)| i).collect();
    model.independent = match &spec.independent {
        Some(names) => {
            let names = names.value.iter();
            names.filter_map(|n| find(&n.value)).collect()
        }
        None => model.actuated.clone(),
    };
    model.dependent = (0..model.coordinates.len())
        .filter(|c| !model.independent.contains(c))
        .collect();
    model.home = vec![Number::zero(); model.coordinates.len()];
    for (name, value) in &spec.home {
        if let Some(at) = model.coordinates.iter().position(|c| c.name == name.value) {
            model.home[at] = value.value.clone();
        }
    }
    model.joint_springs = springs::joint_springs(spec);
    model.effort_terms = springs::effort_terms(spec);
    model.point_springs = springs::point_springs(spec, &model.bodies);
    for &at in &model.drives {
        if let Some(value) = spec.home_of_drive(&model.coordinates[at].name) {
            model.home[at] = value;
        }
    }
    model.parameters = parameters::list(spec, &model.bodies, &model.coordinates);
    model.parameters.extend(parameters::of_springs(
        &model.coordinates,
        &model.joint_springs,
        &model.effort_terms,
        &model.point_springs,
    ));
    model
}

/// The swing limits of joints, each between the placed frame and the one that the joint moves, then
/// those of cuts.
fn cones(spec: &Spec, model: &Model) -> Vec<SwingLimit> {
    let mut cones = Vec::new();
    let mut coordinate = 0;
    for joint in spec.limbs.iter().flat_map(|limb| &limb.joints) {
        let axes = joint.kind.value.coordinates();
        if let (Some(greatest), Some(name)) = (&joint.limits.cone, &joint.name)
            && axes > 0
        {
            let first = &model.links[model.coordinates[coordinate].link];
            let before = Side {
                link: first.parent,
                placement: first.placement.clone(),
            };
            let after = Side {
                link: Some(model.coordinates[coordinate + axes - 1].link),
                placement: Vec::new(),
            };
            cones.push(SwingLimit {
                name: name.value.clone(),
                greatest: greatest.value.clone(),
                sides: [before, after],
            });
        }
        coordinate += axes;
    }
    for (cut, of_model) in spec.cuts.iter().zip(&model.cuts) {
        if let Some(greatest) = &cut.limits.cone {
            cones.push(SwingLimit {
                name: cut.name.value.clone(),
                greatest: greatest.value.clone(),
                sides: of_model.sides.clone(),
            });
        }
    }
    cones
}

/// Adds links, coordinates and bodies. Coordinates and bodies are numbered in the order of the
/// spec; links with parents first, which differs if a limb starts from a body of a later limb.
fn add_limbs(spec: &Spec, model: &mut Model) {
    let mut first_coordinate = Vec::new();
    let mut first_body = Vec::new();
    for limb in &spec.limbs {
        first_coordinate.push(model.coordinates.len());
        first_body.push(model.bodies.len());
        for joint in &limb.joints {
            let axes = joint.kind.value.coordinates();
            let base = joint.name.as_ref().map_or("", |n| n.value.as_str());
            for axis in 0..axes {
                model.coordinates.push(Coordinate {
                    name: if axes == 1 {
                        base.to_owned()
                    } else {
                        format!("{base}.{}", axis + 1)
                    },
                    link: usize::MAX,
                    actuated: joint.actuated,
                    position: joint
                        .limits
                        .position
                        .as_ref()
                        .map(|[lo, hi]| [lo.value.to_f64(), hi.value.to_f64()]),
                });
            }
            if let Some(body) = &joint.body {
                model.bodies.push(Body {
                    label: body.value.clone(),
                    link: usize::MAX,
                });
            }
        }
    }
    // validation has checked that every limb is connected to the world
    let mut waiting = (0..spec.limbs.len()).collect::<Vec<_>>();
    while !waiting.is_empty() {
        let before = waiting.len();
        waiting.retain(|&l| {
            let limb = &spec.limbs[l];
            let from = match &limb.from {
                None => None,
                Some(label) => {
                    let body = model.bodies.iter().find(|b| b.label == label.value);
                    match body {
                        Some(b) if b.link != usize::MAX => Some(b.link),
                        _ => return true,
                    }
                }
            };
            add_limb(limb, from, first_coordinate[l], first_body[l], model);
            false
        });
        if waiting.len() == before {
            break;
        }
    }
}

fn add_limb(
    limb: &spec::Limb,
    from: Option<usize>,
    coordinate: usize,
    body: usize,
    model: &mut Model,
) {
    let (mut coordinate, mut body) = (coordinate, body);
    let mut parent = from;
    let mut pending = placement(&limb.base);
    for joint in &limb.joints {
        pending.extend(joint_frame(&joint.frame));
        let motions = motions_of(joint, coordinate);
        let is_rigid = motions.is_empty();
        let body_label = joint.body.as_ref().map(|b| b.value.clone());
        let last = motions.len().saturating_sub(1);
        for (index, motion) in motions.into_iter().enumerate() {
            let link = model.links.len();
            let name = match &body_label {
                Some(label) if index == last => label.clone(),
                _ => model.coordinates[coordinate].name.clone(),
            };
            model.coordinates[coordinate].link = link;
            model.links.push(Link {
                parent,
                placement: std::mem::take(&mut pending),
                motion: Some(motion),
                name,
            });
            parent = Some(link);
            coordinate += 1;
        }
        if let Some(label) = body_label {
            if is_rigid {
                let link = model.links.len();
                model.links.push(Link {
                    parent,
                    placement: std::mem::take(&mut pending),
                    motion: None,
                    name: label,
                });
                parent = Some(link);
            }
            if let Some(link) = parent {
                model.bodies[body].link = link;
            }
            body += 1;
        }
    }
}
