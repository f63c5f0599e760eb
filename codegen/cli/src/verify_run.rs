//! `regen verify`: every check of a robot, and its base parameters beside the numeric path.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{DMatrix, DVector};
use regen_codegen::base::{Analysis, Base, Direction};
use regen_codegen::robot::Robot;
use regen_runtime::{Closure, Model};
use serde::Serialize;

use crate::args::{VerifyArgs, VerifyFormat};
use crate::exit::Failure;
use crate::numeric::{Numeric, Rank};
use crate::verify::{self, Check, Random, Reach, larger};
use crate::workspace::Workspace;
use crate::{base, evidence, load, model, modules, sources, table, terminal};
use regen_interpreted::Interpreted;

/// Rows of the observation matrix per column.
const ROWS_PER_COLUMN: usize = 4;
/// Parameter vectors that are projected.
const PROJECTED: usize = 8;
/// As far as states go without leaving what mechanisms are built for: the wider, the better the
/// numeric rank.
const REACH: Reach = Reach {
    tree: 3.0,
    loops: 0.4,
};
/// Bound of the angle between null spaces, rad.
const ANGLE: f64 = 1e-6;
/// Bound of the error of projections, relative to the largest force.
const PROJECTION: f64 = 1e-9;

/// The numeric path beside the analytic one.
#[derive(Serialize)]
pub(crate) struct Beside {
    states: usize,
    rows: usize,
    columns: usize,
    /// Over all columns.
    certificate: Option<usize>,
    /// What the derived directions leave of the columns that the spec's `base` leaves.
    pub(crate) analytic: usize,
    pub(crate) svd: Rank,
    qr: Rank,
    /// The same where the spec's `base` takes columns out.
    reduced: Option<Reduced>,
    /// Whether double precision leaves the rank open.
    pub(crate) doubt: bool,
    pub(crate) checks: Vec<Check>,
    /// Between the null spaces, rad.
    #[serde(skip)]
    pub(crate) angle: f64,
    /// What the angle was found by.
    #[serde(skip)]
    pub(crate) found_by: Rank,
}

#[derive(Serialize)]
struct Reduced {
    columns: usize,
    svd: Rank,
    qr: Rank,
}

#[derive(Serialize)]
struct Json<'a> {
    robot: &'a str,
    ok: bool,
    failed: &'a [&'a str],
    states: usize,
    checks: &'a [Check],
    base: &'a Beside,
}

/// Runs the command.
pub(crate) fn run(args: &VerifyArgs) -> Result<(), Failure> {
    if args.all {
        return evidence::run(args);
    }
    let [file] = args.files.as_slice() else {
        return Err(Failure::Usage(
            "several specs are verified with --all".to_owned(),
        ));
    };
    let robot = load::with_base(&load::source(file)?)?;
    let analysis = base::analysis(&robot)?;
    let states = states(&robot, args.states)?;
    let same = same_source(&robot, file)?;
    let verified = verify::all(&robot, same)?;
    let beside = beside(&robot, analysis, states)?;
    let failed: Vec<&str> = verified
        .failed()
        .chain(beside.checks.iter().filter(|c| !c.ok).map(|c| c.name))
        .collect();
    terminal::print(&match args.format {
        VerifyFormat::Markdown => {
            return Err(Failure::Usage("--format markdown needs --all".to_owned()));
        }
        VerifyFormat::Human => format!(
            "{}\n{}\n{}",
            table::paragraph(&robot.name),
            verify::human(&verified),
            human(&beside, analysis)
        ),
        VerifyFormat::Json => table::json(&Json {
            robot: &robot.name,
            ok: failed.is_empty(),
            failed: &failed,
            states: verified.states,
            checks: &verified.checks,
            base: &beside,
        }),
    })?;
    if failed.is_empty() {
        Ok(())
    } else {
        Err(Failure::Check(format!(
            "{} is not verified: {}",
            robot.name,
            failed.join("; ")
        )))
    }
}

/// How many states give enough rows.
pub(crate) fn states(robot: &Robot, asked: Option<usize>) -> Result<usize, Failure> {
    let (columns, dof) = (robot.parameters.len(), robot.independent.len().max(1));
    let least = columns.div_ceil(dof).max(1);
    match asked {
        Some(n) if n < least => Err(Failure::Input(format!(
            "{n} states give {} rows, fewer than the {columns} columns of {}: name at least \
             --states {least}",
            n * dof,
            robot.name
        ))),
        Some(n) => Ok(n),
        None => Ok((ROWS_PER_COLUMN * columns).div_ceil(dof).max(1)),
    }
}

