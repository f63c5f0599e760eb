//! Import of robot files from other tools, URDF, SDF, MJCF and USD as text, as specs, and export of identified
//! parameters to them.
//!
//! [`import`] converts the text of a file into the text of a spec: with the file's names, limits,
//! inertias and friction; long serial limbs with branches; loops as cuts, joints that follow others
//! as couplings. This crate opens no files itself. [`export`] writes identified
//! parameters back.
//!
//! ```
//! use regen_codegen::diag::Source;
//! use regen_import::{Options, import};
//!
//! let urdf = r#"<robot name="pendulum">
//!   <link name="base"/>
//!   <link name="rod">
//!     <inertial><origin xyz="0 0 -0.3"/><mass value="2"/>
//!       <inertia ixx="0.06" ixy="0" ixz="0" iyy="0.06" iyz="0" izz="0.001"/></inertial>
//!   </link>
//!   <joint name="swing" type="continuous">
//!     <parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
//!   </joint>
//! </robot>"#;
//! let source = Source::new("pendulum.urdf", urdf);
//! let mut no_includes = |_: &str| Err("there is none".to_owned());
//! let imported = import(&source, &mut no_includes, &Options::default()).unwrap();
//! assert!(imported.spec.contains("{name: swing, type: revolute, axis: y, body: rod, actuated: true}"));
//! assert!(imported.spec.contains("rod: {mass: 2, com: [0, 0, -0.3]"));
//! ```

#![allow(
    clippy::float_cmp,
    reason = "zeros, and numbers as they were read, are told from others exactly"
)]

mod choose;
mod cut;
mod dh_table;
mod edits;
mod export;
mod fields;
mod frames;
mod isaac;
mod layout;
mod lock;
mod log;
mod mesh;
mod mjcf;
mod names;
mod notes;
mod number;
mod physical;
mod pose;
mod sdf;
mod tree;
mod unused;
mod urdf;
mod usd;
mod values;
mod write;
mod xml;

pub use dh_table::{Rows, from_dh_table};
pub use export::{BodyParameters, Exported, FileFormat, JointParameters, Parameters, export};
pub use isaac::{isaac_lab, usd_layer};
pub use log::{LOOP_IN_TREE, Note};
pub use usd::FLATTEN as USD_FLATTEN;
pub use xml::Reader;

use regen_codegen::diag::{Report, Source, Span};

use choose::Verdict;
use fields::Fields;
use layout::Draft;
use log::{Log, Place};
use tree::{Joint, Kind, Tree};

/// Options of an import.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The spec's name; default: the robot's name in the file.
    pub name: Option<String>,
    /// Whether angles keep their printed digits: 1.5708 is not taken as pi/2.
    pub exact: bool,
    /// Whether actuated joints have friction and rotors, as drives with gears do, where the file states
    /// none.
    pub geared: bool,
    /// How the root is connected to the world; default: as in the file.
    pub base: Option<Base>,
    /// Joints that are taken as rigid: `NAME`, at 0, or `NAME=VALUE`, in rad or m, counted as in the
    /// file. Joints that follow them stand still too.
    pub lock: Vec<String>,
    /// Loops to add: `NAME:JOINT:BODY@x,y,z[,r,p,y]:BODY[@x,y,z[,r,p,y]]`, with lengths in m and
    /// angles in rad. Bodies are given by the file's names or `world`, frames in the frames of the
    /// file's links. The default of the second frame is the pose of the first one at zero.
    pub cuts: Vec<String>,
    /// Actuated joints, by the file's names; default: as in the file.
    pub actuated: Vec<String>,
    /// Initial values for the closure of the loops, `NAME=VALUE` with the file's names, in rad or
    /// m; default: 0.
    pub home: Vec<String>,
    /// Names of elements and attributes to leave out of the file.
    pub ignore: Vec<String>,
    /// The names by which errors refer to the texts above.
    pub names: OptionNames,
}

