//! `regen view`: the mechanism in 3D on one page of its own.

mod data;

use std::path::PathBuf;

use clap::Args;
use regen_codegen::pipeline;

use crate::exit::Failure;
use crate::{load, table, terminal, write};
use regen_interpreted::Interpreted;

#[derive(Debug, Args)]
#[command(after_help = "\
The page needs nothing else and no network. It shows the bodies, joint axes,
frames and cut joints at home and moving along the trajectory, or else with each
independent coordinate swept in turn as far as limits and loops let it.
Drag to turn, wheel or pinch to come nearer, right button to shift.

A mechanism whose loops do not close is shown as its home states it, with what
gapes in red; the exit code is then that of the error.

Examples:
  regen view robots/3rps.yaml --out 3rps.html
  regen view robots/3rps.yaml --trajectory t.json --out 3rps.html")]
pub(crate) struct ViewArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// How it moves, as `regen excite` writes it [default: a sweep]
    #[arg(long, value_name = "TRAJECTORY")]
    pub(crate) trajectory: Option<PathBuf>,
    /// Where the page is written
    #[arg(long, value_name = "HTML")]
    pub(crate) out: PathBuf,
}

/// Runs the command.
pub(crate) fn run(args: &ViewArgs) -> Result<(), Failure> {
    let source = load::source(&args.file)?;
    let mechanism = load::mechanism(&source)?;
    let scene = mechanism.scene();
    let (data, wrong) = match mechanism.robot(&pipeline::without_base()) {
        Ok(robot) => {
            let model = Interpreted::new(&robot);
            let file = args.trajectory.as_deref();
            (data::moving(&scene, &model, file)?, None)
        }
        Err(report) => {
            let data = data::still(&scene, &report.to_string());
            (data, Some(Failure::from(report)))
        }
    };
    write::atomically(&args.out, &page(&scene.name, &table::json(&data)))?;
    terminal::note(&format!("{}: written", args.out.display()));
    wrong.map_or(Ok(()), Err)
}

/// The whole page.
fn page(name: &str, data: &str) -> String {
    let escaped = name.replace('&', "&amp;").replace('<', "&lt;");
    // a script ends at the first of these, wherever it stands
    let data = data.trim_end().replace("</", "<\\/");
    let parts = [
        ("{{name}}", escaped.as_str()),
        ("{{style}}", include_str!("view.css")),
        ("{{script}}", include_str!("view.js")),
        // last: nothing is looked for in it
        ("{{data}}", data.as_str()),
    ];
    let page = include_str!("view.html").to_owned();
    parts
        .iter()
        .fold(page, |page, (place, text)| page.replace(place, text))
}
