//! The base parameters as a table, like Table 1 of the chapter: as plain text, in Markdown, in
//! LaTeX and as comma-separated values.

mod csv;
mod factor;
mod latex;
mod rows;
mod words;

use std::fmt::Write as _;

use super::Grouped;
use super::lines::{WIDTH, field, paragraph};
use crate::base::{self, Analysis, Exactness, Provenance, Substitution, Term};
use crate::diag::counted;
use crate::robot::Robot;

pub use factor::Style;
pub use words::{certificate, completed, doubt, label, largest_term, layer};

use factor::{Factor, Signed};
use rows::{Part, Row};
use words::{condition, largest_coefficient, mark, payloads};

/// The number of inertial parameters of a body; they come first, body by body.
const PER_BODY: usize = 10;

/// The mark before a number that replaces a long expression.
const NUMBER_MARK: &str = "~";

/// A table of base parameters: the combinations, whether each was derived or completed, and facts
/// about the table as a whole.
///
/// ```
/// use regen_codegen::explain::table::{Style, Table};
/// use regen_codegen::{Mechanism, diag::Source};
///
/// let text = "\
/// name: arm
/// limbs:
///   - name: arm
///     joints:
///       - {name: q1, type: revolute, body: link, actuated: true}
/// ";
/// let mechanism = Mechanism::open(&Source::new("arm.yaml", text))?;
/// // the names suffice: no function is derived
/// let robot = mechanism.robot(&[])?;
/// let table = Table::new(&robot, mechanism.analysis()?, Style::Short, &[]);
/// assert!(table.markdown().starts_with("## arm: 1 base parameters\n"));
/// # Ok::<(), regen_codegen::diag::Report>(())
/// ```
#[derive(Clone, Debug)]
pub struct Table {
    robot: String,
    rows: Vec<Row>,
    /// Why the base parameters are not known to be complete; `None` where they are.
    doubt: Option<String>,
    /// Facts about the table as a whole, each a title and a text.
    facts: Vec<(&'static str, String)>,
}

/// The combinations of the base parameters in the order of the base regressor's columns, each as
/// one line of text.
///
/// ```
/// # use regen_codegen::{Mechanism, diag::Source, explain::table::combinations};
/// let text = "\
/// name: arm
/// limbs:
///   - name: arm
///     joints:
///       - {name: q1, type: revolute, body: link, actuated: true}
/// ";
/// let mechanism = Mechanism::open(&Source::new("arm.yaml", text))?;
/// let found = combinations(&mechanism.robot(&[])?, mechanism.analysis()?);
/// assert_eq!(found, ["Izz(link)"]);
/// # Ok::<(), regen_codegen::diag::Report>(())
/// ```
pub fn combinations(robot: &Robot, analysis: &Analysis) -> Vec<String> {
    let table = Table::new(robot, analysis, Style::Short, &[]);
    table.rows.iter().map(Row::plain).collect()
}

impl Table {
    /// Makes the table of a robot's base parameters.
    ///
    /// - `style`: how factors of the combinations are printed;
    /// - `reasons`: the reasons why parameters of completed directions act only together, see
    ///   [`Explanation`](super::Explanation).
    pub fn new(robot: &Robot, analysis: &Analysis, style: Style, reasons: &[Grouped]) -> Self {
        let base = &analysis.base;
        let kept = base.parameters.iter().filter(|p| !p.dropped);
        let rows: Vec<Row> = kept
            .map(|parameter| Row {
                payload: robot.payload_of(parameter.column).map(str::to_owned),
                parts: parts(robot, &parameter.terms, style),
                layer: parameter.provenance,
                exactness: parameter.exactness,
            })
            .collect();
        let instead = |part: &Part| matches!(part.signed.factor, Factor::Instead(_));
        let shortened = rows.iter().any(|row| row.parts.iter().any(instead));
        let mut facts = facts(robot, analysis);
        facts.extend(because(reasons));
        facts.extend(payloads(robot));
        facts.extend(marks(&rows));
        if shortened {
            let text = "a number for an expression of more than 60 characters, or with a number of \
                        more than 6 digits";
            facts.push((NUMBER_MARK, text.to_owned()));
        }
        Self {
            robot: robot.name.clone(),
            rows,
            doubt: doubt(analysis),
            facts,
        }
    }

