//! Writing of a draft as the text of a spec.

use std::fmt::Write as _;

use crate::frames::denavit_hartenberg;
use crate::layout::{Draft, DraftBody, DraftJoint, DraftLimb};
use crate::number::{angle, exact_angle, number};
use crate::pose::{Pose, V3};
use crate::tree::{Drive, Joint};

/// Longer entries are written on several lines.
const MAX_ENTRY_WIDTH: usize = 110;

/// Formats an angle.
type Angle = fn(f64) -> String;

/// The data of a spec in addition to the draft.
#[derive(Clone, Debug)]
pub(crate) struct SpecContext<'a> {
    pub(crate) name: &'a str,
    /// The robot's name in the file.
    pub(crate) robot: &'a str,
    /// The file's own name, without directories.
    pub(crate) file: &'a str,
    pub(crate) format: &'a str,
    pub(crate) gravity: Option<V3>,
    /// Whether angles keep their printed digits.
    pub(crate) exact: bool,
    /// Actuated joints by their names in the spec.
    pub(crate) actuated: &'a [String],
    /// Whether actuated joints for which the file states no friction or rotor have both.
    pub(crate) geared: bool,
    pub(crate) independent: Option<&'a [String]>,
}

/// The text of the spec.
pub(crate) fn write(draft: &Draft, context: &SpecContext<'_>) -> String {
    let mut out = String::new();
    let angle: Angle = if context.exact { exact_angle } else { angle };
    header(draft, context, &mut out);
    out.push_str("\nlimbs:\n");
    for limb in &draft.limbs {
        write_limb(limb, context, angle, &mut out);
    }
    if !draft.cuts.is_empty() {
        out.push_str("\n# Where the loops were opened: a frame on each of two bodies.\ncuts:\n");
        for cut in &draft.cuts {
            let side = |(body, pose): &(Option<String>, Pose)| {
                let body = body.as_deref().unwrap_or("world");
                let mut fields = vec![("body", body.to_owned())];
                fields.extend(placement(pose, angle));
                flow(&fields)
            };
            let [a, b] = &cut.sides;
            let between = format!("[{}, {}]", side(a), side(b));
            let fields = [
                ("name", cut.name.clone()),
                ("joint", cut.kind.clone()),
                ("between", between),
            ];
            entry(&fields, 2, &mut out);
        }
    }
    if !draft.couplings.is_empty() {
        out.push_str("\n# Joints that follow others.\ncouplings:\n");
        for coupling in &draft.couplings {
            let form = linear(coupling.constant, &coupling.terms, angle);
            let _ = writeln!(out, "  {}: {form}", coupling.key);
        }
    }
    if !draft.drives.is_empty() {
        out.push_str("\n# Motors that move several joints, or one with a ratio.\ndrives:\n");
        for drive in &draft.drives {
            let fields = drive_fields(drive, draft, context, angle);
            let _ = writeln!(out, "  {}: {}", drive.name, flow(&fields));
        }
    }
    if !draft.springs.is_empty() {
        out.push_str("\n# Springs between points of two bodies.\nsprings:\n");
        for spring in &draft.springs {
            let end = |(body, point): &(Option<String>, V3)| {
                let body = body.as_deref().unwrap_or("world");
                let mut fields = vec![("body", body.to_owned())];
                if *point != [0.0; 3] {
                    fields.push(("xyz", list(&point.map(number))));
                }
                flow(&fields)
            };
            let [a, b] = &spring.ends;
            let fields = [
                ("name", spring.name.clone()),
                ("between", format!("[{}, {}]", end(a), end(b))),
                ("length", number(spring.length)),
                ("nominal", flow(&[("k", number(spring.stiffness))])),
            ];
            entry(&fields, 2, &mut out);
        }
    }
    if let Some(independent) = context.independent {
        let _ = writeln!(
            out,
            "\n# The coordinates that the others follow from.\nindependent: [{}]",
            wrapped(independent)
        );
    }
    if !draft.home.is_empty() {
        let home: Vec<String> = draft
            .home
            .iter()
            .map(|(name, value)| format!("{name}: {}", angle(*value)))
            .collect();
        let _ = writeln!(
            out,
            "\n# Where the file has the robot at its start.\nhome: {{{}}}",
            home.join(", ")
        );
    }
    bodies(&draft.bodies, angle, &mut out);
    out
}

