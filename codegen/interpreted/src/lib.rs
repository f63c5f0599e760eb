//! A derived robot as a model that needs no compilation: its programs are executed as lists of
//! instructions, at one state or at blocks of states in vector registers.
//!
//! ```
//! use regen_codegen::{diag::Source, pipeline};
//! use regen_interpreted::Interpreted;
//! use regen_runtime::Model;
//!
//! let text = "name: pendulum\nlimbs:\n  - name: arm\n    base: {rpy: [-pi/2, 0, 0]}\n    \
//!             joints:\n      - {name: q1, type: revolute, body: 1, actuated: true}\n";
//! let robot = pipeline::derive(&Source::new("pendulum.yaml", text))?;
//! let model = Interpreted::new(&robot);
//! // 2 kg at 0.5 m along x, which is level at 0
//! let mut phi = [0.0; 10];
//! (phi[6], phi[9]) = (1.0, 2.0);
//! let mut tau = [0.0];
//! model.gravity(&[0.0], &phi, &mut tau)?;
//! assert!((tau[0].abs() - 9.81).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod block;
mod efforts;
mod eval;
mod exact;
mod kinematics;
mod machine;
mod schedule;
mod tangent;
mod tape;

use std::sync::OnceLock;

use regen_codegen::base;
use regen_codegen::model::{self, MotionKind, ParameterKind, SpringPart};
use regen_codegen::robot::{JointInfo, Robot};
use regen_codegen::spec;
use regen_runtime::function::Sizes;
use regen_runtime::{
    BaseInfo, BaseParameter, BaseTerm, Certificate, Cut, Friction, Info, Joint, Limits, Motion,
    Parameter, SwingLimit, Symbol,
};

pub use efforts::{NominalEfforts, UnknownEfforts};
pub use eval::Interpret;
use eval::Programs;
pub use kinematics::{ChosenGeometry, Described};

/// A robot's programs with the names that its [`info`](Interpreted::info) refers to.
///
/// It implements the models of the runtime for every number that implements [`Interpret`].
pub struct Interpreted<'a> {
    robot: &'a Robot,
    programs: Programs<'a>,
    sizes: Sizes,
    coordinates: Vec<&'a str>,
    parameters: Vec<Parameter<'a>>,
    bodies: Vec<&'a str>,
    frames: Vec<&'a str>,
    cuts: Vec<Cut<'a>>,
    joints: Vec<Joint>,
    cones: Vec<SwingLimit<'a>>,
    base: Vec<BaseParameter<'a>>,
    zeros: Vec<BaseParameter<'a>>,
    free: Vec<&'a str>,
    /// The adjustable geometry of the description, for programs that take it.
    geometry: Vec<f64>,
}

/// The terms of a robot's base parameters, which [`Interpreted::with_terms`] refers to.
pub struct BaseTerms<'a> {
    base: Vec<Combination<'a>>,
    zeros: Vec<Combination<'a>>,
}

/// A label with the terms of the combination.
struct Combination<'a> {
    label: &'a str,
    terms: Vec<Term<'a>>,
    /// The terms in the runtime's form, created at the first use; they borrow the texts of `terms`.
    borrowed_terms: OnceLock<Vec<BaseTerm<'a>>>,
}

/// A term that owns the text of its coefficient.
struct Term<'a> {
    parameter: &'a str,
    index: usize,
    coefficient: String,
    value: f64,
}

impl<'a> Combination<'a> {
    fn new(label: &'a str, terms: impl Iterator<Item = Term<'a>>) -> Self {
        Self {
            label,
            terms: terms.collect(),
            borrowed_terms: OnceLock::new(),
        }
    }

    fn borrow_terms(&'a self) -> BaseParameter<'a> {
        let borrowed_terms = self.borrowed_terms.get_or_init(|| {
            let terms = self.terms.iter().map(|term| BaseTerm {
                parameter: term.parameter,
                index: term.index,
                coefficient: &term.coefficient,
                value: term.value,
            });
            terms.collect()
        });
        BaseParameter {
            label: self.label,
            terms: borrowed_terms,
        }
    }
}

impl<'a> BaseTerms<'a> {
    /// The terms of the base parameters that the functions use.
    pub fn new(robot: &'a Robot) -> Self {
        let label = |column: usize| {
            robot
                .parameters
                .get(column)
                .map_or("?", |p| p.label.as_str())
        };
        let analysis = robot.analysis.iter();
        let of = |term: &base::Term| Term {
            parameter: label(term.column),
            index: term.column,
            coefficient: term.coefficient.to_string(),
            value: term.value.to_f64(),
        };
        let all = || analysis.clone().flat_map(|a| &a.base.parameters);
        let row =
            |p: &base::BaseParameter| Combination::new(label(p.column), p.terms.iter().map(of));
        let dropped = all().filter(|p| p.dropped).map(row);
        // for a parameter that is replaced by others, the combination minus the parameter is zero
        let known = analysis.clone().flat_map(|a| &a.base.known).map(|known| {
            let own = Term {
                parameter: label(known.column),
                index: known.column,
                coefficient: "-1".to_owned(),
                value: -1.0,
            };
            let all = std::iter::once(own).chain(known.terms.iter().map(of));
            Combination::new(label(known.column), all)
        });
        Self {
            base: all().filter(|p| !p.dropped).map(row).collect(),
            zeros: known.chain(dropped).collect(),
        }
    }
}

impl<'a> Interpreted<'a> {
    /// The model of a robot, without the terms of its base parameters.
    pub fn new(robot: &'a Robot) -> Self {
        let null = robot.analysis.iter().flat_map(|a| &a.base.null);
        let free = null.filter_map(|d| robot.parameters.get(d.column));
        let mut model = Self {
            robot,
            programs: Programs::of(robot),
            sizes: Sizes::of(&Info::EMPTY),
            coordinates: robot.coordinates.iter().map(String::as_str).collect(),
            parameters: robot.parameters.iter().map(runtime_parameter).collect(),
            bodies: robot.bodies.iter().map(String::as_str).collect(),
            frames: robot.frames.iter().map(String::as_str).collect(),
            cuts: robot
                .cuts
                .iter()
                .map(|cut| Cut {
                    name: &cut.name,
                    rows: cut.rows,
                })
                .collect(),
            joints: robot.joints.iter().map(runtime_joint).collect(),
            cones: robot
                .cones
                .iter()
                .map(|cone| SwingLimit {
                    name: &cone.name,
                    greatest: cone.greatest,
                })
                .collect(),
            base: Vec::new(),
            zeros: Vec::new(),
            free: free.map(|p| p.label.as_str()).collect(),
            geometry: robot.adjustable.iter().map(|(_, value)| *value).collect(),
        };
        model.sizes = Sizes {
            base: model.rank(),
            free: model.free.len(),
            ..Sizes::of(&model.info())
        };
        model
    }

