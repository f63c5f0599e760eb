//! The JSON that commands print, and the schema of each.
//!
//! A schema allows no other keys than those that it lists. Where a change of a form could break a
//! program that reads it, the number in `version`, and at the end of the schema's `$id`, increases.

use serde::Serialize;

/// The version of the forms that [`Versioned`] writes.
const VERSION: u32 = 1;

macro_rules! documents {
    ($($case:ident $name:literal $about:literal)*) => {
        /// What a command prints with `--format json`.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[non_exhaustive]
        pub enum Document {
            $(#[doc = $about] $case,)*
        }

        impl Document {
            /// All documents, by name.
            pub const ALL: &[Self] = &[$(Self::$case),*];

            /// The name of the command; `model` for `regen FILE`.
            pub fn name(self) -> &'static str {
                match self { $(Self::$case => $name),* }
            }

            /// Its JSON Schema.
            pub fn schema(self) -> &'static str {
                match self {
                    $(Self::$case => include_str!(concat!("documents/", $name, ".json"))),*
                }
            }
        }
    };
}

documents! {
    Base "base" "The base parameters and their certificate."
    Calibrate "calibrate" "The geometry that fits measurements, and what they cannot tell."
    Check "check" "A mechanism in words."
    Eval "eval" "Closure and regressors at states."
    Excite "excite" "A trajectory and how it keeps the limits."
    Export "export" "A robot file with identified parameters."
    Generate "generate" "The files of generated source and their states."
    Identify "identify" "An identified model with the summary of its fit."
    Import "import" "A description made of a robot file."
    Info "info" "Names, sizes and operation counts."
    Inspect "inspect" "What logs hold and can identify."
    Model "model" "What `regen FILE` derived, wrote and verified."
    New "new" "A new description."
    Observe "observe" "Logs reduced to a factor file."
    Rehearse "rehearse" "The score of rehearsed identifications."
    Simulate "simulate" "Simulated runs."
    Validate "validate" "Prediction errors on logs."
    Verify "verify" "The checks of one robot, or of several."
}

impl Document {
    /// The document of a name.
    pub fn of(name: &str) -> Option<Self> {
        let mut all = Self::ALL.iter().copied();
        all.find(|document| document.name() == name)
    }
}

/// A printed value with the version of its form.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Versioned<'a, T> {
    version: u32,
    #[serde(flatten)]
    value: &'a T,
}

impl<'a, T> Versioned<'a, T> {
    /// A value, which must be serialised as an object.
    pub fn new(value: &'a T) -> Self {
        Self {
            version: VERSION,
            value,
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use serde_json::Value;

    use super::*;

    #[test]
    fn every_schema_names_its_document_and_version() {
        for document in Document::ALL {
            let schema: Value = serde_json::from_str(document.schema()).unwrap();
            let name = document.name();
            let version = if name == "inspect" { 2 } else { VERSION };
            assert_eq!(schema["$id"], format!("urn:regen:{name}:{version}"));
            assert_eq!(Document::of(name), Some(*document));
            let stated = &schema["properties"]["version"];
            assert!(stated.is_null() || stated["const"] == version, "{name}");
        }
        assert_eq!(Document::of("other"), None);
    }
}
