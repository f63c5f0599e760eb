//! MJCF: nested bodies with classes of defaults, MuJoCo's units and frames.
//!
//! Rules that are not obvious from the file follow the XML reference in MuJoCo's documentation.

mod bodies;
mod defaults;
mod equality;
mod geoms;
mod meshes;
mod orientation;
mod resistance;
mod tendon_coupling;
mod tendons;

use std::collections::BTreeMap;

use crate::fields::Fields;
use crate::mesh::Solid;
use crate::notes::unread;
use crate::tree::Tree;
use crate::unused::Row;
use crate::xml::{Attribute, Element, Reader};

use defaults::Defaults;

/// What of actuators, tendons, equalities and shapes has no effect.
const ACTUATOR: &str = "name class group ctrllimited forcelimited actlimited ctrlrange forcerange actrange \
                        lengthrange user dyntype gaintype biastype dynprm gainprm biasprm kp kv kd ki dampratio \
                        timeconst inheritrange actdim actearly delay nsample interp";
const TENDON: &str = "name class group width material rgba solreflimit solimplimit solreffriction solimpfriction \
                      margin user springlength limited range actuatorfrclimited";
const EQUALITY: &str = "name class solref solimp torquescale active";
const GEOM: &str = "name class type contype conaffinity condim group priority size material rgba friction mass \
                    density shellinertia solmix solref solimp margin gap fromto pos quat axisangle xyaxes zaxis \
                    euler hfield mesh fitscale fluidshape fluidcoef user";

/// What of an MJCF file has no effect on the dynamics.
pub(crate) const ROWS: &[Row] = &[
    Row::whole("asset", "*"),
    Row::whole("mesh", "*"),
    Row::whole("texture", "*"),
    Row::whole("material", "*"),
    Row::whole("hfield", "*"),
    Row::whole("visual", "*"),
    Row::whole("sensor", "*"),
    Row::whole("keyframe", "*"),
    Row::whole("contact", "*"),
    Row::whole("pair", "*"),
    Row::whole("size", "*"),
    Row::whole("statistic", "*"),
    Row::whole("custom", "*"),
    Row::whole("camera", "*"),
    Row::whole("light", "*"),
    Row::whole("geom", GEOM),
    Row::whole("site", GEOM),
    Row::parts(
        "joint",
        "class group solreflimit solimplimit solreffriction solimpfriction margin user springref limited \
         actuatorfrclimited solref solimp active",
    ),
    Row::parts("freejoint", "name group"),
    Row::parts("body", "user"),
    Row::parts("fixed", TENDON),
    Row::parts("spatial", TENDON),
    Row::parts("tendon", TENDON),
    Row::parts("connect", EQUALITY),
    Row::parts("weld", EQUALITY),
    Row::parts("equality", EQUALITY),
    Row::parts("general", ACTUATOR),
    Row::parts("motor", ACTUATOR),
    Row::parts("position", ACTUATOR),
    Row::parts("velocity", ACTUATOR),
    Row::parts("intvelocity", ACTUATOR),
    Row::parts("damper", ACTUATOR),
    Row::parts("cylinder", ACTUATOR),
    Row::parts("muscle", ACTUATOR),
    Row::parts("adhesion", ACTUATOR),
    Row::parts(
        "compiler",
        "texturedir meshdir assetdir strippath fitaabb discardvisual fusestatic usethread convexhull saveinertial \
         alignfree inertiagrouprange",
    ),
    Row::parts(
        "option",
        "timestep integrator cone jacobian solver iterations tolerance ls_iterations ls_tolerance \
         noslip_iterations noslip_tolerance ccd_iterations ccd_tolerance mpr_iterations mpr_tolerance \
         sdf_iterations sdf_initpoints actuatorgroupdisable apirate impratio o_margin o_solref o_solimp o_friction \
         wind magnetic collision sleep_tolerance",
    ),
    Row::parts(
        "flag",
        "contact limit warmstart filterparent actuation refsafe sensor midphase eulerdamp autoreset nativeccd \
         override energy fwdinv invdiscrete multiccd island clampctrl sleep",
    ),
];

