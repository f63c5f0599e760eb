//! Tells what of a file no reader has used: nothing is dropped without a word.
//!
//! What is known to have no effect on the dynamics is one note; everything else is told by the element
//! that it stands in. An unknown name that may tie links together is an error, since a robot without
//! one of its constraints is another robot.

use crate::log::{Log, Place};
use crate::xml::{Attribute, Element};

/// An element of a format, with the names of what no reader needs in it.
pub(crate) struct Row {
    /// The element's name.
    tag: &'static str,
    /// Whether the element as a whole has no effect on the dynamics.
    is_idle: bool,
    /// The attributes and elements within it that have none, separated by blanks; `*` for any.
    idle: &'static str,
}

impl Row {
    /// An element that has no effect as a whole.
    pub(crate) const fn whole(tag: &'static str, idle: &'static str) -> Self {
        Self {
            tag,
            is_idle: true,
            idle,
        }
    }

    /// An element that readers need, with parts that have no effect.
    pub(crate) const fn parts(tag: &'static str, idle: &'static str) -> Self {
        Self {
            tag,
            is_idle: false,
            idle,
        }
    }

    fn has(&self, name: &str) -> bool {
        self.idle == "*" || self.idle.split(' ').any(|word| word == name)
    }
}

/// Parts of names of what may tie links together.
const KINEMATIC: [&str; 23] = [
    "joint",
    "loop",
    "constraint",
    "coupl",
    "frame",
    "equality",
    "gear",
    "mimic",
    "closure",
    "weld",
    "connect",
    "tendon",
    "belt",
    "pulley",
    "cable",
    "chain",
    "transmission",
    "differential",
    "hinge",
    "prismatic",
    "revolute",
    "screw",
    "linkage",
];

/// The name of a property without the schema of PhysX that it belongs to, which has joints in its name.
fn of_joint(name: &str) -> &str {
    let schema = ["physxJoint:", "physxJointAxis:", "physxMimicJoint:"];
    let found = schema.iter().find_map(|own| name.strip_prefix(own));
    found.unwrap_or(name)
}

/// Notes what was not used of an element, and records errors for names that may be kinematic.
///
/// - `rows`: what of the format has no effect on the dynamics.
/// - `ignore`: the option by which a name can be left out.
pub(crate) fn report(root: &Element, rows: &[Row], ignore: &str, log: &mut Log) {
    let mut reporter = Reporter {
        rows,
        log,
        refused: Vec::new(),
    };
    reporter.used(root);
    for Refused {
        name,
        within,
        place,
        count,
    } in reporter.refused
    {
        let times = match count {
            1 => String::new(),
            count => format!(" ({count} times)"),
        };
        let message =
            format!("{name} in <{within}> is not known, and may tie links together{times}");
        let bare = name.trim_matches(['<', '>']);
        log.error(place, message, &format!("`{ignore} {bare}` leaves it out"));
    }
}

/// A name that may be kinematic, at the first place where it stands.
struct Refused {
    name: String,
    within: String,
    place: Place,
    count: usize,
}

struct Reporter<'a> {
    rows: &'a [Row],
    log: &'a mut Log,
    refused: Vec<Refused>,
}

