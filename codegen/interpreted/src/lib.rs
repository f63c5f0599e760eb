//! A derived robot as a model without compiling it: its programs run by the interpreter.
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

use regen_codegen::base;
use regen_codegen::interpret;
use regen_codegen::model::MotionKind;
use regen_codegen::robot::{FunctionKind, JointInfo, Robot};
use regen_codegen::spec;
use regen_runtime::{
    BaseInfo, BaseModel, BaseParameter, BaseTerm, Certificate, Condition, Cone, Cut, Friction,
    Info, Joint, Limits, Model, Motion, SizeError,
};

/// A robot and the borrowed names that [`Model::info`] lends.
pub struct Interpreted<'a> {
    robot: &'a Robot,
    coordinates: Vec<&'a str>,
    parameters: Vec<&'a str>,
    bodies: Vec<&'a str>,
    cuts: Vec<Cut<'a>>,
    joints: Vec<Joint>,
    cones: Vec<Cone<'a>>,
    base: Vec<BaseParameter<'a>>,
    zeros: Vec<BaseParameter<'a>>,
    free: Vec<&'a str>,
}

/// A label with what it stands for.
type Labelled<'a> = (&'a str, Vec<BaseTerm<'a>>);

/// The terms of a robot's base parameters, for [`Interpreted::with_terms`] to lend.
pub struct BaseTerms<'a> {
    base: Vec<Labelled<'a>>,
    zeros: Vec<Labelled<'a>>,
}

impl<'a> BaseTerms<'a> {
    /// The terms of the base parameters that functions take.
    pub fn new(robot: &'a Robot) -> Self {
        let label = |column: usize| robot.parameters.get(column).map_or("?", String::as_str);
        let analysis = robot.analysis.iter();
        let of = |term: &'a base::Term| BaseTerm {
            parameter: label(term.column),
            index: term.column,
            coefficient: &term.coefficient,
            value: term.value.to_f64(),
        };
        let all = || analysis.clone().flat_map(|a| &a.base.parameters);
        let row = |p: &'a base::BaseParameter| (label(p.column), p.terms.iter().map(of).collect());
        let dropped = all().filter(|p| p.dropped).map(row);
        // a parameter that others stand for: those less it are zero
        let known = analysis.clone().flat_map(|a| &a.base.known).map(|known| {
            let own = BaseTerm {
                parameter: label(known.column),
                index: known.column,
                coefficient: "-1",
                value: -1.0,
            };
            let all = std::iter::once(own).chain(known.terms.iter().map(of));
            (own.parameter, all.collect())
        });
        Self {
            base: all().filter(|p| !p.dropped).map(row).collect(),
            zeros: known.chain(dropped).collect(),
        }
    }
}

/// An argument: its name, the length it must have, and its entries.
type Input<'a> = (&'static str, usize, &'a [f64]);

impl<'a> Interpreted<'a> {
    /// The model of a robot; its base parameters have no terms to show.
    pub fn new(robot: &'a Robot) -> Self {
        let null = robot.analysis.iter().flat_map(|a| &a.base.null);
        let free = null.filter_map(|d| robot.parameters.get(d.column));
        Self {
            robot,
            coordinates: robot.coordinates.iter().map(String::as_str).collect(),
            parameters: robot.parameters.iter().map(String::as_str).collect(),
            bodies: robot.bodies.iter().map(String::as_str).collect(),
            cuts: robot
                .cuts
                .iter()
                .map(|cut| Cut {
                    name: &cut.name,
                    rows: cut.rows,
                })
                .collect(),
            joints: robot.joints.iter().map(stated).collect(),
            cones: robot
                .cones
                .iter()
                .map(|cone| Cone {
                    name: &cone.name,
                    greatest: cone.greatest,
                })
                .collect(),
            base: Vec::new(),
            zeros: Vec::new(),
            free: free.map(String::as_str).collect(),
        }
    }

