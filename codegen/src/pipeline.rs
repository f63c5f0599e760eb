//! The whole derivation on one page: from a spec's text to a robot's programs.

use crate::base::{self, Analysis};
use crate::constraints::Closed;
use crate::diag::{Report, Source};
use crate::explain::{self, Explanation};
use crate::functions::{Context, Symbols, request};
use crate::kinematics::{Frames, Geometry};
use crate::model::{self, Model};
use crate::optimize::lower;
use crate::robot::{Function, FunctionKind, Robot};
use crate::spec::{self, Spec};
use crate::sym::Graph;

/// Where base parameters with their certificate, and the functions over them,
/// come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BaseFrom<'a> {
    /// They are left out.
    Nowhere,
    /// They are derived, however long it takes.
    Derivation,
    /// They are read from what was stored; derived where nothing was and it is
    /// quick (see [`base::is_heavy`]).
    Store(Option<&'a str>),
}

/// Why there is no robot.
#[derive(Clone, Debug)]
pub enum DeriveError {
    /// The spec has errors.
    Spec(Box<Report>),
    /// The stored base parameters cannot be used.
    Store(base::StoreProblem),
    /// The base parameters should be stored, and are not.
    NotStored,
}

impl From<Report> for DeriveError {
    fn from(report: Report) -> Self {
        DeriveError::Spec(Box::new(report))
    }
}

/// Derives a robot, with its base parameters, from the text of its spec; without
/// them where it has more than [`base::MOST_PARAMETERS`].
///
/// # Errors
/// A report with the place of every mistake in the spec: of its syntax, its
/// names and values, or of a home that does not close or does not fit the
/// mobility.
pub fn derive(source: &Source) -> Result<Robot, Report> {
    assemble(source, |spec, model, home| {
        Ok(base::is_within_reach(model).then(|| base::analyse(spec, model, home)))
    })
}

/// Derives a robot from the text of its spec, with base parameters from where
/// they are wanted from.
///
/// # Errors
/// As [`derive()`]; or why what was stored cannot be used.
pub fn derive_with(source: &Source, from: BaseFrom<'_>) -> Result<Robot, DeriveError> {
    assemble(source, |spec, model, home| match from {
        _ if !base::is_within_reach(model) => Ok(None),
        BaseFrom::Nowhere => Ok(None),
        BaseFrom::Store(Some(text)) => base::restore(text, source, spec, model)
            .map(Some)
            .map_err(DeriveError::Store),
        BaseFrom::Store(None) if base::is_heavy(model) => Err(DeriveError::NotStored),
        BaseFrom::Store(None) | BaseFrom::Derivation => Ok(Some(base::analyse(spec, model, home))),
    })
}

/// Whether base parameters of a spec would be derived, before the work is done.
///
/// # Errors
/// A report of mistakes in the spec, or of what puts them out of reach.
pub fn within_reach(source: &Source) -> Result<(), Report> {
    let spec = spec::parse(source)?;
    crate::checks::within_reach(source, &spec, &model::build(&spec))
}

/// Explains a robot in words, from the text of its spec and the analysis of its
/// base parameters, if there is one already.
///
/// # Errors
/// As [`derive()`]; or where base parameters are out of reach.
pub fn explain(source: &Source, analysis: Option<&Analysis>) -> Result<Explanation, Report> {
    let spec = spec::parse(source)?;
    let model = model::build(&spec);
    crate::checks::within_reach(source, &spec, &model)?;
    let mut g = Graph::new();
    let _ = Symbols::new(&mut g, &model);
    let frames = Frames::new(&mut g, &model, Geometry::Values);
    let closed = Closed::new(&mut g, &frames, &model)
        .map_err(|problem| crate::checks::home_report(source, &spec, &model, &problem))?;
    crate::checks::aligned_at_home(source, &spec, &mut g, &frames, &model, &closed.home)?;
    crate::checks::fits(source, &spec, &g)?;
    let analysis = analysis.cloned();
    let analysis = analysis.unwrap_or_else(|| base::analyse(&spec, &model, &closed.home));
    let redundant = closed
        .closure
        .as_ref()
        .map_or(&[][..], |c| c.redundant_rows());
    Ok(explain::explain(
        &spec,
        &model,
        &closed.home,
        redundant,
        &analysis,
    ))
}

