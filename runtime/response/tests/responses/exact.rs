//! Exact data give exact parameters.

use regen_response::respond;

use crate::arm::Arm;
use crate::picker::Picker;
use crate::twin::{Twin, off, worst};

#[test]
fn exact_responses_give_exact_parameters_of_a_five_bar() {
    let twin = Twin {
        duration: 1.0,
        ..Twin::new(&Picker, &[[30.0, 0.6]; 2])
    };
    let start = off(&twin.beta(), 0.1);
    let clock = std::time::Instant::now();
    let found = respond(&Picker, &Picker, &[twin.run()], &twin.setup(), &start, 0.95, &mut |k, s| println!("{k} {s:e}")).unwrap();
    println!("{:?} {} steps {} refused, {} windows", clock.elapsed(), found.steps, found.refused, found.windows);
    println!("{:?}\n{:?}", found.model.beta, twin.beta());
    println!("{:?}", found.undetermined);
    assert!(worst(&found.model.beta, &twin.beta()) < 1e-4);
}

#[test]
fn exact_responses_give_exact_parameters_of_an_arm() {
    let twin = Twin {
        duration: 1.0,
        ..Twin::new(&Arm, &[[300.0, 12.0], [60.0, 1.5]])
    };
    let start = off(&twin.beta(), 0.1);
    let clock = std::time::Instant::now();
    let found = respond(&Arm, &Arm, &[twin.run()], &twin.setup(), &start, 0.95, &mut |k, s| println!("{k} {s:e}")).unwrap();
    println!("{:?} {} steps {} refused, {} windows", clock.elapsed(), found.steps, found.refused, found.windows);
    println!("{:?}\n{:?}", found.model.beta, twin.beta());
    println!("{:?}", found.undetermined);
    assert!(worst(&found.model.beta, &twin.beta()) < 1e-4);
}
