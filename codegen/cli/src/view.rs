//! `regen view`: shows the mechanism in 3D on one HTML page.

use regen_codegen::pipeline;

use crate::args::ViewArgs;
use crate::exit::Failure;
use crate::{load, path, terminal, write};
use regen_interpreted::Interpreted;
use regen_report::{ViewError, view};

/// Runs the command.
pub(crate) fn run(args: &ViewArgs) -> Result<(), Failure> {
    let source = load::source(&args.file)?;
    let mechanism = load::mechanism(&source)?;
    let scene = mechanism.scene();
    let (data, wrong) = match mechanism.robot(&pipeline::functions_without_base()) {
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
