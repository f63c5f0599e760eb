//! The stages of the derivation in their order: from the text of a spec (the YAML description of a
//! robot) to one program (a list of operations) for each function of the robot. This is the file to
//! read first.

mod whole;

use std::cell::OnceCell;
use std::sync::Arc;

use crate::base::{self, Analysis, StoreProblem};
use crate::checks;
use crate::constraints::{Closed, HomeProblem, Mismatch};
use crate::diag::{Report, Source};
use crate::explain::{self, Explanation};
use crate::functions::{Context, Symbols, request};
use crate::kinematics::{Arguments, Frames, Geometry};
use crate::model::{self, Model};
use crate::optimize::lower;
use crate::robot::{Function, FunctionKind, Robot};
use crate::scene::Scene;
use crate::signature::{Needs, Trait};
use crate::spec::{self, Payloads, Spec};
use crate::store::{self, Facts, Key, Store};
use crate::sym::{Graph, Number};

pub use whole::{BaseSource, DeriveError, derive, derive_with, functions_without_base};

/// A mechanism that is derived in stages: spec, model, closed loops, base parameters. Each stage
/// runs at most once, when a method first needs its result.
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
    /// Which runs the spec's payloads are for.
    payloads: Payloads,
    /// The store of results that were derived before, if there is one.
    store: Option<Arc<dyn Store>>,
    /// The loops closed at home, or the report why they cannot be.
    closed: OnceCell<Result<ClosedMechanism, Report>>,
    /// The base parameters, derived or read by [`Mechanism::load_base`].
    analysis: OnceCell<Analysis>,
    /// Where the loops are closed, as far as [`Robot`] states it.
    at_home: OnceCell<AtHome>,
}

/// The coordinates at home, rad or m, and the indices of the redundant closure rows.
#[derive(Debug)]
struct AtHome {
    home: Vec<f64>,
    redundant_rows: Vec<usize>,
}