    /// The model of a robot with its base parameters.
    pub fn with_terms(robot: &'a Robot, terms: &'a BaseTerms<'a>) -> Self {
        let lent = |all: &'a [Labelled<'a>]| {
            let each = all.iter();
            each.map(|(label, terms)| BaseParameter { label, terms })
                .collect()
        };
        Self {
            base: lent(&terms.base),
            zeros: lent(&terms.zeros),
            ..Self::new(robot)
        }
    }

    fn q<'v>(&self, v: &'v [f64]) -> Input<'v> {
        ("q", self.coordinates.len(), v)
    }

    fn qd<'v>(&self, v: &'v [f64]) -> Input<'v> {
        ("qd", self.coordinates.len(), v)
    }

    fn qdd<'v>(&self, v: &'v [f64]) -> Input<'v> {
        ("qdd", self.coordinates.len(), v)
    }

    fn phi<'v>(&self, v: &'v [f64]) -> Input<'v> {
        ("phi", self.parameters.len(), v)
    }

    fn independent<'v>(&self, name: &'static str, v: &'v [f64]) -> Input<'v> {
        (name, self.dof(), v)
    }

    fn dof(&self) -> usize {
        self.robot.independent.len()
    }

    /// The number of base parameters.
    pub fn rank(&self) -> usize {
        let analysis = self.robot.analysis.as_ref();
        analysis.map_or(0, |analysis| analysis.base.rank())
    }

    fn beta<'v>(&self, v: &'v [f64]) -> Input<'v> {
        ("beta", self.rank(), v)
    }

    /// Runs one function; `size` is the length of its output.
    fn call(
        &self,
        kind: FunctionKind,
        inputs: &[Input<'_>],
        size: usize,
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        let outputs = ("out", size, &*out);
        for &(argument, expected, values) in inputs.iter().chain([&outputs]) {
            if values.len() != expected {
                return Err(SizeError {
                    argument,
                    expected,
                    got: values.len(),
                });
            }
        }
        if size == 0 {
            return Ok(Condition::regular(1.0));
        }
        let found = self.robot.functions.iter().find(|f| f.kind == kind);
        let Some(function) = found else {
            // Every robot has every function; if one lacked it, its result is unknown.
            out.fill(f64::NAN);
            return Ok(Condition { pivot: f64::NAN });
        };
        let values: Vec<&[f64]> = inputs.iter().map(|input| input.2).collect();
        let (results, pivot) = interpret::run(&function.program, &values);
        let entries = results.into_iter().chain(std::iter::repeat(f64::NAN));
        for (slot, value) in out.iter_mut().zip(entries) {
            *slot = value;
        }
        Ok(Condition { pivot })
    }
}

/// A joint in the runtime's terms.
fn stated(joint: &JointInfo) -> Joint {
    let [position, velocity, acceleration, effort] = joint.limits;
    Joint {
        motion: match joint.motion {
            MotionKind::Rotation => Motion::Turn,
            MotionKind::Translation => Motion::Shift,
        },
        friction: match joint.friction {
            spec::Friction::None => Friction::None,
            spec::Friction::Viscous => Friction::Viscous,
            spec::Friction::Coulomb => Friction::Coulomb,
            spec::Friction::Linear => Friction::Linear,
            spec::Friction::CoulombAsymmetric => Friction::CoulombAsymmetric,
            spec::Friction::Asymmetric => Friction::Asymmetric,
            spec::Friction::Stribeck => Friction::Stribeck,
            spec::Friction::Atan => Friction::Atan,
            spec::Friction::Power => Friction::Power,
        },
        limits: Limits {
            position,
            velocity,
            acceleration,
            effort,
        },
        nominal: joint.nominal,
    }
}

