// Planar four-bars with one common input crank, written by hand.

use regen_runtime::function::Sizes;
use regen_runtime::{
    Arguments, Condition, Cut, Function, Info, Model, Parameter, SizeError, Symbol,
};

/// One loop: the lengths of the input crank, the coupler, the follower crank and the ground.
#[derive(Clone, Copy, Debug)]
pub struct Loop {
    pub input: f64,
    pub coupler: f64,
    pub follower: f64,
    pub ground: f64,
}

/// A mechanism of four-bar loops with one common input crank. q = (input angle, then for each loop
/// the coupler's angle relative to the input and the follower's absolute angle). The only parameter
/// is the crank's inertia.
#[derive(Clone, Debug)]
pub struct FourBars {
    pub loops: Vec<Loop>,
    pub home: Vec<f64>,
}

const NAMES: [&str; 5] = ["input", "coupler1", "follower1", "coupler2", "follower2"];
const CUTS: [Cut<'static>; 2] = [
    Cut {
        name: "pin1",
        rows: 2,
    },
    Cut {
        name: "pin2",
        rows: 2,
    },
];

impl FourBars {
    pub fn n(&self) -> usize {
        1 + 2 * self.loops.len()
    }

    /// Solves the two equations of each loop; the pivot is the smallest sine of the angle between
    /// coupler and follower.
    fn solve(&self, q: &[f64], sides: &[f64], out: &mut [f64]) -> Condition<f64> {
        let mut condition = Condition { pivot: 1.0 };
        for (k, bars) in self.loops.iter().enumerate() {
            let (coupler, follower) = (q[0] + q[1 + 2 * k], q[2 + 2 * k]);
            let sine = (coupler - follower).sin();
            let (x, y) = (sides[2 * k], sides[2 * k + 1]);
            out[2 * k] = -(x * follower.cos() + y * follower.sin()) / (bars.coupler * sine);
            out[2 * k + 1] = -(x * coupler.cos() + y * coupler.sin()) / (bars.follower * sine);
            condition = condition.worst(Condition { pivot: sine.abs() });
        }
        condition
    }

    /// The right-hand sides of all loops, two per loop: -f, or those of the velocities or the
    /// accelerations.
    fn sides(&self, each: impl Fn(usize, &Loop) -> [f64; 2]) -> Vec<f64> {
        self.loops
            .iter()
            .enumerate()
            .flat_map(|(k, bars)| each(k, bars))
            .collect()
    }

    /// The closure equations f(q), two per loop.
    fn f(&self, q: &[f64]) -> Vec<f64> {
        self.sides(|k, bars| {
            let (input, coupler, follower) = (q[0], q[0] + q[1 + 2 * k], q[2 + 2 * k]);
            [
                bars.input * input.cos() + bars.coupler * coupler.cos()
                    - bars.follower * follower.cos()
                    - bars.ground,
                bars.input * input.sin() + bars.coupler * coupler.sin()
                    - bars.follower * follower.sin(),
            ]
        })
    }

    /// The bias b = -(dA/dt) qd, two entries per loop.
    fn b(&self, q: &[f64], qd: &[f64]) -> Vec<f64> {
        self.sides(|k, bars| {
            let (coupler, follower) = (q[0] + q[1 + 2 * k], q[2 + 2 * k]);
            let input = bars.input * qd[0] * qd[0];
            let middle = bars.coupler * (qd[0] + qd[1 + 2 * k]).powi(2);
            let last = bars.follower * qd[2 + 2 * k].powi(2);
            [
                input * q[0].cos() + middle * coupler.cos() - last * follower.cos(),
                input * q[0].sin() + middle * coupler.sin() - last * follower.sin(),
            ]
        })
    }

    /// The constraint Jacobian A, row-major.
    fn a(&self, q: &[f64], out: &mut [f64]) {
        let n = self.n();
        out.fill(0.0);
        let input = self.driven(q, -1.0);
        for (k, bars) in self.loops.iter().enumerate() {
            let (coupler, follower) = (q[0] + q[1 + 2 * k], q[2 + 2 * k]);
            out[2 * k * n] = input[2 * k];
            out[(2 * k + 1) * n] = input[2 * k + 1];
            out[2 * k * n + 1 + 2 * k] = -bars.coupler * coupler.sin();
            out[(2 * k + 1) * n + 1 + 2 * k] = bars.coupler * coupler.cos();
            out[2 * k * n + 2 + 2 * k] = bars.follower * follower.sin();
            out[(2 * k + 1) * n + 2 + 2 * k] = -bars.follower * follower.cos();
        }
    }

    /// -A_i times the velocity of the input.
    fn driven(&self, q: &[f64], rate: f64) -> Vec<f64> {
        self.sides(|k, bars| {
            let coupler = q[0] + q[1 + 2 * k];
            [
                rate * (bars.input * q[0].sin() + bars.coupler * coupler.sin()),
                -rate * (bars.input * q[0].cos() + bars.coupler * coupler.cos()),
            ]
        })
    }
}

impl Model for FourBars {
    fn info(&self) -> Info<'_> {
        let n = self.n();
        Info {
            name: "four_bars",
            coordinates: &NAMES[..n],
            independent: &[0],
            dependent: &[1, 2, 3, 4][..n - 1],
            actuated: &[0],
            parameters: const { &[Parameter::new(Symbol::Rotor, "input")] },
            bodies: &[],
            cuts: &CUTS[..self.loops.len()],
            home: &self.home,
            rows: n - 1,
            ..Info::EMPTY
        }
    }

    fn eval(
        &self,
        function: Function,
        x: Arguments<'_, f64>,
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        Sizes::of(&self.info()).check(function.signature(), &x, out)?;
        let q = x.q;
        match function {
            Function::Constraints => out.copy_from_slice(&self.f(q)),
            Function::Jacobian => self.a(q, out),
            Function::Bias => out.copy_from_slice(&self.b(q, x.qd)),
            Function::NewtonStep => {
                let sides: Vec<f64> = self.f(q).iter().map(|f| -f).collect();
                return Ok(self.solve(q, &sides, out));
            }
            Function::DependentJacobian => {
                let n = self.n();
                let mut all = vec![0.0; (n - 1) * n];
                self.a(q, &mut all);
                for (row, all) in out.chunks_exact_mut(n - 1).zip(all.chunks_exact(n)) {
                    row.copy_from_slice(&all[1..]);
                }
            }
            Function::Velocities => {
                out[0] = x.qd_i[0];
                return Ok(self.solve(q, &self.driven(q, x.qd_i[0]), &mut out[1..]));
            }
            Function::Accelerations => {
                out[0] = x.qdd_i[0];
                let driven = self.driven(q, x.qdd_i[0]);
                let sides = driven.iter().zip(self.b(q, x.qd));
                let sides: Vec<f64> = sides.map(|(driven, b)| driven + b).collect();
                return Ok(self.solve(q, &sides, &mut out[1..]));
            }
            Function::Regressor => out[0] = x.qdd[0],
            Function::InverseDynamics => out[0] = x.phi[0] * x.qdd[0],
            Function::Gravity | Function::BiasForces => out[0] = 0.0,
            Function::MassMatrix => out[0] = x.phi[0],
            Function::AdaptiveRegressor => out[0] = x.qdd_r_i[0],
            Function::GeneralizedForces => out[0] = x.tau_actuated[0],
            Function::Poses | Function::Cones => {}
        }
        Ok(Condition::regular(1.0))
    }
}
