//! A robot's names, sizes and operation counts.

use std::fmt::Write as _;

use regen_codegen::diag::{counted, rounded};
use regen_codegen::explain::lines::{columns, field, paragraph};
use regen_codegen::robot::{FunctionKind, Robot};
use serde::Serialize;

/// Names, sizes and operation counts of a robot, to be serialised.
#[derive(Serialize)]
pub struct Info<'a> {
    robot: &'a str,
    coordinates: &'a [String],
    independent: Vec<&'a str>,
    /// The closed home: one value per coordinate, rad or m.
    home: &'a [f64],
    dof: usize,
    parameters: Vec<&'a str>,
    cuts: Vec<Cut<'a>>,
    operations: Operations,
}

#[derive(Serialize)]
struct Cut<'a> {
    name: &'a str,
    rows: usize,
}

#[derive(Default, Serialize)]
struct Operations {
    add: usize,
    mul: usize,
    div: usize,
    sincos: usize,
    /// Square roots, which only springs between points need; `None` without any.
    #[serde(skip_serializing_if = "Option::is_none")]
    sqrt: Option<usize>,
}

/// Names and sizes of a robot; the operations are those of the regressor.
pub fn info(robot: &Robot) -> Info<'_> {
    let operations = robot
        .functions
        .iter()
        .find(|function| function.kind == FunctionKind::Regressor)
        .map(operations)
        .unwrap_or_default();
    Info {
        robot: &robot.name,
        coordinates: &robot.coordinates,
        independent: names(&robot.coordinates, &robot.independent),
        home: &robot.home,
        dof: robot.independent.len(),
        parameters: robot.labels(),
        cuts: robot
            .cuts
            .iter()
            .map(|cut| Cut {
                name: &cut.name,
                rows: cut.rows,
            })
            .collect(),
        operations,
    }
}

fn operations(function: &regen_codegen::robot::Function) -> Operations {
    let count = function.program.operations();
    Operations {
        add: count.add,
        mul: count.mul,
        div: count.div,
        sincos: count.sincos,
        sqrt: (count.sqrt > 0).then_some(count.sqrt),
    }
}

fn names<'a>(all: &'a [String], which: &[usize]) -> Vec<&'a str> {
    which
        .iter()
        .filter_map(|&k| all.get(k).map(String::as_str))
        .collect()
}

/// Names, sizes and the operations of each function as tables of at most 80 columns.
pub fn info_text(robot: &Robot) -> String {
    let mut out = match &robot.description {
        Some(text) => paragraph(&format!("{}: {text}", robot.name)),
        None => paragraph(&robot.name),
    };
    out.push('\n');
    let list = |count: usize, text: &str| match count {
        0 => "none".to_owned(),
        n => format!("{n}: {text}"),
    };
    let some = |which: &[usize]| list(which.len(), &names(&robot.coordinates, which).join(" "));
    let rows: Vec<String> = robot
        .redundant_rows
        .iter()
        .map(|row| (row + 1).to_string())
        .collect();
    let redundant = match rows.len() {
        0 => "none".to_owned(),
        n => format!(
            "{n} of {}: {}",
            counted(robot.rows, "closure row", "closure rows"),
            rows.join(" ")
        ),
    };
    let home = robot.coordinates.iter().zip(&robot.home);
    let home = home.map(|(name, q)| format!("{name} {}", rounded(*q)));
    let home = home.collect::<Vec<_>>().join(", ");
    let cuts: Vec<String> = robot
        .cuts
        .iter()
        .map(|cut| format!("{} ({})", cut.name, counted(cut.rows, "row", "rows")))
        .collect();
    for (name, value) in [
        (
            "coordinates",
            list(robot.coordinates.len(), &robot.coordinates.join(" ")),
        ),
        ("independent", some(&robot.independent)),
        ("dependent", some(&robot.dependent)),
        ("home", home),
        ("actuated", some(&robot.actuated)),
        ("bodies", list(robot.bodies.len(), &robot.bodies.join(" "))),
        ("cuts", list(cuts.len(), &cuts.join(" "))),
        ("redundant", redundant),
        (
            "parameters",
            list(robot.parameters.len(), &robot.labels().join(" ")),
        ),
    ] {
        out.push_str(&field(name, &value));
    }
    let heads = ["operations", "add", "mul", "div", "sincos", "sqrt"];
    // only springs between points need square roots
    let has_roots = robot.functions.iter().any(|f| operations(f).sqrt.is_some());
    let shown = heads.len() - usize::from(!has_roots);
    let rows: Vec<Vec<String>> = robot
        .functions
        .iter()
        .map(|function| {
            let count = operations(function);
            let counts = [count.add, count.mul, count.div, count.sincos];
            let roots = has_roots.then_some(count.sqrt.unwrap_or(0));
            std::iter::once(function.kind.name().to_owned())
                .chain(counts.into_iter().chain(roots).map(|n| n.to_string()))
                .collect()
        })
        .collect();
    let _ = write!(out, "\n{}", columns(&heads[..shown], &rows));
    out
}
