//! Refuses options that change nothing beside the others.

use clap::ArgMatches;
use clap::parser::ValueSource;

use crate::exit::Failure;

/// Options of reading logs.
const READING: [&str; 22] = [
    "folder",
    "column",
    "topic",
    "episode",
    "poses",
    "rate",
    "resample",
    "velocities",
    "fourier",
    "butterworth",
    "local",
    "no_filter",
    "decimate",
    "period",
    "deviation",
    "problems",
    "standstill",
    "rest_speed",
    "delay",
    "energy",
    "bandwidth",
    "no_suspicion",
];

/// The arguments of a command as they were written.
struct Written<'m> {
    matches: &'m ArgMatches,
}

impl Written<'_> {
    /// Whether an option was written; defaults do not count.
    fn has(&self, id: &str) -> bool {
        self.matches.ids().any(|own| own.as_str() == id)
            && self.matches.value_source(id) == Some(ValueSource::CommandLine)
    }

    fn estimator(&self) -> &str {
        if !self.has("estimator") {
            return "ls";
        }
        let raw = self.matches.get_raw("estimator");
        let word = raw.and_then(|mut values| values.next());
        word.and_then(|word| word.to_str()).unwrap_or("ls")
    }
}

/// When options of a command have no effect, and why.
struct Rule {
    commands: &'static [&'static str],
    options: &'static [&'static str],
    holds: fn(&Written<'_>) -> bool,
    why: &'static str,
}

const RULES: [Rule; 6] = [
    Rule {
        commands: &["identify"],
        options: &READING,
        holds: |w| w.has("from") && !w.has("against"),
        why: "factors (--from) are of equations that were read before; give it to `regen observe`",
    },
    Rule {
        commands: &["identify"],
        options: &[
            "command",
            "loop_bandwidth",
            "settle",
            "window",
            "friction_width",
            "start",
        ],
        holds: |w| !matches!(w.estimator(), "didim" | "response"),
        why: "it is for the estimators didim and response, which simulate the robot",
    },
    Rule {
        commands: &["identify"],
        options: &["window", "friction_width"],
        holds: |w| w.estimator() == "didim",
        why: "it is for the estimator response",
    },
    Rule {
        commands: &["identify"],
        options: &["loop_bandwidth", "settle"],
        holds: |w| w.estimator() == "response",
        why: "it is for the estimator didim",
    },
    Rule {
        commands: &["simulate", "rehearse"],
        options: &["friction_width"],
        holds: |w| w.has("no_friction"),
        why: "there is no friction (--no-friction)",
    },
    Rule {
        commands: &["rehearse"],
        options: &["huber"],
        holds: |w| w.has("estimator") && w.estimator() != "huber",
        why: "it is for the estimator huber",
    },
];

/// Refuses the first option of a parsed command that has no effect beside the others.
///
/// # Errors
///
/// Names the option and why.
pub(super) fn require_effect(parsed: &ArgMatches) -> Result<(), Failure> {
    let Some((command, matches)) = parsed.subcommand() else {
        return Ok(());
    };
    let written = Written { matches };
    for rule in &RULES {
        if !rule.commands.contains(&command) || !(rule.holds)(&written) {
            continue;
        }
        if let Some(option) = rule.options.iter().find(|option| written.has(option)) {
            let name = match *option {
                "folder" => "logs".to_owned(),
                other => other.replace('_', "-"),
            };
            return Err(Failure::Usage(format!(
                "--{name} has no effect here: {}",
                rule.why
            )));
        }
    }
    Ok(())
}
