//! Frames, motions and twists of the links, as expressions.

mod centre;
mod chain;
mod frames;
mod geometry;
mod motion;
mod springs;
mod twist;

pub use centre::{Centre, centres};
pub use chain::{Chain, ChainJoint, Start, centripetal};
pub use frames::{FrameJoint, Frames, LinkFrame, Turn, unit};
pub use geometry::{Arguments, Geometry};
pub use motion::{LinkMotion, Rates, motions};
pub use springs::spring_column;
pub use twist::{Twist, carried_outward, twists};
