//! Robot files of others: URDF and MJCF into regen's descriptions, and identified
//! parameters back into URDF.
//!
//! [`import`] takes a file's text and gives the text of a spec: the file's names,
//! limits, inertias and friction; long serial limbs with branches; loops as cuts,
//! joints that follow others as couplings. Nothing here reads files: a text goes
//! in, a text comes out.
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

mod choose;
mod fields;
mod layout;
mod log;
mod mjcf;
mod names;
mod number;
mod pose;
mod tree;
mod urdf;
mod write;
mod xml;

pub use log::Note;
pub use xml::Reader;

use regen_codegen::diag::{Report, Source};

use choose::Verdict;
use fields::Fields;
use layout::Draft;
use log::Log;
use tree::Tree;

/// How a file is imported.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The spec's name; the robot's in the file if missing.
    pub name: Option<String>,
    /// Keep angles as they are printed: 1.5708 is not taken as pi/2.
    pub exact: bool,
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
    let imported = tree(source, reader, options, &mut log)
        .map(|tree| (layout::lay_out(&tree, &mut log), tree));
    let Some((draft, tree)) = imported.filter(|_| !log.failed()) else {
        return Err(log.reports());
    };
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
    let text = write::write(draft, &frame);
    let text = match choose::judge(&text)? {
        Verdict::Valid => text,
        Verdict::Choose(choice) => {
            frame.independent = Some(&choice);
            let text = write::write(draft, &frame);
            choose::judge(&text)?;
            text
        }
    };
    Ok((name, text))
}

/// The joints with motors: those that the file names, or else every joint of one
/// freedom that follows no other.
fn actuated(draft: &Draft, tree: &Tree) -> Vec<String> {
    let joints = draft.limbs.iter().flat_map(|limb| &limb.joints);
    let follows = |name: &str| draft.couplings.iter().any(|c| c.0 == name);
    let chosen = joints.filter_map(|joint| {
        let (name, from) = (joint.name.as_ref()?, joint.from.as_ref()?);
        let single = joint.kind != "spherical" && !from.passive && !follows(name);
        let named = tree.actuated.is_empty() || tree.actuated.contains(&from.name);
        (single && named).then(|| name.clone())
    });
    chosen.collect()
}
