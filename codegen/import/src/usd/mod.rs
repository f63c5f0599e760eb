//! USD as text (usda) with the schema of physics: rigid bodies, their masses, joints with a frame on each of two
//! bodies. Joints form a graph, as in SDF. Lengths, masses and angles are in the units of the stage, and degrees.

mod joints;
mod text;
mod transforms;

use std::collections::BTreeMap;

use crate::fields::Fields;
use crate::pose::{Pose, V3, tensor_in, transposed};
use crate::sdf::{SdfJoint, order, spanning};
use crate::tree::{Inertia, Link, Side, Tree};
use crate::unused::{Row, is_kinematic};
use crate::xml::{Attribute, Element};

pub(crate) use joints::free_direction;
pub(crate) use text::read as read_text;

/// How a USD file becomes one that [`import`](crate::import) reads: a text, without parts in other files and choices
/// between parts.
pub const FLATTEN: &str = "`usdcat --flatten ROBOT.usd -o WHOLE.usda`, of Pixar's usd-core, writes one text without references and variants";

/// The reader tells what has no effect itself, by the beginning of its name.
pub(crate) const ROWS: &[Row] = &[];

/// Prims that are drawn, or lit, or collide.
const SHAPES: &str = "Mesh Cube Sphere Cylinder Cylinder_1 Capsule Capsule_1 Cone Plane Points BasisCurves GeomSubset \
    Material Shader NodeGraph Camera DistantLight DomeLight SphereLight RectLight DiskLight \
    CylinderLight PhysicsCollisionGroup OmniGraph OmniGraphNode RenderProduct RenderSettings RenderVar";

/// Names of properties and metadata without effect on the dynamics; those with a colon begin longer names.
const IDLE: &str = "doc documentation comment customData customLayerData kind assetInfo displayName hidden extent \
    visibility purpose instanceable orientation displayColor displayOpacity timeCodesPerSecond \
    framesPerSecond startTimeCode endTimeCode autoPlay renderSettings metricsAssembler primvars: material: \
    collection: physxCollision: physxMaterial: physxScene: physxConvexHullCollision: physxArticulation: physxLimit: \
    state: isaac: omni: ui: semantic: semantics: physics:velocity physics:angularVelocity physics:startsAsleep \
    physics:collisionEnabled physics:approximation physics:simulationOwner physics:filteredPairs physics:breakForce \
    physics:breakTorque physxRigidBody:solver physxRigidBody:sleep physxRigidBody:max physxRigidBody:enable \
    physxRigidBody:stabilizationThreshold";

/// Metadata that bring in what stands elsewhere.
const ELSEWHERE: &str = "references payload inherits specializes subLayers variants variantSets";

/// Metadata of properties that tell how they are shown.
const SHOWN: &str = "interpolation elementSize doc documentation customData displayName displayGroup allowedTokens \
    hidden colorSpace";

/// Schemas that the reader needs, or that have no effect; those with a colon begin longer names.
const SCHEMAS: &str = "PhysicsRigidBodyAPI PhysicsMassAPI PhysicsArticulationRootAPI PhysicsDriveAPI: PhysicsLimitAPI: \
    PhysxJointAPI PhysxJointAxisAPI: PhysxMimicJointAPI: PhysicsCollisionAPI PhysicsMeshCollisionAPI \
    PhysicsMaterialAPI PhysicsFilteredPairsAPI PhysxCollisionAPI PhysxRigidBodyAPI PhysxArticulationAPI \
    PhysxSceneAPI PhysxMaterialAPI PhysxLimitAPI: PhysicsJointStateAPI: PhysxConvexHullCollisionAPI \
    PhysxConvexDecompositionCollisionAPI PhysxTriangleMeshCollisionAPI PhysxSDFMeshCollisionAPI MaterialBindingAPI \
    GeomModelAPI SemanticsAPI: IsaacRobotAPI IsaacLinkAPI IsaacJointAPI";