/// Whether the workspace's module of a robot of the workspace, or its digest, is what would be
/// generated; `None` where there is none.
fn same_source(robot: &Robot, file: &Path) -> Result<Option<bool>, Failure> {
    let beside = match file.parent() {
        Some(dir) if !dir.as_os_str().is_empty() => dir,
        _ => Path::new("."),
    };
    if !Workspace::above(beside).is_some_and(|w| w.holds_robot(file)) {
        return Ok(None);
    }
    let dir = model::default_dir(file);
    let place = sources::place(&dir, &robot.name)?;
    if !place.is_file() {
        return Ok(None);
    }
    let found = load::text(&place)?;
    let module = modules::module(robot, file)?;
    Ok(Some(if place.extension().is_some_and(|e| e == "rs") {
        found == module.text
    } else {
        let digest = BTreeMap::from([(robot.name.clone(), module.digest)]);
        found == sources::digests(Some(&found), digest)
    }))
}

/// The observation matrix over random closed states.
fn observe(robot: &Robot, states: usize, random: &mut Random) -> Result<DMatrix<f64>, Failure> {
    let model = Interpreted::new(robot);
    let mut closure = Closure::new(&model)?;
    let (dof, columns) = (model.info().dof(), robot.parameters.len());
    let mut w = DMatrix::zeros(dof * states, columns);
    for k in 0..states {
        let m = verify::closed_state(&model, &mut closure, random, REACH)?;
        let entries: Vec<f64> = evidence::regressor(robot, &m);
        if entries.iter().any(|x| !x.is_finite()) {
            return Err(Failure::Numeric(format!(
                "{}: the regressor is not finite at a random closed state",
                robot.name
            )));
        }
        w.rows_mut(k * dof, dof)
            .copy_from(&DMatrix::from_column_slice(dof, columns, &entries));
    }
    Ok(w)
}

pub(crate) fn beside(robot: &Robot, analysis: &Analysis, states: usize) -> Result<Beside, Failure> {
    let base = &analysis.base;
    let mut random = Random(verify::SEED);
    let w = observe(robot, states, &mut random)?;
    let undecided = || Failure::Numeric(format!("{}: no singular values were found", robot.name));
    let whole = Numeric::new(&w).ok_or_else(undecided)?;
    let kept = Kept::new(base, robot.parameters.len());
    let reduced = kept.columns_of(&w, base);
    let (numeric, extra) = if base.known.is_empty() {
        (whole.clone(), None)
    } else {
        let numeric = Numeric::new(&reduced).ok_or_else(undecided)?;
        let extra = Reduced {
            columns: reduced.ncols(),
            svd: numeric.svd,
            qr: numeric.qr,
        };
        (numeric, Some(extra))
    };
    let analytic = base.parameters.len();
    let certificate = analysis.certificate.as_ref().ok().map(|c| c.rank);

    let mut checks = Vec::new();
    let mut note = |name, largest: f64, bound: f64| {
        checks.push(Check {
            name,
            largest,
            bound,
            ok: largest <= bound,
        });
    };
    let apart = |a: usize, b: usize| a.abs_diff(b) as f64;
    let incomplete = f64::from(u8::from(base::doubt(analysis).is_some()));
    note("base parameters are certified complete", incomplete, 0.0);
    if let Some(certified) = certificate {
        for (name, found) in [
            ("SVD rank = certified rank", whole.svd),
            ("QR rank = certified rank", whole.qr),
        ] {
            // a doubtful rank says nothing against the certificate
            if found.certain {
                note(name, apart(found.count, certified), 0.0);
            }
        }
    }
    for (name, found) in [
        ("SVD rank = analytic rank", numeric.svd),
        ("QR rank = analytic rank", numeric.qr),
    ] {
        if found.certain {
            note(name, apart(found.count, analytic), 0.0);
        }
    }
    let angle = numeric.angle(&kept.null_directions(base));
    let doubt = [whole.svd, whole.qr, numeric.svd, numeric.qr]
        .iter()
        .any(|r| !r.certain);
    if numeric.svd.certain {
        note("angle between the null spaces, rad", angle, ANGLE);
    }
    let error = kept.projection(base, &reduced, &mut random);
    note("projection by the combinations", error, PROJECTION);
    Ok(Beside {
        states,
        rows: w.nrows(),
        columns: w.ncols(),
        certificate,
        analytic,
        svd: whole.svd,
        qr: whole.qr,
        reduced: extra,
        doubt,
        checks,
        angle,
        found_by: numeric.svd,
    })
}

/// The columns that the spec's `base` leaves, in order.
struct Kept {
    columns: Vec<usize>,
    /// The place of each column among them.
    place: Vec<Option<usize>>,
}

