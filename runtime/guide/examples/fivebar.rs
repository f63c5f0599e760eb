//! Identifies a planar five-bar from a CSV file with the library alone: reads the log,
//! differentiates, identifies, and predicts a log that was not used. `regen identify --report` does
//! the same from the command line, with figures.
//!
//! ```sh
//! cargo run --release -p regen-guide --example fivebar
//! ```

use std::error::Error;
use std::path::{Path, PathBuf};

use regen_identify::data::{Logs, Settings};
use regen_identify::identify::{EquationKind, Identified, Options, identify, observe, residuals};
use regen_identify::signals::Method;
use regen_runtime::BaseModel;

regen_runtime::robot_model!("../fivebar/fivebar.yaml");

/// The robot, over `f64`.
fn robot() -> &'static dyn BaseModel<f64> {
    &picker::Picker
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fivebar");
    // positions and torques of the motors; the other coordinates follow from the loop
    let mut first = logs(&folder.join("run1.csv"))?;
    let found = identify(
        robot(),
        EquationKind::Forces,
        &Options::default(),
        &mut first,
    )?;
    table(&found);

    let mut second = logs(&folder.join("run2.csv"))?;
    let (set, _) = observe(robot(), EquationKind::Forces, &mut second)?;
    let values = &found.estimate.values;
    let checked = residuals(
        robot(),
        EquationKind::Forces,
        &mut second,
        values,
        &set.means(),
        0,
    )?;
    for error in checked.efforts() {
        println!(
            "on the other log, {}: eps_RA {:.2} %",
            error.name, error.relative_absolute
        );
    }
    Ok(())
}

fn logs(path: &Path) -> Result<Logs<'static, dyn BaseModel<f64>>, Box<dyn Error>> {
    let settings = Settings {
        method: Method::Butterworth {
            order: 4,
            cutoff: 20.0,
        },
        ..Settings::default()
    };
    Ok(Logs::open(robot(), &[PathBuf::from(path)], &settings)?)
}

/// Prints the values with their standard deviations; above 15 % a parameter is not properly
/// identified.
fn table(found: &Identified) {
    let estimate = &found.estimate;
    println!("{:8} {:>10} {:>10} {:>8}", "", "value", "sigma", "sigma %");
    for (k, label) in estimate.labels.iter().enumerate() {
        let percent = estimate.sigma_percent(k);
        let note = if percent < 15.0 { "" } else { "poor" };
        println!(
            "{label:8} {:10.5} {:10.5} {percent:8.2} {note}",
            estimate.values[k],
            estimate.sigma(k)
        );
    }
    println!(
        "{} parameters, condition number {:.0}, eps_RA {:.2} %",
        estimate.values.len(),
        estimate.scaled_condition,
        found.relative_absolute
    );
}
