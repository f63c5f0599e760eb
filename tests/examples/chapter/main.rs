//! The chapter's figures and tables again, on the simulated 3-RPS, each beside the chapter's
//! numbers:
//!
//! ```sh
//! cargo run --release --example chapter -- --seeds 20 --out chapter
//! ```
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod actual;
mod figures;
mod friction;
mod models;
mod robot;

use std::path::PathBuf;

use regen_runtime::excite::{Criterion, Excitation};
use regen_runtime::{Closure, Model, State};

use actual::Measured;
use figures::{Curve, Panel};
use friction::Fits;
use models::Row;
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

/// Poses of the whole stroke: how singular they are, by the largest angle of a cone.
fn cones() {
    title("Section 3: the cone limit keeps the robot away from singularities");
    for (from, least, count) in pivots(18) {
        println!(
            "largest cone angle {from:2.0} to {:2.0} degrees: least pivot of A_e {least:.3} ({count} poses)",
            from + 15.0
        );
    }
}

/// Least pivot of `A_e` over poses whose largest cone angle is in steps of 15 degrees.
fn pivots(steps: usize) -> Vec<(f64, f64, usize)> {
    let model = robot::model();
    let mut closure = Closure::new(model).expect("a model");
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
        if let Some(class) = classes.get_mut((angle / 15.0) as usize) {
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
    for by_sign in [true, false] {
        let equations = models::equations(by_sign);
        let all: Vec<[Row; 4]> = (1..=seeds)
            .map(|seed| models::table6(&equations, states, seed))
            .collect();
        if by_sign {
            table5(&equations, &all[0][0]);
        }
        title(&format!(
            "Table 6, {} parameters: mean [least, greatest] over the seeds",
            equations.columns.len()
        ));
        println!("model  parameters  well identified      eps_RA %              eps_AV");
        let chapter = [
            "37/4 4.57 5.37",
            "24/12 4.58 2.94",
            "18/12 4.63 3.06",
            "12/12 4.73 3.17",
        ];
        for (k, chapter) in chapter.iter().enumerate() {
            let of = |f: &dyn Fn(&Row) -> f64| {
                summary(&all.iter().map(|rows| f(&rows[k])).collect::<Vec<_>>())
            };
            println!(
                "{:5}  {:10}  {:20} {:21} {:21} chapter {chapter}",
                k + 1,
                all[0][k].parameters,
                of(&|row| row.well as f64),
                of(&|row| row.relative_absolute),
                of(&|row| row.average),
            );
        }
        let count = |holds: &dyn Fn(&[Row; 4]) -> bool| all.iter().filter(|r| holds(r)).count();
        println!(
            "from Model 1 to 2 eps_RA grows in {} and eps_AV falls in {} of {seeds}",
            count(&|r| r[1].relative_absolute > r[0].relative_absolute),
            count(&|r| r[1].average < r[0].average)
        );
    }
    automatic(states, others);
}

fn table5(equations: &robot::Equations, row: &Row) {
    title("Table 5: some parameters of Model 1 (first seed)");
    let exact = models::exact(equations);
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
}

fn automatic(states: &[State], others: &[State]) {
    title("The reduction without being told which parameters (first seed)");
    let equations = models::equations(false);
    let exact = models::exact(&equations);
    let mut noise = regen_runtime::simulate::Noise::new(1);
    let mut data = |states: &[State]| {
        let forces = equations.forces(states, &exact);
        let forces = robot::perturbed(&forces, models::FORCE_NOISE, &mut noise);
        let seen = models::noisy(states, &mut noise);
        (equations.factor(&seen, &forces), seen, forces)
    };
    let (factor, _, _) = data(states);
    let (other, seen, forces) = data(others);
    let reduction = models::automatic(&equations, &factor, &other, &exact);
    let last = reduction.result().expect("a model");
    let mut values = vec![0.0; equations.columns.len()];
    for (place, value) in last.kept.iter().zip(&last.estimate.values) {
        values[*place] = *value;
    }
    let fourth = &models::models(&equations)[3];
    let kept: Vec<usize> = fourth.groups.iter().flatten().copied().collect();
    let told = factor
        .select(&kept)
        .expect("columns")
        .solve()
        .expect("determined");
    let mut by_hand = vec![0.0; equations.columns.len()];
    for (place, value) in kept.iter().zip(&told) {
        by_hand[*place] = *value;
    }
    let error = |values: &[f64]| relative_absolute(&forces, &equations.forces(&seen, values));
    println!(
        "kept {}, all below 15 %: {}\non another trajectory eps_RA {:.2} %, Model 4 {:.2} %; \
         eps_AV {:.3}",
        last.kept.len(),
        last.estimate.labels.join(" "),
        error(&values),
        error(&by_hand),
        last.average_relative.unwrap_or(f64::NAN)
    );
}

fn tables_7_and_8(runs: &[Measured], out: &std::path::Path) {
    title("Table 7 (SIMULATED: the chapter's data are not public)");
    let used = &runs[1];
    let by_sign = models::equations(true);
    let exact = models::exact(&by_sign);
    let rows = models::models(&by_sign)
        .map(|model| models::row(&by_sign, &model, &used.states, &used.forces, &exact));
    let chapter = ["37/2 8.40", "24/9 8.43", "18/12 8.53", "12/12 8.62"];
    println!("model  parameters  well identified  eps_RA %");
    for (k, (row, chapter)) in rows.iter().zip(chapter).enumerate() {
        println!(
            "{:5}  {:10}  {:15}  {:8.2}   chapter {chapter}",
            k + 1,
            row.parameters,
            row.well,
            row.relative_absolute
        );
    }
    title("Table 8 (SIMULATED): three base parameters, kg m and kg");
    println!("parameter      CAD   Model 4   Model 1   chapter's CAD, Model 4, Model 1");
    let labels = by_sign.labels();
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
            "{label:9} {:8.2}  {:8.2}  {:8.2}   {chapter}",
            exact[place],
            of(&rows[3]),
            of(&rows[0])
        );
    }
    println!(
        "Model 1's parameters are of a robot that can be built: {}",
        models::feasible(&by_sign, &rows[0].estimate.values)
    );
    figure4(&by_sign, &rows[3], &runs[0], out);
}

/// Model 4, identified from one trajectory, predicts another.
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