fn header(draft: &Draft, context: &SpecContext<'_>, out: &mut String) {
    let SpecContext {
        name,
        robot,
        file,
        format,
        ..
    } = context;
    let _ = writeln!(
        out,
        "# Imported from the {format} file {}. Names, limits and inertias are the file's.\n\
         # A coordinate is 0 where it is 0 in the file. A body's frame is its link's frame there, with\n\
         # what turns or shifts it noted at the body.\n",
        printable(file)
    );
    let _ = writeln!(out, "name: {name}");
    let loops = match draft.cuts.len() {
        0 => String::new(),
        n => format!(", {}", count(n, "loop", "loops")),
    };
    let joints = draft.limbs.iter().flat_map(|l| &l.joints);
    let joints = joints.filter(|j| j.name.is_some()).count();
    let joints = count(joints, "joint", "joints");
    let bodies = count(draft.bodies.len(), "body", "bodies");
    let description = format!("{robot}: {joints}, {bodies}{loops}");
    let _ = writeln!(out, "description: {}", quoted(&description));
    let gravity = context.gravity.unwrap_or([0.0, 0.0, -9.81]);
    let _ = writeln!(out, "gravity: {}", list(&gravity.map(number)));
}

fn count(number: usize, one: &str, many: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
}

/// Replaces control characters by blanks, so that the text is one line.
fn printable(text: &str) -> String {
    let keep = |c: char| if c.is_control() { ' ' } else { c };
    text.chars().map(keep).collect()
}

/// The text as a double-quoted scalar of YAML.
fn quoted(text: &str) -> String {
    let text = printable(text).replace('\\', "\\\\").replace('"', "\\\"");
    format!("\"{text}\"")
}

fn write_limb(limb: &DraftLimb, context: &SpecContext<'_>, angle: Angle, out: &mut String) {
    let _ = writeln!(out, "  - name: {}", limb.name);
    if let Some(from) = &limb.from {
        let _ = writeln!(out, "    from: {from}");
    }
    let (base, rows) = rows(limb, angle);
    if !base.is_unit() {
        let _ = writeln!(out, "    base: {}", flow(&placement(&base, angle)));
    }
    out.push_str("    joints:\n");
    for (joint, row) in limb.joints.iter().zip(rows) {
        entry(&joint_fields(joint, row, context, angle), 6, out);
    }
}

