//! The base parameters stored beside a spec, for macros, equal those derived today.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::fs;

use regen_codegen::diag::Source;
use regen_codegen::{base, pipeline};
use regen_tests::files;

#[test]
fn every_stored_base_is_up_to_date() {
    for folder in [files::robots(), files::mechanisms()] {
        for stored in files::list(&folder, "base").unwrap() {
            let spec = stored.with_extension("yaml");
            let text = fs::read_to_string(&spec).expect("a spec beside the stored base");
            let source = Source::new(spec.display().to_string(), text);
            let analysis = pipeline::derive(&source).unwrap().analysis.unwrap();
            assert!(
                fs::read_to_string(&stored).unwrap() == base::store(&source, &analysis),
                "{} is stale: regen base {} --store",
                stored.display(),
                spec.display()
            );
        }
    }
}
