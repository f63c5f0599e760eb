//! Robot files of others: URDF and MJCF into regen's descriptions, and identified
//! parameters back into URDF.
//!
//! [`import`] takes a file's text and gives the text of a spec: the file's names,
//! limits, inertias and friction; long serial limbs with branches; loops as cuts,
//! joints that follow others as couplings. Nothing here reads files: a text goes
//! in, a text comes out. [`export`] is the way back for identified parameters.
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
mod edits;
mod export;
mod fields;
mod frames;
mod layout;
mod log;
mod mjcf;
mod names;
mod number;
mod pose;
mod tree;
mod urdf;
mod values;
mod write;
mod xml;

pub use export::{BodyParameters, Exported, JointParameters, Parameters, export};
pub use log::{LOOP_IN_TREE, Note};
pub use xml::Reader;

use regen_codegen::diag::{Report, Source, Span};

use choose::Verdict;
use fields::Fields;
use layout::Draft;
use log::{Log, Place};
use tree::{Joint, Kind, Tree};

/// How a file is imported.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The spec's name; the robot's in the file if missing.
    pub name: Option<String>,
    /// Keep angles as they are printed: 1.5708 is not taken as pi/2.
    pub exact: bool,
    /// What the root stands on, if not what the file says.
    pub base: Option<Base>,
    /// Loops to add: `NAME:JOINT:BODY@x,y,z[,r,p,y]:BODY[@x,y,z[,r,p,y]]`, bodies by
    /// the file's names or `world`, frames in the frames of the file's links. Where the
    /// second frame is missing, it is the first one at zero.
    pub cuts: Vec<String>,
    /// Joints with motors, if not those that the file says.
    pub actuated: Vec<String>,
    /// Start of the loops' solution, `NAME=VALUE` with the file's names; 0 if missing.
    pub home: Vec<String>,
    /// What errors in the texts above name as their source.
    pub names: OptionNames,
}

/// How the texts of [`Options`] are called in errors.
#[derive(Clone, Copy, Debug)]
pub struct OptionNames {
    /// [`Options::cuts`].
    pub cuts: &'static str,
    /// [`Options::actuated`].
    pub actuated: &'static str,
    /// [`Options::home`].
    pub home: &'static str,
}

impl Default for OptionNames {
    fn default() -> Self {
        Self {
            cuts: "cuts",
            actuated: "actuated",
            home: "home",
        }
    }
}

/// What the root of the tree stands on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Base {
    /// The world; a free joint there is left out.
    Fixed,
    /// Nothing: it moves with six freedoms.
    Floating,
}

/// A spec made from a file.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The spec's name.
    pub name: String,
    /// The spec's text.
    pub spec: String,
    /// Decisions and omissions, in the order of the file.
    pub notes: Vec<Note>,
}

/// Turns a URDF or MJCF file into a spec. `reader` reads the files that it
/// includes, by the names given there.
///
/// # Errors
/// What is wrong with the file, one report per file; or with the mechanism it
/// makes, with the place in the spec's text.
pub fn import(
    source: &Source,
    reader: &mut Reader<'_>,
    options: &Options,
) -> Result<Imported, Vec<Report>> {
    let mut log = Log::default();
    let imported = tree(source, reader, options, &mut log).map(|mut tree| {
        adapt(&mut tree, options, &mut log);
        (layout::lay_out(&tree, &mut log), tree)
    });
    let Some((mut draft, tree)) = imported.filter(|_| !log.failed()) else {
        return Err(log.reports());
    };
    home(&mut draft, options, &mut log);
    if draft.bodies.is_empty() {
        let hint = "masses stand in <inertial> of the links that move";
        log.error(tree.place, "nothing with mass moves in this file", hint);
    }
    if log.failed() {
        return Err(log.reports());
    }
    let (name, spec) = settle(&draft, &tree, &source.name, options).map_err(|r| vec![r])?;
    Ok(Imported {
        name,
        spec,
        notes: log.notes(),
    })
}

