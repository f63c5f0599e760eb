//! The row of a screw, which ties the shift along its axis to the angle about it.
//!
//! With the frames A and B of a cut whose z axes are one, the lead h, the shift z = zA.(pB - pA)
//! and the angle t from xA to xB, c = xA.xB is cos t and s = yA.xB is sin t. The row is
//!
//! ```text
//! f = h (c sin(z/h) - s cos(z/h)) = h sin(z/h - t).
//! ```
//!
//! Near the closure it is z - h t. Unlike this it is analytic in the coordinates, since it needs
//! no arc tangent, and a screw may make any number of turns.

use crate::kinematics::turned_twice;
use crate::spec::Axis;
use crate::sym::{Ex, Graph, V3};

use super::rows::{Form, product_rule};
use super::view::{Column, View};

/// A screw between two sides.
pub(super) struct Screw<'v> {
    a: &'v View,
    b: &'v View,
    gap: V3,
    lead: Ex,
    /// sin(z/h) and cos(z/h).
    sin: Ex,
    cos: Ex,
    /// `sin(z/h) xA - cos(z/h) yA`: the row is h times its product with xB.
    across: V3,
    /// `cos(z/h) xA + sin(z/h) yA`: where xB is when the screw is closed.
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

    /// f.
    pub(super) fn residual(&self, g: &mut Graph) -> Ex {
        let sine = g.dot3(&self.across, &self.b.axes[0]);
        g.mul(self.lead, sine)
    }

    /// cos(z/h - t).
    pub(super) fn agreement(&self, g: &mut Graph) -> Ex {
        g.dot3(&self.closed, &self.b.axes[0])
    }

    /// A side's entry of A in the column of a coordinate, but for the side's sign.
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

    /// The second derivative of f at zero accelerations of the coordinates, polar in the
    /// velocities.
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
        // the second derivatives of c and s, and h (c'' sin - s'' cos)
        let x = b.axes[0];
        let x_rates = (g.cross(&b.w, &x), g.cross(&b.wr, &x));
        let tangential = g.cross(&b.alpha, &x);
        let turned = turned_twice(g, &b.w, &b.wr, &x);
        let x_second = g.add3(&tangential, &turned);
        let [c, s] = [Axis::X, Axis::Y].map(|i| product_rule(g, a, i, &x, &x_rates, &x_second));
        let (c, s) = (g.mul(self.sin, c), g.mul(self.cos, s));
        let turning = g.sub(c, s);
        let turning = g.mul(self.lead, turning);
        // z'' cos(z/h - t)
        let cosine = self.agreement(g);
        let along = g.mul(cosine, along);
        // 2 z' (c' cos + s' sin), the rates of c and s at a rest of z/h
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
        let bent = g.mul(squared, sine);
        let bent = g.div(bent, self.lead).unwrap_or(Ex::ZERO);
        let sum = g.add(along, turning);
        let sum = g.add(sum, both);
        g.sub(sum, bent)
    }
}