/// The mechanism with its loops closed; the expressions of every function are built from this
/// stage.
#[derive(Debug)]
struct ClosedMechanism {
    /// The expression graph, with the nodes of `symbols`, `frames` and `closed`.
    g: Graph,
    /// The inputs of the functions: coordinates, rates and parameters.
    symbols: Symbols,
    /// The frames of the links as functions of the coordinates.
    frames: Frames,
    /// The coordinates at home, rad or m, where all loops are closed, and the symbolic solution of
    /// the closure equations for the dependent velocities (Eq. 8-10).
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
            payloads: Payloads::default(),
            store: None,
            closed: OnceCell::new(),
            analysis: OnceCell::new(),
            at_home: OnceCell::new(),
        })
    }

    /// The mechanism with a store of results: what the same generator derived before from the same
    /// text is read from the store.
    #[must_use]
    pub fn with_store(self, store: Arc<dyn Store>) -> Self {
        Self {
            store: Some(store),
            ..self
        }
    }

    /// The mechanism whose payloads are always or never carried, for runs that are all of one kind;
    /// by default their parameters are apart from the robot's.
    ///
    /// ```
    /// use regen_codegen::Mechanism;
    /// use regen_codegen::diag::Source;
    /// use regen_codegen::spec::Payloads;
    ///
    /// let text = "\
    /// name: arm
    /// limbs:
    ///   - name: arm
    ///     joints:
    ///       - {name: q1, type: revolute, body: link, actuated: true}
    ///       - {type: fixed, body: load, payload: true}
    /// ";
    /// let rank = |payloads: Payloads| -> Result<usize, regen_codegen::diag::Report> {
    ///     let mechanism = Mechanism::open(&Source::new("arm.yaml", text))?;
    ///     Ok(mechanism.with_payloads(payloads).analysis()?.base.rank())
    /// };
    /// // runs with and without the load tell the two moments of inertia apart
    /// assert_eq!(rank(Payloads::Apart)?, 2);
    /// assert_eq!(rank(Payloads::Absent)?, 1);
    /// assert_eq!(rank(Payloads::Carried)?, 1);
    /// # Ok::<(), regen_codegen::diag::Report>(())
    /// ```
    #[must_use]
    pub fn with_payloads(self, payloads: Payloads) -> Self {
        if payloads == Payloads::Apart {
            return self;
        }
        let spec = self.spec.with_payloads(payloads);
        Self {
            source: self.source,
            model: model::build(&spec),
            spec,
            payloads,
            store: self.store,
            closed: OnceCell::new(),
            analysis: OnceCell::new(),
            at_home: OnceCell::new(),
        }
    }

    /// The mechanism with another acceleration of gravity, m/s^2, to see whether runs fit it better;
    /// its results are not stored. `None` for a number that is not finite.
    ///
    /// ```
    /// use regen_codegen::Mechanism;
    /// use regen_codegen::diag::Source;
    ///
    /// let text = "\
    /// name: arm
    /// limbs:
    ///   - name: arm
    ///     joints:
    ///       - {name: q1, type: revolute, body: link, actuated: true}
    /// ";
    /// let mechanism = Mechanism::open(&Source::new("arm.yaml", text))?;
    /// let across = mechanism.with_gravity([-9.81, 0.0, 0.0]).unwrap();
    /// // the axis is horizontal now, so the first moments have an effect
    /// assert_eq!(across.analysis()?.base.rank(), 3);
    /// # Ok::<(), regen_codegen::diag::Report>(())
    /// ```
    pub fn with_gravity(&self, gravity: [f64; 3]) -> Option<Self> {
        let mut spec = self.spec.clone();
        for (own, value) in spec.gravity.iter_mut().zip(gravity) {
            let value = Number::parse_decimal(&value.to_string())?;
            own.expr = spec::Expr::Number(value.clone());
            own.value = value;
        }
        Some(self.with_spec(spec))
    }

    /// The mechanism with more base parameters left out of its model, as `base: drop` of the spec does, by
    /// their labels; its results are not stored.
    #[must_use]
    pub fn with_dropped(&self, labels: &[String]) -> Self {
        let mut spec = self.spec.clone();
        let span = spec.name.span;
        let more = labels.iter().cloned();
        spec.base
            .drop
            .extend(more.map(|value| spec::Spanned { value, span }));
        self.with_spec(spec)
    }

    /// The mechanism of a changed spec. Its results are not stored, since they are stored by the text of the spec.
    fn with_spec(&self, spec: Spec) -> Self {
        Self {
            source: self.source.clone(),
            model: model::build(&spec),
            spec,
            payloads: self.payloads,
            store: None,
            closed: OnceCell::new(),
            analysis: OnceCell::new(),
            at_home: OnceCell::new(),
        }
    }

    /// The acceleration of gravity, m/s^2.
    pub fn gravity(&self) -> [f64; 3] {
        self.model.gravity.each_ref().map(|g| g.value.to_f64())
    }

    /// The labels of the bodies that are payloads.
    pub fn payloads(&self) -> impl Iterator<Item = &str> {
        let bodies = self.model.payloads.iter();
        bodies.filter_map(|body| Some(self.model.bodies.get(*body)?.label.as_str()))
    }

    /// The description, with every expression as written.
    pub fn spec(&self) -> &Spec {
        &self.spec
    }

    /// The mechanism's links, coordinates, cuts and parameters.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The report of a problem at home, with its place in the spec.
    pub fn report(&self, problem: &HomeProblem) -> Report {
        checks::home_report(&self.source, &self.spec, &self.model, problem)
    }

    /// The frames, joints and cuts as numbers, for drawing. The scene is built from the spec alone;
    /// the loops need not close.
    pub fn scene(&self) -> Scene {
        Scene::new(&self.spec, &self.model)
    }

    /// The base parameters (Eq. 23) with the certificate that they are complete.
    ///
    /// # Errors
    /// A report of one of these problems:
    /// - the mechanism has more than [`base::MAX_PARAMETERS`] parameters;
    /// - the loops do not close at home ([`HomeProblem::NotClosed`]);
    /// - the number of independent coordinates is not the mobility at home
    ///   ([`HomeProblem::Mobility`]);
    /// - the dependent coordinates do not follow from the independent ones at home
    ///   ([`HomeProblem::NotIndependent`]);
    /// - home is singular ([`HomeProblem::Singular`]);
    /// - the two frames of a cut differ by a half turn at home;
    /// - the expression graph is full: the robot needs more expressions than can be numbered;
    /// - `base: drop` in the spec names a parameter that is not a base parameter.
    pub fn analysis(&self) -> Result<&Analysis, Report> {
        let analysis = self.analysis_with_dropped()?;
        checks::check_dropped_parameters(&self.source, &self.spec, &self.model, &analysis.base)?;
        Ok(analysis)
    }

    /// Reads base parameters that [`base::store`] wrote, so that they need not be derived.
    ///
    /// # Errors
    /// [`StoreProblem::OutOfDate`] if the base parameters were stored for another version of the
    /// spec, [`StoreProblem::OtherRegen`] if another version of `regen` wrote them,
    /// [`StoreProblem::Malformed`] if the text is not in the format of [`base::store`].
    pub fn load_base(&mut self, stored: &str) -> Result<(), StoreProblem> {
        let analysis = base::restore(stored, &self.source, &self.spec, &self.model)?;
        self.analysis = OnceCell::from(analysis);
        // what follows depends on the stored text too, which keys do not contain
        self.store = None;
        Ok(())
    }

    /// Explains the mechanism in words: its mobility, loops, motions and unidentifiable parameters.
    ///
    /// # Errors
    /// As [`Mechanism::analysis`], except that `base: drop` is not checked.
    pub fn explanation(&self) -> Result<Explanation, Report> {
        let analysis = self.analysis_with_dropped()?;
        let at_home = self.at_home()?;
        let mut explanation = explain::explain(
            &self.spec,
            &self.model,
            &at_home.home,
            &at_home.redundant_rows,
            analysis,
        );
        explanation.name_lines(&self.source);
        Ok(explanation)
    }

    /// The kinds of the functions that generated sources have: all, without those of controllers
    /// if the description does not ask for them with `control: true`.
    pub fn functions(&self) -> Vec<FunctionKind> {
        let all = FunctionKind::ALL.into_iter();
        all.filter(|kind| self.spec.control || kind.signature().of != Trait::ControlModel)
            .collect()
    }

    /// Builds the robot with a program for each function of `kinds` that the mechanism has. Base
    /// parameters are derived only if one of the functions needs them. A mechanism with too many
    /// parameters gets neither base parameters nor the functions that need them.
    ///
    /// # Errors
    /// As [`Mechanism::analysis`], except that too many parameters are not an error here.
    pub fn robot(&self, kinds: &[FunctionKind]) -> Result<Robot, Report> {
        if kinds.is_empty() {
            let at_home = self.at_home()?;
            return Ok(without_functions(&self.spec, &self.model, at_home));
        }
        let names: Vec<&str> = kinds.iter().map(|kind| kind.name()).collect();
        let key = self.key("robot", &names.join(" "));
        if let Some(robot) = self.stored_robot(&key) {
            return Ok(robot);
        }
        let robot = self.derive_robot(self.closed()?, kinds)?;
        if let Some(store) = &self.store {
            store.put(&key, &|| store::robot_to_bytes(&robot));
        }
        Ok(robot)
    }

    /// The robot that was stored for a key.
    fn stored_robot(&self, key: &Key) -> Option<Robot> {
        let bytes = self.store.as_ref()?.get(key)?;
        let (facts, functions) = store::robot_from_bytes(&bytes)?;
        let at_home = AtHome {
            home: facts.home,
            redundant_rows: facts.redundant_rows,
        };
        Some(Robot {
            functions,
            analysis: facts.analysis,
            ..without_functions(&self.spec, &self.model, &at_home)
        })
    }

    /// The key of a result of the given kind, with what distinguishes it from others of the text.
    fn key(&self, kind: &str, which: &str) -> Key {
        let payloads: &[u8] = match self.payloads {
            Payloads::Apart => b"apart",
            Payloads::Absent => b"absent",
            Payloads::Carried => b"carried",
        };
        let text = self.source.text.as_bytes();
        Key::new(kind, &[which.as_bytes(), payloads, text])
    }

    /// The robot of generated sources: as [`Mechanism::robot`], but where the description has `adjustable`
    /// names of its geometry the functions take them as arguments, and there are no base parameters, since
    /// which combinations of parameters count can depend on these names.
    ///
    /// # Errors
    /// As [`Mechanism::robot`].
    pub fn source_robot(&self, kinds: &[FunctionKind]) -> Result<Robot, Report> {
        if self.spec.adjustable.is_empty() {
            return self.robot(kinds);
        }
        let has_base = |kind: &&FunctionKind| kind.signature().needs == Needs::Base;
        let kinds = kinds.iter().filter(|kind| !has_base(kind)).copied();
        let kinds: Vec<FunctionKind> = kinds.collect();
        let names: Vec<&str> = kinds.iter().map(|kind| kind.name()).collect();
        let key = self.key("source robot", &names.join(" "));
        let mut robot = if let Some(robot) = self.stored_robot(&key) {
            robot
        } else {
            let robot = self.derive_robot(&self.with_arguments(&self.spec)?, &kinds)?;
            if let Some(store) = &self.store {
                store.put(&key, &|| store::robot_to_bytes(&robot));
            }
            robot
        };
        let adjustable = self.spec.adjusted();
        robot.adjustable = adjustable
            .map(|(name, value)| (name.to_owned(), value))
            .collect();
        Ok(robot)
    }

    /// The robot of equations that people read: as [`Mechanism::robot`], but each function also takes the names of
    /// the geometry as arguments, as far as they can be ([`Robot::adjustable`]), so that expressions contain them.
    /// Which base parameters are kept is decided at their values.
    ///
    /// # Errors
    /// As [`Mechanism::robot`].
    pub fn robot_in_names(&self, kinds: &[FunctionKind]) -> Result<Robot, Report> {
        let angles = base::angle_names(&self.spec, &self.model);
        let names = spec::possible_arguments(&self.spec, |name| angles.contains(name));
        if names.is_empty() {
            return self.robot(kinds);
        }
        let spec = Spec {
            adjustable: names,
            ..self.spec.clone()
        };
        let mut robot = self.derive_robot(&self.with_arguments(&spec)?, kinds)?;
        let adjustable = spec.adjusted();
        robot.adjustable = adjustable
            .map(|(name, value)| (name.to_owned(), value))
            .collect();
        Ok(robot)
    }

    /// The closed mechanism with adjustable names as arguments. Their values decide where the loops close
    /// and in which order they are solved; expressions of the names follow.
    fn with_arguments(&self, spec: &Spec) -> Result<ClosedMechanism, Report> {
        let (names, values): (Vec<&str>, Vec<f64>) = spec.adjusted().unzip();
        let mut g = Graph::new();
        Symbols::of_coordinates(&mut g, &self.model);
        // no coordinate's or parameter's name has a blank
        let symbol = |name: &str| format!("geometry {name}");
        let arguments = Arguments::new(&mut g, spec, &names, symbol);
        let symbols = Symbols::new(&mut g, &self.model);
        let symbols = symbols.with_geometry(arguments.symbols.clone());
        let frames = Frames::new(&mut g, &self.model, Geometry::Arguments(arguments));
        let closed = &self.closed()?.closed;
        let closed = closed.with_arguments(&mut g, &frames, &self.model, &values);
        let closed = closed.ok_or_else(|| {
            let choice = self.model.independent.clone();
            let mismatch = Mismatch::default();
            self.report(&HomeProblem::NotIndependent { choice, mismatch })
        })?;
        checks::check_graph_capacity(&self.source, &self.spec, &g)?;
        Ok(ClosedMechanism {
            g,
            symbols,
            frames,
            closed,
        })
    }

    /// Derives the robot with a program for each function of `kinds` that the mechanism has.
    fn derive_robot(
        &self,
        mechanism: &ClosedMechanism,
        kinds: &[FunctionKind],
    ) -> Result<Robot, Report> {
        let needs_base = kinds
            .iter()
            .any(|kind| kind.signature().needs == Needs::Base);
        let analysis =
            (needs_base && base::has_few_enough_parameters(&self.model)).then(|| self.analysis());
        let analysis = analysis.transpose()?;
        // the functions extend a clone of the graph: programs do not depend on earlier requests
        let mut g = mechanism.g.clone();
        let mut cx = Context {
            g: &mut g,
            model: &self.model,
            frames: &mechanism.frames,
            closed: &mechanism.closed,
            symbols: mechanism.symbols.clone(),
            base: analysis.map(|a| &a.base),
        };
        // dynamics: every function's expressions (Eq. 2-5, 11, 14-20), then its program
        let mut functions = Vec::new();
        for &kind in kinds {
            if let Some(request) = request(&mut cx, kind) {
                // optimize: order of the operations, related angles, multiply-add
                let program = lower(cx.g, request);
                functions.push(Function { kind, program });
            }
            checks::check_graph_capacity(&self.source, &self.spec, cx.g)?;
        }
        Ok(Robot {
            functions,
            analysis: analysis.cloned(),
            ..without_functions(&self.spec, &self.model, self.at_home()?)
        })
    }

    /// The base parameters, those under `base: drop` in the spec included and not yet checked.
    fn analysis_with_dropped(&self) -> Result<&Analysis, Report> {
        if !base::has_few_enough_parameters(&self.model) {
            return Err(checks::too_many_parameters(
                &self.source,
                &self.spec,
                &self.model,
            ));
        }
        if let Some(known) = self.analysis.get() {
            // loops that do not close are reported first
            self.at_home()?;
            return Ok(known);
        }
        let key = self.key("analysis", "");
        if let Some(stored) = self.stored_facts(&key)
            && let Some(analysis) = stored.analysis
        {
            self.at_home.get_or_init(|| AtHome {
                home: stored.home,
                redundant_rows: stored.redundant_rows,
            });
            return Ok(self.analysis.get_or_init(|| analysis));
        }
        let AtHome {
            home,
            redundant_rows,
        } = self.at_home()?;
        // base: which combinations of the parameters affect the dynamics (Eq. 23), certified
        let analyse = || base::analyse(&self.spec, &self.model, home);
        let analysis = self.analysis.get_or_init(analyse);
        if let Some(store) = &self.store {
            let facts = || Facts {
                home: home.clone(),
                redundant_rows: redundant_rows.clone(),
                analysis: Some(analysis.clone()),
            };
            store.put(&key, &|| facts().to_bytes());
        }
        Ok(analysis)
    }

    /// The facts that were stored for a key.
    fn stored_facts(&self, key: &Key) -> Option<Facts> {
        Facts::from_bytes(&self.store.as_ref()?.get(key)?)
    }

    /// Home and the redundant rows, stored or of the closed mechanism.
    fn at_home(&self) -> Result<&AtHome, Report> {
        if let Some(known) = self.at_home.get() {
            return Ok(known);
        }
        let closed = &self.closed()?.closed;
        Ok(self.at_home.get_or_init(|| AtHome {
            home: closed.home.clone(),
            redundant_rows: closed.redundant_rows(&self.model),
        }))
    }

    /// The mechanism with its loops closed, computed at the first call.
    fn closed(&self) -> Result<&ClosedMechanism, Report> {
        let closed = self.closed.get_or_init(|| self.close_loops());
        closed.as_ref().map_err(Clone::clone)
    }

    /// Builds the frames and closure equations, and closes the loops at home.
    fn close_loops(&self) -> Result<ClosedMechanism, Report> {
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
        // constraints: loops closed at home, A_e eliminated in a fixed order of pivots (Eq. 6-10)
        let closed = Closed::new(&mut g, &frames, model)
            .map_err(|problem| checks::home_report(source, spec, model, &problem))?;
        checks::check_alignment_at_home(source, spec, &mut g, &frames, model, &closed.home)?;
        checks::check_graph_capacity(source, spec, &g)?;
        Ok(ClosedMechanism {
            g,
            symbols,
            frames,
            closed,
        })
    }
}

