//! Springs, and efforts that depend on a joint's motion.

use super::types::{Function, Quantity, Spanned};
use crate::diag::Span;

/// A spring at a joint: the effort K (q - rest) that the joint needs is linear in its stiffness K.
#[derive(Clone, Debug)]
pub struct JointSpring {
    /// The value of the coordinate at which the spring is relaxed, rad or m.
    pub rest: Quantity,
}

/// The factor of an effort term: an expression in the coordinate of its joint, the coordinate's
/// rate, and constants.
#[derive(Clone, Debug)]
pub enum EffortExpr {
    /// A constant.
    Constant(Quantity),
    /// The joint's coordinate, rad or m.
    Q,
    /// The coordinate's rate, rad/s or m/s.
    Qd,
    /// Negation.
    Neg(Box<EffortExpr>),
    /// Sum.
    Add(Box<EffortExpr>, Box<EffortExpr>),
    /// Difference.
    Sub(Box<EffortExpr>, Box<EffortExpr>),
    /// Product.
    Mul(Box<EffortExpr>, Box<EffortExpr>),
    /// Quotient.
    Div(Box<EffortExpr>, Box<EffortExpr>),
    /// Power with a whole exponent from 1 to [`EffortExpr::MAX_EXPONENT`].
    Pow(Box<EffortExpr>, u32),
    /// A function of one argument.
    Call(Function, Box<EffortExpr>),
}

impl EffortExpr {
    /// The largest exponent of a power.
    pub const MAX_EXPONENT: u32 = 32;

    /// The constants of the expression, from left to right.
    pub(super) fn constants_mut(&mut self) -> Vec<&mut Quantity> {
        match self {
            EffortExpr::Constant(quantity) => vec![quantity],
            EffortExpr::Q | EffortExpr::Qd => Vec::new(),
            EffortExpr::Neg(a) | EffortExpr::Pow(a, _) | EffortExpr::Call(_, a) => {
                a.constants_mut()
            }
            EffortExpr::Add(a, b)
            | EffortExpr::Sub(a, b)
            | EffortExpr::Mul(a, b)
            | EffortExpr::Div(a, b) => {
                let mut all = a.constants_mut();
                all.extend(b.constants_mut());
                all
            }
        }
    }

    /// Whether the expression contains the coordinate's rate.
    pub fn uses_rate(&self) -> bool {
        match self {
            EffortExpr::Constant(_) | EffortExpr::Q => false,
            EffortExpr::Qd => true,
            EffortExpr::Neg(a) | EffortExpr::Pow(a, _) | EffortExpr::Call(_, a) => a.uses_rate(),
            EffortExpr::Add(a, b)
            | EffortExpr::Sub(a, b)
            | EffortExpr::Mul(a, b)
            | EffortExpr::Div(a, b) => a.uses_rate() || b.uses_rate(),
        }
    }
}

/// The force of a spring between two points at the distance d, N, along the line through them.
#[derive(Clone, Debug)]
pub enum SpringForce {
    /// The pull k (d - length), with the parameter k. Without a length, which is then unknown,
    /// the pull k d - kl, with the parameters k and kl = k length.
    Elastic {
        /// The length of the relaxed spring, m.
        length: Option<Quantity>,
    },
    /// A constant pull, the parameter f; negative where it pushes, as gas springs do.
    Constant,
}

impl SpringForce {
    /// The symbols of the spring's parameters, in order.
    pub fn symbols(&self) -> &'static [&'static str] {
        match self {
            SpringForce::Elastic { length: Some(_) } => &["k"],
            SpringForce::Elastic { length: None } => &["k", "kl"],
            SpringForce::Constant => &["f"],
        }
    }
}

/// An end of a spring: a point of a body.
#[derive(Clone, Debug)]
pub struct SpringEnd {
    /// Body label; `None` is the world.
    pub body: Option<Spanned<String>>,
    /// The point in the body's frame, m.
    pub xyz: [Quantity; 3],
}

/// A spring or a constant pull between points of two bodies.
#[derive(Clone, Debug)]
pub struct PointSpring {
    /// Unique name.
    pub name: Spanned<String>,
    /// The two points.
    pub ends: [SpringEnd; 2],
    /// Its force.
    pub force: SpringForce,
    /// Nominal values, SI, by symbol: `k`, `kl`, `f`.
    pub nominal: Vec<(Spanned<String>, Quantity)>,
    /// The place of the spring in the file.
    pub span: Span,
}
