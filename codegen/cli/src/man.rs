//! `regen man`: manual pages, made from the same text as `--help`.

use clap::CommandFactory;

use crate::args::Cli;
use crate::exit::Failure;
use crate::terminal;

/// Prints the page of a command, or of regen itself.
pub(crate) fn run(command: Option<&str>) -> Result<(), Failure> {
    let mut regen = Cli::command();
    regen.build();
    let page = match command {
        None => regen,
        Some(name) => {
            let names = regen.get_subcommands().map(clap::Command::get_name);
            let names: Vec<_> = names.collect();
            let found = regen.find_subcommand(name).ok_or_else(|| {
                Failure::Input(format!(
                    "there is no command '{name}'; there are {}",
                    names.join(", ")
                ))
            })?;
            found.clone()
        }
    };
    let mut text = Vec::new();
    clap_mangen::Man::new(page)
        .render(&mut text)
        .map_err(|error| Failure::Io(format!("cannot write the page: {error}")))?;
    terminal::print(&String::from_utf8_lossy(&text))
}
