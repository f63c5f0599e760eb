//! The closure equations of each loop, expressed in a frame of the loop.
//!
//! The frame is free: rotating the rows does not change X = A_e^-1 A_i. It is always a frame within
//! the loop, because only there do redundant rows of the loop (the normal of a planar loop) stay
//! the same rows; in the world frame they change as the loop is moved about.

use crate::kinematics::{Frames, Rates, Start};
use crate::model::{Cut, Model};
use crate::sym::{Graph, ZERO3, transposed};

use super::rows::{Equations, Form, cut_equations};
use super::view::View;

/// The frame in which a loop's rows are expressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Viewpoint {
    /// The frame of the link on one side of the cut (0 is A, 1 is B).
    Side(usize),
    /// The frame in which the first joint of a side's chain is placed; it is fixed to the link
    /// that both chains start from.
    Base(usize),
}

impl Viewpoint {
    /// All viewpoints.
    pub const ALL: [Viewpoint; 4] = [
        Viewpoint::Side(0),
        Viewpoint::Side(1),
        Viewpoint::Base(0),
        Viewpoint::Base(1),
    ];
}

/// A loop: the cut, and the two chains from the last common link to the cut's sides.
#[derive(Clone, Debug)]
pub struct LoopEquations<'m> {
    cut: &'m Cut,
    chains: [Vec<usize>; 2],
    coordinates: usize,
}

impl<'m> LoopEquations<'m> {
    /// The loop that a cut closes.
    pub fn new(model: &'m Model, cut: &'m Cut) -> Self {
        let mut a = model.path(cut.sides[0].link);
        let mut b = model.path(cut.sides[1].link);
        let common = a.iter().zip(&b).take_while(|(x, y)| x == y).count();
        a.drain(..common);
        b.drain(..common);
        LoopEquations {
            cut,
            chains: [a, b],
            coordinates: model.coordinates.len(),
        }
    }

    /// The distinct viewpoints of this loop.
    pub fn viewpoints(&self) -> Vec<Viewpoint> {
        Viewpoint::ALL
            .into_iter()
            .filter(|v| match v {
                Viewpoint::Side(s) | Viewpoint::Base(s) => !self.chains[*s].is_empty(),
            })
            .collect()
    }

    /// The loop's rows in the axes of a viewpoint's frame, in the form that is valid where the loop
    /// is closed.
    pub fn expressed_in(
        &self,
        g: &mut Graph,
        frames: &Frames,
        view: Viewpoint,
        rates: Option<&Rates>,
    ) -> Equations {
        let start = match view {
            Viewpoint::Side(side) => View::back(g, frames, &self.chains[side]),
            Viewpoint::Base(side) => {
                let first = self.chains[side].first();
                let turned = first.map(|link| frames.placed(g, *link));
                turned.map_or_else(Start::own, |rotation| Start {
                    rotation: transposed(&rotation),
                    origin: ZERO3,
                })
            }
        };
        let mut view_of = |side: usize| {
            let (path, frame) = (&self.chains[side], &self.cut.sides[side]);
            if view == Viewpoint::Side(side) {
                View::own(g, frames, path, frame, rates)
            } else {
                View::along(g, frames, path, frame, &start, rates)
            }
        };
        let views = [view_of(0), view_of(1)];
        let n = self.coordinates;
        cut_equations(
            g,
            frames,
            n,
            self.cut,
            &views,
            Form::OnClosure,
            rates.is_some(),
        )
    }
}
