//! The options of `regen view`.

use std::path::PathBuf;

use clap::Args;

#[derive(Debug, Args)]
#[command(after_help = "\
The page needs nothing else and no network. It shows the bodies, joint axes,
frames and cut joints at home and moving along the trajectory, or else with each
independent coordinate swept in turn as far as limits and loops let it.
Drag to turn, wheel or pinch to come nearer, right button to shift.

A mechanism whose loops do not close is shown at the stated home, with the gaps
in red; the exit code is then that of the error.

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
