//! Targets for URDF and MJCF files, for files of factors, and for experiment files.

use regen_codegen::diag::Source;
use regen_codegen::spec::parse;
use regen_identify::estimate::{Estimate, FactorSet, Weighting};
use regen_identify::experiment_file::ExperimentFile;
use regen_import::{Options, import as of};
use regen_runtime::Info;

use crate::description::check_report;

/// Checks that a URDF, SDF, MJCF or USD file becomes a description that can be read, or is refused; what follows a form
/// feed is the `robot.yaml` beside it.
///
/// # Panics
/// When the importer panics, or its description cannot be read.
pub fn import(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    let (text, beside) = text.split_once('\u{c}').unwrap_or((text, ""));
    let source = Source::new("input.xml", text);
    let mut reader = |name: &str| match name {
        "robot.yaml" if !beside.is_empty() => Ok(beside.as_bytes().to_vec()),
        _ => Err("there is none".to_owned()),
    };
    for exact in [false, true] {
        let options = Options {
            exact,
            ..Options::default()
        };
        match of(&source, &mut reader, &options) {
            Ok(imported) => {
                let spec = Source::new("import.yaml", imported.spec.as_str());
                assert!(parse(&spec).is_ok(), "{}", imported.spec);
            }
            Err(reports) => {
                assert!(!reports.is_empty());
                for report in reports {
                    check_report(&report.source.text.clone(), &report);
                }
                // with all digits of its angles it is refused for the same reason, after the same search for a
                // closed state, which takes nearly all of the time
                return;
            }
        }
    }
}

/// Checks that a file of factors gives an estimate or is refused, and that factors are written
/// again as they were read.
///
/// # Panics
/// When the reader panics, or factors change by being written and read.
pub fn factors(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    match FactorSet::from_text(text) {
        Ok(set) => {
            let _ = Estimate::new(&set, Weighting::PerEffort).map_err(|e| e.to_string());
            let again = FactorSet::from_text(&set.to_text());
            assert_eq!(again.map(|s| s.to_text()), Ok(set.to_text()));
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

/// Checks that an experiment file is read, or refused with mistakes that are in the text.
///
/// # Panics
/// When the reader panics, or a mistake is outside of the text.
pub fn experiment(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    let info = Info {
        coordinates: &["q1", "q2", "slide"],
        actuated: &[0, 2],
        ..Info::EMPTY
    };
    if let Err(mistakes) = ExperimentFile::read(text, &info) {
        assert!(!mistakes.0.is_empty());
        for mistake in mistakes.0 {
            assert!(!mistake.message.is_empty());
            assert!(
                text.is_char_boundary(mistake.at),
                "{}: {text:?}",
                mistake.at
            );
        }
    }
}
