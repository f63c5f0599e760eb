//! The compiled models agree with the second derivation: `robot_model!` of every mechanism, and the
//! checked-in robots.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_codegen::robot::FunctionKind;
use regen_runtime::{LoopClosure, Model};
use regen_tests::compiled::Compiled;
use regen_tests::engine::{Answer, Engine, Names, check_engine, check_oracle};
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

/// A compiled model with the home of its own geometry.
struct AtHome<'a>(Compiled<'a>, Vec<f64>);

impl Engine for AtHome<'_> {
    fn names(&self) -> Names {
        self.0.names()
    }

    fn home(&self) -> Vec<f64> {
        self.1.clone()
    }

    fn call(&self, kind: FunctionKind, inputs: &[&[f64]]) -> Answer<Vec<f64>> {
        self.0.call(kind, inputs)
    }
}

#[test]
fn a_model_with_another_geometry_agrees_with_the_second_derivation_of_its_numbers() {
    use regen_robots::fixtures::adjustable::{Adjustable, GEOMETRY, Geometry};

    let mut geometry = Geometry::default();
    let path = files::fixtures().join("adjustable/adjustable.yaml");
    let mut text = std::fs::read_to_string(path).unwrap();
    // one in a hundred longer, the others shorter, the slope in degrees
    let mut change = |name: &str, value: &mut f64, to: f64| {
        let [own, other] = [*value, to].map(|x| format!("  {name}: {x}\n"));
        assert_eq!(text.matches(&own).count(), 1, "{own}");
        text = text.replace(&own, &other);
        *value = to;
    };
    change("a", &mut geometry.a, 0.303);
    change("c", &mut geometry.c, 0.345);
    change("base", &mut geometry.base, 0.49);
    change("tilt", &mut geometry.tilt, 0.25);
    change("lift", &mut geometry.lift, 0.015);
    change("slope", &mut geometry.slope, -2.5);
    change("g0", &mut geometry.g0, 9.7);
    assert_eq!(GEOMETRY.len(), 7);
    let mechanism = regen_reference::Mechanism::from_yaml(&text).unwrap();
    let model = Adjustable { geometry };
    let home = LoopClosure::new(&model).unwrap().home().clone();
    assert!(home.outcome.is_closed());
    let engine = AtHome(Compiled(&model), home.q);
    println!("{}", check_engine(&engine, &mechanism, 31, 3).unwrap());
    // the stated geometry does not fit these numbers
    let stated = Compiled(&Adjustable::default());
    assert!(check_engine(&stated, &mechanism, 31, 3).is_err());
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
    specs.extend(files::list(&files::fixtures().join("adjustable"), "yaml").unwrap());
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
