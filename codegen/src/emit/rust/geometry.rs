//! Emits the type of the adjustable geometry.

use std::fmt::Write as _;

use crate::robot::Robot;

use super::names::{RESERVED, literal};

/// Emits the names and the type of the adjustable geometry, if there is any.
pub(super) fn write(robot: &Robot, out: &mut String) {
    let all = &robot.adjustable;
    if all.is_empty() {
        return;
    }
    let fields = fields(all);
    let count = all.len();
    let _ = writeln!(
        out,
        "/// Names of the adjustable geometry, in the order of `geometry`."
    );
    let names: Vec<String> = all.iter().map(|(name, _)| format!("{name:?}")).collect();
    let _ = writeln!(
        out,
        "pub const GEOMETRY: [&str; {count}] = [{}];",
        names.join(", ")
    );
    let _ = writeln!(
        out,
        "/// The adjustable geometry, m or rad: by default as the robot's spec states it.\n///\n\
         /// Functions do not check that loops close with it, and `HOME` is closed with the default."
    );
    let _ = writeln!(out, "#[derive(Clone, Copy, Debug, PartialEq)]");
    let _ = writeln!(out, "pub struct Geometry {{");
    for (field, (name, _)) in fields.iter().zip(all) {
        let _ = writeln!(out, "    /// `{name}` of the spec.\n    pub {field}: f64,");
    }
    let _ = writeln!(out, "}}\n");
    let _ = writeln!(out, "impl Geometry {{");
    let _ = writeln!(out, "    /// What the robot's spec states.");
    let _ = writeln!(out, "    pub const STATED: Self = Self {{");
    for (field, (_, value)) in fields.iter().zip(all) {
        let _ = writeln!(out, "        {field}: {},", literal(*value));
    }
    let _ = writeln!(out, "    }};\n");
    let _ = writeln!(
        out,
        "    /// The values in the order of [`GEOMETRY`], as scalars like `proto`."
    );
    let values: Vec<String> = fields
        .iter()
        .map(|field| format!("proto.splat(self.{field})"))
        .collect();
    let _ = writeln!(
        out,
        "    pub fn splat<T: Scalar>(&self, proto: T) -> [T; {count}] {{\n        [{}]\n    }}\n}}\n\n\
         impl Default for Geometry {{\n    fn default() -> Self {{\n        Self::STATED\n    }}\n}}",
        values.join(", ")
    );
}

/// The names of the fields: `_` behind keywords and where that is another's name.
fn fields(all: &[(String, f64)]) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for (name, _) in all {
        let mut own = name.clone();
        let is_taken = |own: &String| {
            let others = all.iter().filter(|(other, _)| other != name);
            RESERVED.contains(&own.as_str())
                || own == "Self"
                || own == "_"
                || out.contains(own)
                || others.map(|(other, _)| other).any(|other| other == own)
        };
        while is_taken(&own) {
            own.push('_');
        }
        out.push(own);
    }
    out
}
