// An offset slider-crank, written by hand: the analytic model of the tests and of the
// documentation's examples, which include this file.

/// A crank at the origin, a rod, and a slider along x, cut at the rod's end.
///
/// q = (crank angle, rod angle relative to the crank, slider position). Gravity is along -x.
/// Parameters: the crank's inertia and viscous friction, the slider's mass; the rod has no mass.
#[derive(Clone, Copy, Debug)]
pub struct SliderCrank {
    pub crank: f64,
    pub rod: f64,
    pub offset: f64,
    pub home: [f64; 3],
}

impl Default for SliderCrank {
    fn default() -> Self {
        Self {
            crank: 1.0,
            rod: 2.0,
            offset: 0.0,
            home: [0.0, 0.0, 3.0],
        }
    }
}

impl SliderCrank {
    const GRAVITY: f64 = 9.81;

    fn rows<T: regen_runtime::Scalar>(&self, q: &[T; 3]) -> [[T; 3]; 2] {
        let ((s, c), (rs, rc)) = (q[0].sin_cos(), (q[0] + q[1]).sin_cos());
        let (a, b) = (s.splat(self.crank), s.splat(self.rod));
        [
            [-(a * s) - b * rs, -(b * rs), s.splat(-1.0)],
            [a * c + b * rc, b * rc, s.splat(0.0)],
        ]
    }

    /// Multiplies right-hand sides by A_e^-1.
    fn solve<T: regen_runtime::Scalar, const K: usize>(
        &self,
        q: &[T; 3],
        sides: &[[T; K]; 2],
    ) -> ([[T; K]; 2], regen_runtime::Condition<T>) {
        let dependent = self.rows(q).map(|[_, rod, slider]| [rod, slider]);
        let (x, pivot) = regen_runtime::solve_pivoted(&dependent, sides);
        (x, regen_runtime::Condition { pivot })
    }

    /// X = A_e^-1 A_i.
    fn x<T: regen_runtime::Scalar>(&self, q: &[T; 3]) -> ([T; 2], regen_runtime::Condition<T>) {
        let (x, condition) = self.solve(q, &self.rows(q).map(|[crank, ..]| [crank]));
        (x.map(|[x]| x), condition)
    }

    fn residual<T: regen_runtime::Scalar>(&self, q: &[T; 3]) -> [T; 2] {
        let ((s, c), (rs, rc)) = (q[0].sin_cos(), (q[0] + q[1]).sin_cos());
        let (a, b) = (s.splat(self.crank), s.splat(self.rod));
        [a * c + b * rc - q[2], a * s + b * rs - s.splat(self.offset)]
    }

    fn b<T: regen_runtime::Scalar>(&self, q: &[T; 3], qd: &[T; 3]) -> [T; 2] {
        let ((s, c), (rs, rc)) = (q[0].sin_cos(), (q[0] + q[1]).sin_cos());
        let crank = s.splat(self.crank) * qd[0] * qd[0];
        let rod = s.splat(self.rod) * (qd[0] + qd[1]) * (qd[0] + qd[1]);
        [crank * c + rod * rc, crank * s + rod * rs]
    }

    /// The regressor row for the given velocity of the crank and accelerations of crank and slider.
    fn row<T: regen_runtime::Scalar>(x: [T; 2], qd: T, qdd: T, slide: T) -> [T; 3] {
        [qdd, qd, -(x[1] * (slide + slide.splat(Self::GRAVITY)))]
    }

    /// All accelerations, from all velocities and the crank's acceleration.
    fn second<T: regen_runtime::Scalar>(&self, q: &[T; 3], qd: &[T; 3], qdd: T) -> [T; 3] {
        let (x, _) = self.x(q);
        let (y, _) = self.solve(q, &self.b(q, qd).map(|b| [b]));
        [qdd, y[0][0] - x[0] * qdd, y[1][0] - x[1] * qdd]
    }
}

fn dot<T: regen_runtime::Scalar>(row: [T; 3], phi: &[T; 3]) -> T {
    row[0] * phi[0] + row[1] * phi[1] + row[2] * phi[2]
}

