//! Classes of default values: a missing attribute is taken from the element's class, or from the
//! class that the enclosing body gives to its children, or from the top class.

use std::collections::BTreeMap;

use crate::log::Log;
use crate::xml::{Attribute, Element};

/// The name of the top class.
const MAIN: &str = "main";

/// The elements that have defaults.
const KINDS: [&str; 11] = [
    "joint", "geom", "site", "mesh", "material", "camera", "light", "pair", "equality", "tendon",
    "general",
];

/// Attributes by class, tag and name; each class contains those of the enclosing classes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Defaults(BTreeMap<String, Class>);

type Class = BTreeMap<String, BTreeMap<String, Attribute>>;

impl Defaults {
    /// Reads all sections `<default>`.
    pub(crate) fn new(root: &Element, log: &mut Log) -> Self {
        let mut defaults = Self::default();
        defaults.0.insert(MAIN.to_owned(), Class::new());
        // merge all sections of the top class before other classes copy it
        let sections: Vec<&Element> = root.all("default").collect();
        for section in &sections {
            let name = section.text("class").unwrap_or(MAIN);
            let mut class = defaults.class(MAIN);
            fill(section, &mut class);
            defaults.0.insert(MAIN.to_owned(), class.clone());
            defaults.0.insert(name.to_owned(), class);
        }
        for section in &sections {
            let name = section.text("class").unwrap_or(MAIN);
            defaults.nested(section, name, log);
        }
        defaults
    }

    /// Reads the classes within a section of the class `around`, whose attributes they start from.
    fn nested(&mut self, section: &Element, around: &str, log: &mut Log) {
        for inner in section.all("default") {
            let Some(name) = inner.text("class") else {
                let message = "this class of defaults has no name";
                log.error(inner.place, message, "write class=\"...\"");
                continue;
            };
            let mut class = self.class(around);
            fill(inner, &mut class);
            self.0.insert(name.to_owned(), class);
            self.nested(inner, name, log);
        }
    }

    fn class(&self, name: &str) -> Class {
        self.0.get(name).cloned().unwrap_or_default()
    }

    /// An attribute of an element, or else the default of its class. `inherited` is the class that
    /// the enclosing bodies give to their children.
    pub(crate) fn attribute<'a>(
        &'a self,
        element: &'a Element,
        inherited: Option<&str>,
        name: &str,
    ) -> Option<&'a Attribute> {
        let class = element.text("class").or(inherited).unwrap_or(MAIN);
        let by_class = || self.0.get(class)?.get(kind(&element.tag))?.get(name);
        let found = element.attribute(name).or_else(by_class);
        found.inspect(|a| a.used.mark())
    }

    /// Records an error if an element names an undefined class.
    pub(crate) fn check(&self, element: &Element, log: &mut Log) {
        for name in ["class", "childclass"] {
            if let Some(class) = element.attribute(name)
                && !self.0.contains_key(&class.value)
            {
                let message = format!("no class of defaults is called '{}'", class.value);
                let hint =
                    "classes are defined in <default>, perhaps in a file that is not included";
                log.error(class.place, message, hint);
            }
        }
    }
}

/// The element whose defaults an element takes: actuators share theirs, as do tendons and equalities.
fn kind(tag: &str) -> &str {
    match tag {
        "motor" | "position" | "velocity" | "intvelocity" | "damper" | "cylinder" | "muscle"
        | "adhesion" | "dcmotor" => "general",
        "spatial" | "fixed" => "tendon",
        "connect" | "weld" => "equality",
        tag => tag,
    }
}

/// Adds the attributes of a section to a class, in place of those that it has.
fn fill(section: &Element, class: &mut Class) {
    for element in section.children.iter().filter(|c| c.tag != "default") {
        if KINDS.contains(&kind(&element.tag)) {
            element.used.mark();
        }
        let attributes = class.entry(kind(&element.tag).to_owned()).or_default();
        for attribute in &element.attributes {
            attributes.insert(attribute.name.clone(), attribute.clone());
        }
    }
}
