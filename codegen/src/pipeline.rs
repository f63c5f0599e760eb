//! The whole derivation in one file: from the text of a spec to the programs of a robot.

use std::cell::OnceCell;
use std::error::Error;
use std::fmt;

use crate::base::{self, Analysis, StoreProblem};
use crate::checks;
use crate::constraints::Closed;
use crate::diag::{Report, Source};
use crate::explain::{self, Explanation};
use crate::functions::{Context, Symbols, request};
use crate::kinematics::{Frames, Geometry};
use crate::model::{self, Model};
use crate::optimize::lower;
use crate::robot::{Function, FunctionKind, Robot};
use crate::scene::Scene;
use crate::signature::Needs;
use crate::spec::{self, Spec};
use crate::sym::Graph;

/// A mechanism, derived in stages: each stage runs at most once, when a method first needs its
/// result.
///
/// ```
/// use regen_codegen::Mechanism;
/// use regen_codegen::diag::Source;
/// use regen_codegen::robot::FunctionKind;
///
/// let text = "\
/// name: arm
/// limbs:
///   - name: arm
///     joints:
///       - {name: q1, type: revolute, body: link, actuated: true}
/// ";
/// let mechanism = Mechanism::open(&Source::new("arm.yaml", text))?;
/// // the axis is vertical, so Izz is the only base parameter; finding it builds no program
/// assert_eq!(mechanism.analysis()?.base.rank(), 1);
/// let robot = mechanism.robot(&[FunctionKind::Regressor])?;
/// assert_eq!(robot.functions.len(), 1);
/// # Ok::<(), regen_codegen::diag::Report>(())
/// ```
#[derive(Debug)]
pub struct Mechanism {
    source: Source,
    spec: Spec,
    model: Model,
    loops: OnceCell<Result<Loops, Report>>,
    analysis: OnceCell<Analysis>,
}

/// The mechanism with its loops closed; the expressions of every function are built from this
/// stage.
#[derive(Debug)]
struct Loops {
    g: Graph,
    symbols: Symbols,
    frames: Frames,
    closed: Closed,
}

impl Mechanism {
    /// Reads a mechanism from the text of its spec.
    ///
    /// # Errors
    /// A report with the place of every mistake of syntax, names and values.
    pub fn open(source: &Source) -> Result<Self, Report> {
        // spec: text -> validated spec
        let spec = spec::parse(source)?;
        // model: bodies, joints, spanning tree, cuts, parameter order
        let model = model::build(&spec);
        Ok(Self {
            source: source.clone(),
            spec,
            model,
            loops: OnceCell::new(),
            analysis: OnceCell::new(),
        })
    }

    /// The mechanism's links, coordinates, cuts and parameters.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The frames, joints and cuts as numbers, for drawing. The scene is built from the spec alone;
    /// the loops need not close.
    pub fn scene(&self) -> Scene {
        Scene::new(&self.spec, &self.model)
    }

    /// The base parameters (Eq. 23) with the certificate that they are complete.
    ///
    /// # Errors
    /// A report if the mechanism has too many parameters (see [`base::has_few_enough_parameters`]), if home
    /// does not close or does not fit the mobility, or if `base: drop` in the spec names a
    /// parameter that is not a base parameter.
    pub fn analysis(&self) -> Result<&Analysis, Report> {
        let analysis = self.analysed()?;
        checks::check_dropped_parameters(&self.source, &self.spec, &self.model, &analysis.base)?;
        Ok(analysis)
    }

    /// Reads base parameters that [`base::store`] wrote, so that they need not be derived.
    ///
    /// # Errors
    /// If the stored base parameters were not derived from this spec.
    pub fn restore(&mut self, stored: &str) -> Result<(), StoreProblem> {
        let analysis = base::restore(stored, &self.source, &self.spec, &self.model)?;
        self.analysis = OnceCell::from(analysis);
        Ok(())
    }