    /// Appends advice on how to print long expressions in full, if the table replaces some by
    /// numbers.
    #[must_use]
    pub fn with_remedy(mut self, remedy: &str) -> Self {
        for (_, text) in self.facts.iter_mut().filter(|fact| fact.0 == NUMBER_MARK) {
            text.push_str("; ");
            text.push_str(remedy);
        }
        self
    }

    /// The payload whose base parameters begin with this row.
    fn payload_from(&self, row: usize) -> Option<&str> {
        let of = |row: usize| self.rows.get(row)?.payload.as_deref();
        let before = row.checked_sub(1).and_then(of);
        of(row).filter(|own| before != Some(*own))
    }

    fn title(&self) -> String {
        match &self.doubt {
            None => format!("{}: {} base parameters", self.robot, self.rows.len()),
            Some(why) => format!("{}: INCOMPLETE base parameters: {why}", self.robot),
        }
    }

    /// The table as plain text of 80 columns.
    pub fn plain_text(&self) -> String {
        const GAP: &str = "  ";
        let mut out = paragraph(&self.title());
        out.push('\n');
        for (name, text) in &self.facts {
            out.push_str(&field(name, text));
        }
        if self.rows.is_empty() {
            return out;
        }
        let numbers = self.rows.len().to_string().len().max(2);
        let layers = self.rows.iter().map(|row| row.provenance().len());
        let layers = layers.max().unwrap_or(0).max("evidence".len());
        let indent = 3 * GAP.len() + numbers + layers;
        let _ = writeln!(
            out,
            "\n{GAP}{:>numbers$}{GAP}{:<layers$}{GAP}base parameter",
            "no", "evidence"
        );
        for (k, row) in self.rows.iter().enumerate() {
            if let Some(payload) = self.payload_from(k) {
                let _ = writeln!(out, "{GAP}payload {payload}:");
            }
            let mut lines = row.lines(WIDTH - indent).into_iter();
            let _ = writeln!(
                out,
                "{GAP}{:>numbers$}{GAP}{:<layers$}{GAP}{}",
                k + 1,
                row.provenance(),
                lines.next().unwrap_or_default()
            );
            for line in lines {
                let _ = writeln!(out, "{:indent$}{line}", "");
            }
        }
        out
    }

