//! Geometry of a mechanism for drawing: the poses of all frames, joints and cuts, as numbers.
//!
//! A scene is built from a spec alone, before the loops are closed, so that a mechanism with a
//! faulty description can be drawn too.

use crate::model::{Link, Model, Side, Step, joints_of_coordinates};
use crate::spec::{Axis, Spec, SpringForce};

/// A pose in the world frame: the rotation matrix row-major (its columns are the frame's axes),
/// then the position of the origin, m.
pub type Pose = [f64; 12];

/// The pose of the world frame itself.
const WORLD: Pose = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];

/// A mechanism ready to be drawn at any coordinates, closed or not.
///
/// ```
/// use regen_codegen::{Mechanism, diag::Source};
///
/// let text = "
/// name: arm
/// gravity: [0, 0, -9.81]
/// limbs:
///   - name: arm
///     joints:
///       - {name: q1, type: revolute, axis: z, body: 1, actuated: true}
///       - {name: q2, type: prismatic, origin: {xyz: [2, 0, 0]}, axis: x, body: 2, actuated: true}
/// ";
/// let scene = Mechanism::open(&Source::new("arm.yaml", text)).unwrap().scene();
/// // A quarter turn, then 0.5 m: the second body's origin is at (0, 2.5, 0).
/// let frames = scene.frames(&[std::f64::consts::FRAC_PI_2, 0.5]);
/// let [x, y, z] = [9, 10, 11].map(|k| frames[scene.bodies[1].link][k]);
/// assert!(x.abs() < 1e-15 && (y - 2.5).abs() < 1e-15 && z == 0.0);
/// ```
#[derive(Clone, Debug)]
pub struct Scene {
    /// The robot's name.
    pub name: String,
    /// The description of the robot, if the spec gives one.
    pub description: Option<String>,
    /// The bodies with their links.
    pub bodies: Vec<Body>,
    /// The joints of the tree.
    pub joints: Vec<Joint>,
    /// The joints at which loops were cut.
    pub cuts: Vec<Cut>,
    /// The springs at joints.
    pub joint_springs: Vec<JointSpring>,
    /// The springs and constant pulls between points.
    pub springs: Vec<Spring>,
    /// The drives, which have no place in space.
    pub drives: Vec<Drive>,
    /// The names of all coordinates.
    pub coordinates: Vec<String>,
    /// Whether each coordinate is a rotation (rad) rather than a translation (m).
    pub turns: Vec<bool>,
    /// The home coordinates as the spec states them, 0 where it states none; the loops are not
    /// closed.
    pub home: Vec<f64>,
    links: Vec<Link>,
    placements: Vec<Pose>,
}

/// A body and the link that carries its frame.
#[derive(Clone, Debug)]
pub struct Body {
    /// The body's label.
    pub label: String,
    /// Index of its link in [`Scene::frames`].
    pub link: usize,
    /// Points at which the body is connected, in its own frame, m: the origin of the body or of the
    /// joint that carries it, the joints that it carries, and cuts.
    pub points: Vec<[f64; 3]>,
    /// Whether it is a payload, which is carried in some runs only.
    pub is_payload: bool,
}

/// A spring at a joint.
#[derive(Clone, Debug)]
pub struct JointSpring {
    /// The name of its coordinate.
    pub name: String,
    /// The link that the coordinate moves.
    pub link: usize,
    /// Whether the coordinate is a rotation.
    pub turns: bool,
    /// The coordinate at which the spring is relaxed, rad or m.
    pub rest: f64,
}

/// A spring or a constant pull between two points.
#[derive(Clone, Debug)]
pub struct Spring {
    /// Its name.
    pub name: String,
    /// Whether its force is constant.
    pub is_constant: bool,
    /// For each end the link that carries it (`None` is the world), and the point in the link's
    /// frame, m.
    pub ends: [(Option<usize>, [f64; 3]); 2],
}