/// The names by which errors refer to the texts of [`Options`].
#[derive(Clone, Copy, Debug)]
pub struct OptionNames {
    /// [`Options::cuts`].
    pub cuts: &'static str,
    /// [`Options::actuated`].
    pub actuated: &'static str,
    /// [`Options::home`].
    pub home: &'static str,
    /// [`Options::lock`].
    pub lock: &'static str,
    /// [`Options::base`].
    pub base: &'static str,
    /// [`Options::geared`].
    pub geared: &'static str,
    /// [`Options::ignore`].
    pub ignore: &'static str,
}

impl Default for OptionNames {
    fn default() -> Self {
        Self {
            cuts: "cuts",
            actuated: "actuated",
            home: "home",
            lock: "lock",
            base: "base",
            geared: "geared",
            ignore: "ignore",
        }
    }
}

/// How the root of the tree is connected to the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Base {
    /// Fixed to the world; a free joint of the file is left out.
    Fixed,
    /// Moves freely with six degrees of freedom.
    Floating,
}

/// The result of an import.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The spec's name.
    pub name: String,
    /// The spec's text.
    pub spec: String,
    /// Messages on decisions and omissions, in the order of the file.
    pub notes: Vec<Note>,
}

/// Converts a URDF, SDF or MJCF file, or one of USD as text, into a spec. `reader` returns the bytes of included files and of
/// meshes whose volume is needed, by the names given in the file.
///
/// # Errors
/// If the file is invalid, with one report per file; or if the mechanism it describes is, with the
/// place in the spec's text.
pub fn import(
    source: &Source,
    reader: &mut Reader<'_>,
    options: &Options,
) -> Result<Imported, Vec<Report>> {
    let mut log = Log::default();
    let imported = tree(source, reader, options, &mut log).map(|mut tree| {
        apply_options(&mut tree, options, &mut log);
        notes::contradicting_limits(&tree, &mut log);
        if !options.geared {
            notes::without_friction(&tree, options.names.geared, &mut log);
        }
        (layout::lay_out(&tree, &mut log), tree)
    });
    let Some((mut draft, tree)) = imported.filter(|_| !log.failed()) else {
        return Err(log.reports());
    };
    home(&mut draft, options, &mut log);
    if draft.bodies.is_empty() {
        let still = tree.links.iter().any(tree::Link::is_massive);
        let hint = if still && options.base != Some(Base::Floating) {
            let floating = options.names.base;
            format!("what has mass stands still: `{floating} floating` lets it move in space")
        } else {
            "masses stand in <inertial> of the links that move, in USD in their MassAPI".to_owned()
        };
        log.error(tree.place, "nothing with mass moves in this file", &hint);
    }
    if log.failed() {
        return Err(log.reports());
    }
    let (name, spec, actuated) =
        write_valid_spec(&draft, &tree, &source.name, options).map_err(|r| vec![r])?;
    if names_no_motors(&draft, &tree) {
        let text = format!(
            "no motors are named: {} have them here, as many as the robot has degrees of freedom ({} NAME,NAME names \
             others)",
            actuated.join(", "),
            options.names.actuated
        );
        log.note(tree.place, text);
    }
    if options.geared {
        notes::without_values(&draft, &actuated, &tree, &mut log);
    }
    Ok(Imported {
        name,
        spec,
        notes: log.notes(),
    })
}

/// How the formats are told apart.
const FIRST_ELEMENTS: &str = "a URDF file starts with <robot>, an MJCF file with <mujoco>, an SDF file with <sdf>, one of USD with #usda";

