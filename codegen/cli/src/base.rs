//! `regen base`: the base parameters and their certificate.

use regen_codegen::Mechanism;
use regen_codegen::base::{Analysis, store};
use regen_codegen::diag::Source;
use regen_codegen::explain::Grouped;
use regen_codegen::explain::table::{Style, Table, doubt};
use regen_codegen::spec::{self, edit::with_geometry};
use regen_report::results;

use crate::args::{BaseArgs, TableFormat};
use crate::exit::Failure;
use crate::{load, table, terminal, write};

/// Runs the command.
pub(crate) fn run(args: &BaseArgs) -> Result<(), Failure> {
    let mut source = load::source(&args.file)?;
    if !args.at.is_empty() {
        source.text = at_values(&source, &args.at)?;
    }
    let mechanism = load::mechanism(&source)?;
    load::note_units(&source);
    let analysis = load::analysis(&mechanism, &source)?;
    // only the robot's names are needed: no function is derived
    let robot = mechanism.robot(&[])?;
    if args.store {
        let beside = args.file.with_extension("base");
        write::atomically(&beside, &store(&source, analysis))?;
        terminal::note(&format!("{}: written", beside.display()));
    }
    let style = match (args.numbers, args.expressions) {
        (true, _) => Style::Numbers,
        (_, true) => Style::Expressions,
        _ => Style::Short,
    };
    let reasons = reasons(&mechanism, analysis)?;
    let table =
        Table::new(&robot, analysis, style, &reasons).with_remedy("--expressions prints it");
    terminal::print(&match args.format {
        TableFormat::Human => table.plain_text(),
        TableFormat::Markdown => table.markdown(),
        TableFormat::Latex => table.latex(),
        TableFormat::Csv => table.csv(),
        TableFormat::Json => table::json(&results::base(&robot, analysis, &reasons)),
    })?;
    match doubt(analysis) {
        Some(why) => Err(Failure::Check(format!(
            "the base parameters of {} are INCOMPLETE: {why}",
            robot.name
        ))),
        None => Ok(()),
    }
}

/// The spec's text with the values of `--at`.
fn at_values(source: &Source, values: &[String]) -> Result<String, Failure> {
    let spec = spec::parse(source).map_err(|report| Failure::Spec(vec![report]))?;
    let pairs = values.iter().map(|given| {
        let pair = given.split_once('=').map(|(n, v)| (n.trim(), v.trim()));
        pair.filter(|(_, value)| !value.is_empty()).ok_or_else(|| {
            Failure::Input(format!(
                "--at '{given}': write NAME=VALUE, as in alpha=pi/2"
            ))
        })
    });
    let pairs: Vec<(&str, &str)> = pairs.collect::<Result<_, _>>()?;
    let twice = |(k, (name, _)): (usize, &(&str, &str))| {
        pairs.iter().take(k).any(|(other, _)| other == name)
    };
    if let Some((_, (name, _))) = pairs
        .iter()
        .enumerate()
        .find(|(k, pair)| twice((*k, *pair)))
    {
        return Err(Failure::Input(format!("--at: '{name}' is given twice")));
    }
    for (name, value) in &pairs {
        // commas and colons would end the entry in the spec
        if spec.evaluate(value).is_none() {
            return Err(Failure::Input(format!(
                "--at {name}: '{value}' is no expression in numbers and names of the geometry"
            )));
        }
    }
    with_geometry(&source.text, &spec, &pairs).map_err(|name| {
        let names = spec.geometry.iter().map(|(name, _)| name.value.as_str());
        let names: Vec<&str> = names.collect();
        let names = match names.as_slice() {
            [] => "there are none".to_owned(),
            names => format!("they are {}", names.join(", ")),
        };
        Failure::Input(format!(
            "--at: '{name}' is none of the names of 'geometry' in {}; {names}",
            source.name
        ))
    })
}

/// The reasons why the parameters of completed directions act only together; empty where no
/// direction was completed.
fn reasons(mechanism: &Mechanism, analysis: &Analysis) -> Result<Vec<Grouped>, Failure> {
    if analysis.base.completed == 0 {
        return Ok(Vec::new());
    }
    Ok(mechanism.explanation()?.grouped_from_samples())
}
