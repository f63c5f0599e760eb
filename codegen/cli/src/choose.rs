//! `regen excite --calibrate`: poses for a calibration of the geometry.

use std::path::Path;

use regen_calibrate::{CalibrateError, Choice, Efforts, Problem};
use regen_interpreted::Described;
use regen_report::results::{Calibrated, chosen_text};

use crate::args::{ExciteArgs, Format};
use crate::calibrate::{
    efforts_of, experiment, geometry, held_robot, reading_columns, sensors, stated, stated_plan,
};
use crate::exit::Failure;
use crate::{load, table, terminal, write};

/// The noise of sensors that state none: of lengths, m, and of angles, rad.
pub(crate) const NOISE: [f64; 2] = [5e-5, 1e-4];

/// Chooses poses of what a file says is measured.
pub(crate) fn run(
    args: &ExciteArgs,
    poses: usize,
    file: &Path,
    margin: f64,
) -> Result<(), Failure> {
    let mechanism = load::mechanism(&load::source(&args.file)?)?;
    let robot = mechanism.robot(&[])?;
    let mut described = Described::new(mechanism.spec(), mechanism.model(), &robot);
    let kinematics = &mut described.kinematics;
    for given in &args.limit {
        if given.quantity != "position" {
            return Err(Failure::Usage(format!(
                "--limit {}.{} has no effect here: poses are at rest, and only positions are limited",
                given.coordinate, given.quantity
            )));
        }
        let names = &kinematics.coordinates;
        let Some(place) = names.iter().position(|own| *own == given.coordinate) else {
            return Err(Failure::Input(format!(
                "--limit: there is no coordinate {}; there are {}",
                given.coordinate,
                names.join(" ")
            )));
        };
        kinematics.limits[place] = Some(given.range);
    }
    if args.margin.is_some() && kinematics.rows() == 0 {
        let text =
            "--margin has no effect here: the robot has no loops, and so no singularities of them";
        return Err(Failure::Usage(text.to_owned()));
    }
    let (source, plan_file) = experiment(file, &mechanism)?;
    let plan = stated_plan(file, &plan_file)?;
    let sensors = sensors(&source, plan, &described)?;
    let geometry = geometry(&[], plan, &described, &sensors)?;
    let measured = stated(&plan_file.settings, &mechanism);
    let noise = vec![plan.noise; measured.len()];
    let held = held_robot(&mechanism, &geometry)?;
    let efforts = efforts_of(held.as_ref(), &args.file)?;
    let problem = Problem {
        kinematics: &described.kinematics,
        geometry: &geometry,
        measured: &measured,
        noise_of_readings: &noise,
        sensors: &sensors,
        tolerance: plan.tolerance,
        efforts: efforts.as_ref().map(|own| own as &dyn Efforts),
        poses: &[],
    };
    let what = Choice {
        poses,
        margin,
        noise: NOISE,
        seed: args.seed,
    };
    let failed = |error: CalibrateError| {
        let text = format!("{}: {error}", file.display());
        match error {
            CalibrateError::NotClosed | CalibrateError::TooFewPoses { .. } => {
                Failure::Numeric(text)
            }
            _ => Failure::Input(text),
        }
    };
    let chosen = problem.choose(&what).map_err(failed)?;
    let columns = reading_columns(&problem, &plan_file.settings);
    let titles: Vec<&str> = columns.iter().map(|own| own.0.as_str()).collect();
    let rows = chosen.states.iter().map(|state| {
        let readings = measured.iter().zip(&columns);
        let row = readings.map(|(c, (_, factor, offset))| (state[*c] - offset) / factor);
        row.collect::<Vec<f64>>()
    });
    let rows: Vec<Vec<f64>> = rows.collect();
    let mut text = titles.join(",") + "\n";
    for row in &rows {
        // no negative zero
        let row = row.iter().map(|x| format!("{:.9}", x + 0.0));
        text += &(row.collect::<Vec<String>>().join(",") + "\n");
    }
    if let Some(out) = &args.out {
        write::atomically(out, &text)?;
    }
    let known = problem.known().map_err(failed)?;
    let columns = columns.into_iter().map(|own| own.0).collect();
    let found = Calibrated::of_chosen(&robot.name, &problem, &known, (&chosen, columns, rows));
    terminal::print(&match args.format {
        Format::Human => chosen_text(&found),
        Format::Json => table::json(&found),
    })?;
    match &args.out {
        Some(out) => terminal::note(&format!("{}: written", out.display())),
        None if args.format == Format::Human => {
            terminal::note("note: the poses are not written: give --out CSV");
        }
        None => {}
    }
    Ok(())
}