/// Whether a list has a name, or a beginning of it.
fn lists(list: &str, name: &str) -> bool {
    let begins = |word: &str| word.contains(':') && name.starts_with(word);
    list.split(' ').any(|word| word == name || begins(word))
}

/// The last part of a path.
fn last_part(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or(path)
}

/// A prim where it stands as the file draws it.
#[derive(Clone, Copy)]
struct Drawn {
    world: Pose,
    scale: V3,
    /// Whether axes of it are not perpendicular.
    is_sheared: bool,
    /// The body that it is part of.
    body: Option<usize>,
}

struct Body<'a> {
    path: String,
    element: &'a Element,
}

struct Reading<'a, 'f, 'l> {
    fields: &'f mut Fields<'l>,
    /// m and kg in the units of the file.
    meter: f64,
    kilogram: f64,
    prims: BTreeMap<String, Drawn>,
    bodies: Vec<Body<'a>>,
    /// Joints with their paths.
    joints: Vec<(String, &'a Element)>,
    scenes: Vec<&'a Element>,
    tree: Tree,
}

/// Reads the robot of a layer; `None` if an error was recorded.
pub(crate) fn read(root: &Element, fields: &mut Fields<'_>) -> Option<Tree> {
    let defs = root
        .children
        .iter()
        .filter(|c| !matches!(c.tag.as_str(), "over" | "class"));
    let first = root.text("defaultPrim");
    let name = first.or_else(|| defs.clone().find_map(|c| c.text("name")));
    let mut reading = Reading {
        fields,
        meter: 1.0,
        kilogram: 1.0,
        prims: BTreeMap::new(),
        bodies: Vec::new(),
        joints: Vec::new(),
        scenes: Vec::new(),
        tree: Tree {
            name: name.unwrap_or("robot").to_owned(),
            place: root.place,
            format: "USD",
            ..Tree::default()
        },
    };
    reading.meter = reading.unit(root, "metersPerUnit", 0.01);
    reading.kilogram = reading.unit(root, "kilogramsPerUnit", 1.0);
    reading.tree.units.meter = reading.meter;
    reading.tree.units.kilogram = reading.kilogram;
    reading.prim(root);
    let world = Drawn {
        world: Pose::default(),
        scale: [1.0; 3],
        is_sheared: false,
        body: None,
    };
    reading.within(root, "", world);
    reading.gravity(root);
    reading.build();
    let failed = reading.fields.log.failed();
    (!failed).then_some(reading.tree)
}

impl<'a> Reading<'a, '_, '_> {
    fn unit(&mut self, root: &Element, name: &str, default: f64) -> f64 {
        let given = root.attribute(name).and_then(|a| self.fields.number(a));
        if given.is_none() && default != 1.0 {
            let text = format!("the file states no {name}, which is {default} then");
            self.fields.log.note(root.place, text);
        }
        if given.is_some_and(|unit| unit <= 0.0) {
            let hint = "it is the size of a unit of the file in m or kg, such as 0.01";
            let message = format!("{name} must be above 0");
            self.fields.log.error(root.place, message, hint);
        }
        given.filter(|unit| *unit > 0.0).unwrap_or(default)
    }

    /// Tells what of a prim is of no effect, what is in other files, and which schemas are not known.
    fn prim(&mut self, element: &Element) {
        element.used.mark();
        element.text("name");
        for attribute in &element.attributes {
            let name = attribute.name.as_str();
            let shown = name
                .split_once(" of ")
                .is_some_and(|(key, _)| lists(SHOWN, key));
            if shown || lists(IDLE, name) {
                attribute.used.mark();
                let text = "not used, since it has no effect on the dynamics: {}";
                self.fields.log.note_each(attribute.place, text, name);
            } else if lists(ELSEWHERE, name) {
                attribute.used.mark();
                let message = format!("{name}: what stands elsewhere is not read");
                let hint = format!(
                    "{FLATTEN}; `--ignore {name}` leaves it out, if nothing in it is part of the robot"
                );
                self.fields.log.error(attribute.place, message, &hint);
            } else if name == "apiSchemas" {
                attribute.used.mark();
                self.schemas(attribute);
            }
        }
    }

