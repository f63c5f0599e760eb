// The slider-crank's base parameters: all three of its parameters, as they are. Stands behind
// slider_crank.rs.

use regen_runtime::{BaseInfo, BaseModel, BaseParameter, BaseTerm, Condition, Model, SizeError};

const fn alone(parameter: &'static str, index: usize) -> BaseTerm<'static> {
    BaseTerm {
        parameter,
        index,
        coefficient: "1",
        value: 1.0,
    }
}

const INERTIA: [BaseTerm<'static>; 1] = [alone("J(crank)", 0)];
const FRICTION: [BaseTerm<'static>; 1] = [alone("Fv(crank)", 1)];
const MASS: [BaseTerm<'static>; 1] = [alone("m(slider)", 2)];

impl BaseModel<f64> for SliderCrank {
    fn base_info(&self) -> BaseInfo<'_> {
        BaseInfo {
            base: &[
                BaseParameter {
                    label: "J(crank)",
                    terms: &INERTIA,
                },
                BaseParameter {
                    label: "Fv(crank)",
                    terms: &FRICTION,
                },
                BaseParameter {
                    label: "m(slider)",
                    terms: &MASS,
                },
            ],
            free: &[],
            certificate: None,
            complete: false,
        }
    }

    fn base_regressor(
        &self,
        q: &[f64],
        qd: &[f64],
        qdd: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        self.regressor(q, qd, qdd, out)
    }

    fn to_base(&self, phi: &[f64], out: &mut [f64]) -> Result<(), SizeError> {
        *regen_runtime::array_mut::<f64, 3>(out, "out")? = *regen_runtime::array(phi, "phi")?;
        Ok(())
    }

    fn parameters_from_base(
        &self,
        beta: &[f64],
        free: &[f64],
        out: &mut [f64],
    ) -> Result<(), SizeError> {
        regen_runtime::array::<f64, 0>(free, "free")?;
        self.to_base(beta, out)
    }

    fn base_inverse_dynamics(
        &self,
        q: &[f64],
        qd: &[f64],
        qdd: &[f64],
        beta: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        self.inverse_dynamics(q, qd, qdd, beta, out)
    }

    fn base_gravity(
        &self,
        q: &[f64],
        beta: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        self.gravity(q, beta, out)
    }

    fn base_bias_forces(
        &self,
        q: &[f64],
        qd: &[f64],
        beta: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        self.bias_forces(q, qd, beta, out)
    }

    fn base_mass_matrix(
        &self,
        q: &[f64],
        beta: &[f64],
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        self.mass_matrix(q, beta, out)
    }
}
