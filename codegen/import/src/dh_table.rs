//! A table of Denavit and Hartenberg parameters as a spec.

use std::fmt::Write as _;

use regen_codegen::diag::{Diagnostic, Report, Source, Span};

/// What a step of the reading finds, or the mistake that ends it.
type Read<T> = Result<T, Box<Diagnostic>>;

/// The convention of a table's rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rows {
    /// `Rx(alpha) Tx(a) Rz(theta) Tz(d)`: alpha and a lead from the axis before to the row's own
    /// (Craig; Khalil and Kleinfinger), as in a spec.
    Modified,
    /// `Rz(theta) Tz(d) Tx(a) Rx(alpha)`: alpha and a lead from the row's axis to the next one.
    Classic,
}

/// The columns of a table.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Column {
    Joint,
    Kind,
    Alpha,
    A,
    Theta,
    D,
    Lowest,
    Highest,
}

impl Column {
    fn of(word: &str) -> Option<Self> {
        Some(match word {
            "joint" | "name" => Self::Joint,
            "type" | "sigma" => Self::Kind,
            "alpha" => Self::Alpha,
            "a" => Self::A,
            "theta" => Self::Theta,
            "d" => Self::D,
            "min" => Self::Lowest,
            "max" => Self::Highest,
            _ => return None,
        })
    }
}

/// The factors of a column's unit.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Unit {
    /// None is stated: rad or m.
    Si,
    Radians,
    Metres,
    Degrees,
    Millimetres,
}

impl Unit {
    /// The unit, if it is one of angles, or else of lengths.
    fn of_kind(self, cell: Cell<'_>, is_angle: bool) -> Read<Self> {
        let (fits, kind, hint) = if is_angle {
            let fits = matches!(self, Self::Si | Self::Radians | Self::Degrees);
            (fits, "an angle", "its unit is rad or deg")
        } else {
            let fits = matches!(self, Self::Si | Self::Metres | Self::Millimetres);
            let hint = "its unit is m or mm; limits of joints of both types need columns without a \
                        unit, with deg(...) for degrees";
            (fits, "a length", hint)
        };
        if fits {
            return Ok(self);
        }
        let message = format!("'{}' is {kind}, and its column has another unit", cell.text);
        Err(Diagnostic::new(cell.span, message).hint(hint).into())
    }
}

/// One cell: its text and its place.
#[derive(Clone, Copy)]
struct Cell<'a> {
    text: &'a str,
    span: Span,
}

/// One joint as the spec has it.
#[derive(Default)]
struct Joint {
    name: String,
    prismatic: bool,
    /// alpha, a, theta, d; empty where they are zero.
    row: [String; 4],
    limits: Option<[String; 2]>,
}

/// The text of a serial arm's spec from a table with one row for each joint, fields separated by
/// commas, semicolons or tabs.
///
/// The first line names the columns: `alpha`, `a`, `theta`, `d`, and where wanted `joint`, `type`
/// (`revolute`, `prismatic`, `R`, `P`, or Khalil's sigma: 0, 1), `min` and `max`. A name may end in
/// `[deg]` or `[mm]`; without, angles are in rad and lengths in m. Cells are numbers or expressions
/// such as `pi/2`; theta, or d of a prismatic joint, may name the coordinate: `q1 + pi/2`. Limits,
/// friction and bodies of the spec are guesses, which its comments say.
///
/// # Errors
/// Places in the table: an unknown column, a missing one, rows of another length, a cell that is no
/// expression.
///
/// ```
/// use regen_codegen::diag::Source;
/// use regen_import::{Rows, from_dh_table};
///
/// let table = Source::new("arm.csv", "joint,alpha [deg],a,theta,d\nq1,90,0,q1,0.4\nq2,0,0.3,q2,0\n");
/// let spec = from_dh_table(&table, "arm", Rows::Classic).unwrap();
/// // alpha of the classic first row is that of the modified second one
/// assert!(spec.contains("dh: {alpha: deg(90)}"));
/// ```
pub fn from_dh_table(table: &Source, name: &str, rows: Rows) -> Result<String, Report> {
    joints(table, rows)
        .map(|joints| write(table, name, rows, &joints))
        .map_err(|error| Report::new(table.clone(), vec![*error]))
}

/// The lines of the table that are not empty, each with its cells.
fn lines(text: &str) -> Vec<Vec<Cell<'_>>> {
    let mut out = Vec::new();
    let mut start = 0;
    let first = text.lines().find(|line| !line.trim().is_empty());
    let separator = [';', '\t', ',']
        .into_iter()
        .find(|c| first.is_some_and(|line| line.contains(*c)));
    for line in text.split_inclusive('\n') {
        if !line.trim().is_empty() && !line.trim_start().starts_with('#') {
            let mut at = start;
            let mut cells = Vec::new();
            for field in line.split(|c| Some(c) == separator) {
                let before = field.len() - field.trim_start().len();
                let text = field.trim();
                let span = Span::new(at + before, at + before + text.len());
                cells.push(Cell { text, span });
                at += field.len() + 1;
            }
            out.push(cells);
        }
        start += line.len();
    }
    out
}

