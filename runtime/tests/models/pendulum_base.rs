// The pendulum's base parameters, which are its two parameters. To be included after pendulum.rs.

use regen_runtime::{BaseFunction, BaseInfo, BaseModel, BaseParameter, BaseTerm};

/// The combination of a base parameter that is one parameter alone.
const fn alone(parameter: &'static str, index: usize) -> BaseTerm<'static> {
    BaseTerm {
        parameter,
        index,
        coefficient: "1",
        value: 1.0,
    }
}

const INERTIA: [BaseTerm<'static>; 1] = [alone("Izz(1)", 0)];
const MOMENT: [BaseTerm<'static>; 1] = [alone("mx(1)", 1)];

impl BaseModel<f64> for Pendulum {
    fn base_info(&self) -> BaseInfo<'_> {
        BaseInfo {
            base: &[
                BaseParameter {
                    label: "Izz(1)",
                    terms: &INERTIA,
                },
                BaseParameter {
                    label: "mx(1)",
                    terms: &MOMENT,
                },
            ],
            free: &[],
            certificate: None,
            complete: false,
        }
    }

    fn eval_base(
        &self,
        function: BaseFunction,
        x: Arguments<'_, f64>,
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        // the base parameters are the parameters
        let full = Arguments { phi: x.beta, ..x };
        match function {
            BaseFunction::BaseRegressor => self.eval(Function::Regressor, x, out),
            BaseFunction::ToBase => {
                *array_mut::<f64, 2>(out, "out")? = *array(x.phi, "phi")?;
                Ok(Condition::regular(1.0))
            }
            BaseFunction::FromBase => {
                array::<f64, 0>(x.free, "free")?;
                *array_mut::<f64, 2>(out, "out")? = *array(x.beta, "beta")?;
                Ok(Condition::regular(1.0))
            }
            BaseFunction::BaseInverseDynamics => self.eval(Function::InverseDynamics, full, out),
            BaseFunction::BaseGravity => self.eval(Function::Gravity, full, out),
            BaseFunction::BaseBiasForces => self.eval(Function::BiasForces, full, out),
            BaseFunction::BaseMassMatrix => self.eval(Function::MassMatrix, full, out),
        }
    }
}