    /// The model of a robot with the terms of its base parameters.
    pub fn with_terms(robot: &'a Robot, terms: &'a BaseTerms<'a>) -> Self {
        let borrowed_terms =
            |all: &'a [Combination<'a>]| all.iter().map(Combination::borrow_terms).collect();
        Self {
            base: borrowed_terms(&terms.base),
            zeros: borrowed_terms(&terms.zeros),
            ..Self::new(robot)
        }
    }

    /// The number of base parameters.
    pub fn rank(&self) -> usize {
        let analysis = self.robot.analysis.as_ref();
        analysis.map_or(0, |analysis| analysis.base.rank())
    }

    /// The names and sizes of the robot's parts, as [`Model::info`](regen_runtime::Model::info).
    pub fn info(&self) -> Info<'_> {
        Info {
            name: &self.robot.name,
            coordinates: &self.coordinates,
            independent: &self.robot.independent,
            dependent: &self.robot.dependent,
            actuated: &self.robot.actuated,
            parameters: &self.parameters,
            bodies: &self.bodies,
            frames: &self.frames,
            cuts: &self.cuts,
            home: &self.robot.home,
            gravity: self.robot.gravity,
            rows: self.robot.rows,
            joints: &self.joints,
            cones: &self.cones,
            nominal: &self.robot.nominal,
        }
    }

    /// The combinations and their certificate, as
    /// [`BaseModel::base_info`](regen_runtime::BaseModel::base_info).
    pub fn base_info(&self) -> BaseInfo<'_> {
        let analysis = self.robot.analysis.as_ref();
        let certificate = analysis.and_then(|a| a.certificate.as_ref().ok());
        BaseInfo {
            base: &self.base,
            free: &self.free,
            certificate: certificate.map(|c| Certificate {
                columns: c.columns,
                rank: c.rank,
                states: c.states,
                digits: c.digits,
                smallest_pivot: c.smallest_pivot,
                largest_remainder: c.largest_remainder,
            }),
            complete: analysis.is_some_and(|a| a.complete),
        }
    }

    /// Linear forms in the parameters that the base parameters assume to be zero, as
    /// [`BaseModel::zeros`](regen_runtime::BaseModel::zeros).
    pub fn zeros(&self) -> &[BaseParameter<'_>] {
        &self.zeros
    }
}

/// Converts a parameter to the runtime's type.
fn runtime_parameter(parameter: &model::Parameter) -> Parameter<'_> {
    let symbol = match parameter.kind {
        ParameterKind::Inertial { entry, .. } => {
            let own = Symbol::INERTIAL.get(entry).copied();
            own.unwrap_or(Symbol::Mass)
        }
        ParameterKind::Friction { column, .. } => Symbol::Friction(column.symbol()),
        ParameterKind::Offset { .. } => Symbol::Offset,
        ParameterKind::Rotor { .. } => Symbol::Rotor,
        ParameterKind::JointSpring { .. } => Symbol::Stiffness,
        ParameterKind::EffortTerm { .. } => Symbol::Term(parameter.symbol()),
        ParameterKind::PointSpring { part, .. } => match part {
            SpringPart::Stiffness => Symbol::SpringStiffness,
            SpringPart::Preload => Symbol::SpringPreload,
            SpringPart::Pull => Symbol::SpringPull,
        },
    };
    Parameter::new(symbol, &parameter.owner)
}

/// Converts a friction law to the runtime's type by its name; a test checks that both lists of laws
/// are equal.
fn law(friction: spec::Friction) -> Friction {
    let mut laws = Friction::ALL.into_iter();
    let found = laws.find(|law| law.name() == friction.word());
    found.unwrap_or(Friction::None)
}

/// Converts a joint to the runtime's type.
fn runtime_joint(joint: &JointInfo) -> Joint {
    let [position, velocity, acceleration, jerk, effort] = joint.limits;
    Joint {
        motion: match joint.motion {
            MotionKind::Rotation => Motion::Rotation,
            MotionKind::Translation => Motion::Translation,
        },
        friction: law(joint.friction),
        limits: Limits {
            position,
            velocity,
            acceleration,
            jerk,
            effort,
        },
        nominal: joint.nominal,
        travel: joint.travel,
    }
}