/// A drive: its coordinate is a linear function of those of joints.
#[derive(Clone, Debug)]
pub struct Drive {
    /// Its name.
    pub name: String,
    /// Whether it is actuated.
    pub is_actuated: bool,
    /// The constant part, rad or m.
    pub constant: f64,
    /// Coordinates of joints with their factors.
    pub terms: Vec<(usize, f64)>,
}

/// A joint of the tree.
#[derive(Clone, Debug)]
pub struct Joint {
    /// Its name, as in the spec.
    pub name: String,
    /// The kind as in the spec: `revolute`, `spherical`, ...
    pub kind: &'static str,
    /// Indices of the joint's coordinates.
    pub coordinates: Vec<usize>,
    /// One link per coordinate, from the base outward; the joint carries the last one.
    pub links: Vec<usize>,
    /// The link that carries the joint; `None` is the world.
    pub parent: Option<usize>,
    /// Whether it is actuated.
    pub actuated: bool,
}

/// A joint at which a loop was cut.
#[derive(Clone, Debug)]
pub struct Cut {
    /// The name of the cut.
    pub name: String,
    /// The kind as in the spec: `spherical`, `revolute`, ...
    pub kind: &'static str,
    /// For each side, the link that carries the cut's frame (`None` is the world) and the pose of
    /// this frame in the link's.
    pub sides: [(Option<usize>, Pose); 2],
}

impl Scene {
    /// Builds the scene from the spec and its model.
    pub(crate) fn new(spec: &Spec, model: &Model) -> Self {
        let placements: Vec<Pose> = model.links.iter().map(|l| placed(&l.placement)).collect();
        let side = |side: &Side| (side.link, placed(&side.placement));
        let cuts = model.cuts.iter().map(|cut| Cut {
            name: cut.name.clone(),
            kind: cut.kind.name(),
            sides: cut.sides.each_ref().map(side),
        });
        let cuts: Vec<Cut> = cuts.collect();
        Self {
            name: spec.name.value.clone(),
            description: spec.description.clone(),
            bodies: bodies(model, &placements, &cuts),
            joints: joints(spec, model),
            cuts,
            joint_springs: joint_springs(model),
            springs: springs(model),
            drives: drives(model),
            coordinates: model.coordinates.iter().map(|c| c.name.clone()).collect(),
            turns: (0..model.coordinates.len())
                .map(|c| !model.slides(c))
                .collect(),
            home: model.home.iter().map(crate::sym::Number::to_f64).collect(),
            placements,
            links: model.links.clone(),
        }
    }

    /// The frames of all links in the world.
    ///
    /// - `q`: n coordinates, rad or m; missing ones count as 0.
    pub fn frames(&self, q: &[f64]) -> Vec<Pose> {
        let mut frames: Vec<Pose> = Vec::with_capacity(self.links.len());
        for (k, link) in self.links.iter().enumerate() {
            let before = self.before(&frames, k);
            let motion = link.motion.as_ref().map(|m| {
                let value = q.get(m.coordinate).copied().unwrap_or(0.0);
                let (angle, shift) = m.displacement(value);
                after(&turned(m.axis, angle), &shifted(m.axis, shift))
            });
            frames.push(motion.map_or(before, |motion| after(&before, &motion)));
        }
        frames
    }

    /// The frame of a link at zero motion of its joint, in the world; `frames` are those of
    /// [`Scene::frames`].
    pub fn before(&self, frames: &[Pose], link: usize) -> Pose {
        let parent = self.links.get(link).and_then(|l| l.parent);
        let parent = parent.and_then(|p| frames.get(p)).unwrap_or(&WORLD);
        self.placements
            .get(link)
            .map_or(*parent, |p| after(parent, p))
    }

    /// The axis of a link's joint in the frame of [`Scene::before`], a unit vector; `None` for a
    /// fixed link.
    pub fn axis(&self, link: usize) -> Option<[f64; 3]> {
        let motion = self.links.get(link)?.motion.as_ref()?;
        Some(match motion.axis {
            Axis::X => [1.0, 0.0, 0.0],
            Axis::Y => [0.0, 1.0, 0.0],
            Axis::Z => [0.0, 0.0, 1.0],
        })
    }