/// The robot without functions and base parameters: names, sizes, limits and nominal values.
fn without_functions(spec: &Spec, model: &Model, at_home: &AtHome) -> Robot {
    let cuts = model.cuts.iter().map(|cut| crate::robot::CutInfo {
        name: cut.name.clone(),
        rows: cut.kind.equations(),
    });
    let cones = model.cones.iter().map(|cone| crate::robot::SwingLimitInfo {
        name: cone.name.clone(),
        greatest: cone.greatest.to_f64(),
    });
    Robot {
        name: spec.name.value.clone(),
        description: spec.description.clone(),
        coordinates: model.coordinates.iter().map(|c| c.name.clone()).collect(),
        independent: model.independent.clone(),
        dependent: model.dependent.clone(),
        actuated: model.actuated.clone(),
        parameters: model.parameters.clone(),
        bodies: model.bodies.iter().map(|b| b.label.clone()).collect(),
        frames: model.frames.iter().map(|f| f.name.clone()).collect(),
        payloads: model.payloads.clone(),
        rows: model.rows(),
        cuts: cuts.collect(),
        joints: crate::robot::joints(spec, model),
        cones: cones.collect(),
        nominal: model::nominal(spec, model)
            .into_iter()
            .map(|value| value.map(|v| v.to_f64()))
            .collect(),
        redundant_rows: at_home.redundant_rows.clone(),
        gravity: model.gravity.each_ref().map(|g| g.value.to_f64()),
        home: at_home.home.clone(),
        adjustable: Vec::new(),
        functions: Vec::new(),
        analysis: None,
    }
}