impl<T: regen_runtime::Scalar> regen_runtime::Model<T> for SliderCrank {
    fn info(&self) -> regen_runtime::Info<'_> {
        regen_runtime::Info {
            name: "slider_crank",
            coordinates: &["crank", "rod", "slider"],
            independent: &[0],
            dependent: &[1, 2],
            actuated: &[0, 2],
            parameters: const {
                &[
                    regen_runtime::Parameter::new(regen_runtime::Symbol::Rotor, "crank"),
                    regen_runtime::Parameter::new(regen_runtime::Symbol::Friction("Fv"), "crank"),
                    regen_runtime::Parameter::new(regen_runtime::Symbol::Mass, "slider"),
                ]
            },
            bodies: &["crank", "slider"],
            cuts: &[regen_runtime::Cut {
                name: "pin",
                rows: 2,
            }],
            home: &self.home,
            rows: 2,
            ..regen_runtime::Info::EMPTY
        }
    }

    fn eval(
        &self,
        function: regen_runtime::Function,
        given: regen_runtime::Arguments<'_, T>,
        out: &mut [T],
    ) -> Result<regen_runtime::Condition<T>, regen_runtime::SizeError> {
        use regen_runtime::{Function, array, array_mut, matrix_mut};
        let q: &[T; 3] = array(given.q, "q")?;
        let qd = || array::<T, 3>(given.qd, "qd");
        let qdd = || array::<T, 3>(given.qdd, "qdd");
        let phi = || array::<T, 3>(given.phi, "phi");
        let mut condition = regen_runtime::Condition::regular(q[0]);
        let mut solved = || {
            let (x, worst) = self.x(q);
            condition = worst;
            x
        };
        match function {
            Function::Constraints => *array_mut(out, "out")? = self.residual(q),
            Function::Jacobian => *matrix_mut(out, "out")? = self.rows(q),
            Function::Bias => *array_mut(out, "out")? = self.b(q, qd()?),
            Function::NewtonStep => {
                let (step, worst) = self.solve(q, &self.residual(q).map(|f| [-f]));
                *array_mut(out, "out")? = step.map(|[x]| x);
                condition = worst;
            }
            Function::DependentJacobian => {
                let rows = self.rows(q).map(|[_, rod, slider]| [rod, slider]);
                *matrix_mut(out, "out")? = rows;
            }
            Function::Velocities => {
                let ([qd], x) = (*array(given.qd_i, "qd_i")?, solved());
                *array_mut(out, "out")? = [qd, -(x[0] * qd), -(x[1] * qd)];
            }
            Function::Accelerations => {
                let (qd, [qdd]) = (qd()?, *array(given.qdd_i, "qdd_i")?);
                *array_mut(out, "out")? = self.second(q, qd, qdd);
                solved();
            }
            Function::Regressor => {
                let ([qd, ..], [qdd, _, slide]) = (*qd()?, *qdd()?);
                *array_mut(out, "out")? = Self::row(solved(), qd, qdd, slide);
            }
            Function::InverseDynamics => {
                let ([qd, ..], [qdd, _, slide]) = (*qd()?, *qdd()?);
                let row = Self::row(solved(), qd, qdd, slide);
                *array_mut(out, "out")? = [dot(row, phi()?)];
            }
            Function::Gravity => {
                let rest = q[0].splat(0.0);
                let row = Self::row(solved(), rest, rest, rest);
                *array_mut(out, "out")? = [dot(row, phi()?)];
            }
            Function::BiasForces => {
                let qd = qd()?;
                let [qdd, _, slide] = self.second(q, qd, q[0].splat(0.0));
                let row = Self::row(solved(), qd[0], qdd, slide);
                *array_mut(out, "out")? = [dot(row, phi()?)];
            }
            Function::MassMatrix => {
                let ([inertia, _, mass], x) = (*phi()?, solved());
                *array_mut(out, "out")? = [inertia + x[1] * x[1] * mass];
            }
            Function::AdaptiveRegressor => {
                let (qd, x) = (qd()?, solved());
                let [qd_r] = *array(given.qd_r_i, "qd_r_i")?;
                let [qdd_r] = *array(given.qdd_r_i, "qdd_r_i")?;
                // The bias is bilinear: one factor is the velocity, the other the reference.
                let rates = [x[0].splat(1.0), -x[0], -x[1]];
                let coast = self.second(q, &rates, qd_r.splat(0.0))[2];
                let slide = coast * qd[0] * qd_r - x[1] * qdd_r;
                *array_mut(out, "out")? = Self::row(x, qd_r, qdd_r, slide);
            }
            Function::GeneralizedForces => {
                let [crank, slider] = *array(given.tau_actuated, "tau_actuated")?;
                *array_mut(out, "out")? = [crank - solved()[1] * slider];
            }
            Function::Poses => {
                let (s, c) = q[0].sin_cos();
                let (o, l, e) = (s.splat(0.0), s.splat(1.0), s.splat(self.offset));
                *matrix_mut(out, "out")? = [
                    [c, -s, o, s, c, o, o, o, l, o, o, o],
                    [l, o, o, o, l, o, o, o, l, q[2], e, o],
                ];
            }
            Function::Cones => *array_mut(out, "out")? = [],
        }
        Ok(condition)
    }
}
