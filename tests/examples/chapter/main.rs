//! Reproduces the chapter's figures and tables on the simulated 3-RPS, and prints each beside the
//! chapter's numbers:
//!
//! ```sh
//! cargo run --release -p regen-tests --features examples --example chapter -- --seeds 20 --out chapter
//! ```
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod actual;
mod figures;
mod friction;
mod models;
mod notes;
mod robot;

use std::path::PathBuf;

use regen_experiment::excite::{Criterion, Excitation};
use regen_runtime::{LoopClosure, State};

use actual::Measured;
use figures::{Curve, Panel};
use friction::Fits;
use models::{Automatic, Row, Table6};
use robot::{LEGS, PERIOD, POINTS, relative_absolute, summary};

fn main() {
    let (mut seeds, mut out) = (20, PathBuf::from("chapter"));
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match (argument.as_str(), arguments.next()) {
            ("--seeds", Some(count)) => seeds = count.parse().expect("a number of seeds"),
            ("--out", Some(dir)) => out = PathBuf::from(dir),
            _ => {
                eprintln!("chapter [--seeds N] [--out DIR]");
                std::process::exit(2);
            }
        }
    }
    let found: Vec<Excitation> = (1..=5)
        .map(|seed| robot::trajectory(seed, Criterion::Condition, 60))
        .collect();
    base_parameters();
    trajectories(&found, &out);
    cones();
    let first = robot::states(&found[1].series, POINTS);
    table3(&first, seeds);
    independent(&first);
    let runs: Vec<Measured> = found
        .iter()
        .map(|f| f.series.clone())
        .chain([actual::slow(&found[1].series)])
        .zip(1..)
        .map(|(series, seed)| actual::measure(&series, seed))
        .collect();
    table4(&found, &runs, &out);
    table6(&first, &robot::states(&found[0].series, POINTS), seeds);
    tables_7_and_8(&runs, &out);
    println!("\nFigures 2 to 4: {}/figure*.svg and .csv", out.display());
}

fn title(text: &str) {
    println!("\n## {text}\n");
}

fn base_parameters() {
    title("Tables 1 and 2: base parameters and models");
    let base = robot::model().base_info().base;
    for row in 1..=base.len() {
        let parameter = base.iter().find(|p| models::number(p.label) == row);
        let terms = parameter.expect("every row").terms.iter();
        let text: Vec<String> = terms
            .map(|term| format!("{:+.4} {}", term.value, term.parameter))
            .collect();
        println!("{row:3}  {}", text.join(" "));
    }
    let equations = models::equations(false);
    for (k, model) in models::models(&equations).iter().enumerate() {
        println!(
            "Model {}: {} of {} parameters",
            k + 1,
            model.groups.len(),
            34
        );
    }
}

fn trajectories(found: &[Excitation], out: &std::path::Path) {
    title("Figure 2: trajectories (the chapter: condition numbers 492 to 718)");
    for (k, f) in found.iter().enumerate() {
        println!(
            "trajectory {}: condition {:.0}, with scaled columns {:.1}",
            k + 1,
            f.figures.condition,
            f.figures.scaled_condition
        );
    }
    println!("{}", notes::FIGURE_2);
    let times: Vec<f64> = (0..=750).map(|k| PERIOD * f64::from(k) / 750.0).collect();
    let panel = |order: usize, label: &str| Panel {
        label: label.to_owned(),
        curves: (0..3)
            .map(|leg| Curve {
                name: format!("{} {label}", LEGS[leg]).replace(',', ""),
                values: times
                    .iter()
                    .map(|t| found[0].series.at(leg, *t)[order])
                    .collect(),
                points: false,
            })
            .collect(),
    };
    let name = format!(
        "A trajectory with condition number {:.0}",
        found[0].figures.condition
    );
    let panels = [
        panel(0, "q, m"),
        panel(1, "qd, m/s"),
        panel(2, "qdd, m/s^2"),
    ];
    figures::write(out, "figure2", &name, &times, &panels);
}

/// Prints how close poses of the whole stroke are to a singularity, by their largest cone angle.
fn cones() {
    title("Section 3: the cone limit keeps the robot away from singularities");
    for (from, least, count) in pivots(18) {
        println!(
            "largest cone angle {from:2.0} to {:2.0} degrees: least pivot of A_e {least:.3} ({count} poses)",
            from + 15.0
        );
    }
}