/// The limb's base and the placement of each joint: by Denavit-Hartenberg rows if all joints,
/// except the first, have such poses, else by origins.
fn rows(limb: &DraftLimb, angle: Angle) -> (Pose, Vec<Option<(&'static str, String)>>) {
    let is_row =
        |joint: &DraftJoint| joint.axis == 'z' && denavit_hartenberg(&joint.pose).is_some();
    let first = limb.joints.first();
    let all = limb.joints.len() > 1 && limb.joints.iter().skip(1).all(is_row);
    // translations along z alone are no reason to use Denavit-Hartenberg rows
    let turned = limb.joints.iter().any(|j| !j.pose.is_shift_along_z());
    if all && turned && first.is_some_and(|j| j.axis == 'z') {
        let by_base = first.filter(|j| !is_row(j)).map(|j| j.pose);
        let rows = limb.joints.iter().enumerate().map(|(k, joint)| {
            if k == 0 && by_base.is_some() {
                return None;
            }
            let [alpha, a, d, theta] = denavit_hartenberg(&joint.pose)?;
            let fields = [
                ("alpha", angle(alpha)),
                ("a", number(a)),
                ("d", number(d)),
                ("theta", angle(theta)),
            ];
            let fields: Vec<_> = fields.into_iter().filter(|f| f.1 != "0").collect();
            (!fields.is_empty()).then(|| ("dh", flow(&fields)))
        });
        return (by_base.unwrap_or_default(), rows.collect());
    }
    let rows = limb.joints.iter().map(|joint| {
        let fields = placement(&joint.pose, angle);
        (!fields.is_empty()).then(|| ("origin", flow(&fields)))
    });
    (Pose::default(), rows.collect())
}

fn joint_fields(
    joint: &DraftJoint,
    row: Option<(&'static str, String)>,
    context: &SpecContext<'_>,
    angle: Angle,
) -> Vec<(&'static str, String)> {
    let mut fields = Vec::new();
    if let Some(name) = &joint.name {
        fields.push(("name", name.clone()));
    }
    fields.push(("type", joint.kind.to_owned()));
    fields.extend(row);
    if joint.axis != 'z' {
        fields.push(("axis", joint.axis.to_string()));
    }
    if let Some(body) = &joint.body {
        fields.push(("body", body.clone()));
    }
    let is_actuated = (joint.name.as_ref()).is_some_and(|n| context.actuated.contains(n));
    if is_actuated {
        fields.push(("actuated", "true".to_owned()));
    }
    let Some(from) = &joint.from else {
        return fields;
    };
    let mut nominal = friction_fields(from.damping, from.friction, from.armature, &mut fields);
    if context.geared && is_actuated {
        let added = [("friction", "linear"), ("rotor_inertia", "true")];
        for (key, value) in added {
            if fields.iter().all(|(own, _)| *own != key) {
                fields.push((key, value.to_owned()));
            }
        }
    }
    if from.stiffness > 0.0 {
        let rest = number(from.spring_rest);
        fields.push(("spring", flow(&[("rest", rest)])));
        nominal.push(("K", number(from.stiffness)));
    }
    let mut limits = Vec::new();
    // multiples of pi only where the number agrees with one up to rounding
    let figure = |x: f64| {
        let turns = joint.kind != "prismatic";
        if turns { angle(x) } else { number(x) }
    };
    if let Some(range) = from.position {
        limits.push(("position", list(&range.map(figure))));
    }
    if let Some(velocity) = from.velocity {
        limits.push(("velocity", list(&[-velocity, velocity].map(figure))));
    }
    if let Some(most) = from.acceleration {
        limits.push(("acceleration", list(&[-most, most].map(figure))));
    }
    if let Some(most) = from.jerk {
        limits.push(("jerk", list(&[-most, most].map(figure))));
    }
    if let Some(effort) = from.effort {
        limits.push(("effort", list(&effort.map(number))));
    }
    if !limits.is_empty() {
        fields.push(("limits", flow(&limits)));
    }
    if !nominal.is_empty() {
        fields.push(("nominal", flow(&nominal)));
    }
    fields
}

/// Adds the keys of friction and rotor, and returns their nominal values.
fn friction_fields(
    damping: f64,
    friction: f64,
    armature: f64,
    fields: &mut Vec<(&'static str, String)>,
) -> Vec<(&'static str, String)> {
    let mut nominal = Vec::new();
    let law = match (damping > 0.0, friction > 0.0) {
        (false, false) => None,
        (true, false) => Some("viscous"),
        (false, true) => Some("coulomb"),
        (true, true) => Some("linear"),
    };
    if damping > 0.0 {
        nominal.push(("Fv", number(damping)));
    }
    if friction > 0.0 {
        nominal.push(("Fc", number(friction)));
    }
    fields.extend(law.map(|kind| ("friction", kind.to_owned())));
    if armature > 0.0 {
        fields.push(("rotor_inertia", "true".to_owned()));
        nominal.push(("J", number(armature)));
    }
    nominal
}

fn drive_fields(
    drive: &Drive,
    draft: &Draft,
    context: &SpecContext<'_>,
    angle: Angle,
) -> Vec<(&'static str, String)> {
    let mut fields = vec![("of", linear(0.0, &drive.terms, angle))];
    if drive.slides {
        fields.push(("type", "prismatic".to_owned()));
    }
    let nominal = friction_fields(drive.damping, drive.friction, drive.armature, &mut fields);
    if context.geared {
        // not where the file states them at a joint that the drive moves
        let of = |joint: &&DraftJoint| {
            let name = joint.name.as_ref();
            name.is_some_and(|name| drive.terms.iter().any(|(own, _)| own == name))
        };
        let joints = || draft.limbs.iter().flat_map(|limb| &limb.joints).filter(of);
        let from = |value: fn(&Joint) -> f64| {
            let mut all = joints().filter_map(|joint| joint.from.as_ref());
            all.any(|from| value(from) != 0.0)
        };
        let added = [
            ("friction", "linear", from(|j| j.damping + j.friction)),
            ("rotor_inertia", "true", from(|j| j.armature)),
        ];
        for (key, value, is_stated) in added {
            if !is_stated && fields.iter().all(|(own, _)| *own != key) {
                fields.push((key, value.to_owned()));
            }
        }
    }
    let ranges = [("position", drive.position), ("effort", drive.effort)];
    let limits: Vec<_> = ranges
        .into_iter()
        .filter_map(|(key, range)| Some((key, list(&range?.map(number)))))
        .collect();
    if !limits.is_empty() {
        fields.push(("limits", flow(&limits)));
    }
    if !nominal.is_empty() {
        fields.push(("nominal", flow(&nominal)));
    }
    fields
}

fn bodies(bodies: &[DraftBody], angle: Angle, out: &mut String) {
    let unknown = bodies.iter().filter(|body| body.unknown);
    let unknown: Vec<&str> = unknown.map(|body| body.label.as_str()).collect();
    if !unknown.is_empty() {
        let _ = writeln!(
            out,
            "\n# The file states no mass of: {}",
            unknown.join(", ")
        );
    }
    if unknown.len() == bodies.len() {
        return;
    }
    out.push_str("\n# Mass, centre of mass, and inertia about it, in the body's frame.\nbodies:\n");
    for body in bodies.iter().filter(|body| !body.unknown) {
        let inertia = &body.inertia;
        let mut fields = vec![("mass", number(inertia.mass))];
        if inertia.com != [0.0; 3] {
            fields.push(("com", list(&inertia.com.map(number))));
        }
        if inertia.tensor != [0.0; 6] {
            fields.push(("inertia", list(&inertia.tensor.map(number))));
        }
        let _ = write!(out, "  {}: {}", body.label, flow(&fields));
        if !body.frame.is_unit() {
            let frame = flow(&placement(&body.frame, angle));
            let link = printable(&body.link);
            let _ = write!(out, "  # frame at {frame} of {link}");
        }
        out.push('\n');
    }
}

/// The keys and values of a placement, without those that are zero.
fn placement(pose: &Pose, angle: Angle) -> Vec<(&'static str, String)> {
    let mut fields = Vec::new();
    if pose.p != [0.0; 3] {
        fields.push(("xyz", list(&pose.p.map(number))));
    }
    let rpy = pose.rpy().map(angle);
    if rpy.iter().any(|x| x != "0") {
        fields.push(("rpy", list(&rpy)));
    }
    fields
}

fn linear(constant: f64, terms: &[(String, f64)], angle: Angle) -> String {
    let mut out = String::new();
    for (name, factor) in terms {
        if *factor == 0.0 {
            continue;
        }
        let sign = match (out.is_empty(), *factor < 0.0) {
            (true, true) => "-",
            (true, false) => "",
            (false, true) => " - ",
            (false, false) => " + ",
        };
        out.push_str(sign);
        if factor.abs() != 1.0 {
            let _ = write!(out, "{}*", number(factor.abs()));
        }
        out.push_str(name);
    }
    if out.is_empty() {
        return angle(constant);
    }
    if constant != 0.0 {
        let sign = if constant < 0.0 { "-" } else { "+" };
        let _ = write!(out, " {sign} {}", angle(constant.abs()));
    }
    out
}

fn list(values: &[String]) -> String {
    format!("[{}]", values.join(", "))
}

/// Names, separated into lines that are not too long.
fn wrapped(names: &[String]) -> String {
    let mut out = String::new();
    let mut column = "independent: [".len();
    for (k, name) in names.iter().enumerate() {
        if k > 0 && column + name.len() + 3 > MAX_ENTRY_WIDTH {
            out.push_str(",\n  ");
            column = 2;
        } else if k > 0 {
            out.push_str(", ");
            column += 2;
        }
        out.push_str(name);
        column += name.len();
    }
    out
}

fn flow(fields: &[(&'static str, String)]) -> String {
    let fields: Vec<String> = fields.iter().map(|(k, v)| format!("{k}: {v}")).collect();
    format!("{{{}}}", fields.join(", "))
}

/// A list entry, on one line if it is short.
fn entry(fields: &[(&'static str, String)], indent: usize, out: &mut String) {
    let line = flow(fields);
    if indent + 2 + line.len() <= MAX_ENTRY_WIDTH {
        let _ = writeln!(out, "{:indent$}- {line}", "");
        return;
    }
    for (k, (key, value)) in fields.iter().enumerate() {
        let mark = if k == 0 { "- " } else { "  " };
        let long = *key == "between" && indent + value.len() > MAX_ENTRY_WIDTH;
        if long && let Some((a, b)) = value.split_once("}, {body") {
            let _ = writeln!(out, "{:indent$}{mark}{key}:", "");
            let _ = writeln!(out, "{:indent$}    - {}}}", "", a.trim_start_matches('['));
            let b = b.strip_suffix(']').unwrap_or(b);
            let _ = writeln!(out, "{:indent$}    - {{body{b}", "");
            continue;
        }
        let _ = writeln!(out, "{:indent$}{mark}{key}: {value}", "");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lists_of_names_are_wrapped() {
        let names: Vec<String> = (0..30).map(|k| format!("joint_{k}")).collect();
        let text = wrapped(&names);
        assert!(text.lines().count() > 2 && text.lines().all(|l| l.len() <= MAX_ENTRY_WIDTH));
        assert_eq!(text.matches(',').count(), 29);
        assert_eq!(wrapped(&names[..2]), "joint_0, joint_1");
    }

    #[test]
    fn a_line_of_names_is_filled_up_to_its_width_and_no_further() {
        // the line with what precedes the names and a bracket or a comma behind them
        let width = |names: &[String]| {
            let first = wrapped(names).lines().next().map_or(0, |line| {
                "independent: [".len() + line.trim_end_matches(',').len() + 1
            });
            (first, wrapped(names).lines().count())
        };
        let names = |last: usize| ["a".repeat(40), "b".repeat(40), "c".repeat(last)];
        let fits = MAX_ENTRY_WIDTH - "independent: [".len() - 80 - 4 - 1;
        assert_eq!(width(&names(fits)), (MAX_ENTRY_WIDTH, 1));
        assert_eq!(width(&names(fits + 1)).1, 2);
    }
}
