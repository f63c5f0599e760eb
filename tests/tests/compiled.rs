//! The compiled models agree with the second derivation: `robot_model!` of every mechanism, and the
//! checked-in robots.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_runtime::Model;
use regen_tests::compiled::Compiled;
use regen_tests::engine::{check_engine, check_oracle};
use regen_tests::files;

// Only selected random mechanisms are compiled here; `examples/compile_random.rs` compiles the
// rest.

/// A model with the file of its spec.
type Compared = (String, &'static dyn Model<f64>);

/// The mechanisms of `fixtures/`.
fn compiled() -> Vec<Compared> {
    let all = regen_robots::fixtures::ALL.iter();
    all.map(|&(file, model)| -> Compared { (file.to_owned(), model) })
        .collect()
}

/// The robots of `robots/`.
fn robots() -> Vec<Compared> {
    let path = |name: &str| format!("../../robots/{name}.yaml");
    let all = regen_robots::ALL.iter();
    all.map(|&(name, model)| -> Compared { (path(name), model) })
        .collect()
}

/// Compares every model with the second derivation; the assertion lists all that differ.
fn check_all(models: Vec<Compared>) {
    let mut failures = Vec::new();
    for (file, model) in models {
        let mechanism = files::mechanism(&files::fixtures().join(file)).unwrap();
        match check_engine(&Compiled(model), &mechanism, 31, 3) {
            Ok(figures) => println!("{}\n{figures}", mechanism.name),
            Err(error) => failures.push(error),
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn models_of_the_macro_agree_with_the_second_derivation() {
    check_all(compiled());
}

#[test]
fn shipped_robots_agree_with_the_second_derivation() {
    check_all(robots());
}

#[test]
fn shipped_robots_agree_with_the_published_vectors() {
    let mut checked = 0;
    for (file, model) in robots() {
        let name = file
            .trim_start_matches("../../robots/")
            .trim_end_matches(".yaml");
        // Not every robot has published vectors.
        if files::oracle().join(format!("{name}.json")).exists() {
            check_oracle(&Compiled(model), name).unwrap();
            checked += 1;
        }
    }
    let vectors = files::list(&files::oracle(), "json").unwrap();
    assert_eq!(checked, vectors.len(), "a robot for every file of vectors");
}

#[test]
fn every_spec_is_compiled() {
    let mut specs = files::list(&files::mechanisms(), "yaml").unwrap();
    for folder in files::folders(&files::pairs()).unwrap() {
        specs.extend(files::list(&folder, "yaml").unwrap());
    }
    let chosen = compiled();
    let drawn = chosen
        .iter()
        .filter(|(file, _)| file.starts_with("random/"));
    assert_eq!(chosen.len() - drawn.count(), specs.len());
    let specs = files::list(&files::robots(), "yaml").unwrap();
    assert_eq!(robots().len(), specs.len());
}