    /// The parent of each link, in the order of the links; `None` is the world.
    pub fn parents(&self) -> impl Iterator<Item = Option<usize>> + '_ {
        self.links.iter().map(|l| l.parent)
    }

    /// The origins of a cut's two frames in the world, m. They coincide on a closed configuration
    /// if the cut constrains the position.
    pub fn ends(frames: &[Pose], cut: &Cut) -> [[f64; 3]; 2] {
        cut.sides.each_ref().map(|(link, on)| {
            let link = link.and_then(|l| frames.get(l)).unwrap_or(&WORLD);
            let end = after(link, on);
            [end[9], end[10], end[11]]
        })
    }
}

impl Spring {
    /// The two ends in the world, m; `frames` are those of [`Scene::frames`].
    pub fn tips(&self, frames: &[Pose]) -> [[f64; 3]; 2] {
        self.ends.map(|(link, [x, y, z])| {
            let frame = link.and_then(|l| frames.get(l)).unwrap_or(&WORLD);
            let mut on = WORLD;
            on[9..].copy_from_slice(&[x, y, z]);
            let tip = after(frame, &on);
            [tip[9], tip[10], tip[11]]
        })
    }
}

/// The tree's joints with their coordinates, in the order of the spec. Drives are left out, since
/// they have no place in space.
fn joints(spec: &Spec, model: &Model) -> Vec<Joint> {
    let mut joints: Vec<Joint> = Vec::new();
    let mut last = None;
    let spec_joints = joints_of_coordinates(spec).into_iter();
    let all = model.coordinates.iter().enumerate().zip(spec_joints);
    for ((k, coordinate), joint) in all.filter(|((k, _), _)| !model.drives.contains(k)) {
        let own = joint.span.start;
        if last != Some(own) {
            last = Some(own);
            let parent = model.links.get(coordinate.link).and_then(|l| l.parent);
            joints.push(Joint {
                name: joint
                    .name
                    .as_ref()
                    .map_or_else(String::new, |n| n.value.clone()),
                kind: joint.kind.value.name(),
                coordinates: Vec::new(),
                links: Vec::new(),
                parent,
                actuated: coordinate.actuated,
            });
        }
        if let Some(joint) = joints.last_mut() {
            joint.coordinates.push(k);
            joint.links.push(coordinate.link);
        }
    }
    joints
}

/// The bodies with the points at which others are connected to them.
fn bodies(model: &Model, placements: &[Pose], cuts: &[Cut]) -> Vec<Body> {
    let carrier = |mut link: Option<usize>, mut pose: Pose| {
        // go up through fixed links without a body
        while let Some(l) = link {
            if let Some(body) = model.bodies.iter().position(|b| b.link == l) {
                return Some((body, pose));
            }
            if model.links.get(l)?.motion.is_some() {
                return None;
            }
            pose = after(placements.get(l)?, &pose);
            link = model.links.get(l)?.parent;
        }
        None
    };
    let mut points = vec![vec![[0.0; 3]]; model.bodies.len()];
    let on_links = model.links.iter().zip(placements);
    let on_links = on_links.map(|(link, placement)| (link.parent, *placement));
    let on_cuts = cuts.iter().flat_map(|cut| cut.sides.iter().copied());
    for (link, pose) in on_links.chain(on_cuts) {
        let Some((body, pose)) = carrier(link, pose) else {
            continue;
        };
        let point = [pose[9], pose[10], pose[11]];
        let Some(points) = points.get_mut(body) else {
            continue;
        };
        let near = |p: &[f64; 3]| p.iter().zip(point).all(|(a, b)| (a - b).abs() < 1e-9);
        if !points.iter().any(near) {
            points.push(point);
        }
    }
    let carried = model
        .bodies
        .iter()
        .map(|b| carried_at(model, placements, b.link));
    for (points, carried) in points.iter_mut().zip(carried) {
        // for a body attached by a fixed joint, draw to the joint that carries it instead of to the
        // frame's origin
        if let Some(point) = carried {
            if points.len() > 2 {
                points.remove(0);
            }
            points.push(point);
        }
    }
    let bodies = model.bodies.iter().zip(points).enumerate();
    bodies
        .map(|(k, (body, points))| Body {
            label: body.label.clone(),
            link: body.link,
            points,
            is_payload: model.payloads.contains(&k),
        })
        .collect()
}