/// The columns that the first line names.
fn header(cells: &[Cell<'_>]) -> Read<Vec<(Column, Unit)>> {
    let mut columns: Vec<(Column, Unit)> = Vec::new();
    for cell in cells {
        let lower = cell.text.to_lowercase();
        let (word, unit) = match lower.split_once('[') {
            None => (lower.trim(), Unit::Si),
            Some((word, unit)) => {
                let unit = match unit.trim_end_matches(']').trim() {
                    "rad" => Unit::Radians,
                    "m" => Unit::Metres,
                    "deg" => Unit::Degrees,
                    "mm" => Unit::Millimetres,
                    other => {
                        let message = format!("unknown unit '{other}'");
                        let hint = "units are rad, deg, m and mm";
                        return Err(Diagnostic::new(cell.span, message).hint(hint).into());
                    }
                };
                (word.trim(), unit)
            }
        };
        let Some(column) = Column::of(word) else {
            let message = format!("unknown column '{}'", cell.text);
            let hint =
                "the first line names the columns: joint, type, alpha, a, theta, d, min, max";
            return Err(Diagnostic::new(cell.span, message).hint(hint).into());
        };
        if columns.iter().any(|(other, _)| *other == column) {
            let message = format!("two columns '{word}'");
            return Err(Diagnostic::new(cell.span, message).into());
        }
        columns.push((column, unit));
    }
    let named = [Column::Alpha, Column::A, Column::Theta, Column::D];
    let words = ["alpha", "a", "theta", "d"];
    for (column, word) in named.into_iter().zip(words) {
        if !columns.iter().any(|(other, _)| *other == column) {
            let span = cells.first().map_or(Span::default(), |cell| cell.span);
            let message = format!("there is no column '{word}'");
            let hint = "the first line names the columns: alpha, a, theta, d";
            return Err(Diagnostic::new(span, message).hint(hint).into());
        }
    }
    Ok(columns)
}

/// The joints, with rows in the convention of specs.
fn joints(table: &Source, rows: Rows) -> Read<Vec<Joint>> {
    let lines = lines(&table.text);
    let Some((first, rest)) = lines.split_first() else {
        return Err(Diagnostic::new(Span::default(), "the table is empty").into());
    };
    let columns = header(first)?;
    let mut out: Vec<Joint> = Vec::new();
    for (k, cells) in rest.iter().enumerate() {
        let place = cells.first().map_or(Span::default(), |cell| cell.span);
        if cells.len() != columns.len() {
            let (found, wanted) = (cells.len(), columns.len());
            let message = format!("{found} cells, but the first line has {wanted}");
            return Err(Diagnostic::new(place, message).into());
        }
        out.push(joint(k + 1, &columns, cells)?);
    }
    if out.is_empty() {
        let message = "the table has no row of a joint";
        return Err(Diagnostic::new(Span::default(), message).into());
    }
    if rows == Rows::Classic {
        // alpha and a of a row lead to the next one; those of the last one lead to the tool
        for k in (1..out.len()).rev() {
            let [alpha, a, ..] = out[k - 1].row.clone();
            out[k].row[0] = alpha;
            out[k].row[1] = a;
        }
        out[0].row[0].clear();
        out[0].row[1].clear();
    }
    Ok(out)
}

/// One row of the table.
fn joint(number: usize, columns: &[(Column, Unit)], cells: &[Cell<'_>]) -> Read<Joint> {
    let find = |column: Column| {
        let k = columns.iter().position(|(c, _)| *c == column)?;
        Some((*cells.get(k)?, columns.get(k)?.1))
    };
    let mut joint = Joint {
        name: format!("q{number}"),
        ..Joint::default()
    };
    if let Some((cell, _)) = find(Column::Joint) {
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
        if !cell.text.chars().all(plain) || !cell.text.starts_with(|c: char| c.is_alphabetic()) {
            let message = format!("'{}' is not the name of a joint", cell.text);
            let hint = "letters, digits and _, such as q1";
            return Err(Diagnostic::new(cell.span, message).hint(hint).into());
        }
        cell.text.clone_into(&mut joint.name);
    }
    if let Some((cell, _)) = find(Column::Kind) {
        joint.prismatic = match cell.text.to_lowercase().as_str() {
            "revolute" | "r" | "0" => false,
            "prismatic" | "p" | "1" => true,
            _ => {
                let message = format!("unknown type '{}'", cell.text);
                let hint = "types are revolute and prismatic";
                return Err(Diagnostic::new(cell.span, message).hint(hint).into());
            }
        };
    }
    let named = [Column::Alpha, Column::A, Column::Theta, Column::D];
    let moving = if joint.prismatic {
        Column::D
    } else {
        Column::Theta
    };
    for (slot, column) in joint.row.iter_mut().zip(named) {
        let Some((mut cell, unit)) = find(column) else {
            continue;
        };
        if column == moving {
            cell.text = offset(cell.text, &joint.name, number);
        }
        let is_angle = matches!(column, Column::Alpha | Column::Theta);
        *slot = expression(cell, unit.of_kind(cell, is_angle)?)?;
    }
    if let (Some(low), Some(high)) = (find(Column::Lowest), find(Column::Highest)) {
        let is_angle = !joint.prismatic;
        let limit =
            |(cell, unit): (Cell<'_>, Unit)| expression(cell, unit.of_kind(cell, is_angle)?);
        joint.limits = Some([limit(low)?, limit(high)?]);
    }
    Ok(joint)
}

/// What is added to the coordinate: the text without the coordinate's name at its beginning.
fn offset<'a>(text: &'a str, name: &str, number: usize) -> &'a str {
    let names = [
        name.to_owned(),
        format!("q{number}"),
        format!("theta{number}"),
        format!("d{number}"),
        "*".to_owned(),
    ];
    for name in names {
        if let Some(rest) = text.strip_prefix(name.as_str()) {
            let rest = rest.trim_start();
            if rest.is_empty() || rest.starts_with(['+', '-']) {
                return rest.strip_prefix('+').unwrap_or(rest).trim_start();
            }
        }
    }
    text
}

/// A cell as an expression of a spec; empty where it is zero.
fn expression(cell: Cell<'_>, unit: Unit) -> Read<String> {
    let plain = |c: char| c.is_ascii_alphanumeric() || "+-*/().^ _".contains(c);
    let words = cell.text.split(|c: char| !c.is_ascii_alphabetic());
    let known = ["", "e", "E", "pi", "sqrt", "sin", "cos", "deg"];
    let mut unknown = words.filter(|word| !known.contains(word));
    if !cell.text.chars().all(plain) || unknown.next().is_some() {
        let message = format!("'{}' is not a number or expression such as pi/2", cell.text);
        return Err(Diagnostic::new(cell.span, message).into());
    }
    if cell.text.is_empty() || cell.text.parse::<f64>().is_ok_and(|value| value == 0.0) {
        return Ok(String::new());
    }
    Ok(match unit {
        Unit::Si | Unit::Radians | Unit::Metres => cell.text.to_owned(),
        Unit::Degrees => format!("deg({})", cell.text),
        Unit::Millimetres => format!("({})/1000", cell.text),
    })
}

/// The text of the spec.
fn write(table: &Source, name: &str, rows: Rows, joints: &[Joint]) -> String {
    let file = table.name.rsplit(['/', '\\']).next().unwrap_or_default();
    let kind = match rows {
        Rows::Modified => "modified rows",
        Rows::Classic => "classic rows, whose alpha and a stand one row later here",
    };
    let mut out = format!(
        "# {name}: a serial arm from {file} ({kind}).\n\
         # Limits without a value in the table, friction and bodies are guesses, so that the arm can be\n\
         # simulated: replace them by yours. They do not change the base parameters.\n\
         name: {name}\n\
         description: serial arm with {} joints\n\
         gravity: [0, 0, -9.81]\n\n\
         limbs:\n  - name: arm\n    joints:\n",
        joints.len()
    );
    for (k, joint) in joints.iter().enumerate() {
        let kind = if joint.prismatic {
            "prismatic"
        } else {
            "revolute"
        };
        let _ = writeln!(out, "      - name: {}\n        type: {kind}", joint.name);
        let names = ["alpha", "a", "theta", "d"];
        let given = names
            .into_iter()
            .zip(&joint.row)
            .filter(|(_, v)| !v.is_empty());
        let given: Vec<String> = given.map(|(name, v)| format!("{name}: {v}")).collect();
        if !given.is_empty() {
            let _ = writeln!(out, "        dh: {{{}}}", given.join(", "));
        }
        let (range, speed, effort) = if joint.prismatic {
            (["-0.3", "0.3"], 1, 500)
        } else {
            (["-2.5", "2.5"], 2, 150)
        };
        let zero = |text: &String| {
            if text.is_empty() {
                "0".to_owned()
            } else {
                text.clone()
            }
        };
        let [low, high] = match &joint.limits {
            Some(limits) => limits.each_ref().map(zero),
            None => range.map(str::to_owned),
        };
        let _ = writeln!(
            out,
            "        body: {}\n        actuated: true\n        friction: linear\n        \
             nominal: {{Fv: 1, Fc: 2}}\n        limits: {{position: [{low}, {high}], \
             velocity: [-{speed}, {speed}], effort: [-{effort}, {effort}]}}",
            k + 1
        );
    }
    out.push_str(
        "\n# Mass, centre of mass in the body's frame, inertia about it: Ixx, Ixy, Ixz, Iyy, Iyz, Izz.\nbodies:\n",
    );
    for k in 0..joints.len() {
        let mass = 2.0 / (1.0 + k as f64 / 2.0);
        let _ = writeln!(
            out,
            "  {}: {{mass: {mass:.2}, com: [0.05, 0, 0.02], inertia: [0.01, 0, 0, 0.01, 0, 0.01]}}",
            k + 1
        );
    }
    out
}
