//! The options of `regen serve`.

use std::path::PathBuf;

use clap::Args;

#[derive(Debug, Args)]
#[command(after_help = "\
Open the printed address in a browser on this machine. While you type, the page
shows mistakes at their lines, the mechanism in 3D, the base parameters and the
result of `regen check`; with an experiment file also the report of `regen
identify`. Files are written only by the button Save.

The server listens on 127.0.0.1 only, and serves only requests with the token in
the address. The page loads nothing from other hosts. Ctrl-C ends the server.

Examples:
  regen serve robots/3rps.yaml
  regen serve arm.yaml runs.yaml --port 8000")]
pub(crate) struct ServeArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// An experiment file, from which the robot is identified
    pub(crate) runs: Option<PathBuf>,
    /// The port [default: a free one]
    #[arg(long, default_value_t = 0, hide_default_value = true)]
    pub(crate) port: u16,
    /// The time limit of the computations for one text, s
    #[arg(long, value_name = "SECONDS", default_value_t = 60)]
    pub(crate) limit: u32,
    /// Run as a server's worker, which reads the texts from standard input
    #[arg(long, hide = true)]
    pub(crate) worker: bool,
}
