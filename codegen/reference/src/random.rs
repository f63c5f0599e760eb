//! Seeded random numbers and random physically possible bodies.

use crate::mechanism::PARAMETERS_PER_BODY;
use crate::scalar::{identity, mul, rotation};

/// A small deterministic generator (splitmix64).
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// A generator with a given seed.
    pub fn new(seed: u64) -> Random {
        Random(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform between two bounds.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        let unit = (self.next() >> 11) as f64 / (1_u64 << 53) as f64;
        low + (high - low) * unit
    }

    /// Uniform in [-1, 1).
    pub fn signed(&mut self) -> f64 {
        self.uniform(-1.0, 1.0)
    }

    /// A vector of `n` numbers, uniform in [-size, size].
    pub fn vector(&mut self, n: usize, size: f64) -> Vec<f64> {
        (0..n).map(|_| self.uniform(-size, size)).collect()
    }
}

/// A rigid body: mass, centre of mass, and inertia about the centre of mass in the body's axes
/// (`Ixx Ixy Ixz Iyy Iyz Izz`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhysicalBody {
    /// Mass, kg.
    pub mass: f64,
    /// Centre of mass in the body's frame, m.
    pub com: [f64; 3],
    /// Inertia about the centre of mass, kg m^2.
    pub inertia: [f64; 6],
}

impl PhysicalBody {
    /// A body with a positive mass and principal moments that satisfy the triangle inequality.
    pub fn random(random: &mut Random) -> PhysicalBody {
        let mass = random.uniform(0.5, 4.0);
        let com = [0; 3].map(|_| random.uniform(-0.3, 0.3));
        // Second moments along three axes; the principal moments of inertia are sums of two of
        // them.
        let s = [0; 3].map(|_| mass * random.uniform(0.001, 0.04));
        let principal = [s[1] + s[2], s[2] + s[0], s[0] + s[1]];
        let mut r = identity();
        for k in 0..3 {
            r = mul(&r, &rotation(k, random.uniform(-3.0, 3.0)));
        }
        let entry = |i: usize, j: usize| (0..3).map(|k| r[i][k] * principal[k] * r[j][k]).sum();
        let inertia = [
            entry(0, 0),
            entry(0, 1),
            entry(0, 2),
            entry(1, 1),
            entry(1, 2),
            entry(2, 2),
        ];
        PhysicalBody { mass, com, inertia }
    }

    /// The ten parameters about the frame's origin, by the parallel axis theorem.
    pub fn parameters(&self) -> [f64; PARAMETERS_PER_BODY] {
        let PhysicalBody { mass, com, inertia } = *self;
        let [x, y, z] = com;
        [
            inertia[0] + mass * (y * y + z * z),
            inertia[1] - mass * x * y,
            inertia[2] - mass * x * z,
            inertia[3] + mass * (x * x + z * z),
            inertia[4] - mass * y * z,
            inertia[5] + mass * (x * x + y * y),
            mass * x,
            mass * y,
            mass * z,
            mass,
        ]
    }
}