impl Model<f64> for Interpreted<'_> {
    fn info(&self) -> Info<'_> {
        Info {
            name: &self.robot.name,
            coordinates: &self.coordinates,
            independent: &self.robot.independent,
            dependent: &self.robot.dependent,
            actuated: &self.robot.actuated,
            parameters: &self.parameters,
            bodies: &self.bodies,
            cuts: &self.cuts,
            home: &self.robot.home,
            gravity: self.robot.gravity,
            rows: self.robot.rows,
            joints: &self.joints,
            cones: &self.cones,
            nominal: &self.robot.nominal,
        }
    }

    fn constraints(&self, q: &[f64], out: &mut [f64]) -> Result<(), SizeError> {
        let inputs = [self.q(q)];
        self.call(FunctionKind::Constraints, &inputs, self.robot.rows, out)
            .map(drop)
    }

    fn jacobian(&self, q: &[f64], out: &mut [f64]) -> Result<(), SizeError> {
        let size = self.robot.rows * self.coordinates.len();
        self.call(FunctionKind::Jacobian, &[self.q(q)], size, out)
            .map(drop)
    }

    fn bias(&self, q: &[f64], qd: &[f64], out: &mut [f64]) -> Result<(), SizeError> {
        let inputs = [self.q(q), self.qd(qd)];
        self.call(FunctionKind::Bias, &inputs, self.robot.rows, out)
            .map(drop)
    }

    fn newton_step(&self, q: &[f64], out: &mut [f64]) -> Result<Condition<f64>, SizeError> {
        let size = self.robot.dependent.len();
        self.call(FunctionKind::NewtonStep, &[self.q(q)], size, out)
    }

    fn dependent_jacobian(&self, q: &[f64], out: &mut [f64]) -> Result<(), SizeError> {
        let size = self.robot.dependent.len().pow(2);
        self.call(FunctionKind::DependentJacobian, &[self.q(q)], size, out)
            .map(drop)
    }

    fn velocities(
        &self,
        q: &[f64],
        qd_i: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        let inputs = [self.q(q), self.independent("qd_i", qd_i)];
        self.call(FunctionKind::Velocities, &inputs, q.len(), out)
    }

    fn accelerations(
        &self,
        q: &[f64],
        qd: &[f64],
        qdd_i: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        let inputs = [self.q(q), self.qd(qd), self.independent("qdd_i", qdd_i)];
        self.call(FunctionKind::Accelerations, &inputs, q.len(), out)
    }

    fn regressor(
        &self,
        q: &[f64],
        qd: &[f64],
        qdd: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        let size = self.dof() * self.parameters.len();
        let inputs = [self.q(q), self.qd(qd), self.qdd(qdd)];
        self.call(FunctionKind::Regressor, &inputs, size, out)
    }

    fn inverse_dynamics(
        &self,
        q: &[f64],
        qd: &[f64],
        qdd: &[f64],
        phi: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        let inputs = [self.q(q), self.qd(qd), self.qdd(qdd), self.phi(phi)];
        self.call(FunctionKind::InverseDynamics, &inputs, self.dof(), out)
    }

    fn gravity(
        &self,
        q: &[f64],
        phi: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        let inputs = [self.q(q), self.phi(phi)];
        self.call(FunctionKind::Gravity, &inputs, self.dof(), out)
    }

    fn bias_forces(
        &self,
        q: &[f64],
        qd: &[f64],
        phi: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        let inputs = [self.q(q), self.qd(qd), self.phi(phi)];
        self.call(FunctionKind::BiasForces, &inputs, self.dof(), out)
    }

    fn mass_matrix(
        &self,
        q: &[f64],
        phi: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        let inputs = [self.q(q), self.phi(phi)];
        self.call(FunctionKind::MassMatrix, &inputs, self.dof().pow(2), out)
    }

    fn slotine_li(
        &self,
        q: &[f64],
        qd: &[f64],
        qd_r_i: &[f64],
        qdd_r_i: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        let inputs = [
            self.q(q),
            self.qd(qd),
            self.independent("qd_r_i", qd_r_i),
            self.independent("qdd_r_i", qdd_r_i),
        ];
        let size = self.dof() * self.parameters.len();
        self.call(FunctionKind::SlotineLi, &inputs, size, out)
    }

    fn efforts(
        &self,
        q: &[f64],
        tau_actuated: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        let actuated = self.robot.actuated.len();
        let inputs = [self.q(q), ("tau_actuated", actuated, tau_actuated)];
        self.call(FunctionKind::Efforts, &inputs, self.dof(), out)
    }

    fn poses(&self, q: &[f64], out: &mut [f64]) -> Result<(), SizeError> {
        let size = 12 * self.robot.bodies.len();
        self.call(FunctionKind::Poses, &[self.q(q)], size, out)
            .map(drop)
    }

    fn cones(&self, q: &[f64], out: &mut [f64]) -> Result<(), SizeError> {
        let size = self.cones.len();
        self.call(FunctionKind::Cones, &[self.q(q)], size, out)
            .map(drop)
    }
}

impl BaseModel<f64> for Interpreted<'_> {
    fn base_info(&self) -> BaseInfo<'_> {
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
                smallest_kept: c.smallest_kept,
                largest_dropped: c.largest_dropped,
            }),
            complete: analysis.is_some_and(|a| a.complete),
        }
    }

    fn zeros(&self) -> &[BaseParameter<'_>] {
        &self.zeros
    }

    fn base_regressor(
        &self,
        q: &[f64],
        qd: &[f64],
        qdd: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        let inputs = [self.q(q), self.qd(qd), self.qdd(qdd)];
        let size = self.dof() * self.rank();
        self.call(FunctionKind::BaseRegressor, &inputs, size, out)
    }

    fn to_base(&self, phi: &[f64], out: &mut [f64]) -> Result<(), SizeError> {
        self.call(FunctionKind::ToBase, &[self.phi(phi)], self.rank(), out)
            .map(drop)
    }

    fn parameters_from_base(
        &self,
        beta: &[f64],
        free: &[f64],
        out: &mut [f64],
    ) -> Result<(), SizeError> {
        let inputs = [self.beta(beta), ("free", self.free.len(), free)];
        self.call(FunctionKind::FromBase, &inputs, self.parameters.len(), out)
            .map(drop)
    }

    fn base_inverse_dynamics(
        &self,
        q: &[f64],
        qd: &[f64],
        qdd: &[f64],
        beta: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        let inputs = [self.q(q), self.qd(qd), self.qdd(qdd), self.beta(beta)];
        self.call(FunctionKind::BaseInverseDynamics, &inputs, self.dof(), out)
    }

    fn base_gravity(
        &self,
        q: &[f64],
        beta: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        let inputs = [self.q(q), self.beta(beta)];
        self.call(FunctionKind::BaseGravity, &inputs, self.dof(), out)
    }

    fn base_bias_forces(
        &self,
        q: &[f64],
        qd: &[f64],
        beta: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        let inputs = [self.q(q), self.qd(qd), self.beta(beta)];
        self.call(FunctionKind::BaseBiasForces, &inputs, self.dof(), out)
    }

    fn base_mass_matrix(
        &self,
        q: &[f64],
        beta: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        let inputs = [self.q(q), self.beta(beta)];
        self.call(
            FunctionKind::BaseMassMatrix,
            &inputs,
            self.dof().pow(2),
            out,
        )
    }
}