/// The smallest pivot of `A_e` over all poses, grouped by their largest cone angle in steps of 15
/// degrees.
fn pivots(steps: usize) -> Vec<(f64, f64, usize)> {
    let model = robot::model();
    let mut closure = LoopClosure::new(model).expect("a model");
    let mut classes: Vec<(f64, f64, usize)> = (0..6)
        .map(|k| (15.0 * f64::from(k), f64::INFINITY, 0))
        .collect();
    let leg = |k: usize| 0.35 + 0.5 * k as f64 / (steps - 1) as f64;
    for k in 0..steps.pow(3) {
        let q = [
            leg(k % steps),
            leg(k / steps % steps),
            leg(k / steps / steps),
        ];
        let closed = closure.solve(&q).expect("finite");
        if !closed.outcome.is_closed() {
            continue;
        }
        let mut cosines = [0.0; 3];
        model.cones(&closed.q, &mut cosines).expect("sizes");
        let angle = cosines
            .iter()
            .fold(1.0_f64, |m, c| m.min(*c))
            .acos()
            .to_degrees();
        #[allow(clippy::cast_sign_loss, reason = "an arc cosine")]
        let class = (angle / 15.0) as usize;
        if let Some(class) = classes.get_mut(class) {
            class.1 = class.1.min(closed.condition.pivot);
            class.2 += 1;
        }
    }
    classes.retain(|class| class.2 > 0);
    classes
}

fn table3(states: &[State], seeds: u64) {
    title("Table 3: eps_RA in percent, mean [least, greatest] over the seeds");
    let all: Vec<[[f64; 2]; 3]> = (1..=seeds)
        .map(|seed| friction::table3(states, seed))
        .collect();
    println!("                     perturbed             original              chapter");
    let names = [
        ("linear (LSM)", "11.96   8.26"),
        ("linear, feasible", "12.44   8.85"),
        ("nonlinear, feasible", "11.02   7.28"),
    ];
    for (k, (name, chapter)) in names.iter().enumerate() {
        let of = |column: usize| summary(&all.iter().map(|t| t[k][column]).collect::<Vec<_>>());
        println!("{name:20} {:21} {:21} {chapter}", of(0), of(1));
    }
    let wins = all.iter().filter(|t| t[2][1] < t[1][1]).count();
    println!("nonlinear feasible beats linear feasible on the original forces: {wins} of {seeds}");
    println!("{}", notes::TABLE_3);
}

fn independent(states: &[State]) {
    title("Section 2.5: friction and drive columns are independent of the rest");
    let equations = models::equations(false);
    let forces = vec![0.0; 3 * states.len()];
    let factor = equations.factor(states, &forces);
    let spectrum = factor.spectrum().expect("values");
    let bodies = factor
        .select(&(0..25).collect::<Vec<_>>())
        .expect("columns");
    println!(
        "rank of the rigid bodies' columns {}, with friction and drives {} of {}; smallest scaled \
         singular value {:.2e}",
        bodies.spectrum().expect("values").rank(),
        spectrum.rank(),
        equations.columns.len(),
        spectrum.scaled.last().copied().unwrap_or(0.0)
    );
}