/// Reads the file as a tree of links.
fn tree(
    source: &Source,
    reader: &mut Reader<'_>,
    options: &Options,
    log: &mut Log,
) -> Option<Tree> {
    let mut root = xml::read(source, log)?;
    if root.tag == "mujoco" {
        xml::include(&mut root, reader, log);
    }
    for name in &options.ignore {
        let places = xml::take_out(&mut root, name);
        if places.is_empty() {
            let message = format!("no element or attribute is called '{name}'");
            let hint = "write a name as it stands in the file, with its prefix";
            option_error(options.names.ignore, name, message, hint, log);
        }
        for place in places {
            let text = format!("left out by {}: {{}}", options.names.ignore);
            log.note_each(place, text, name);
        }
    }
    let mut fields = Fields {
        log,
        exact: options.exact,
    };
    let (tree, rows) = match root.tag.as_str() {
        "robot" => (urdf::read(&root, &mut fields, reader)?, urdf::ROWS),
        "mujoco" => (mjcf::read(&root, &mut fields, reader)?, mjcf::ROWS),
        "sdf" => (sdf::read(&root, &mut fields)?, sdf::ROWS),
        "usda" => (usd::read(&root, &mut fields)?, usd::ROWS),
        other => {
            let message = format!("<{other}> is none of URDF, MJCF, SDF and USD");
            log.error(root.place, message, FIRST_ELEMENTS);
            return None;
        }
    };
    unused::report(&root, rows, options.names.ignore, log);
    Some(tree)
}

/// Changes the tree according to the options.
fn apply_options(tree: &mut Tree, options: &Options, log: &mut Log) {
    for text in &options.lock {
        lock::lock(options.names.lock, text, tree, log);
    }
    for text in &options.cuts {
        cut::add(options.names.cuts, text, tree, log);
    }
    let names: Vec<&str> = tree
        .links
        .iter()
        .flat_map(|link| &link.joints)
        .map(|joint| joint.name.as_str())
        .collect();
    for name in &options.actuated {
        if !names.contains(&name.as_str()) {
            let hint = format!("the file's joints are {}", names.join(", "));
            option_error(
                options.names.actuated,
                name,
                format!("no joint is called '{name}'"),
                &hint,
                log,
            );
        }
    }
    if !options.actuated.is_empty() {
        tree.actuated.clone_from(&options.actuated);
        tree.drives.clear();
    }
    match options.base {
        None => {}
        Some(Base::Fixed) => {
            // parents come before their links
            let mut is_fixed: Vec<bool> = Vec::new();
            for link in &mut tree.links {
                let on_ground = link.parent.is_none_or(|p| is_fixed.get(p) == Some(&true));
                if on_ground {
                    link.joints.retain(|j| j.kind != Kind::Free);
                }
                is_fixed.push(on_ground && link.joints.is_empty());
            }
        }
        Some(Base::Floating) => {
            if let Some(root) = tree.links.first_mut()
                && root.joints.iter().all(|j| j.kind != Kind::Free)
            {
                let free = Joint::new("base".to_owned(), root.place, Kind::Free);
                root.joints.insert(0, free);
            }
        }
    }
}

/// Records an error in a text of the options.
fn option_error(option: &str, word: &str, message: String, hint: &str, log: &mut Log) {
    let file = log.add(Source::new(option, word));
    log.error(Place::new(file, Span::new(0, word.len())), message, hint);
}

/// Sets the initial values that the options give.
fn home(draft: &mut Draft, options: &Options, log: &mut Log) {
    for text in &options.home {
        let parsed = text.split_once('=').and_then(|(name, value)| {
            let coordinate = draft.coordinate(name.trim())?;
            Some((coordinate, cut::value(value)?))
        });
        let Some((name, value)) = parsed else {
            let message = format!("'{text}' gives no coordinate a value");
            let names = draft.coordinates().join(", ");
            let hint = format!("write NAME=VALUE; coordinates are {names}");
            option_error(options.names.home, text, message, &hint, log);
            continue;
        };
        draft.home.retain(|(other, _)| *other != name);
        draft.home.push((name, value));
    }
}

