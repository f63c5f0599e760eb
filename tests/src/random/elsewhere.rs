//! The same mechanism cut at another place: a cut's joint is moved into the tree, and the loop is
//! cut rigidly instead.

use std::fmt::Write as _;

use super::complete::closed_text;
use super::draft::{Frame, Joint, Kind, Limb, Placement, home_text};
use super::{Reject, Sample};
use crate::reference::{CutKind, Mechanism};

/// Moves the joint of a cut into the tree. It carries a massless body `extra`, which is cut rigidly
/// at the joint's second frame. The independent coordinates stay the same.
///
/// # Errors
/// When the text is not a spec.
pub fn opened_elsewhere(sample: &Sample, cut: usize) -> Result<(String, Mechanism), Reject> {
    let mut draft = sample.draft.clone();
    let opened = &mut draft.cuts[cut];
    let [x, y, z, slide] = opened.displacement;
    let (kind, home) = match opened.kind {
        CutKind::Spherical => (Kind::Spherical, vec![z, y, x]),
        CutKind::Universal => (Kind::Universal, vec![x, y]),
        CutKind::Revolute => (Kind::Revolute, vec![z]),
        CutKind::Prismatic => (Kind::Prismatic, vec![slide]),
        CutKind::Helical => (Kind::Helical, vec![z]),
        CutKind::Cylindrical => (Kind::Cylindrical, vec![z, slide]),
        CutKind::Fixed => (Kind::Fixed, Vec::new()),
    };
    let limb = Limb {
        from: opened.a.body.take(),
        base: std::mem::replace(&mut opened.a.placement, Placement::none()),
        joints: vec![Joint {
            name: "extra".into(),
            kind,
            frame: Frame::Same,
            axis: "z",
            pitch: opened.pitch,
            body: Some("extra".into()),
            actuated: false,
            friction: "none",
            rotor: false,
            more: String::new(),
            home: home.iter().map(|x| format!("{x}")).collect(),
        }],
    };
    opened.a.body = Some("extra".into());
    opened.kind = CutKind::Fixed;
    opened.displacement = [0.0; 4];
    opened.more = "";
    draft.limbs.push(limb);
    let mut text = closed_text(&draft)? + &home_text(&draft.home_pairs());
    let _ = writeln!(text, "independent: [{}]", sample.independent.join(", "));
    let mechanism = Mechanism::from_yaml(&text).map_err(|_| Reject::Unfit)?;
    Ok((text, mechanism))
}
