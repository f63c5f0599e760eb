//! Base parameters stored in a file next to the spec. Macros run in unoptimised builds; if deriving
//! the base parameters there would take long, they are written once, with a digest of their spec.
//!
//! The format is line-based; the first word of a line says what the line contains:
//!
//! ```text
//! regen-base 0.2.0                    the version that wrote it
//! spec 6f1c...                        digest of the spec's bytes (SHA-256)
//! certificate 70 25 19 96 1.2e-3 4e-95  columns rank states digits kept dropped
//! sums 4 45 0 true                    trees, dimension, completed, complete
//! condition 385.2                     condition of the sampled rows, if it is known
//! refuted 1                           directions that samples contradict, if any
//! number Ixx(2) in Iyy(3)             a factor that is a number only
//! held a, b in proportion only: ...   names that were not varied, and why
//! varied al, a                        names at other values of which rows were checked
//! special 12 at al = pi/2              a value that lowers the rank
//! equal l1 = l2                       a coincidence of values
//! base 23 kept derived                a base parameter: column, kept or dropped, how obtained
//! term 23 1                           column and factor, for the line above
//! null 19 completed                   a null direction: eliminated column, how obtained
//! known 12                            a parameter written as a combination of others
//! end                                 the file is complete
//! ```

use std::fmt::Write as _;

use sha2::{Digest, Sha256};

use crate::diag::Source;
use crate::model::Model;
use crate::spec::Spec;

use super::certificate::Certificate;
use super::{
    Analysis, Base, BaseParameter, Coefficient, Exactness, NullDirection, Provenance, Substitution,
    Term,
};

/// The first line. It contains the version, since another version may choose other columns.
const HEAD: &str = concat!("regen-base ", env!("CARGO_PKG_VERSION"));
/// The beginning of the first line in every version.
const FORMAT: &str = "regen-base ";
/// The last line; a file without it is incomplete.
const END: &str = "end";

/// The reason why stored base parameters cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StoreProblem {
    /// The file was written for another version of the spec.
    OutOfDate,
    /// Another version of `regen` wrote the file, which may choose other base parameters.
    OtherRegen,
    /// The file is not in the format that `regen` writes.
    Malformed,
}

impl core::fmt::Display for StoreProblem {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            StoreProblem::OutOfDate => "belongs to another version of the spec",
            StoreProblem::OtherRegen => "was written by another version of regen",
            StoreProblem::Malformed => "is not what regen writes",
        })
    }
}

impl core::error::Error for StoreProblem {}

fn digest(source: &Source) -> String {
    let mut text = String::new();
    for byte in Sha256::digest(source.text.as_bytes()) {
        let _ = write!(text, "{byte:02x}");
    }
    text
}

/// A rough cost of the derivation in an unoptimised build, without unit: the time of the rank grows
/// with the cube of the number of columns, and the trees add a factor that grows with the number of
/// loops.
fn debug_cost(model: &Model) -> usize {
    let columns = model.parameters.len();
    columns
        .saturating_pow(3)
        .saturating_mul(1 + model.cuts.len())
}

/// Whether deriving the base would take more than about a second in an unoptimised build, so that
/// it should be stored.
pub fn is_slow_in_debug(model: &Model) -> bool {
    // 70 columns and two cuts, 1.0 million, take a third of a second
    debug_cost(model) > 3_000_000
}

/// The file's words for the provenance of a combination and the exactness of its factors.
const PROVENANCE_WORDS: [(&str, Provenance, Exactness); 7] = [
    ("derived", Provenance::Derived, Exactness::Symbolic),
    (
        "derived-here",
        Provenance::Derived,
        Exactness::AtThisGeometry,
    ),
    ("proven", Provenance::Proven, Exactness::Symbolic),
    ("proven-here", Provenance::Proven, Exactness::AtThisGeometry),
    ("completed", Provenance::Completed, Exactness::Symbolic),
    (
        "completed-here",
        Provenance::Completed,
        Exactness::AtThisGeometry,
    ),
    (
        "completed-digits",
        Provenance::Completed,
        Exactness::Numeric,
    ),
];

fn provenance_word(provenance: Provenance, exactness: Exactness) -> &'static str {
    let mut all = PROVENANCE_WORDS.iter();
    let found = all.find(|(_, l, e)| (*l, *e) == (provenance, exactness));
    found.map_or(PROVENANCE_WORDS[0].0, |(word, ..)| *word)
}