/// The file as a tree of links.
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
    let mut fields = Fields {
        log,
        exact: options.exact,
    };
    match root.tag.as_str() {
        "robot" => urdf::read(&root, &mut fields),
        "mujoco" => mjcf::read(&root, &mut fields),
        other => {
            let message = format!("<{other}> is neither URDF nor MJCF");
            let hint = "a URDF file starts with <robot>, an MJCF file with <mujoco>";
            log.error(root.place, message, hint);
            None
        }
    }
}

/// The tree as the options want it.
fn adapt(tree: &mut Tree, options: &Options, log: &mut Log) {
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
            unknown(
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
    }
    match options.base {
        None => {}
        Some(Base::Fixed) => {
            // links come after their parents
            let mut stands: Vec<bool> = Vec::new();
            for link in &mut tree.links {
                let on_ground = link.parent.is_none_or(|p| stands.get(p) == Some(&true));
                if on_ground {
                    link.joints.retain(|j| j.kind != Kind::Free);
                }
                stands.push(on_ground && link.joints.is_empty());
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

/// An error in a text of the options.
fn unknown(option: &str, word: &str, message: String, hint: &str, log: &mut Log) {
    let file = log.add(Source::new(option, word));
    log.error(Place::new(file, Span::new(0, word.len())), message, hint);
}

/// The start that the options give.
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
            unknown(options.names.home, text, message, &hint, log);
            continue;
        };
        draft.home.retain(|(other, _)| *other != name);
        draft.home.push((name, value));
    }
}

/// The text, with independent coordinates that are some.
fn settle(
    draft: &Draft,
    tree: &Tree,
    file: &str,
    options: &Options,
) -> Result<(String, String), Report> {
    let name = names::module(options.name.as_deref().unwrap_or(&tree.name));
    let actuated = actuated(draft, tree);
    let mut frame = write::Frame {
        name: &name,
        robot: &tree.name,
        file: file.rsplit(['/', '\\']).next().unwrap_or(file),
        format: tree.format,
        gravity: tree.gravity,
        actuated: &actuated,
        independent: None,
    };
    // a spec without motors, or with motors at joints that follow others, says itself what is
    // independent
    let follows = |name: &String| draft.couplings.iter().any(|c| c.key == *name);
    let mut free = draft.coordinates();
    free.retain(|name| !follows(name));
    let said = actuated.is_empty() || actuated.iter().any(follows);
    frame.independent = said.then_some(free.as_slice());
    let mut text = write::write(draft, &frame);
    if let Verdict::Choose(mut choice) = choose::judge(&text)? {
        lead(&mut choice, draft);
        // with loops, and nobody having said where the motors are: there
        let by_choice = tree.actuated.is_empty() && !draft.cuts.is_empty();
        let chosen = |name: &String| choice.contains(name);
        if by_choice && choice.iter().all(|name| actuated.contains(name)) {
            let motors: Vec<String> = actuated.iter().filter(|n| chosen(n)).cloned().collect();
            frame.actuated = &motors;
            frame.independent = None;
            text = write::write(draft, &frame);
        } else {
            frame.independent = Some(&choice);
            text = write::write(draft, &frame);
        }
        choose::judge(&text)?;
    }
    Ok((name, text))
}

/// Replaces joints that follow others by one that leads them: the format has those
/// that follow as dependent.
fn lead(choice: &mut [String], draft: &Draft) {
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

/// The joints with motors: those that the file names, or else every joint of one
/// freedom that follows no other.
fn actuated(draft: &Draft, tree: &Tree) -> Vec<String> {
    let joints = draft.limbs.iter().flat_map(|limb| &limb.joints);
    let follows = |name: &str| draft.couplings.iter().any(|c| c.key == name);
    let chosen = joints.filter_map(|joint| {
        let (name, from) = (joint.name.as_ref()?, joint.from.as_ref()?);
        let single = joint.kind != "spherical" && !from.passive;
        let named = match tree.actuated.as_slice() {
            [] => !follows(name),
            said => said.contains(&from.name),
        };
        (single && named).then(|| name.clone())
    });
    chosen.collect()
}