    fn schemas(&mut self, attribute: &Attribute) {
        for schema in attribute.value.split_whitespace() {
            if lists(SCHEMAS, schema) {
                continue;
            }
            if is_kinematic(schema) {
                let message = format!("{schema} is not known, and may tie links together");
                let hint = format!("`--ignore {schema}` leaves it out");
                self.fields.log.error(attribute.place, message, &hint);
            } else {
                let text = "schemas that are not used: {}";
                self.fields.log.note_each(attribute.place, text, schema);
            }
        }
    }

    /// Walks over the prims within an element.
    fn within(&mut self, element: &'a Element, path: &str, around: Drawn) {
        for child in &element.children {
            let path = format!("{path}/{}", child.text("name").unwrap_or_default());
            if matches!(child.tag.as_str(), "class" | "over") {
                let text = "what is not defined in this file is not used: {}";
                self.fields.log.note_each(child.place, text, &path);
                child.set_aside();
                continue;
            }
            if child.text("active") == Some("false") {
                let text = "not active, and not used: {}";
                self.fields.log.note_each(child.place, text, &path);
                child.set_aside();
                continue;
            }
            let is_joint = child.tag.contains("Joint");
            let is_known = matches!(
                child.tag.as_str(),
                "Xform" | "Scope" | "def" | "PhysicsScene"
            );
            let is_shape = lists(SHAPES, &child.tag);
            let is_body = has_schema(child, "PhysicsRigidBodyAPI");
            if is_joint || is_known || is_shape || is_body {
                self.prim(child);
            }
            let mut drawn = self.placed(child, around);
            if is_body {
                let moves = self.moves(child, &path);
                drawn.body = moves.then_some(self.bodies.len());
                self.bodies.extend(moves.then(|| Body {
                    path: path.clone(),
                    element: child,
                }));
            }
            if is_joint {
                self.joints.push((path.clone(), child));
            }
            if (is_body || is_joint) && drawn.is_sheared {
                let message = format!(
                    "'{path}' is in what is scaled in a direction that is none of its axes"
                );
                let hint = "write the scale into the shapes, so that bodies and joints have none";
                self.fields.log.error(child.place, message, hint);
            }
            if child.tag == "PhysicsScene" {
                self.scenes.push(child);
            }
            if is_shape {
                let text = "not used, since it has no effect on the dynamics: {}";
                let item = format!("<{}>", child.tag);
                self.fields.log.note_each(child.place, text, &item);
                if !is_body {
                    child.attributes.iter().for_each(|a| a.used.mark());
                }
                child
                    .attributes
                    .iter()
                    .filter(|a| !a.name.contains(':'))
                    .for_each(|a| a.used.mark());
            }
            self.prims.insert(path.clone(), drawn);
            self.within(child, &path, drawn);
        }
    }

    /// Whether a body moves by forces; what does not is part of the world.
    fn moves(&mut self, body: &Element, path: &str) -> bool {
        let enabled = body.text("physics:rigidBodyEnabled").is_none_or(is_true);
        let moved = body.text("physics:kinematicEnabled").is_some_and(is_true);
        if !enabled || moved {
            let text = "bodies that forces do not move are part of the world: {}";
            self.fields.log.note_each(body.place, text, path);
        }
        enabled && !moved
    }

    fn gravity(&mut self, root: &Element) {
        let up = root.text("upAxis");
        if up.is_none() {
            let text = "the file states no upAxis, which is Y then";
            self.fields.log.note(root.place, text);
        }
        let down = if up.unwrap_or("Y") == "Z" {
            [0.0, 0.0, -1.0]
        } else {
            [0.0, -1.0, 0.0]
        };
        let scenes = self.scenes.clone();
        let of = |name: &str| scenes.iter().find_map(|scene| scene.attribute(name));
        let (along, size) = (
            of("physics:gravityDirection"),
            of("physics:gravityMagnitude"),
        );
        let along = along.and_then(|a| self.fields.array::<3>(a));
        let along = along.and_then(crate::pose::unit).unwrap_or(down);
        // minus infinity stands for that of the Earth
        let size = size.filter(|a| !a.value.contains("inf"));
        let size = size
            .and_then(|a| self.fields.number(a))
            .filter(|size| *size >= 0.0);
        let size = size.map_or(9.81, |size| size * self.meter);
        let gravity = along.map(|x| if x == 0.0 { 0.0 } else { x * size });
        self.tree.gravity = Some(gravity).filter(|g| *g != [0.0, 0.0, -9.81]);
    }

