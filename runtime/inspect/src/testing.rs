//! Noise and models for tests.

#[allow(unreachable_pub, reason = "examples include the files too")]
pub(crate) mod models {
    include!(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../tests/models/pendulum.rs"
    ));
    include!(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../tests/models/pendulum_base.rs"
    ));
}

/// Numbers of a linear congruential generator.
pub(crate) struct Noise(u64);

impl Noise {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next number, uniformly distributed between 0 and 1.
    pub(crate) fn even(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / 2_f64.powi(31)
    }

    /// The next number, approximately normally distributed with standard deviation 1.
    pub(crate) fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.even()).sum::<f64>() - 6.0
    }
}
