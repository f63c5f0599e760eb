//! Refuses options that change nothing beside the others, and says which keys of an experiment file an
//! estimator does not use.

use clap::ArgMatches;
use clap::parser::ValueSource;
use regen_identify::identify::EquationKind;
use regen_identify::states::Standstill;

use super::EstimatorArg;
use super::reading::DelayArg;
use crate::args::ReadingArgs;
use crate::exit::Failure;

/// How logs are read, as options and as a key of an experiment file say it.
struct Setting {
    /// The options, without those that every command and estimator uses.
    options: &'static [&'static str],
    /// The key of an experiment file.
    key: &'static str,
    /// Whether an experiment file states it.
    is_stated: fn(&ReadingArgs) -> bool,
    /// Whether DIDIM uses it.
    of_didim: bool,
}

/// The settings that the fit to responses does not use: it compares positions as they are logged.
const SETTINGS: [Setting; 7] = [
    Setting {
        options: &["delay"],
        key: "delay",
        is_stated: |reading| {
            let settings = crate::observe::settings(reading);
            reading.delay.contains(&DelayArg::Auto) || !settings.delays.is_empty()
        },
        of_didim: false,
    },
    Setting {
        options: &["period"],
        key: "period",
        is_stated: |reading| crate::observe::settings(reading).period.is_some(),
        of_didim: false,
    },
    Setting {
        options: &["energy"],
        key: "energy",
        is_stated: |reading| crate::observe::kind(reading) != EquationKind::Forces,
        of_didim: false,
    },
    Setting {
        options: &["deviation"],
        key: "deviations",
        is_stated: |reading| !crate::observe::settings(reading).deviations.is_empty(),
        of_didim: false,
    },
    Setting {
        options: &["fourier", "butterworth", "local", "no_filter"],
        key: "filter",
        is_stated: |reading| !crate::choice::is_open(reading),
        of_didim: true,
    },
    Setting {
        options: &["decimate"],
        key: "decimate",
        is_stated: |reading| crate::observe::settings(reading).decimation != 1,
        of_didim: true,
    },
    Setting {
        options: &["standstill", "rest_speed"],
        key: "standstill",
        is_stated: |reading| {
            let settings = crate::observe::settings(reading);
            settings.standstill != Standstill::Drop || settings.rest_speed > 0.0
        },
        of_didim: true,
    },
];

impl Setting {
    fn is_used_by(&self, estimator: &str) -> bool {
        match estimator {
            "response" => false,
            "didim" => self.of_didim,
            _ => true,
        }
    }
}

/// The keys that an experiment file states and an estimator does not use.
pub(crate) fn unused_keys(
    estimator: EstimatorArg,
    reading: &ReadingArgs,
) -> impl Iterator<Item = &'static str> {
    let name = match estimator {
        EstimatorArg::Didim => "didim",
        EstimatorArg::Response => "response",
        EstimatorArg::Ls | EstimatorArg::Huber | EstimatorArg::Iv => "ls",
    };
    let unused = SETTINGS.iter().filter(move |own| !own.is_used_by(name));
    unused
        .filter(|own| (own.is_stated)(reading))
        .map(|own| own.key)
}

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

/// Options of reading logs that concern the equations of a robot.
const OF_EQUATIONS: [&str; 14] = [
    "poses",
    "velocities",
    "fourier",
    "butterworth",
    "local",
    "no_filter",
    "decimate",
    "period",
    "deviation",
    "standstill",
    "rest_speed",
    "delay",
    "energy",
    "payload",
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

    /// The words of an option that was written.
    fn words(&self, id: &str) -> Vec<&str> {
        if !self.has(id) {
            return Vec::new();
        }
        let raw = self.matches.get_raw(id).into_iter().flatten();
        raw.filter_map(|word| word.to_str()).collect()
    }

    fn is(&self, id: &str, word: &str) -> bool {
        self.words(id).contains(&word)
    }

    fn estimator(&self) -> &str {
        match self.words("estimator").first() {
            Some(word) => word,
            None if self.has("iv") => "iv",
            None => "ls",
        }
    }

    fn simulates(&self) -> bool {
        matches!(self.estimator(), "didim" | "response")
    }

    /// Whether `regen inspect` has no robot: neither `--spec` nor a description before the logs.
    fn has_no_robot(&self) -> bool {
        let is_yaml = |word: &&str| {
            let extension = std::path::Path::new(word).extension();
            extension.is_some_and(|own| own == "yaml" || own == "yml")
        };
        let logs = self.words("logs");
        !(self.has("spec") || logs.len() > 1 && logs.first().is_some_and(is_yaml))
    }

    /// Whether gains without a joint's name are given, which are those of all controllers.
    fn has_gains_of_all(&self) -> bool {
        self.words("pid").iter().any(|gains| !gains.contains('='))
    }
}