fn joint_springs(model: &Model) -> Vec<JointSpring> {
    let springs = model.joint_springs.iter().filter_map(|spring| {
        let coordinate = model.coordinates.get(spring.coordinate)?;
        Some(JointSpring {
            name: coordinate.name.clone(),
            link: coordinate.link,
            turns: !model.slides(spring.coordinate),
            rest: spring.rest.value.to_f64(),
        })
    });
    springs.collect()
}

fn springs(model: &Model) -> Vec<Spring> {
    let springs = model.point_springs.iter().map(|spring| Spring {
        name: spring.name.clone(),
        is_constant: matches!(spring.force, SpringForce::Constant),
        ends: spring.ends.each_ref().map(|end| {
            let point = end.point.each_ref().map(|x| x.value.to_f64());
            (end.link, point)
        }),
    });
    springs.collect()
}

fn drives(model: &Model) -> Vec<Drive> {
    let drives = model.drives.iter().filter_map(|drive| {
        let (coordinate, form) = (model.coordinates.get(*drive)?, model.form_of_drive(*drive)?);
        let terms = form.terms.iter();
        Some(Drive {
            name: coordinate.name.clone(),
            is_actuated: coordinate.actuated,
            constant: form.constant.to_f64(),
            terms: terms.map(|(k, factor)| (*k, factor.to_f64())).collect(),
        })
    });
    drives.collect()
}

/// The position of the joint that carries a body, in the body's frame, m; `None` if the joint is at
/// the frame's origin.
fn carried_at(model: &Model, placements: &[Pose], link: usize) -> Option<[f64; 3]> {
    let mut at = link;
    let mut pose = WORLD;
    while model.links.get(at)?.motion.is_none() {
        pose = after(placements.get(at)?, &pose);
        at = model.links.get(at)?.parent?;
    }
    let back = [9, 10, 11].map(|k| -pose[k]);
    let far = back.iter().any(|x| x.abs() > 1e-9);
    // R^T (-p)
    far.then(|| [0, 1, 2].map(|j: usize| (0..3).map(|i| pose[3 * i + j] * back[i]).sum()))
}

fn placed(steps: &[Step]) -> Pose {
    steps.iter().fold(WORLD, |pose, step| {
        let step = match step {
            Step::Rotate(axis, angle) => turned(*axis, angle.value.to_f64()),
            Step::Translate(axis, length) => shifted(*axis, length.value.to_f64()),
        };
        after(&pose, &step)
    })
}

fn turned(axis: Axis, angle: f64) -> Pose {
    let (s, c) = (libm::sin(angle), libm::cos(angle));
    let [a, b, k, d, e, f, g, h, i] = match axis {
        Axis::X => [1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c],
        Axis::Y => [c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c],
        Axis::Z => [c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0],
    };
    [a, b, k, d, e, f, g, h, i, 0.0, 0.0, 0.0]
}

fn shifted(axis: Axis, by: f64) -> Pose {
    let mut pose = WORLD;
    pose[match axis {
        Axis::X => 9,
        Axis::Y => 10,
        Axis::Z => 11,
    }] = by;
    pose
}

/// The pose of `b`, given in `a`, in the frame in which `a` is given.
fn after(a: &Pose, b: &Pose) -> Pose {
    let mut out = [0.0; 12];
    for i in 0..3 {
        for j in 0..3 {
            out[3 * i + j] = (0..3).map(|k| a[3 * i + k] * b[3 * k + j]).sum();
        }
        out[9 + i] = a[9 + i] + (0..3).map(|k| a[3 * i + k] * b[9 + k]).sum::<f64>();
    }
    out
}