fn table4(found: &[Excitation], runs: &[Measured], out: &std::path::Path) {
    title("Table 4: eps_RA in percent on the stand-in of the actual robot (SIMULATED)");
    let used = &runs[1];
    let fits = Fits::new(&used.states, &used.forces);
    let errors: Vec<[f64; 3]> = runs
        .iter()
        .map(|r| fits.errors(&r.states, &r.forces))
        .collect();
    print!("condition number    ");
    for f in found {
        print!("{:8.0}", f.figures.condition);
    }
    println!("  LowVel   (identified from the second)");
    let rows = [
        ("linear LSM", [12.8, 9.48, 14.6, 17.9, 17.9, 15.5]),
        ("linear feasible", [26.1, 20.5, 24.4, 23.9, 23.9, 19.2]),
        ("nonlinear feasible", [24.7, 21.2, 23.5, 23.4, 23.4, 18.0]),
    ];
    for (k, (name, chapter)) in rows.iter().enumerate() {
        let line = |values: Vec<f64>| {
            let cells = values.iter().map(|v| format!("{v:8.2}"));
            cells.collect::<String>()
        };
        println!("{name:20}{}", line(errors.iter().map(|e| e[k]).collect()));
        println!("{:20}{}", "  chapter", line(chapter.to_vec()));
    }
    let tracking = runs.iter().map(|r| r.tracking).fold(0.0, f64::max);
    println!(
        "largest distance from the reference {:.1} mm",
        1e3 * tracking
    );
    println!("{}", notes::TABLE_4);
    let predicted = fits.forces(&used.states);
    let panels: Vec<Panel> = (0..3)
        .map(|leg| {
            let curve = |name: &str, values: &[f64], points: bool| Curve {
                name: format!("{name} {}", LEGS[leg]),
                values: values.iter().skip(leg).step_by(3).copied().collect(),
                points,
            };
            Panel {
                label: format!("force of {}, N", LEGS[leg]),
                curves: vec![
                    curve("measured", &used.forces, false),
                    curve("LSM", &predicted[0], false),
                    curve("feasible", &predicted[1], false),
                ],
            }
        })
        .collect();
    figures::write(
        out,
        "figure3",
        "Forces by LSM and by the feasible fit",
        &times(),
        &panels,
    );
}

fn times() -> Vec<f64> {
    (0..POINTS)
        .map(|k| PERIOD * k as f64 / POINTS as f64)
        .collect()
}

fn table6(states: &[State], others: &[State], seeds: u64) {
    let at = |sigma: f64| -> Vec<Table6> {
        (1..=seeds)
            .map(|seed| Table6::new(states, sigma, seed))
            .collect()
    };
    let (all, more) = (at(models::FORCE_NOISE), at(models::MORE_NOISE));
    table5(&all[0].by_sign);
    title("Table 6: mean [least, greatest] over the seeds");
    println!("noise of {} N", models::FORCE_NOISE);
    table6_rows(&all);
    println!(
        "noise of {} N, with which eps_RA is the chapter's",
        models::MORE_NOISE
    );
    table6_rows(&more);
    for (name, first) in [("37", 0), ("34", 1)] {
        let count = |holds: &dyn Fn(&Row, &Row) -> bool| {
            let pairs = all.iter().map(models::Table6::rows);
            pairs.filter(|rows| holds(rows[first].1, rows[2].1)).count()
        };
        println!(
            "from Model 1 ({name}) to 2 eps_RA grows in {} and eps_AV falls in {} of {seeds}",
            count(&|a, b| b.relative_absolute > a.relative_absolute),
            count(&|a, b| b.average < a.average)
        );
    }
    println!("{}", notes::TABLE_6);
    title("The reduction without being told which parameters");
    let found: Vec<Automatic> = (1..=seeds)
        .map(|seed| Automatic::new(states, others, seed))
        .collect();
    println!(
        "first seed: kept {}: {}",
        found[0].kept.len(),
        found[0].kept.join(" ")
    );
    let of = |f: &dyn Fn(&Automatic) -> f64| summary(&found.iter().map(f).collect::<Vec<_>>());
    println!("kept {}", of(&|a| a.kept.len() as f64));
    println!(
        "eps_RA on another trajectory {} %, Model 4 {} %",
        of(&|a| a.errors[0]),
        of(&|a| a.errors[1])
    );
    println!("eps_AV {}", of(&|a| a.average));
}

fn table6_rows(all: &[Table6]) {
    println!("model       parameters  well identified      eps_RA %              eps_AV");
    let chapter = [
        "37/4  4.57 5.37",
        "34/4 in the text",
        "24/12 4.58 2.94",
        "18/12 4.63 3.06",
        "12/12 4.73 3.17",
    ];
    for (k, chapter) in chapter.iter().enumerate() {
        let of = |f: &dyn Fn(&Row) -> f64| {
            summary(&all.iter().map(|t| f(t.rows()[k].1)).collect::<Vec<_>>())
        };
        let (name, row) = all[0].rows()[k];
        println!(
            "{name:10}  {:10}  {:20} {:21} {:21} chapter {chapter}",
            row.parameters,
            of(&|row| row.well_identified as f64),
            of(&|row| row.relative_absolute),
            of(&|row| row.average),
        );
    }
}