/// The settings of `<compiler>`.
#[derive(Clone, Debug)]
pub(crate) struct Compiler {
    /// Angles are in degrees.
    degrees: bool,
    /// The axes of euler angles: capital letters are fixed axes, small letters axes that rotate
    /// along.
    sequence: [char; 3],
    /// Whether a range is a limit even if `limited` is not set.
    autolimits: bool,
    inertia: InertiaFrom,
    /// The first and last group of geoms that have mass.
    groups: [f64; 2],
    /// The total mass to which all masses are scaled.
    total_mass: Option<f64>,
    /// The folder of the mesh files, empty for that of the file.
    meshes: String,
    /// Whether meshes count with the volume that they bound, if they do not say.
    exact_meshes: bool,
}

impl Compiler {
    /// The path of a mesh file beside the file that is imported.
    fn mesh_path(&self, file: &str) -> String {
        match self.meshes.trim_end_matches('/') {
            "" => file.to_owned(),
            folder => format!("{folder}/{file}"),
        }
    }
}

/// The source of the bodies' inertia.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum InertiaFrom {
    /// `<inertial>`, or else the geoms.
    Either,
    Geoms,
    Inertials,
}

/// The state while a file is read.
struct Reading<'a, 'f, 'l> {
    fields: &'f mut Fields<'l>,
    compiler: Compiler,
    defaults: Defaults,
    tree: Tree,
    root: &'a Element,
    files: &'f mut Reader<'f>,
    /// The solids of the meshes that were asked for.
    solids: BTreeMap<String, Result<Solid, String>>,
    left_out: LeftOut,
}

/// What is left out and noted together.
#[derive(Default)]
struct LeftOut {
    /// The number of bodies with `gravcomp`.
    compensated: usize,
    /// The joints with a `springdamper`.
    springdampers: Vec<String>,
    /// Whether meshes of the body that was read last have mass that is not known.
    has_unknown_mass: bool,
}

/// Reads the robot of an MJCF file whose includes have been inserted, and with `files` the meshes
/// that bodies without inertia consist of; `None` if an error was recorded.
pub(crate) fn read(
    root: &Element,
    fields: &mut Fields<'_>,
    files: &mut Reader<'_>,
) -> Option<Tree> {
    let compiler = compiler(root, fields);
    let defaults = Defaults::new(root, fields.log);
    let mut reading = Reading {
        fields,
        compiler,
        defaults,
        tree: Tree {
            name: root.text("model").unwrap_or("robot").to_owned(),
            place: root.place,
            format: "MJCF",
            ..Tree::default()
        },
        root,
        files,
        solids: BTreeMap::new(),
        left_out: LeftOut::default(),
    };
    let gravity = root
        .all("option")
        .filter_map(|o| o.attribute("gravity"))
        .last();
    reading.tree.gravity = gravity.and_then(|g| reading.fields.array(g));
    reading.gravity_flag();
    reading.note_fluid();
    reading.bodies();
    reading.scale_masses();
    reading.actuators();
    reading.springs();
    reading.equalities();
    reading.note_ignored_elements();
    let failed = reading.fields.log.failed();
    (!failed).then_some(reading.tree)
}

fn compiler(root: &Element, fields: &mut Fields<'_>) -> Compiler {
    let mut settings = Compiler {
        degrees: true,
        sequence: ['x', 'y', 'z'],
        autolimits: true,
        inertia: InertiaFrom::Either,
        groups: [0.0, 5.0],
        total_mass: None,
        meshes: String::new(),
        exact_meshes: false,
    };
    const READ: [&str; 10] = [
        "angle",
        "autolimits",
        "inertiafromgeom",
        "inertiagrouprange",
        "eulerseq",
        "coordinate",
        "exactmeshinertia",
        "settotalmass",
        "boundmass",
        "boundinertia",
    ];
    let mut assets = String::new();
    let elements: Vec<&Element> = root.all("compiler").collect();
    for attribute in elements.iter().flat_map(|e| &e.attributes) {
        let value = attribute.value.as_str();
        if READ.contains(&attribute.name.as_str()) {
            attribute.used.mark();
        }
        match attribute.name.as_str() {
            "angle" => settings.degrees = value != "radian",
            "autolimits" => settings.autolimits = value != "false",
            "inertiafromgeom" => {
                settings.inertia = match value {
                    "true" => InertiaFrom::Geoms,
                    "false" => InertiaFrom::Inertials,
                    _ => InertiaFrom::Either,
                };
            }
            "inertiagrouprange" => {
                if let Some(groups) = fields.array(attribute) {
                    settings.groups = groups;
                }
            }
            "eulerseq" => sequence(attribute, &mut settings, fields),
            "coordinate" if value == "global" => fields.log.error(
                attribute.place,
                "global coordinates",
                "current MuJoCo has local ones only: save the file again with a MuJoCo before 2.3.4",
            ),
            "meshdir" => settings.meshes.clone_from(&attribute.value),
            "exactmeshinertia" => settings.exact_meshes = value == "true",
            "assetdir" => assets.clone_from(&attribute.value),
            "settotalmass" => {
                settings.total_mass = fields.number(attribute).filter(|m| *m > 0.0);
            }
            "boundmass" | "boundinertia" => {
                let text = format!("{} is not applied: inertias stay as given", attribute.name);
                fields.log.note(attribute.place, text);
            }
            _ => {}
        }
    }
    if settings.meshes.is_empty() {
        settings.meshes = assets;
    }
    settings
}

