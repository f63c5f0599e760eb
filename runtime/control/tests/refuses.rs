//! What a closure refuses, and where it stays then.

use regen_control::{Closure, ClosureError, Outcome, closure};
use regen_generated::fourbar::{self, Fourbar};
use regen_generated::rps3::Rps3;
use regen_runtime::{Info, Model};

#[test]
fn wrong_sizes_and_lengths_are_errors() {
    let wrong = Closure::<f64, 9, 2, 6, 6, _>::new(&Rps3);
    let expected = ClosureError::Size {
        of: "independent coordinates",
        expected: 3,
        got: 2,
    };
    assert_eq!(wrong.unwrap_err(), expected);
    for length in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let wrong = Closure::<f64, 9, 3, 6, 6, _>::with_length(&Rps3, length);
        assert_eq!(wrong.unwrap_err(), ClosureError::Length);
    }
}

/// The 3-RPS with a home that is not closed.
#[derive(Debug)]
struct Open;

impl Model<f64> for Open {
    fn info(&self) -> Info<'_> {
        Info {
            home: &[0.0, 0.6, 1.0, 0.0, 0.0, 0.0, 0.6, 0.0, 0.6],
            ..<Rps3 as Model<f64>>::info(&Rps3)
        }
    }

    fn eval(
        &self,
        function: regen_runtime::Function,
        arguments: regen_runtime::Arguments<'_, f64>,
        out: &mut [f64],
    ) -> Result<regen_runtime::Condition<f64>, regen_runtime::SizeError> {
        Rps3.eval(function, arguments, out)
    }
}

#[test]
fn an_open_home_is_an_error() {
    let open = Closure::<f64, 9, 3, 6, 6, _>::new(&Open);
    assert_eq!(open.unwrap_err(), ClosureError::Home);
}

#[test]
fn an_unreachable_target_leaves_the_state_closed() {
    // longer than the legs allow: the branch ends before
    let mut closure = <closure!(fourbar::Fourbar, f64)>::new(&Fourbar).unwrap();
    let home = *closure.q();
    assert_eq!(closure.track(&[f64::NAN], 10), Outcome::NotFinite);
    assert_eq!(*closure.q(), home);
    let mut legs = Closure::<f64, 9, 3, 6, 6, _>::new(&Rps3).unwrap();
    let outcome = legs.track(&[0.6, 0.6, 3.0], 10_000);
    let at = match outcome {
        Outcome::Singular { at } | Outcome::Lost { at } => at,
        other => panic!("{other:?}"),
    };
    assert!(at > 0.1 && at < 1.0, "{at}");
    let mut f = [0.0; 6];
    Rps3.constraints(legs.q(), &mut f).unwrap();
    assert!(f.iter().all(|f: &f64| f.abs() < 1e-12), "{f:?}");
    // a state of another branch, or none, is not taken
    assert!(!legs.resume(&[0.3; 9]));
    legs.restart();
    assert_eq!(legs.track(&[0.6, 0.6, 0.62], 100), Outcome::Closed);
    let near = *legs.q();
    legs.restart();
    assert!(legs.resume(&near));
}

#[test]
fn a_target_whose_rates_overflow_is_refused_at_once() {
    let mut legs = Closure::<f64, 9, 3, 6, 6, _>::new(&Rps3).unwrap();
    let before = *legs.q();
    let far = [f64::MAX, -f64::MAX, f64::MAX];
    assert!(matches!(
        legs.track(&far, 100),
        Outcome::Singular { at: 0.0 }
    ));
    assert_eq!(*legs.q(), before);
}