/// Name and text of the spec, with a valid choice of independent coordinates, and its joints with
/// motors.
fn write_valid_spec(
    draft: &Draft,
    tree: &Tree,
    file: &str,
    options: &Options,
) -> Result<(String, String, Vec<String>), Report> {
    let name = names::module(options.name.as_deref().unwrap_or(&tree.name));
    let actuated = actuated(draft, tree);
    let mut with_motors = actuated.clone();
    let mut frame = write::SpecContext {
        name: &name,
        robot: &tree.name,
        file: file.rsplit(['/', '\\']).next().unwrap_or(file),
        format: tree.format,
        gravity: tree.gravity,
        exact: options.exact,
        actuated: &actuated,
        geared: options.geared,
        independent: None,
    };
    // a spec without actuated joints, or with actuated joints that follow others, must name its
    // independent coordinates
    let follows = |name: &String| draft.couplings.iter().any(|c| c.key == *name);
    let mut free = draft.coordinates();
    free.retain(|name| !follows(name));
    let drives = !draft.drives.is_empty();
    let names_independent = actuated.is_empty() && !drives || actuated.iter().any(follows);
    frame.independent = names_independent.then_some(free.as_slice());
    let mut text = write::write(draft, &frame);
    if let Verdict::Choose(mut choice) = choose::test_independent(&text, options.names.home)? {
        replace_followers(&mut choice, draft);
        // if there are loops, and neither file nor options name actuated joints, the independent
        // coordinates become the actuated ones
        let by_choice = names_no_motors(draft, tree);
        if by_choice && let Some(base) = base_joints(draft, choice.len()) {
            // motors stand at the base as a rule
            let at_base = write::SpecContext {
                actuated: &base,
                independent: None,
                ..frame
            };
            let text = write::write(draft, &at_base);
            let valid = choose::test_independent(&text, options.names.home);
            if matches!(valid, Ok(Verdict::Valid)) {
                return Ok((name, text, base));
            }
        }
        let chosen = |name: &String| choice.contains(name);
        if by_choice && choice.iter().all(|name| actuated.contains(name)) {
            let motors: Vec<String> = actuated.iter().filter(|n| chosen(n)).cloned().collect();
            frame.actuated = &motors;
            frame.independent = None;
            text = write::write(draft, &frame);
            with_motors.clone_from(&motors);
        } else {
            frame.independent = Some(&choice);
            text = write::write(draft, &frame);
        }
        choose::test_independent(&text, options.names.home)?;
    }
    Ok((name, text, with_motors))
}

/// Whether a robot with loops has motors at joints that its file does not name.
fn names_no_motors(draft: &Draft, tree: &Tree) -> bool {
    tree.actuated.is_empty() && !draft.cuts.is_empty() && draft.drives.is_empty()
}

/// The first joint with one coordinate of each limb at the world, if there are so many.
fn base_joints(draft: &Draft, count: usize) -> Option<Vec<String>> {
    let at_world = draft.limbs.iter().filter(|limb| limb.from.is_none());
    let first = at_world.filter_map(|limb| {
        let first = limb.joints.iter().find(|joint| joint.kind != "fixed")?;
        let single = first.kind != "spherical" && first.kind != "universal";
        first.name.clone().filter(|_| single)
    });
    let first: Vec<String> = first.collect();
    (first.len() == count).then_some(first)
}

/// Replaces each joint that follows others by one of those, since the spec's format takes joints
/// that follow others as dependent.
fn replace_followers(choice: &mut [String], draft: &Draft) {
    for _ in 0..=draft.couplings.len() {
        for k in 0..choice.len() {
            let Some(coupling) = draft.couplings.iter().find(|c| c.key == choice[k]) else {
                continue;
            };
            let mut terms = coupling.terms.iter().filter(|t| t.1 != 0.0);
            if let Some((leader, _)) = terms.find(|t| !choice.contains(&t.0)) {
                choice[k].clone_from(leader);
            }
        }
    }
}

/// The actuated joints: those that the file or the options name, or else, without drives, every
/// joint with one degree of freedom that follows no other.
fn actuated(draft: &Draft, tree: &Tree) -> Vec<String> {
    let joints = draft.limbs.iter().flat_map(|limb| &limb.joints);
    let follows = |name: &str| draft.couplings.iter().any(|c| c.key == name);
    let chosen = joints.filter_map(|joint| {
        let (name, from) = (joint.name.as_ref()?, joint.from.as_ref()?);
        let single = joint.kind != "spherical" && !from.passive;
        let named = match tree.actuated.as_slice() {
            [] => tree.drives.is_empty() && !follows(name),
            names => names.contains(&from.name),
        };
        (single && named).then(|| name.clone())
    });
    chosen.collect()
}
