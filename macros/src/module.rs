//! Generates a robot's module, or reads it from the cache if the same text was derived before.

use regen_cache::Cache;
use regen_codegen::diag::Source;
use regen_codegen::emit;
use regen_codegen::pipeline::{self, BaseSource, DeriveError};
use regen_codegen::store::{Key, Store};

/// A robot's name and the source of its module.
#[derive(Debug, PartialEq)]
pub(crate) struct Module {
    pub(crate) robot: String,
    pub(crate) source: String,
}

impl Module {
    /// The length of the name, the name and the source.
    fn to_bytes(&self) -> Vec<u8> {
        format!("{} {}{}", self.robot.len(), self.robot, self.source).into_bytes()
    }

    fn from_bytes(bytes: Vec<u8>) -> Option<Self> {
        let text = String::from_utf8(bytes).ok()?;
        let (length, rest) = text.split_once(' ')?;
        let (robot, source) = rest.split_at_checked(length.parse().ok()?)?;
        Some(Self {
            robot: robot.to_owned(),
            source: source.to_owned(),
        })
    }
}

/// The module of a robot, from the cache or derived now. `stored` is the text of its stored base
/// parameters.
pub(crate) fn module(
    source: &Source,
    stored: Option<&str>,
    options: &emit::Options,
) -> Result<Module, DeriveError> {
    let cache = Cache::of_user();
    module_from(cache.as_ref(), source, stored, options)
}

fn module_from(
    cache: Option<&Cache>,
    source: &Source,
    stored: Option<&str>,
    options: &emit::Options,
) -> Result<Module, DeriveError> {
    // everything that the module depends on
    let emit::Options { runtime } = options;
    let base: [&[u8]; 2] = match stored {
        Some(text) => [b"stored", text.as_bytes()],
        None => [b"derived", b""],
    };
    let inputs = [source.text.as_bytes(), runtime.as_bytes(), base[0], base[1]];
    let key = Key::new("module", &inputs);
    let found = cache.and_then(|cache| cache.get(&key));
    if let Some(module) = found.and_then(Module::from_bytes) {
        return Ok(module);
    }
    let robot = pipeline::derive_with(source, BaseSource::Store(stored))?;
    let module = Module {
        source: emit::module(&robot, options),
        robot: robot.name,
    };
    if let Some(cache) = cache {
        cache.put(&key, &|| Some(module.to_bytes()));
    }
    Ok(module)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use std::time::Duration;

    use super::*;

    #[test]
    fn a_cached_module_is_the_derived_one_and_that_of_another_text_is_not() {
        let text = "name: arm\nlimbs:\n  - name: arm\n    joints:\n      \
                    - {name: q1, type: revolute, body: link, actuated: true}\n";
        let folder = std::env::temp_dir().join(format!("regen-macro-{}", std::process::id()));
        let cache = Cache::at(&folder).with_min_time(Duration::ZERO);
        let options = emit::Options {
            runtime: "::regen_runtime".to_owned(),
        };
        let made = |cache: Option<&Cache>, text: &str| {
            module_from(cache, &Source::new("arm.yaml", text), None, &options).unwrap()
        };
        let derived = made(None, text);
        assert_eq!(made(Some(&cache), text), derived);
        let entries = || std::fs::read_dir(&folder).unwrap().count();
        assert_eq!(entries(), 1);
        assert_eq!(made(Some(&cache), text), derived);
        let other = text.replace("q1", "q2");
        assert_eq!(made(Some(&cache), &other), made(None, &other));
        assert_eq!(entries(), 2);
        let kept = std::fs::read_dir(&folder).unwrap().flatten();
        for entry in kept {
            std::fs::write(entry.path(), "damaged").unwrap();
        }
        assert_eq!(made(Some(&cache), text), derived);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
