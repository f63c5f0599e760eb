//! `regen verify --all`: independent checks of any number of robots, with figures and bounds.
//!
//! | file | what |
//! |---|---|
//! | `finding` | a check, its figure, its bound, and what came of them |
//! | `rounding` | how far two computations may differ at a state |
//! | `forces` | the regressor against other derivations: Newton-Euler, energy, vectors |
//! | `loops` | the drift of the loops along a motion |
//! | `base` | rank, span, certificate and the ways to base parameters and back |
//! | `vectors` | vectors of another program, kept beside the spec |
//! | `show` | tables and JSON |

mod base;
mod finding;
mod forces;
mod loops;
mod rounding;
mod show;
#[cfg(test)]
mod tests;
mod vectors;

use std::path::{Path, PathBuf};

use indicatif::ProgressBar;
use regen_codegen::robot::Robot;
use regen_reference::Mechanism;
use regen_runtime::Closure;

use crate::args::{VerifyArgs, VerifyFormat};
use crate::exit::Failure;
use crate::states::Motion;
use crate::verify::{self, Random, Reach};
use crate::workspace::{self, Workspace};
use crate::{load, progress, terminal};
use regen_interpreted::Interpreted;

pub(crate) use rounding::certain as regressor;

use finding::Finding;
use vectors::Vectors;

/// Closed states that are tried.
const STATES: usize = 8;
/// How far from home the independent coordinates go, rad and m.
const REACH: Reach = Reach {
    tree: 2.0,
    loops: 0.2,
};

/// The condition of A_e may be this much worse than at home; bounds grow with it, and where they
/// end near a singularity is no evidence about the model.
const WORSE_THAN_HOME: f64 = 0.1;
/// States that are drawn for one that is so.
const TRIES: usize = 20;

/// What is found about one robot.
pub(crate) struct Evidence {
    pub(crate) robot: String,
    pub(crate) file: String,
    /// In the order of [`finding::CHECKS`].
    pub(crate) findings: Vec<Finding>,
}

/// Everything that the checks of one robot look at.
pub(crate) struct Subject<'a> {
    pub(crate) robot: &'a Robot,
    /// The second derivation, from the same text.
    pub(crate) reference: &'a Mechanism,
    pub(crate) vectors: Option<&'a Vectors>,
}

/// Runs the command.
pub(crate) fn run(args: &VerifyArgs) -> Result<(), Failure> {
    if args.states.is_some() {
        return Err(Failure::Usage("--states does not go with --all".to_owned()));
    }
    let files = files(&args.files)?;
    let progress = match files.len() {
        0 | 1 => ProgressBar::hidden(),
        many => progress::bar(many as u64, "{bar:24} {pos}/{len} {msg}"),
    };
    let mut all = Vec::new();
    for file in &files {
        progress.set_message(file.display().to_string());
        all.push(of_file(file)?);
        progress.inc(1);
    }
    progress.finish_and_clear();
    terminal::print(&match args.format {
        VerifyFormat::Human => show::human(&all),
        VerifyFormat::Markdown => show::markdown(&all),
        VerifyFormat::Json => show::json(&all),
    })?;
    let failed: Vec<String> = all.iter().flat_map(show::failures).collect();
    if failed.is_empty() {
        Ok(())
    } else {
        Err(Failure::Check(format!(
            "not verified: {}",
            failed.join("; ")
        )))
    }
}

/// The specs that are meant: files, those of directories, or those of the workspace.
fn files(named: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    if named.is_empty() {
        return Workspace::current()?.robots();
    }
    let mut files = Vec::new();
    for path in named {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let mut inside =
            workspace::entries(path).map_err(|error| Failure::io("read", path, &error))?;
        inside.retain(|p| p.extension().is_some_and(|e| e == "yaml") && p.is_file());
        if inside.is_empty() {
            return Err(Failure::Input(format!("no *.yaml in {}", path.display())));
        }
        files.extend(inside);
    }
    Ok(files)
}

fn of_file(file: &Path) -> Result<Evidence, Failure> {
    let source = load::source(file)?;
    let robot = load::with_base(&source)?;
    let reference = Mechanism::from_yaml(&source.text).map_err(|why| {
        Failure::Check(format!(
            "{}: the second derivation cannot read this: {why}",
            file.display()
        ))
    })?;
    let vectors = Vectors::of(file)?;
    let subject = Subject {
        robot: &robot,
        reference: &reference,
        vectors: vectors.as_ref(),
    };
    Ok(Evidence {
        robot: robot.name.clone(),
        file: file.display().to_string(),
        findings: subject.check()?,
    })
}

impl Subject<'_> {
    /// Every check, in the order of [`finding::CHECKS`].
    pub(crate) fn check(&self) -> Result<Vec<Finding>, Failure> {
        if self.robot.coordinates != self.reference.coordinates
            || self.robot.parameters != self.reference.labels()
            || self.robot.independent != self.reference.independent
        {
            return Err(Failure::Check(format!(
                "{}: the second derivation reads other coordinates or parameters in this spec",
                self.robot.name
            )));
        }
        let states = self.states()?;
        let mut random = Random(verify::SEED + 1);
        let mut findings = vec![
            self.second(&states)?,
            self.peer(),
            self.power(&states, &mut random)?,
            self.drift(&states),
        ];
        findings.extend(self.base(&states, &mut random)?);
        findings.push(self.single(&states));
        Ok(findings)
    }

    fn states(&self) -> Result<Vec<Motion>, Failure> {
        let model = Interpreted::new(self.robot);
        let mut closure = Closure::new(&model)?;
        let mut random = Random(verify::SEED);
        let home = self.reference.conditioning(&closure.home().q);
        let mut states = Vec::new();
        for _ in 0..STATES {
            let mut motion = verify::closed_state(&model, &mut closure, &mut random, REACH)?;
            for _ in 0..TRIES {
                if self.reference.conditioning(&motion.q) >= WORSE_THAN_HOME * home {
                    break;
                }
                motion = verify::closed_state(&model, &mut closure, &mut random, REACH)?;
            }
            states.push(motion);
        }
        Ok(states)
    }
}
