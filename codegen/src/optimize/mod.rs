//! From expressions to a straight-line program: order of steps, sines and cosines of related
//! angles, shared factors, multiply-add, operation counts.

mod angles;
mod factor;
mod lower;
mod order;
mod program;
mod relations;

pub use lower::{Request, lower};
pub use program::{
    Argument, Group, Op, Operand, Operations, Output, Program, SolveStep, Step, Temp,
};