    /// Explains the mechanism in words: its mobility, loops, motions and unidentifiable parameters.
    ///
    /// # Errors
    /// A report if the mechanism has too many parameters, or if home does not close or does not fit
    /// the mobility.
    pub fn explanation(&self) -> Result<Explanation, Report> {
        let analysis = self.analysed()?;
        let closed = &self.loops()?.closed;
        let redundant = closed
            .closure
            .as_ref()
            .map_or(&[][..], |c| c.redundant_rows());
        Ok(explain::explain(
            &self.spec,
            &self.model,
            &closed.home,
            redundant,
            analysis,
        ))
    }

    /// Builds the robot with a program for each function of `kinds` that the mechanism has. Base
    /// parameters are derived only if one of the functions needs them. A mechanism with too many
    /// parameters gets neither base parameters nor the functions that need them.
    ///
    /// # Errors
    /// As [`Mechanism::analysis`], except that too many parameters are not an error here.
    pub fn robot(&self, kinds: &[FunctionKind]) -> Result<Robot, Report> {
        let loops = self.loops()?;
        let base = kinds
            .iter()
            .any(|kind| kind.signature().needs == Needs::Base);
        let analysis =
            (base && base::has_few_enough_parameters(&self.model)).then(|| self.analysis());
        let analysis = analysis.transpose()?;
        // the functions extend a clone of the graph: programs do not depend on earlier requests
        let mut g = loops.g.clone();
        let mut cx = Context {
            g: &mut g,
            model: &self.model,
            frames: &loops.frames,
            closed: &loops.closed,
            symbols: loops.symbols.clone(),
            base: analysis.map(|a| &a.base),
        };
        // dynamics: every function's expressions (Eq. 2-5, 11, 14-20), then its program
        let mut functions = Vec::new();
        for &kind in kinds {
            if let Some(request) = request(&mut cx, kind) {
                // optimize: order, related angles, multiply-add
                let program = lower(cx.g, request);
                functions.push(Function { kind, program });
            }
            checks::check_graph_capacity(&self.source, &self.spec, cx.g)?;
        }
        Ok(Robot {
            functions,
            analysis: analysis.cloned(),
            ..without_functions(&self.spec, &self.model, &loops.closed)
        })
    }

    /// The base parameters, before the parameters under `base: drop` in the spec are checked.
    fn analysed(&self) -> Result<&Analysis, Report> {
        if !base::has_few_enough_parameters(&self.model) {
            return Err(checks::too_many_parameters(
                &self.source,
                &self.spec,
                &self.model,
            ));
        }
        let home = &self.loops()?.closed.home;
        // base: which combinations of the parameters affect the dynamics (Eq. 23), certified
        let analyse = || base::analyse(&self.spec, &self.model, home);
        Ok(self.analysis.get_or_init(analyse))
    }

    fn loops(&self) -> Result<&Loops, Report> {
        let loops = self.loops.get_or_init(|| self.close());
        loops.as_ref().map_err(Clone::clone)
    }

    fn close(&self) -> Result<Loops, Report> {
        let Self {
            source,
            spec,
            model,
            ..
        } = self;
        // sym: coordinates are the graph's first symbols
        let mut g = Graph::new();
        let symbols = Symbols::new(&mut g, model);
        // kinematics: frames of the links
        let frames = Frames::new(&mut g, model, Geometry::Values);
        // constraints: closed at home, loops solved in a fixed order (Eq. 6-10)
        let closed = Closed::new(&mut g, &frames, model)
            .map_err(|problem| checks::home_report(source, spec, model, &problem))?;
        checks::check_alignment_at_home(source, spec, &mut g, &frames, model, &closed.home)?;
        checks::check_graph_capacity(source, spec, &g)?;
        Ok(Loops {
            g,
            symbols,
            frames,
            closed,
        })
    }
}

/// Where [`derive_with`] gets the base parameters and their certificate from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BaseSource<'a> {
    /// Nowhere: the robot has neither base parameters nor the functions that need them.
    Skip,
    /// The base parameters are derived, however long that takes.
    Derivation,
    /// The base parameters are read from the text that [`base::store`] wrote. With `None` they are
    /// derived, but only if that is quick (see [`base::is_slow_in_debug`]).
    Store(Option<&'a str>),
}

