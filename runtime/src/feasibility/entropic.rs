//! The log-det divergence as a part of the programme.

use std::prelude::v1::*;
use std::vec;

use nalgebra::Matrix4;

use super::inertia::TRIANGLE;
use super::program::{Affine, Program};

/// Adds `strength (trace(X) - ln det X)` for X = L^-1 J L^-T with the reference L L^T, or tells
/// that there is no L.
///
/// With a lower triangular V that has the diagonal d, `[X V; V^T diag(d)]` positive
/// semidefinite means `det X >= product of d`.
pub(super) fn divergence(
    program: &mut Program,
    entries: &[Affine],
    reference: &[[f64; 4]; 4],
    strength: f64,
) -> bool {
    let matrix = Matrix4::from_fn(|r, c| reference[r][c]);
    let Some(inverse) = matrix.cholesky().and_then(|l| l.l().try_inverse()) else {
        return false;
    };
    let entry = |r: usize, c: usize| {
        let at = TRIANGLE.iter().position(|p| *p == (r.min(c), r.max(c)));
        &entries[at.unwrap_or(0)]
    };
    let whitened = |i: usize, j: usize| {
        let mut sum = Affine::default();
        for r in 0..4 {
            for c in 0..4 {
                let factor = inverse[(i, r)] * inverse[(j, c)];
                let from = entry(r, c);
                sum.constant += factor * from.constant;
                for (v, f) in &from.terms {
                    match sum.terms.iter_mut().find(|(k, _)| k == v) {
                        Some((_, slot)) => *slot += factor * f,
                        None => sum.terms.push((*v, factor * f)),
                    }
                }
            }
        }
        sum
    };
    let variable = |v: usize| Affine {
        terms: vec![(v, 1.0)],
        constant: 0.0,
    };
    // V column by column, its diagonal first
    let first = program.variables(10);
    let place = |i: usize, j: usize| first + j * 4 - j * (j + 1) / 2 + i;
    let logarithms = program.variables(4);
    let mut triangle = Vec::with_capacity(36);
    for column in 0..8 {
        for row in 0..=column {
            triangle.push(match (row, column) {
                (r, c) if c < 4 => whitened(r, c),
                (r, c) if r < 4 && r >= c - 4 => variable(place(r, c - 4)),
                (r, c) if r == c => variable(place(c - 4, c - 4)),
                _ => Affine::default(),
            });
        }
    }
    program.semidefinite(8, &triangle);
    for k in 0..4 {
        let above = variable(place(k, k));
        program.below_logarithm(&variable(logarithms + k), &above);
        program.minimise(logarithms + k, -strength);
        for (v, factor) in whitened(k, k).terms {
            program.minimise(v, strength * factor);
        }
    }
    true
}