fn parse_provenance(word: &str) -> Option<(Provenance, Exactness)> {
    let found = PROVENANCE_WORDS.iter().find(|(w, ..)| *w == word)?;
    Some((found.1, found.2))
}

/// The text of an analysis for the file.
pub fn store(source: &Source, analysis: &Analysis) -> String {
    let Analysis {
        base,
        condition,
        certificate,
        complete,
    } = analysis;
    let mut out = format!("{HEAD}\nspec {}\n", digest(source));
    match certificate {
        Ok(c) => {
            let _ = writeln!(
                out,
                "certificate {} {} {} {} {:?} {:?}",
                c.columns, c.rank, c.states, c.digits, c.smallest_pivot, c.largest_remainder
            );
        }
        Err(reason) => {
            let _ = writeln!(out, "uncertified {}", reason.replace('\n', " "));
        }
    }
    let _ = writeln!(
        out,
        "sums {} {} {} {complete}",
        base.trees, base.from_trees, base.completed
    );
    if let Some(condition) = condition {
        let _ = writeln!(out, "condition {condition:?}");
    }
    if base.refuted > 0 {
        let _ = writeln!(out, "refuted {}", base.refuted);
    }
    for note in &base.unrecognised {
        let _ = writeln!(out, "number {note}");
    }
    for note in &base.unvaried_names {
        let _ = writeln!(out, "held {note}");
    }
    if !base.varied_names.is_empty() {
        let _ = writeln!(out, "varied {}", base.varied_names.join(", "));
    }
    for value in &base.special_angles {
        let _ = writeln!(out, "special {value}");
    }
    for equation in &base.coincidences {
        let _ = writeln!(out, "equal {equation}");
    }
    let terms = |out: &mut String, terms: &[Term]| {
        for term in terms {
            let _ = writeln!(out, "term {} {}", term.column, term.coefficient);
        }
    };
    for parameter in &base.parameters {
        let kept = if parameter.dropped { "dropped" } else { "kept" };
        let provenance = provenance_word(parameter.provenance, parameter.exactness);
        let _ = writeln!(out, "base {} {kept} {provenance}", parameter.column);
        terms(&mut out, &parameter.terms);
    }
    for row in &base.null {
        let provenance = provenance_word(row.provenance, row.exactness);
        let _ = writeln!(out, "null {} {provenance}", row.column);
        terms(&mut out, &row.terms);
    }
    for known in &base.known {
        let _ = writeln!(out, "known {}", known.column);
        terms(&mut out, &known.terms);
    }
    let _ = writeln!(out, "{END}");
    out
}

/// Reads an analysis from the text of its file.
///
/// # Errors
/// If the text belongs to another version of the spec or of `regen`, or is malformed.
pub fn restore(
    text: &str,
    source: &Source,
    spec: &Spec,
    model: &Model,
) -> Result<Analysis, StoreProblem> {
    let body = text.trim_end().strip_suffix(END).unwrap_or("");
    let mut lines = body.lines();
    match lines.next() {
        Some(HEAD) => {}
        Some(other) if other.starts_with(FORMAT) => return Err(StoreProblem::OtherRegen),
        _ => return Err(StoreProblem::Malformed),
    }
    let owner = lines.next().and_then(|l| l.strip_prefix("spec "));
    if owner.ok_or(StoreProblem::Malformed)? != digest(source) {
        return Err(StoreProblem::OutOfDate);
    }
    read(lines, spec, model.parameters.len()).ok_or(StoreProblem::Malformed)
}

