//! A body at a sampled state, and the quadratic forms of twists that its inertial parameters multiply.

use core::ops::{Add, Mul, Sub};

use super::float320::Float320;

/// A twist (w, v) of a body in its own frame at its own origin.
pub(super) type Twist = [Float320; 6];

/// A body at a state.
#[derive(Clone, Debug)]
pub(super) struct BodyAt {
    /// The twist for a unit rate of each independent coordinate.
    pub(super) twists: Vec<Twist>,
    /// Gravity in the body's frame, as the linear part of a twist.
    pub(super) gamma: Twist,
}

impl BodyAt {
    /// The twist at some rates of the independent coordinates.
    pub(super) fn moving(&self, rates: &[Float320]) -> Twist {
        let mut sum = [Float320::ZERO; 6];
        for (twist, rate) in self.twists.iter().zip(rates) {
            for (sum, x) in sum.iter_mut().zip(twist).filter(|(_, x)| !x.is_zero()) {
                *sum = *sum + *rate * *x;
            }
        }
        sum
    }
}

/// The derivative of the potential energy by the independent coordinate `j`, which is the negative
/// power of gravity at its unit rate, as coefficients of each body's parameters.
pub(super) fn weights(bodies: &[BodyAt], j: usize) -> Vec<[Float320; 10]> {
    let blocks = bodies.iter().map(|body| {
        let power = polar(&body.gamma, &body.twists[j]);
        power.map(|x| -x)
    });
    blocks.collect()
}

/// The symmetric form h: h(V, V) . phi / 2 is the kinetic energy of a body with the twist V.
pub(in crate::base) fn polar<S>(a: &[S; 6], b: &[S; 6]) -> [S; 10]
where
    S: Copy + Add<Output = S> + Sub<Output = S> + Mul<Output = S>,
{
    let ([ax, ay, az, au, av, aw], [bx, by, bz, bu, bv, bw]) = (*a, *b);
    [
        ax * bx,
        ax * by + ay * bx,
        ax * bz + az * bx,
        ay * by,
        ay * bz + az * by,
        az * bz,
        (av * bz - aw * by) + (bv * az - bw * ay),
        (aw * bx - au * bz) + (bw * ax - bu * az),
        (au * by - av * bx) + (bu * ay - bv * ax),
        au * bu + av * bv + aw * bw,
    ]
}
