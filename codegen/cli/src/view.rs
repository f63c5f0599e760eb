//! `regen view`: the mechanism in 3D on one page of its own.

use std::path::PathBuf;

use clap::Args;
use regen_codegen::pipeline;

use crate::exit::Failure;
use crate::{load, path, terminal, write};
use regen_interpreted::Interpreted;
use regen_report::{ViewError, view};

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
            let motion = file.map(|file| path::read(file, &model)).transpose()?;
            (view::moving(&scene, &model, motion.as_ref())?, None)
        }
        Err(report) => {
            let data = view::still(&scene, &report.to_string());
            (data, Some(Failure::from(report)))
        }
    };
    write::atomically(&args.out, &view::page(&data))?;
    terminal::note(&format!("{}: written", args.out.display()));
    wrong.map_or(Ok(()), Err)
}

impl From<ViewError> for Failure {
    fn from(error: ViewError) -> Self {
        match error {
            ViewError::NotFollowed { .. } => Self::Numeric(error.to_string()),
            other => Self::Input(other.to_string()),
        }
    }
}
