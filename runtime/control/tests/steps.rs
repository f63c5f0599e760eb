//! How many of Newton's steps a motion takes.

use regen_control::{Closure, Outcome};
use regen_runtime::{Arguments, Condition, Function, Info, Model, SizeError};

/// Two coordinates on a curve: the closure equation with its derivatives by both. The second
/// coordinate is dependent; home is at zero.
#[derive(Debug)]
struct Curve(fn(f64, f64) -> [f64; 3]);

impl Model<f64> for Curve {
    fn info(&self) -> Info<'_> {
        Info {
            coordinates: &["along", "across"],
            independent: &[0],
            dependent: &[1],
            actuated: &[0],
            home: &[0.0, 0.0],
            rows: 1,
            ..Info::EMPTY
        }
    }

    fn eval(
        &self,
        function: Function,
        x: Arguments<'_, f64>,
        out: &mut [f64],
    ) -> Result<Condition<f64>, SizeError> {
        let [f, along, across] = (self.0)(x.q[0], x.q[1]);
        match function {
            Function::NewtonStep => out[0] = -f / across,
            Function::Velocities => out.copy_from_slice(&[x.qd_i[0], -along / across * x.qd_i[0]]),
            Function::DependentJacobian => out[0] = across,
            _ => unreachable!("{function:?}"),
        }
        Ok(Condition::regular(1.0))
    }
}

fn closure(curve: &Curve) -> Closure<'_, f64, 2, 1, 1, 1, Curve> {
    Closure::new(curve).unwrap()
}

/// Newton's method ends where the square of a step is a rounding error of coordinates of size one,
/// also if they are much smaller.
#[test]
fn a_step_whose_square_is_a_rounding_error_is_the_last_one_however_small_the_coordinates_are() {
    let parabola = Curve(|x, y| [y + y * y - x * x, -2.0 * x, 1.0 + 2.0 * y]);
    let mut own = closure(&parabola);
    assert_eq!(own.track(&[1e-5], 1), Outcome::Closed);
    let [x, y] = *own.q();
    assert!((y + y * y - x * x).abs() < 1e-16, "{y}");
}

/// The derivative by the dependent coordinate grows by the same part from step to step: one of 1/8
/// is accepted, and one of 1/4 refused.
#[test]
fn a_step_is_not_doubled_after_one_that_came_near_the_greatest_change() {
    let line = Curve(|x, y| {
        let factor = (3.0 * x).exp();
        [factor * y, 3.0 * factor * y, factor]
    });
    // one that is refused, and then one for each eighth of the way
    assert_eq!(closure(&line).track(&[1.0], 9), Outcome::Closed);
    let short = closure(&line).track(&[1.0], 8);
    assert_eq!(short, Outcome::Unfinished { at: 0.875 });
}