    /// Names that are the last parts of paths, or whole paths where these are not unique.
    fn name(&self, path: &str) -> String {
        let of_bodies = self.bodies.iter().map(|body| body.path.as_str());
        let of_joints = self.joints.iter().map(|(path, _)| path.as_str());
        let last = last_part(path);
        let same = of_bodies
            .chain(of_joints)
            .filter(|other| last_part(other) == last);
        if same.count() > 1 {
            path.trim_start_matches('/').to_owned()
        } else {
            last.to_owned()
        }
    }

    /// Builds the tree from what was collected.
    fn build(&mut self) {
        let mut joints = Vec::new();
        for (path, element) in self.joints.clone() {
            let joint = self.joint(&path, element);
            joints.extend(joint);
        }
        self.leave_loose_bodies(&mut joints);
        if self.bodies.is_empty() {
            let hint = "bodies have the schema PhysicsRigidBodyAPI, and are joined by PhysicsRevoluteJoint and others";
            self.fields
                .log
                .error(self.tree.place, "there is no body", hint);
        }
        if self.fields.log.failed() {
            return;
        }
        let links: Vec<(String, &Element)> = (self.bodies.iter())
            .map(|body| (self.name(&body.path), body.element))
            .collect();
        let in_tree = spanning(&joints, links.len(), &self.tree.actuated);
        let root = links
            .iter()
            .position(|(_, body)| has_schema(body, "PhysicsArticulationRootAPI"));
        let order = order(&joints, &in_tree, &links, (root, false), self.fields);
        let mut index: BTreeMap<usize, usize> = BTreeMap::new();
        for (link, by) in order {
            let Some((name, element)) = links.get(link).cloned() else {
                continue;
            };
            let joint = by.and_then(|k| joints.get(k));
            let drawn = self.drawn(link);
            let (pose, moving) = match joint {
                // where the joint is at 0, its two frames are the same
                Some(joint) => {
                    let own = usize::from(joint.links[1] == Some(link));
                    let back = joint.on[own].inverse();
                    (joint.on[1 - own].then(&back), joint.moving(link, &back))
                }
                None => (drawn.world, Vec::new()),
            };
            let carrier = joint.and_then(|j| j.other(link));
            let (inertia, unknown) = self.inertia(element, &name, drawn.scale);
            index.insert(link, self.tree.links.len());
            self.tree.units.scales.push(drawn.scale);
            self.tree.links.push(Link {
                name,
                place: element.place,
                parent: carrier.and_then(|c| index.get(&c).copied()),
                pose,
                joints: moving,
                inertia,
                unknown,
            });
        }
        for (path, drawn) in &self.prims {
            let body = drawn.body.and_then(|body| self.bodies.get(body));
            let body = body.and_then(|body| self.prims.get(&body.path));
            let pose = body.map_or(drawn.world, |body| body.world.inverse().then(&drawn.world));
            let link = drawn.body.and_then(|body| index.get(&body).copied());
            self.tree
                .frames
                .push((last_part(path).to_owned(), Side { link, pose }));
        }
        for (joint, in_tree) in joints.iter().zip(&in_tree) {
            if !in_tree {
                joint.note_cut(self.fields);
                let links = joint.links.map(|link| index.get(&link?).copied());
                self.tree.closures.push(joint.cut(links));
                self.tree.actuated.retain(|name| *name != joint.name);
            }
            self.tree.couplings.extend(joint.mimics.iter().cloned());
        }
    }