/// When options of a command have no effect, and why.
struct Rule {
    commands: &'static [&'static str],
    options: &'static [&'static str],
    holds: fn(&Written<'_>) -> bool,
    why: &'static str,
}

const RULES: [Rule; 33] = [
    Rule {
        commands: &["identify"],
        options: &READING,
        holds: |w| w.has("from") && !w.has("against"),
        why: "factors (--from) are of equations that were read before; give it to `regen observe`",
    },
    Rule {
        commands: &["identify"],
        options: &["estimator"],
        holds: |w| w.has("from") && w.estimator() == "huber",
        why: "factors (--from) are sums of squares, from which no residual can be bounded",
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
        holds: |w| !w.simulates(),
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
        commands: &["identify"],
        options: &["command", "settle"],
        holds: |w| w.estimator() == "didim" && w.has("reference"),
        why: "the simulated robot follows the trajectory of --reference from its start",
    },
    Rule {
        commands: &["identify"],
        options: &["loop_bandwidth"],
        holds: |w| w.has("controller") || w.has_gains_of_all(),
        why: "the gains of the controllers are given",
    },
    Rule {
        commands: &["identify"],
        options: &["pid"],
        holds: |w| w.estimator() == "iv" && !w.has("reference"),
        why: "without --reference the instruments are those of the measured motion, and no controller is \
              simulated",
    },
    Rule {
        commands: &["identify"],
        options: &["no_suspicion"],
        holds: |w| w.simulates() || w.has("friction"),
        why: "only linear models are searched for such mistakes",
    },
    Rule {
        commands: &["identify", "rehearse"],
        options: &["weighting"],
        holds: |w| w.estimator() == "response",
        why: "the fit to responses has no equations of efforts",
    },
    Rule {
        commands: &["identify"],
        options: &["bandwidth"],
        holds: |w| w.estimator() == "response",
        why: "the deviations of a fit to responses have no such bandwidth",
    },
    Rule {
        commands: &["identify", "rehearse"],
        options: &["weighting"],
        holds: |w| w.has("energy"),
        why: "the energy balance is one equation",
    },
    Rule {
        commands: &[
            "identify", "observe", "validate", "report", "inspect", "rehearse",
        ],
        options: &["velocities"],
        holds: |w| w.has("fourier") && w.is("velocities", "measured"),
        why: "the Fourier series is that of the positions, and so are its velocities",
    },
    Rule {
        commands: &[
            "identify", "observe", "validate", "report", "inspect", "rehearse",
        ],
        options: &["rest_speed"],
        holds: |w| w.is("standstill", "keep"),
        why: "equations of joints at rest are used like all others (--standstill keep)",
    },
    Rule {
        commands: &["inspect"],
        options: &OF_EQUATIONS,
        holds: |w| w.has_no_robot(),
        why: "it concerns the equations of a robot, and none is given: --spec",
    },
    Rule {
        commands: &["simulate", "rehearse"],
        options: &["friction_width"],
        holds: |w| w.has("no_friction"),
        why: "there is no friction (--no-friction)",
    },
    Rule {
        commands: &["simulate", "rehearse"],
        options: &["bandwidth"],
        holds: |w| w.has_gains_of_all(),
        why: "the gains of all controllers are given (--pid)",
    },
    Rule {
        commands: &["simulate"],
        options: &["runs"],
        holds: |w| w.has("exact"),
        why: "runs differ in the noise of the sensors, of which --exact has none",
    },
    Rule {
        commands: &["simulate"],
        options: &["seed"],
        holds: |w| !(w.has("noise") || w.has("perturb")),
        why: "nothing is drawn at random: neither --noise nor --perturb is given",
    },
    Rule {
        commands: &["rehearse"],
        options: &["huber"],
        holds: |w| w.has("estimator") && w.estimator() != "huber",
        why: "it is for the estimator huber",
    },
    Rule {
        commands: &["rehearse"],
        options: &["window"],
        holds: |w| w.estimator() != "response",
        why: "it is for the estimator response",
    },
    Rule {
        commands: &["rehearse"],
        options: &["draws"],
        holds: |w| !(w.has("feasible") || w.has("friction")),
        why: "only the intervals of physical parameters are drawn: --feasible, --friction",
    },
    Rule {
        commands: &["rehearse"],
        options: &["folder", "topic", "episode", "gain"],
        holds: |w| !w.has("logs"),
        why: "no experiment file and no log is given, RUNS",
    },
    Rule {
        commands: &["rehearse"],
        options: &["poses"],
        holds: |_| true,
        why: "the simulated robot moves",
    },
    Rule {
        commands: &["rehearse"],
        options: &["deviation", "velocities"],
        holds: |_| true,
        why: "simulated logs have the positions of the actuated joints, and no velocities",
    },
    Rule {
        commands: &["new"],
        options: &["classic"],
        holds: |w| !w.has("from_dh"),
        why: "there is no table, --from-dh",
    },
    // clap does not demand what an option requires where another option excludes it
    Rule {
        commands: &["identify"],
        options: &[
            "prior",
            "known",
            "bound",
            "total",
            "identical",
            "draws",
            "bodies",
        ],
        holds: |w| !(w.has("feasible") || w.has("friction")),
        why: "only physical parameters have it: --feasible or --friction",
    },
    Rule {
        commands: &["identify"],
        options: &["figures"],
        holds: |w| !w.has("report"),
        why: "there is no page, --report",
    },
    Rule {
        commands: &["base"],
        options: &["numbers", "expressions"],
        holds: |w| w.is("format", "json"),
        why: "JSON has the coefficients as expressions and as numbers",
    },
    Rule {
        commands: &["equations"],
        options: &["parameters"],
        holds: |w| {
            ["closure", "jacobian", "X", "x", "frames"]
                .iter()
                .any(|of| w.is("of", of))
        },
        why: "equations of closure and Jacobians of frames have no dynamic parameters",
    },
    Rule {
        commands: &["verify"],
        options: &["states"],
        holds: |w| w.has("all"),
        why: "the independent checks have states of their own (--all)",
    },
    Rule {
        commands: &["verify"],
        options: &["format"],
        holds: |w| w.is("format", "markdown") && !w.has("all"),
        why: "the table in Markdown is that of the independent checks, --all",
    },
    Rule {
        commands: &["simulate"],
        options: &["noise", "quantum"],
        holds: |w| w.has("exact"),
        why: "--exact logs the motion as it is, without sensors",
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
    let refused = |option: &str, why: &str| {
        let name = match option {
            "folder" => "logs".to_owned(),
            other => other.replace('_', "-"),
        };
        Err(Failure::Usage(format!(
            "--{name} has no effect here: {why}"
        )))
    };
    for rule in &RULES {
        if !rule.commands.contains(&command) || !(rule.holds)(&written) {
            continue;
        }
        if let Some(option) = rule.options.iter().find(|option| written.has(option)) {
            return refused(option, rule.why);
        }
    }
    if ["identify", "rehearse"].contains(&command) {
        let estimator = written.estimator();
        let unused = SETTINGS.iter().filter(|own| !own.is_used_by(estimator));
        let mut options = unused.flat_map(|own| own.options);
        if let Some(option) = options.find(|option| written.has(option)) {
            let why = format!("the estimator {estimator} does not use it");
            return refused(option, &why);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Read {
        #[command(flatten)]
        reading: ReadingArgs,
    }

    #[test]
    fn an_experiment_file_states_what_it_says_and_no_defaults() {
        let unused = |estimator: EstimatorArg, options: &[&str]| -> Vec<&'static str> {
            let words = ["regen"].iter().chain(options);
            let read = Read::try_parse_from(words).map(|own| own.reading);
            read.map_or(vec!["refused"], |own| {
                unused_keys(estimator, &own).collect()
            })
        };
        for estimator in [
            EstimatorArg::Didim,
            EstimatorArg::Response,
            EstimatorArg::Ls,
        ] {
            assert_eq!(unused(estimator, &[]), [""; 0]);
        }
        for (options, key, of_didim) in [
            (&["--delay", "auto"], "delay", false),
            (&["--delay", "q1=0.01"], "delay", false),
            (&["--period", "2.5"], "period", false),
            (&["--butterworth", "20,4"], "filter", true),
            (&["--standstill", "keep"], "standstill", true),
            (&["--rest-speed", "0.1"], "standstill", true),
            (&["--decimate", "3"], "decimate", true),
        ] {
            assert_eq!(unused(EstimatorArg::Response, options), [key]);
            let didim = unused(EstimatorArg::Didim, options);
            assert_eq!(didim, if of_didim { vec![] } else { vec![key] });
            assert_eq!(unused(EstimatorArg::Huber, options), [""; 0]);
        }
    }
}
