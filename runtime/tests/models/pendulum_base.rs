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

/// The base of the pendulum for one number type.
macro_rules! base_of_the_pendulum {
    ($number:ty) => {
        impl BaseModel<$number> for Pendulum {
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
                x: Arguments<'_, $number>,
                out: &mut [$number],
            ) -> Result<Condition<$number>, SizeError> {
                // the base parameters are the parameters
                let full = Arguments { phi: x.beta, ..x };
                match function {
                    BaseFunction::BaseRegressor => self.eval(Function::Regressor, x, out),
                    BaseFunction::ToBase => {
                        *array_mut::<$number, 2>(out, "out")? = *array(x.phi, "phi")?;
                        Ok(Condition::regular(x.phi[0].splat(1.0)))
                    }
                    BaseFunction::FromBase => {
                        array::<$number, 0>(x.free, "free")?;
                        *array_mut::<$number, 2>(out, "out")? = *array(x.beta, "beta")?;
                        Ok(Condition::regular(x.beta[0].splat(1.0)))
                    }
                    BaseFunction::BaseInverseDynamics => {
                        self.eval(Function::InverseDynamics, full, out)
                    }
                    BaseFunction::BaseGravity => self.eval(Function::Gravity, full, out),
                    BaseFunction::BaseBiasForces => self.eval(Function::BiasForces, full, out),
                    BaseFunction::BaseMassMatrix => self.eval(Function::MassMatrix, full, out),
                }
            }
        }
    };
}

base_of_the_pendulum!(f64);