fn table5(row: &Row) {
    let equations = models::equations(true);
    title("Table 5: some parameters of Model 1 (first seed)");
    let exact = models::exact(&equations);
    println!("parameter    exact      identified   sigma %   chapter's identified, sigma %");
    let chapter = [
        ("Izz(4)", "-86.2, 80.2"),
        ("Izz(6)", "-66.6, 62.0"),
        ("Fv(q2)", "3296.7, 2.57"),
        ("Fc+(q2)", "1659.0, 53.3"),
        ("Fc-(q2)", "-1210.6, 73.2"),
        ("J(q2)", "505.0, 13.9"),
    ];
    for (label, text) in chapter {
        let place = equations
            .labels()
            .iter()
            .position(|l| l == label)
            .expect("a label");
        let value = row.estimate.values[place];
        let mark = if models::possible(label, value) {
            ' '
        } else {
            '*'
        };
        println!(
            "{label:8} {:10.4}  {value:12.4}{mark}  {:8.2}   {text}",
            exact[place],
            row.estimate.sigma_percent(place)
        );
    }
    println!("{}", notes::TABLE_5);
}

fn tables_7_and_8(runs: &[Measured], out: &std::path::Path) {
    title("Table 7 (SIMULATED: the chapter's data are not public)");
    let used = &runs[1];
    let exact = models::exact(&models::equations(false));
    let table = Table6::of(&used.states, &used.forces);
    let chapter = ["37/2 8.40", "-", "24/9 8.43", "18/12 8.53", "12/12 8.62"];
    println!("model       parameters  well identified  eps_RA %");
    for ((name, row), chapter) in table.rows().iter().zip(chapter) {
        println!(
            "{name:10}  {:10}  {:15}  {:8.2}   chapter {chapter}",
            row.parameters, row.well_identified, row.relative_absolute
        );
    }
    title("Table 8 (SIMULATED): three base parameters, kg m and kg");
    println!("parameter      CAD   Model 4   Model 1, by sign   chapter's CAD, Model 4, Model 1");
    let labels = models::equations(false).labels();
    for (label, chapter) in [
        ("mx(3)", "-2.47, -2.59, 1.16"),
        ("m(5)", "10.83, 13.72, -3.29"),
        ("m(7)", "5.42, 6.95, -0.557"),
    ] {
        let place = labels.iter().position(|l| l == label).expect("a label");
        let of = |row: &Row| {
            let at = row.estimate.labels.iter().position(|l| l == label);
            at.map_or(f64::NAN, |at| row.estimate.values[at])
        };
        println!(
            "{label:9} {:8.2}  {:8.2}  {:17.2}   {chapter}",
            exact[place],
            of(&table.symmetric[3]),
            of(&table.by_sign)
        );
    }
    println!(
        "Model 1's parameters are of a robot that can be built: {}",
        models::feasible(&models::equations(true), &table.by_sign.estimate.values)
    );
    println!("{}", notes::TABLES_7_AND_8);
    figure4(
        &models::equations(false),
        &table.symmetric[3],
        &runs[0],
        out,
    );
}

/// Figure 4: Model 4, identified from one trajectory, predicts the forces of another.
fn figure4(equations: &robot::Equations, row: &Row, other: &Measured, out: &std::path::Path) {
    let labels = equations.labels();
    let value = |label: &String| {
        let at = row.estimate.labels.iter().position(|l| l == label);
        at.map_or(0.0, |at| row.estimate.values[at])
    };
    let values: Vec<f64> = labels.iter().map(value).collect();
    let predicted = equations.forces(&other.states, &values);
    title("Figure 4: Model 4 on a trajectory that was not used (SIMULATED)");
    println!(
        "eps_RA {:.2} %",
        relative_absolute(&other.forces, &predicted)
    );
    let panels: Vec<Panel> = (0..3)
        .map(|leg| {
            let curve = |name: &str, values: &[f64], points: bool| Curve {
                name: format!("{name} {}", LEGS[leg]),
                values: values.iter().skip(leg).step_by(3).copied().collect(),
                points,
            };
            Panel {
                label: format!("force of {}, N", LEGS[leg]),
                curves: vec![
                    curve("measured", &other.forces, false),
                    curve("Model 4", &predicted, true),
                ],
            }
        })
        .collect();
    figures::write(
        out,
        "figure4",
        "Measured forces and those of Model 4",
        &times(),
        &panels,
    );
}