impl Kept {
    fn new(base: &Base, all: usize) -> Self {
        let known = |c: &usize| base.known.iter().any(|k| k.column == *c);
        let columns: Vec<usize> = (0..all).filter(|c| !known(c)).collect();
        let mut place = vec![None; all];
        for (k, &column) in columns.iter().enumerate() {
            place[column] = Some(k);
        }
        Self { columns, place }
    }

    fn place(&self, column: usize) -> Option<usize> {
        self.place.get(column).copied().flatten()
    }

    /// The matrix over these columns, what is known added to what it is written with.
    fn columns_of(&self, w: &DMatrix<f64>, base: &Base) -> DMatrix<f64> {
        let mut reduced = w.select_columns(&self.columns);
        for known in &base.known {
            for term in &known.terms {
                if let Some(k) = self.place(term.column) {
                    let column = w.column(known.column) * term.value.to_f64();
                    reduced.column_mut(k).axpy(1.0, &column, 1.0);
                }
            }
        }
        reduced
    }

    fn null_directions(&self, base: &Base) -> Vec<DVector<f64>> {
        let direction = |row: &Direction| {
            let mut direction = DVector::zeros(self.columns.len());
            for term in &row.terms {
                if let Some(k) = self.place(term.column) {
                    direction[k] = term.value.to_f64();
                }
            }
            direction
        };
        base.null.iter().map(direction).collect()
    }

    /// What is missed when parameters are replaced by their base parameters, relative to the
    /// largest force.
    fn projection(&self, base: &Base, w: &DMatrix<f64>, random: &mut Random) -> f64 {
        let mut worst: f64 = 0.0;
        for _ in 0..PROJECTED {
            let phi = DVector::from_fn(self.columns.len(), |_, _| random.signed());
            let mut projected = DVector::zeros(self.columns.len());
            for parameter in &base.parameters {
                let terms = parameter.terms.iter();
                let value: f64 = terms
                    .filter_map(|t| Some(t.value.to_f64() * phi.get(self.place(t.column)?)?))
                    .sum();
                if let Some(k) = self.place(parameter.column) {
                    projected[k] = value;
                }
            }
            let forces = w * &phi;
            let missed = (w * projected - &forces).amax();
            let scale = forces.amax();
            worst = larger(worst, if scale > 0.0 { missed / scale } else { missed });
        }
        worst
    }
}

fn human(beside: &Beside, analysis: &Analysis) -> String {
    let mut rows: Vec<Vec<String>> = Vec::new();
    let mut row = |name: &str, columns: usize, rank: usize, kept: Option<(f64, f64)>| {
        let mut cells = vec![name.to_owned(), columns.to_string(), rank.to_string()];
        if let Some((kept, dropped)) = kept {
            let gap = match dropped {
                0.0 => String::new(),
                dropped => format!("{:.0e}", kept / dropped),
            };
            cells.extend([format!("{kept:.1e}"), format!("{dropped:.1e}"), gap]);
        }
        rows.push(cells);
    };
    let numbers = |r: Rank| Some((r.last_kept, r.first_dropped));
    let left = beside
        .reduced
        .as_ref()
        .map_or(beside.columns, |r| r.columns);
    if let Ok(c) = &analysis.certificate {
        let kept = Some((c.smallest_kept, c.largest_dropped));
        row("certificate", c.columns, c.rank, kept);
    }
    row("SVD", beside.columns, beside.svd.count, numbers(beside.svd));
    row(
        "QR with pivoting",
        beside.columns,
        beside.qr.count,
        numbers(beside.qr),
    );
    row("analytic", left, beside.analytic, None);
    if let Some(reduced) = &beside.reduced {
        row("SVD", left, reduced.svd.count, numbers(reduced.svd));
        row(
            "QR with pivoting",
            left,
            reduced.qr.count,
            numbers(reduced.qr),
        );
    }
    let mut out = table::paragraph(&format!(
        "base parameters beside the numeric path, {} random closed states, {} rows:",
        beside.states, beside.rows
    ));
    let head = [
        "rank by",
        "columns",
        "rank",
        "last kept",
        "first dropped",
        "gap",
    ];
    out.push_str(&table::columns(&head, &rows));
    if beside.doubt {
        out.push('\n');
        out.push_str(&table::paragraph(
            "Double precision leaves a doubt: the first number dropped is more than rounding, or no \
             gap stands out. A rank found so is not held against the analytic one.",
        ));
    }
    out.push('\n');
    out.push_str(&verify::checks(&beside.checks));
    if let Some(why) = base::doubt(analysis) {
        out.push('\n');
        out.push_str(&table::paragraph(&format!("INCOMPLETE: {why}.")));
    }
    out
}
