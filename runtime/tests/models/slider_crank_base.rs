// The slider-crank's base parameters, which are its three parameters. To be included after
// slider_crank.rs.

use regen_runtime::{
    Arguments, BaseFunction, BaseInfo, BaseModel, BaseParameter, BaseTerm, Condition, Function,
    Model, SizeError,
};

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

    fn eval_base(
        &self,
        function: BaseFunction,
        x: Arguments<'_, f64>,
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        use regen_runtime::{array, array_mut};
        // the base parameters are the parameters
        let full = Arguments { phi: x.beta, ..x };
        match function {
            BaseFunction::BaseRegressor => self.eval(Function::Regressor, x, out),
            BaseFunction::ToBase => {
                *array_mut::<f64, 3>(out, "out")? = *array(x.phi, "phi")?;
                Ok(Condition::regular(1.0))
            }
            BaseFunction::FromBase => {
                array::<f64, 0>(x.free, "free")?;
                *array_mut::<f64, 3>(out, "out")? = *array(x.beta, "beta")?;
                Ok(Condition::regular(1.0))
            }
            BaseFunction::BaseInverseDynamics => self.eval(Function::InverseDynamics, full, out),
            BaseFunction::BaseGravity => self.eval(Function::Gravity, full, out),
            BaseFunction::BaseBiasForces => self.eval(Function::BiasForces, full, out),
            BaseFunction::BaseMassMatrix => self.eval(Function::MassMatrix, full, out),
        }
    }
}
