//! The closure row of a screw, which relates the shift along its axis to the angle about it.
//!
//! For a cut whose frames A and B have coincident z axes, let h be the lead, z = zA.(pB - pA) the
//! shift and t the angle from xA to xB; then c = xA.xB is cos t and s = yA.xB is sin t. The row is
//! ```text
//! f = h (c sin(z/h) - s cos(z/h)) = h sin(z/h - t).
//! ```
//!
//! Near the closure it equals z - h t. Unlike that expression it is analytic in the coordinates,
//! since it needs no arc tangent, and the screw may make any number of turns.

use crate::kinematics::centripetal;
use crate::spec::Axis;
use crate::sym::{Ex, Graph, V3};

use super::rows::{Form, product_rule};
use super::view::{Column, View};

/// The screw that connects the two sides of a helical cut.
pub(super) struct Screw<'v> {
    a: &'v View,
    b: &'v View,
    gap: V3,
    lead: Ex,
    /// sin(z/h) and cos(z/h).
    sin: Ex,
    cos: Ex,
    /// `sin(z/h) xA - cos(z/h) yA`: the row is h times its dot product with xB.
    across: V3,
    /// `cos(z/h) xA + sin(z/h) yA`: xB equals it when the screw is closed.
    closed: V3,
}

impl<'v> Screw<'v> {
    pub(super) fn new(g: &mut Graph, lead: Ex, [a, b]: [&'v View; 2]) -> Self {
        let gap = g.sub3(&b.point, &a.point);
        let [x, y, z] = a.axes;
        let shift = g.dot3(&z, &gap);
        let angle = g.div(shift, lead).unwrap_or(Ex::ZERO);
        let (sin, cos) = g.sin_cos_of(angle);
        let minus_cos = g.neg(cos);
        let mut sum = |p: Ex, q: Ex| {
            let first = g.scale3(p, &x);
            g.add_scaled3(&first, q, &y)
        };
        let (across, closed) = (sum(sin, minus_cos), sum(cos, sin));
        Screw {
            a,
            b,
            gap,
            lead,
            sin,
            cos,
            across,
            closed,
        }
    }

    /// The closure residual f.
    pub(super) fn residual(&self, g: &mut Graph) -> Ex {
        let sine = g.dot3(&self.across, &self.b.axes[0]);
        g.mul(self.lead, sine)
    }

    /// cos(z/h - t), which is 1 when the screw is closed and -1 a half turn away.
    pub(super) fn agreement(&self, g: &mut Graph) -> Ex {
        g.dot3(&self.closed, &self.b.axes[0])
    }

    /// The entry of A for one side and one coordinate, before the side's sign.
    pub(super) fn entry(&self, g: &mut Graph, column: &Column, form: Form) -> Ex {
        let velocity = column.at(g, &self.b.point);
        let along = g.dot3(&self.a.axes[2], &velocity);
        if form == Form::OnClosure {
            let turning = g.dot3(&self.a.axes[2], &column.angular());
            let turning = g.mul(self.lead, turning);
            return g.sub(along, turning);
        }
        let cosine = self.agreement(g);
        let normal = g.cross(&self.b.axes[0], &self.across);
        let turning = g.dot3(&normal, &column.angular());
        let turning = g.mul(self.lead, turning);
        let along = g.mul(cosine, along);
        g.add(along, turning)
    }

    /// The second derivative of f at zero accelerations of the coordinates, as the symmetric
    /// bilinear form of the velocities and the reference velocities.
    pub(super) fn second(&self, g: &mut Graph, form: Form) -> Ex {
        let Screw { a, b, gap, .. } = self;
        let rates = (g.sub3(&b.v, &a.v), g.sub3(&b.vr, &a.vr));
        let acceleration = g.sub3(&b.a, &a.a);
        let along = product_rule(g, a, Axis::Z, gap, &rates, &acceleration);
        if form == Form::OnClosure {
            let alpha = g.sub3(&b.alpha, &a.alpha);
            let turning = g.dot3(&a.axes[2], &alpha);
            let turning = g.mul(self.lead, turning);
            return g.sub(along, turning);
        }
        // h (c'' sin - s'' cos), with the second derivatives of c and s
        let x = b.axes[0];
        let x_rates = (g.cross(&b.w, &x), g.cross(&b.wr, &x));
        let tangential = g.cross(&b.alpha, &x);
        let turned = centripetal(g, &b.w, &b.wr, &x);
        let x_second = g.add3(&tangential, &turned);
        let [c, s] = [Axis::X, Axis::Y].map(|i| product_rule(g, a, i, &x, &x_rates, &x_second));
        let (c, s) = (g.mul(self.sin, c), g.mul(self.cos, s));
        let turning = g.sub(c, s);
        let turning = g.mul(self.lead, turning);
        // z'' cos(z/h - t)
        let cosine = self.agreement(g);
        let along = g.mul(cosine, along);
        // 2 z' (c' cos + s' sin), with the rates of c and s while z/h is constant
        let normal = g.cross(&x, &self.closed);
        let relative = (g.sub3(&b.w, &a.w), g.sub3(&b.wr, &a.wr));
        let shift = |g: &mut Graph, w: &V3, rate: &V3| {
            let swing = g.cross(w, gap);
            let own = g.sub3(rate, &swing);
            g.dot3(&a.axes[2], &own)
        };
        let (z, zr) = (shift(g, &a.w, &rates.0), shift(g, &a.wr, &rates.1));
        let one = g.dot3(&normal, &relative.0);
        let two = g.dot3(&normal, &relative.1);
        let (one, two) = (g.mul(one, zr), g.mul(two, z));
        let both = g.add(one, two);
        // - z' z' f / h^2
        let sine = g.dot3(&self.across, &x);
        let squared = g.mul(z, zr);
        let curvature = g.mul(squared, sine);
        let curvature = g.div(curvature, self.lead).unwrap_or(Ex::ZERO);
        let sum = g.add(along, turning);
        let sum = g.add(sum, both);
        g.sub(sum, curvature)
    }
}
