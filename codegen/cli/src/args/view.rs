//! The options of `regen view`.

use std::path::PathBuf;

use clap::Args;

#[derive(Debug, Args)]
#[command(after_help = "\
The page is one file that needs no network. It shows the bodies, joint axes,
frames and cut joints, moving along the trajectory or, without one, with each
independent coordinate swept in turn as far as limits and loops allow.
Drag to rotate, wheel or pinch to zoom, right button to pan.

A mechanism whose loops do not close is shown at the stated home, with the gaps
in red; the exit code is then that of the error.

Examples:
  regen view robots/3rps.yaml --out 3rps.html
  regen view robots/3rps.yaml --trajectory t.json --out 3rps.html")]
pub(crate) struct ViewArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// The trajectory, as `regen excite` writes it [default: a sweep]
    #[arg(long, value_name = "TRAJECTORY")]
    pub(crate) trajectory: Option<PathBuf>,
    /// Where the page is written
    #[arg(long, value_name = "HTML")]
    pub(crate) out: PathBuf,
}