    /// The table in Markdown.
    pub fn markdown(&self) -> String {
        let mut out = format!("## {}\n\n", self.title());
        for (name, text) in &self.facts {
            let _ = writeln!(out, "- {name}: {text}");
        }
        out.push_str("\n| No | Base parameter | Evidence |\n| --: | :-- | :-- |\n");
        for (k, row) in self.rows.iter().enumerate() {
            if let Some(payload) = self.payload_from(k) {
                let _ = writeln!(out, "| | payload {payload}: | |");
            }
            let _ = writeln!(
                out,
                "| {} | `{}` | {} |",
                k + 1,
                row.plain(),
                row.provenance()
            );
        }
        out
    }
}

/// The reasons of completed directions, each with the parameters that it explains.
fn because(reasons: &[Grouped]) -> Vec<(&'static str, String)> {
    let mut groups: Vec<(&str, Vec<&str>)> = Vec::new();
    for one in reasons {
        let Some(reason) = &one.reason else { continue };
        match groups.iter_mut().find(|g| g.0 == reason) {
            Some(group) => group.1.push(&one.parameter),
            None => groups.push((reason, vec![&one.parameter])),
        }
    }
    let line = |(reason, parameters): (&str, Vec<&str>)| {
        ("because", format!("{reason}: {}", parameters.join(" ")))
    };
    groups.into_iter().map(line).collect()
}

/// The meanings of the marks that occur in the rows.
fn marks(rows: &[Row]) -> Vec<(&'static str, String)> {
    [
        (
            Exactness::AtThisGeometry,
            "factors are exact at these values of the names; they are not known as functions of \
             all of them",
        ),
        (
            Exactness::Numeric,
            "some factors are known by their digits only",
        ),
    ]
    .into_iter()
    .filter(|(exactness, _)| rows.iter().any(|row| row.exactness == *exactness))
    .map(|(exactness, text)| (mark(exactness), text.to_owned()))
    .collect()
}

fn parts(robot: &Robot, terms: &[Term], style: Style) -> Vec<Part> {
    let part = |term: &Term| Part {
        signed: Signed::new(term, style),
        label: label(robot, term.column).to_owned(),
        latex: robot
            .parameters
            .get(term.column)
            .map_or_else(String::new, base::latex::parameter),
    };
    terms.iter().map(part).collect()
}

fn facts(robot: &Robot, analysis: &Analysis) -> Vec<(&'static str, String)> {
    let base = &analysis.base;
    let columns = robot.parameters.len();
    let mut facts = Vec::new();
    let what = if analysis.complete { "rank" } else { "at most" };
    let mut rank = format!("{} of {columns} columns", base.rank());
    if !base.known.is_empty() {
        let _ = write!(rank, ", {} of them known", base.known.len());
    }
    facts.push((what, rank));
    facts.push((
        "derived",
        format!(
            "{} from {}",
            counted(base.from_trees, "null direction", "null directions"),
            counted(base.trees, "spanning tree", "spanning trees")
        ),
    ));
    if completed(analysis) > 0 {
        let provenances = base.null.iter().map(|row| row.provenance);
        let proof = match provenances.max() {
            Some(Provenance::Proven) => {
                ", all proven: a false one would pass by chance with a probability below 2^-128"
            }
            _ => "",
        };
        let count = completed(analysis);
        let text = format!(
            "{} from samples{proof}",
            counted(count, "more null direction", "more null directions")
        );
        facts.push(("completed", text));
    }
    if !base.unrecognised.is_empty() {
        let text = format!("not exact: {}", base.unrecognised.join("; "));
        facts.push(("numbers", text));
    }
    for note in &base.unvaried_names {
        facts.push(("held", format!("completed factors hold for {note}")));
    }
    facts.push(("certificate", certificate(analysis)));
    if !base.varied_names.is_empty() {
        let text = format!(
            "rows without a mark hold at other values of {} too, by samples there",
            base.varied_names.join(", ")
        );
        facts.push(("names", text));
    }
    if !base.special_angles.is_empty() {
        facts.push((
            "special",
            format!("rank {}", base.special_angles.join(", ")),
        ));
    }
    facts.extend(largest_coefficient(robot, analysis));
    facts.extend(condition(analysis));
    if !base.coincidences.is_empty() {
        let text = format!("equal only by value: {}", base.coincidences.join("; "));
        facts.push(("values", text));
    }
    if !base.known.is_empty() {
        facts.push(("known", known(robot, &base.known)));
    }
    let dropped: Vec<&str> = base
        .parameters
        .iter()
        .filter(|p| p.dropped)
        .map(|p| label(robot, p.column))
        .collect();
    if !dropped.is_empty() {
        facts.push((
            "dropped",
            format!("the base parameters kept at {}", dropped.join(" ")),
        ));
    }
    facts
}

/// The relations known from `base.zero` and `base.equal`; two identical bodies are one entry.
fn known(robot: &Robot, all: &[Substitution]) -> String {
    let terms = |column: usize| {
        let known = all.iter().find(|known| known.column == column);
        known.map(|known| known.terms.as_slice())
    };
    // whether each parameter of a body equals the other body's, or is known by the same terms
    let like = |body: usize, other: usize| {
        (0..PER_BODY).all(|k| {
            let twin = PER_BODY * other + k;
            match (terms(PER_BODY * body + k), terms(twin)) {
                (Some(of), Some(twin)) => of == twin,
                (Some([one]), None) => one.column == twin && one.value.is_one(),
                _ => false,
            }
        })
    };
    let whole = |body: usize| (0..PER_BODY).all(|k| terms(PER_BODY * body + k).is_some());
    let bodies = robot.bodies.len();
    let twin = |body: usize| (0..bodies).find(|&other| !whole(other) && like(body, other));
    let name = |body: usize| robot.bodies.get(body).map_or("?", String::as_str);
    let mut parts: Vec<String> = Vec::new();
    for known in all {
        let body = known.column / PER_BODY;
        let twin = twin(body).filter(|_| body < bodies);
        let text = if let Some(twin) = twin {
            format!("body {} as body {}", name(body), name(twin))
        } else {
            let terms = parts_text(robot, &known.terms);
            format!("{} = {terms}", label(robot, known.column))
        };
        if !parts.contains(&text) {
            parts.push(text);
        }
    }
    parts.join("; ")
}

fn parts_text(robot: &Robot, terms: &[Term]) -> String {
    if terms.is_empty() {
        return "0".to_owned();
    }
    let parts = parts(robot, terms, Style::Short);
    parts.iter().enumerate().map(|(k, p)| p.plain(k)).collect()
}
