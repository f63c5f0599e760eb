//! The generator and the runtime have the same table of functions, and robots conform to it.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_codegen::Mechanism;
use regen_codegen::diag::Source;
use regen_codegen::pipeline;
use regen_codegen::signature::{self, FunctionKind, Needs, Trait};
use regen_runtime::function::{self, Sizes};
use regen_runtime::{BaseFunction, ControlFunction, Function};
use regen_tests::derived::Derived;
use regen_tests::files;

/// The entry of a function in both tables: variant, name, names of arguments, shape, whether it
/// reports a condition.
type Row = (String, &'static str, Vec<&'static str>, String, bool);

fn of_codegen(kind: FunctionKind) -> Row {
    let signature = kind.signature();
    let arguments = signature.arguments.iter();
    (
        format!("{kind:?}"),
        signature.name,
        arguments.map(|a| a.row().runtime_name).collect(),
        format!("{:?}", signature.shape),
        signature.has_condition,
    )
}

fn of_runtime(case: String, signature: &function::Signature) -> Row {
    let arguments = signature.arguments.iter();
    (
        case,
        signature.name,
        arguments.map(|a| a.name()).collect(),
        format!("{:?}", signature.shape),
        signature.has_condition,
    )
}

#[test]
fn the_generator_and_the_runtime_have_the_same_functions() {
    let ours = |of: Trait| -> Vec<Row> {
        let kinds = FunctionKind::ALL.into_iter();
        let kinds = kinds.filter(|kind| kind.signature().of == of);
        kinds.map(of_codegen).collect()
    };
    let theirs = Function::ALL.map(|f| of_runtime(format!("{f:?}"), f.signature()));
    assert_eq!(ours(Trait::Model), theirs.to_vec());
    let theirs = BaseFunction::ALL.map(|f| of_runtime(format!("{f:?}"), f.signature()));
    assert_eq!(ours(Trait::BaseModel), theirs.to_vec());
    let theirs = ControlFunction::ALL.map(|f| of_runtime(format!("{f:?}"), f.signature()));
    assert_eq!(ours(Trait::ControlModel), theirs.to_vec());
}

#[test]
fn the_generator_and_the_runtime_have_the_same_arguments() {
    let ours = signature::Argument::ALL.map(|a| {
        let row = a.row();
        (
            format!("{a:?}"),
            row.runtime_name,
            format!("{:?}", row.size),
        )
    });
    let theirs =
        function::Argument::ALL.map(|a| (format!("{a:?}"), a.name(), format!("{:?}", a.size())));
    assert_eq!(ours, theirs);
}

/// Derived programs have the arguments and the output that the table states, and exist if the robot
/// has what they need.
#[test]
fn every_program_has_the_sizes_of_its_signature() {
    let mut checked = 0;
    for folder in [files::robots(), files::mechanisms()] {
        for path in files::list(&folder, "yaml").unwrap() {
            let text = std::fs::read_to_string(&path).unwrap();
            let mechanism = Mechanism::open(&Source::new("robot.yaml", text)).unwrap();
            let robot = mechanism.robot(&FunctionKind::ALL).unwrap();
            for kind in FunctionKind::ALL {
                let signature = kind.signature();
                let is_expected = match signature.needs {
                    Needs::Nothing => true,
                    Needs::Rows => robot.rows > 0,
                    Needs::Dependent => !robot.dependent.is_empty(),
                    Needs::Cones => !robot.cones.is_empty(),
                    Needs::Frames => !robot.frames.is_empty(),
                    Needs::Base => robot.length(signature::Size::Base) > 0,
                };
                let what = format!("{}: {}", robot.name, signature.name);
                assert_eq!(robot.function(kind).is_some(), is_expected, "{what}");
                let Some(function) = robot.function(kind) else {
                    continue;
                };
                let program = &function.program;
                let given = program.arguments.iter();
                let given: Vec<(&str, usize)> = given.map(|a| (&a.name[..], a.len)).collect();
                let stated = signature.arguments.iter().map(|a| a.row());
                let stated: Vec<(&str, usize)> = stated
                    .map(|row| (row.name, robot.length(row.size)))
                    .collect();
                assert_eq!(given, stated, "{what}");
                let lengths = signature.shape.outer_first().into_iter();
                let shape: Vec<usize> = lengths.map(|size| robot.length(size)).collect();
                assert_eq!(program.output.shape, shape, "{what}");
                let entries: usize = shape.iter().product();
                assert_eq!(program.outputs.len(), entries, "{what}");
                // exactly the programs that solve equations report a condition
                assert!(signature.has_condition || !program.solves(), "{what}");
                checked += 1;
            }
        }
    }
    assert!(checked > 500, "{checked}");
}

/// The lengths that the two compute for a robot are compared.
#[test]
fn the_generator_and_the_runtime_have_the_same_sizes() {
    let robot = Derived::from_file(&files::robots().join("3rps_friction.yaml"));
    let robot = robot.unwrap().robot;
    let model = regen_interpreted::Interpreted::new(&robot);
    let info = model.info();
    let base = Sizes {
        base: model.rank(),
        free: model.base_info().free.len(),
        ..Sizes::of(&info)
    };
    let pairs = [
        (signature::Size::Coordinates, function::Size::Coordinates),
        (signature::Size::Independent, function::Size::Independent),
        (signature::Size::Dependent, function::Size::Dependent),
        (signature::Size::Actuated, function::Size::Actuated),
        (signature::Size::Rows, function::Size::Rows),
        (signature::Size::Parameters, function::Size::Parameters),
        (signature::Size::Bodies, function::Size::Bodies),
        (signature::Size::Cones, function::Size::Cones),
        (signature::Size::Base, function::Size::Base),
        (signature::Size::Free, function::Size::Free),
        (signature::Size::Pose, function::Size::Pose),
        (signature::Size::Frames, function::Size::Frames),
        (signature::Size::FrameRates, function::Size::FrameRates),
        (signature::Size::State, function::Size::State),
        (signature::Size::StateEfforts, function::Size::StateEfforts),
    ];
    for (ours, theirs) in pairs {
        assert_eq!(robot.length(ours), base.length(theirs), "{ours:?}");
    }
}

#[test]
fn the_digest_of_a_module_is_that_of_its_model() {
    let modules = [
        ("3rps", regen_generated::rps3::DIGEST),
        ("fivebar", regen_generated::fivebar::DIGEST),
        ("puma560", regen_generated::puma560::DIGEST),
    ];
    let compiled: [&dyn regen_runtime::BaseModel<f64>; 3] = [
        &regen_generated::rps3::Rps3,
        &regen_generated::fivebar::Fivebar,
        &regen_generated::puma560::Puma560,
    ];
    for ((name, digest), compiled) in modules.into_iter().zip(compiled) {
        let file = files::robots().join(format!("{name}.yaml"));
        let text = std::fs::read_to_string(file).unwrap();
        let robot = pipeline::derive(&Source::new(name, text)).unwrap();
        let terms = regen_interpreted::BaseTerms::new(&robot);
        let model = regen_interpreted::Interpreted::with_terms(&robot, &terms);
        let digest = format!("{digest:016x}");
        assert_eq!(regen_identify::identify::digest(&model), digest, "{name}");
        assert_eq!(regen_identify::identify::digest(compiled), digest, "{name}");
    }
}
