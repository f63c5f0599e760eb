//! Tests of the way from samples to parameters, on mechanisms whose equations are known in closed
//! form: balance of energy, robust weights, and states completed from measurements.
#![allow(clippy::unwrap_used, clippy::expect_used)]

#[path = "identification/coverage.rs"]
mod coverage;
#[path = "identification/delays.rs"]
mod delays;
#[path = "identification/digests.rs"]
mod digests;
#[path = "identification/doubts.rs"]
mod doubts;
#[path = "identification/energy.rs"]
mod energy;
#[path = "identification/gaps.rs"]
mod gaps;
#[path = "identification/held.rs"]
mod held;
#[path = "identification/instruments.rs"]
mod instruments;
#[path = "identification/motion.rs"]
mod motion;
#[path = "identification/observation.rs"]
mod observation;
#[path = "identification/reading.rs"]
mod reading;
#[path = "identification/robust.rs"]
mod robust;
#[path = "identification/sampling.rs"]
mod sampling;

#[allow(unreachable_pub, reason = "examples include the files too")]
mod models {
    pub(crate) mod pendulum {
        include!("../../tests/models/pendulum.rs");
        include!("../../tests/models/pendulum_base.rs");
    }
    pub(crate) mod slider_crank {
        include!("../../tests/models/slider_crank.rs");
        include!("../../tests/models/slider_crank_base.rs");
    }
}