/// The derivation, stage by stage.
fn assemble<E: From<Report>>(
    source: &Source,
    base: impl FnOnce(&Spec, &Model, &[f64]) -> Result<Option<Analysis>, E>,
) -> Result<Robot, E> {
    // spec: text -> validated spec
    let spec = spec::parse(source)?;
    // model: bodies, joints, spanning tree, cuts, parameter order
    let model = model::build(&spec);
    // sym: coordinates are the graph's first symbols
    let mut g = Graph::new();
    let symbols = Symbols::new(&mut g, &model);
    // kinematics: frames of the links
    let frames = Frames::new(&mut g, &model, Geometry::Values);
    // constraints: closed at home, loops solved in a fixed order (Eq. 6-10)
    let closed = Closed::new(&mut g, &frames, &model)
        .map_err(|problem| crate::checks::home_report(source, &spec, &model, &problem))?;
    crate::checks::aligned_at_home(source, &spec, &mut g, &frames, &model, &closed.home)?;
    crate::checks::fits(source, &spec, &g)?;
    // base: which combinations of the parameters count (Eq. 23), certified
    let analysis = base(&spec, &model, &closed.home)?;
    if let Some(analysis) = &analysis {
        crate::checks::dropped_are_kept(source, &spec, &model, &analysis.base)?;
    }
    let mut cx = Context {
        g: &mut g,
        model: &model,
        frames: &frames,
        closed: &closed,
        symbols,
        base: analysis.as_ref().map(|a| &a.base),
    };
    // dynamics: every function's expressions (Eq. 2-5, 11, 14-20), then its program
    let mut functions = Vec::new();
    for kind in FunctionKind::ALL {
        if let Some(request) = request(&mut cx, kind) {
            // optimize: order, related angles, multiply-add
            let program = lower(cx.g, request);
            functions.push(Function { kind, program });
        }
        crate::checks::fits(source, &spec, cx.g)?;
    }
    Ok(Robot {
        functions,
        analysis,
        ..named(&spec, &model, closed)
    })
}

/// The robot with its names.
fn named(spec: &Spec, model: &Model, closed: Closed) -> Robot {
    let cuts = model.cuts.iter().map(|cut| crate::robot::CutInfo {
        name: cut.name.clone(),
        rows: cut.kind.equations(),
    });
    let cuts: Vec<_> = cuts.collect();
    let cones = model.cones.iter().map(|cone| crate::robot::ConeInfo {
        name: cone.name.clone(),
        greatest: cone.greatest.to_f64(),
    });
    let rows = cuts.iter().map(|c| c.rows).sum::<usize>() + model.couplings.len();
    Robot {
        name: spec.name.value.clone(),
        description: spec.description.clone(),
        coordinates: model.coordinates.iter().map(|c| c.name.clone()).collect(),
        independent: model.independent.clone(),
        dependent: model.dependent.clone(),
        actuated: model.actuated.clone(),
        parameters: model.parameters.iter().map(|p| p.label.clone()).collect(),
        bodies: model.bodies.iter().map(|b| b.label.clone()).collect(),
        rows,
        cuts,
        joints: crate::robot::joints(spec, model),
        cones: cones.collect(),
        nominal: model::nominal(spec, model)
            .into_iter()
            .map(|value| value.map(|v| v.to_f64()))
            .collect(),
        redundant_rows: closed
            .closure
            .as_ref()
            .map_or_else(|| (0..rows).collect(), |c| c.redundant_rows().to_vec()),
        gravity: model.gravity.each_ref().map(|g| g.value.to_f64()),
        home: closed.home,
        functions: Vec::new(),
        analysis: None,
    }
}