fn sequence(attribute: &Attribute, settings: &mut Compiler, fields: &mut Fields<'_>) {
    let axes: Vec<char> = attribute.value.chars().collect();
    match <[char; 3]>::try_from(axes) {
        Ok(axes) if axes.iter().all(|a| "xyzXYZ".contains(*a)) => settings.sequence = axes,
        _ => fields.log.error(
            attribute.place,
            format!("'{}' is not a sequence of three axes", attribute.value),
            "write three of x, y, z, or of X, Y, Z for fixed axes",
        ),
    }
}

impl Reading<'_, '_, '_> {
    /// Sets gravity to 0 if a flag disables it.
    fn gravity_flag(&mut self) {
        let options = self.root.all("option");
        let flags = options.flat_map(|option| option.all("flag"));
        let said = flags.filter_map(|flag| flag.attribute("gravity")).last();
        if let Some(said) = said.filter(|said| said.value == "disable") {
            self.tree.gravity = Some([0.0; 3]);
            let text = "gravity is 0 here, since a flag disables it";
            self.fields.log.note(said.place, text);
        }
    }

    /// Whether a flag disables all equalities.
    fn has_equalities(&mut self) -> bool {
        let options = self.root.all("option");
        let flags = options.flat_map(|option| option.all("flag"));
        let said =
            flags.flat_map(|flag| ["equality", "constraint"].map(|name| flag.attribute(name)));
        let disabled = said.flatten().filter(|said| said.value == "disable").last();
        if let Some(said) = disabled {
            let text = "equalities are left out, since a flag disables them";
            self.fields.log.note(said.place, text);
        }
        disabled.is_none()
    }

    /// Notes that the fluid around the robot is left out, if it has a density or a viscosity.
    fn note_fluid(&mut self) {
        for name in ["density", "viscosity"] {
            let options = self.root.all("option");
            let last = options.filter_map(|option| option.attribute(name)).last();
            let Some(said) = last else { continue };
            if self.fields.number(said).is_some_and(|value| value != 0.0) {
                let text = format!(
                    "the {name} of the fluid around the robot, {}, is left out: its forces are not linear in \
                     parameters of the robot",
                    said.value
                );
                self.fields.log.note(said.place, text);
            }
        }
    }

    fn scale_masses(&mut self) {
        let Some(total) = self.compiler.total_mass else {
            return;
        };
        let inertias = || self.tree.links.iter().filter_map(|l| l.inertia);
        let factor = total / inertias().map(|i| i.mass).sum::<f64>();
        if !factor.is_finite() {
            return;
        }
        let text = format!("all masses are scaled by {factor:.6}, to {total} kg together");
        self.fields.log.note(self.root.place, text);
        for inertia in self
            .tree
            .links
            .iter_mut()
            .filter_map(|l| l.inertia.as_mut())
        {
            inertia.mass *= factor;
            inertia.tensor = inertia.tensor.map(|x| x * factor);
        }
    }

    /// Notes elements that a spec of rigid bodies cannot express.
    fn note_ignored_elements(&mut self) {
        let assets = self.root.children.iter().filter(|c| c.tag == "asset");
        let meshes = assets.flat_map(|asset| &asset.children);
        let meshes = meshes.filter(|c| c.tag == "mesh").count();
        let read = self.solids.values().filter(|found| found.is_ok()).count();
        let meshes = meshes.saturating_sub(read);
        if meshes > 0 {
            let text = unread(meshes);
            self.fields.log.note(self.root.place, text);
        }
        self.note_forces_left_out();
        for section in ["deformable", "skin"] {
            for element in self.root.all(section) {
                let text = "what deforms is left out: bodies are rigid here";
                self.fields.log.note(element.place, text);
            }
        }
    }
}
