//! The interpreted engine as a [`Model`], for what works on models: the closure of the runtime.

use regen_codegen::interpret::run;
use regen_codegen::robot::{FunctionKind as Kind, Robot};
use regen_runtime::{Condition, Cut, Info, Model, SizeError};

/// A derived robot with the lists that [`Model::info`] lends.
pub struct DerivedModel<'a> {
    robot: &'a Robot,
    coordinates: Vec<&'a str>,
    parameters: Vec<&'a str>,
    bodies: Vec<&'a str>,
    cuts: Vec<Cut<'a>>,
}

impl<'a> DerivedModel<'a> {
    /// The model of a robot.
    pub fn new(robot: &'a Robot) -> DerivedModel<'a> {
        let cut = |c: &'a regen_codegen::robot::CutInfo| Cut {
            name: &c.name,
            rows: c.rows,
        };
        DerivedModel {
            robot,
            coordinates: robot.coordinates.iter().map(String::as_str).collect(),
            parameters: robot.parameters.iter().map(String::as_str).collect(),
            bodies: robot.bodies.iter().map(String::as_str).collect(),
            cuts: robot.cuts.iter().map(cut).collect(),
        }
    }

    /// A function that the robot lacks has no results: there is nothing of it.
    fn call(
        &self,
        kind: Kind,
        inputs: &[&[f64]],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        let (values, pivot) = match self.robot.function(kind) {
            Some(function) => run(&function.program, inputs),
            None => (Vec::new(), 1.0),
        };
        if values.len() != out.len() {
            return Err(SizeError {
                argument: "out",
                expected: values.len(),
                got: out.len(),
            });
        }
        out.copy_from_slice(&values);
        Ok(Condition { pivot })
    }
}

type Done = Result<Condition<f64>, SizeError>;

impl Model<f64> for DerivedModel<'_> {
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
            // Limits and nominal values have no part in the closure.
            joints: &[],
            cones: &[],
            nominal: &[],
        }
    }

    fn constraints(&self, q: &[f64], out: &mut [f64]) -> Result<(), SizeError> {
        self.call(Kind::Constraints, &[q], out).map(drop)
    }

    fn jacobian(&self, q: &[f64], out: &mut [f64]) -> Result<(), SizeError> {
        self.call(Kind::Jacobian, &[q], out).map(drop)
    }

    fn bias(&self, q: &[f64], qd: &[f64], out: &mut [f64]) -> Result<(), SizeError> {
        self.call(Kind::Bias, &[q, qd], out).map(drop)
    }

    fn newton_step(&self, q: &[f64], out: &mut [f64]) -> Done {
        self.call(Kind::NewtonStep, &[q], out)
    }

    fn dependent_jacobian(&self, q: &[f64], out: &mut [f64]) -> Result<(), SizeError> {
        self.call(Kind::DependentJacobian, &[q], out).map(drop)
    }

    fn velocities(&self, q: &[f64], qd_i: &[f64], out: &mut [f64]) -> Done {
        self.call(Kind::Velocities, &[q, qd_i], out)
    }

    fn accelerations(&self, q: &[f64], qd: &[f64], qdd_i: &[f64], out: &mut [f64]) -> Done {
        self.call(Kind::Accelerations, &[q, qd, qdd_i], out)
    }

    fn regressor(&self, q: &[f64], qd: &[f64], qdd: &[f64], out: &mut [f64]) -> Done {
        self.call(Kind::Regressor, &[q, qd, qdd], out)
    }

    fn inverse_dynamics(
        &self,
        q: &[f64],
        qd: &[f64],
        qdd: &[f64],
        phi: &[f64],
        out: &mut [f64],
    ) -> Done {
        self.call(Kind::InverseDynamics, &[q, qd, qdd, phi], out)
    }

    fn gravity(&self, q: &[f64], phi: &[f64], out: &mut [f64]) -> Done {
        self.call(Kind::Gravity, &[q, phi], out)
    }

    fn bias_forces(&self, q: &[f64], qd: &[f64], phi: &[f64], out: &mut [f64]) -> Done {
        self.call(Kind::BiasForces, &[q, qd, phi], out)
    }

    fn mass_matrix(&self, q: &[f64], phi: &[f64], out: &mut [f64]) -> Done {
        self.call(Kind::MassMatrix, &[q, phi], out)
    }

    fn slotine_li(
        &self,
        q: &[f64],
        qd: &[f64],
        qd_r_i: &[f64],
        qdd_r_i: &[f64],
        out: &mut [f64],
    ) -> Done {
        self.call(Kind::SlotineLi, &[q, qd, qd_r_i, qdd_r_i], out)
    }

    fn efforts(&self, q: &[f64], tau_actuated: &[f64], out: &mut [f64]) -> Done {
        self.call(Kind::Efforts, &[q, tau_actuated], out)
    }

    fn poses(&self, q: &[f64], out: &mut [f64]) -> Result<(), SizeError> {
        self.call(Kind::Poses, &[q], out).map(drop)
    }
}