fn read<'a>(lines: impl Iterator<Item = &'a str>, spec: &Spec, columns: usize) -> Option<Analysis> {
    let mut analysis = Analysis {
        base: Base {
            parameters: Vec::new(),
            null: Vec::new(),
            known: Vec::new(),
            from_trees: 0,
            trees: 0,
            completed: 0,
            refuted: 0,
            unrecognised: Vec::new(),
            unvaried_names: Vec::new(),
            varied_names: Vec::new(),
            special_angles: Vec::new(),
            coincidences: Vec::new(),
        },
        condition: None,
        certificate: Err("none".to_owned()),
        complete: false,
    };
    let base = &mut analysis.base;
    // the list to which `term` lines belong: 0 base, 1 null, 2 known
    let mut open = None;
    for line in lines {
        let (word, rest) = line.split_once(' ')?;
        let parts: Vec<&str> = rest.split(' ').collect();
        let number = |i: usize| parts.get(i)?.parse::<usize>().ok();
        let column = || number(0).filter(|c| *c < columns);
        match word {
            "certificate" => {
                analysis.certificate = Ok(Certificate {
                    columns: number(0)?,
                    rank: number(1)?,
                    states: number(2)?,
                    digits: number(3)?,
                    smallest_pivot: parts.get(4)?.parse().ok()?,
                    largest_remainder: parts.get(5)?.parse().ok()?,
                });
            }
            "uncertified" => analysis.certificate = Err(rest.to_owned()),
            "sums" => {
                base.trees = number(0)?;
                base.from_trees = number(1)?;
                base.completed = number(2)?;
                analysis.complete = parts.get(3)?.parse().ok()?;
            }
            "condition" => analysis.condition = Some(parts.first()?.parse().ok()?),
            "refuted" => base.refuted = number(0)?,
            "number" => base.unrecognised.push(rest.to_owned()),
            "held" => base.unvaried_names.push(rest.to_owned()),
            "varied" => base.varied_names = rest.split(", ").map(str::to_owned).collect(),
            "special" => base.special_angles.push(rest.to_owned()),
            "equal" => base.coincidences.push(rest.to_owned()),
            "base" => {
                let (provenance, exactness) = parse_provenance(parts.get(2)?)?;
                base.parameters.push(BaseParameter {
                    column: column()?,
                    terms: Vec::new(),
                    provenance,
                    exactness,
                    dropped: *parts.get(1)? == "dropped",
                });
                open = Some(0);
            }
            "null" => {
                let (provenance, exactness) = parse_provenance(parts.get(1)?)?;
                base.null.push(NullDirection {
                    column: column()?,
                    terms: Vec::new(),
                    provenance,
                    exactness,
                });
                open = Some(1);
            }
            "known" => {
                base.known.push(Substitution {
                    column: column()?,
                    terms: Vec::new(),
                });
                open = Some(2);
            }
            "term" => {
                let coefficient = rest.split_once(' ')?.1;
                let term = Term {
                    column: column()?,
                    value: spec.evaluate(coefficient)?,
                    coefficient: Coefficient::parse(coefficient)?,
                };
                match open? {
                    0 => base.parameters.last_mut()?.terms.push(term),
                    1 => base.null.last_mut()?.terms.push(term),
                    _ => base.known.last_mut()?.terms.push(term),
                }
            }
            _ => return None,
        }
    }
    Some(analysis)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn five_bar() -> (Source, Spec, Model, Analysis) {
        let text = include_str!("../../../tests/fixtures/oracle/fivebar.yaml");
        let source = Source::new("fivebar.yaml", text);
        let spec = crate::spec::parse(&source).unwrap();
        let model = crate::model::build(&spec);
        let robot = crate::pipeline::derive(&source).unwrap();
        (source, spec, model, robot.analysis.unwrap())
    }

    #[test]
    fn problems_say_what_they_are() {
        let said = |problem: StoreProblem| problem.to_string();
        assert!(said(StoreProblem::OutOfDate).contains("another version of the spec"));
        assert!(said(StoreProblem::OtherRegen).contains("another version of regen"));
        assert!(said(StoreProblem::Malformed).contains("not what regen writes"));
    }

    #[test]
    fn what_is_stored_comes_back() {
        let (source, spec, model, analysis) = five_bar();
        let text = store(&source, &analysis);
        assert_eq!(restore(&text, &source, &spec, &model), Ok(analysis));
    }

    #[test]
    fn another_spec_is_noticed_and_so_is_a_broken_file() {
        let (source, spec, model, analysis) = five_bar();
        let text = store(&source, &analysis);
        let edited = Source::new("fivebar.yaml", format!("{} ", source.text));
        assert_eq!(
            restore(&text, &edited, &spec, &model),
            Err(StoreProblem::OutOfDate)
        );
        let older = text.replacen(HEAD, "regen-base 0.0.1", 1);
        assert_eq!(
            restore(&older, &source, &spec, &model),
            Err(StoreProblem::OtherRegen)
        );
        for broken in [
            text.replace("term 25 ", "term 99 "),
            text.replace("null ", "nil "),
            text[..text.len() / 2].to_owned(),
            String::new(),
        ] {
            assert_eq!(
                restore(&broken, &source, &spec, &model),
                Err(StoreProblem::Malformed)
            );
        }
    }
}