/// Why a robot could not be derived.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum DeriveError {
    /// The spec has errors.
    Spec(Box<Report>),
    /// The stored base parameters cannot be used.
    Store(StoreProblem),
    /// Deriving the base parameters takes long, and no stored ones were given.
    NotStored,
}

impl fmt::Display for DeriveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Spec(report) => report.fmt(f),
            Self::Store(problem) => write!(f, "the file of stored base parameters {problem}"),
            Self::NotStored => f.write_str(
                "the base parameters of this robot take long to derive, and none are stored",
            ),
        }
    }
}

impl Error for DeriveError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        match self {
            Self::Spec(report) => Some(report.as_ref()),
            Self::Store(problem) => Some(problem),
            Self::NotStored => None,
        }
    }
}

impl From<Report> for DeriveError {
    fn from(report: Report) -> Self {
        DeriveError::Spec(Box::new(report))
    }
}

/// Derives a robot with all its functions from the text of its spec. A robot with more than
/// [`base::MAX_PARAMETERS`] parameters gets no base parameters and none of the functions that need
/// them.
///
/// # Errors
/// A report with the place of every mistake in the spec: in its syntax, its names and values, or a
/// home that does not close or does not fit the mobility.
///
/// ```
/// use regen_codegen::diag::Source;
/// use regen_codegen::pipeline::derive;
///
/// let text = "\
/// name: arm
/// limbs:
///   - name: arm
///     joints:
///       - {name: q1, type: revolute, body: link, actuated: true}
/// ";
/// let robot = derive(&Source::new("arm.yaml", text))?;
/// assert_eq!(robot.coordinates, ["q1"]);
/// assert_eq!(robot.independent, [0]);
/// # Ok::<(), regen_codegen::diag::Report>(())
/// ```
pub fn derive(source: &Source) -> Result<Robot, Report> {
    Mechanism::open(source)?.robot(&FunctionKind::ALL)
}

/// Derives a robot from the text of its spec, and gets its base parameters from where `from` says.
///
/// # Errors
/// As [`derive()`], and if the stored base parameters cannot be used or are missing.
pub fn derive_with(source: &Source, from: BaseSource<'_>) -> Result<Robot, DeriveError> {
    let mut mechanism = Mechanism::open(source)?;
    // report mistakes in the spec before those in the stored base parameters
    mechanism.loops()?;
    let within_reach = base::has_few_enough_parameters(&mechanism.model);
    match from {
        BaseSource::Skip => return Ok(mechanism.robot(&without_base())?),
        BaseSource::Store(Some(text)) if within_reach => {
            mechanism.restore(text).map_err(DeriveError::Store)?;
        }
        BaseSource::Store(None) if within_reach && base::is_slow_in_debug(&mechanism.model) => {
            return Err(DeriveError::NotStored);
        }
        BaseSource::Store(_) | BaseSource::Derivation => {}
    }
    Ok(mechanism.robot(&FunctionKind::ALL)?)
}

/// The functions that do not need base parameters.
pub fn without_base() -> Vec<FunctionKind> {
    let all = FunctionKind::ALL.into_iter();
    all.filter(|kind| kind.signature().needs != Needs::Base)
        .collect()
}

/// The robot without functions and base parameters: names, sizes, limits and nominal values.
fn without_functions(spec: &Spec, model: &Model, closed: &Closed) -> Robot {
    let cuts = model.cuts.iter().map(|cut| crate::robot::CutInfo {
        name: cut.name.clone(),
        rows: cut.kind.equations(),
    });
    let cones = model.cones.iter().map(|cone| crate::robot::SwingLimitInfo {
        name: cone.name.clone(),
        greatest: cone.greatest.to_f64(),
    });
    let rows = model.rows();
    Robot {
        name: spec.name.value.clone(),
        description: spec.description.clone(),
        coordinates: model.coordinates.iter().map(|c| c.name.clone()).collect(),
        independent: model.independent.clone(),
        dependent: model.dependent.clone(),
        actuated: model.actuated.clone(),
        parameters: model.parameters.clone(),
        bodies: model.bodies.iter().map(|b| b.label.clone()).collect(),
        rows,
        cuts: cuts.collect(),
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
        home: closed.home.clone(),
        functions: Vec::new(),
        analysis: None,
    }
}