    fn drawn(&self, body: usize) -> Drawn {
        let path = self.bodies.get(body).map(|body| body.path.as_str());
        let drawn = path.and_then(|path| self.prims.get(path));
        drawn.copied().unwrap_or(Drawn {
            world: Pose::default(),
            scale: [1.0; 3],
            is_sheared: false,
            body: None,
        })
    }

    /// Leaves out bodies that no joint connects, if there are joints.
    fn leave_loose_bodies(&mut self, joints: &mut [SdfJoint<'a>]) {
        if joints.is_empty() {
            return;
        }
        let mut new = Vec::new();
        for (k, body) in std::mem::take(&mut self.bodies).into_iter().enumerate() {
            let is_held = joints.iter().any(|joint| joint.links.contains(&Some(k)));
            new.push(is_held.then_some(self.bodies.len()));
            if is_held {
                self.bodies.push(body);
                continue;
            }
            let text = "bodies without joints are left out: {}";
            self.fields
                .log
                .note_each(body.element.place, text, &body.path);
            body.element.set_aside();
        }
        let moved = |link: Option<usize>| link.and_then(|own| new.get(own).copied().flatten());
        for joint in joints {
            joint.links = joint.links.map(moved);
        }
        for drawn in self.prims.values_mut() {
            drawn.body = moved(drawn.body);
        }
    }

    /// The inertia of a body, and whether the file does not state it.
    fn inertia(&mut self, body: &Element, name: &str, scale: V3) -> (Option<Inertia>, bool) {
        // a property may stand there without a value
        let is_value = |a: &&Attribute| !a.value.contains("inf") && !a.value.is_empty();
        let stated = |name: &str| body.attribute(name).filter(is_value);
        let mass = stated("physics:mass").and_then(|a| self.fields.number(a));
        let moments = stated("physics:diagonalInertia").and_then(|a| self.fields.array::<3>(a));
        let com = stated("physics:centerOfMass").and_then(|a| self.vector(a));
        let axes = stated("physics:principalAxes")
            .filter(|a| a.value.split_whitespace().any(|x| x.parse() != Ok(0.0)));
        let axes = axes.and_then(|a| self.quaternion(a));
        let mass = mass.unwrap_or(0.0) * self.kilogram;
        let moments = moments.unwrap_or_default();
        if mass < 0.0 || moments.iter().any(|m| *m < 0.0) {
            let hint = "masses and moments of inertia are zero or above";
            self.fields
                .log
                .error(body.place, "a negative mass or moment of inertia", hint);
        }
        if mass == 0.0 || moments == [0.0; 3] {
            let text = "masses and inertias that USD computes from shapes are not known here: {}";
            let item = format!("'{name}'");
            self.fields.log.note_each(body.place, text, &item);
            return (None, true);
        }
        if com.is_none() {
            let text =
                "centres of mass at the origin of their links, since the file states none: {}";
            let item = format!("'{name}'");
            self.fields.log.note_each(body.place, text, &item);
        }
        let [a, b, c] = moments.map(|m| m * self.kilogram * self.meter * self.meter);
        let own = [a, 0.0, 0.0, b, 0.0, c];
        let scaled = |k: usize| com.unwrap_or_default()[k] * scale[k] * self.meter;
        let inertia = Inertia {
            mass,
            com: [0, 1, 2].map(scaled),
            tensor: axes.map_or(own, |axes| tensor_in(own, &transposed(&axes))),
        };
        (Some(inertia), false)
    }
}

fn is_true(text: &str) -> bool {
    matches!(text, "1" | "true")
}

/// Whether a schema is applied to a prim, of which the instance may follow its name.
pub(crate) fn has_schema(element: &Element, schema: &str) -> bool {
    let all = element.attributes.iter().filter(|a| a.name == "apiSchemas");
    let mut words = all.flat_map(|a| a.value.split_whitespace());
    words.any(|word| word == schema || schema.ends_with(':') && word.starts_with(schema))
}