impl<'a> Reporter<'a> {
    fn row(&self, tag: &str) -> Option<&'a Row> {
        self.rows.iter().find(|row| row.tag == tag)
    }

    /// Reports what is within an element that a reader has used.
    fn used(&mut self, element: &Element) {
        let row = self.row(&element.tag);
        for attribute in unread(element) {
            self.attribute(attribute, element, row);
        }
        if let Some(text) = element.content.as_ref().filter(|c| !c.used.is_marked())
            && row.is_none_or(|row| row.idle != "*")
        {
            let about = format!("not used in <{}>: {{}}", element.tag);
            self.log.note_each(text.place, about, "its text");
        }
        for child in &element.children {
            if child.used.is_marked() {
                self.used(child);
            } else {
                self.unused(child, element, row);
            }
        }
    }

    /// Reports an attribute that no reader has used.
    fn attribute(&mut self, attribute: &Attribute, within: &Element, row: Option<&Row>) {
        let (place, name) = (attribute.place, attribute.name.as_str());
        if row.is_some_and(|row| row.has(name)) {
            self.idle(place, &format!("{name} of <{}>", within.tag));
        } else if is_kinematic(of_joint(name)) {
            self.refuse(place, name, &within.tag);
        } else {
            let about = format!("not used in <{}>: {{}}", within.tag);
            self.log.note_each(place, about, name);
        }
    }

    /// Reports an element that no reader has used.
    fn unused(&mut self, element: &Element, within: &Element, around: Option<&Row>) {
        let tag = &element.tag;
        let row = self.row(tag).filter(|row| row.is_idle);
        if let Some(row) = row {
            if let Some(name) = tying_plugin(element) {
                let text =
                    "a plugin that may tie joints together is not read (check the couplings): {}";
                self.log.note_each(element.place, text, name);
                return;
            }
            self.idle(element.place, &format!("<{tag}>"));
            if row.idle != "*" {
                self.foreign(element, row);
            }
        } else if around.is_some_and(|row| row.has(tag)) {
            self.idle(element.place, &format!("<{tag}>"));
        } else if is_kinematic(tag) {
            self.refuse(element.place, &format!("<{tag}>"), &within.tag);
        } else {
            let text = format!("not used in <{}>: {{}}", within.tag);
            self.log.note_each(element.place, text, &format!("<{tag}>"));
            self.kinematic(element);
        }
    }

    /// Notes names within an element without effect that the format does not have there.
    fn foreign(&mut self, element: &Element, row: &Row) {
        for attribute in unread(element).filter(|a| !row.has(&a.name)) {
            let text = format!("not used in <{}>: {{}}", element.tag);
            self.log.note_each(attribute.place, text, &attribute.name);
        }
        for child in &element.children {
            if !row.has(&child.tag) {
                let text = format!("not used in <{}>: {{}}", element.tag);
                let item = format!("<{}>", child.tag);
                self.log.note_each(child.place, text, &item);
            }
            self.foreign(child, row);
        }
    }

    /// Refuses names within an unknown element that may be kinematic.
    fn kinematic(&mut self, element: &Element) {
        for attribute in unread(element).filter(|a| is_kinematic(&a.name)) {
            self.refuse(attribute.place, &attribute.name, &element.tag);
        }
        for child in element.children.iter().filter(|c| !c.used.is_marked()) {
            if is_kinematic(&child.tag) {
                self.refuse(child.place, &format!("<{}>", child.tag), &element.tag);
            } else {
                self.kinematic(child);
            }
        }
    }

    fn idle(&mut self, place: Place, item: &str) {
        let text = "not used, since it has no effect on the dynamics: {}";
        self.log.note_each(place, text, item);
    }

    fn refuse(&mut self, place: Place, name: &str, within: &str) {
        let mut refused = self.refused.iter_mut();
        let same = refused.find(|own| own.name == name && own.within == within);
        if let Some(same) = same {
            same.count += 1;
            return;
        }
        self.refused.push(Refused {
            name: name.to_owned(),
            within: within.to_owned(),
            place,
            count: 1,
        });
    }
}

/// The attributes that no reader has used.
fn unread(element: &Element) -> impl Iterator<Item = &Attribute> {
    let attributes = element.attributes.iter();
    attributes.filter(|a| !a.used.is_marked() && !a.name.starts_with("xmlns"))
}

/// The file or the name of a simulator's plugin that tells of ties between joints.
fn tying_plugin(element: &Element) -> Option<&str> {
    const TIES: [&str; 7] = [
        "mimic",
        "loop",
        "constraint",
        "coupl",
        "gear",
        "belt",
        "differential",
    ];
    let names = element.attributes.iter().map(|a| a.value.as_str());
    let ties = |name: &str| {
        let name = name.to_ascii_lowercase();
        TIES.iter().any(|part| name.contains(part))
    };
    let mut names = names.filter(|_| element.tag == "plugin");
    names.find(|name| ties(name))
}

pub(crate) fn is_kinematic(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    KINEMATIC.iter().any(|part| name.contains(part))
}
