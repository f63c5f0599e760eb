//! The variables of the programme: what is left when known and identical parameters are gone,
//! and the directions that the observations leave open.

use std::prelude::v1::*;
use std::vec;

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::program::Affine;
use super::{FeasibilityError, Layout, Options};

/// Singular values below this part of the largest are directions that nothing determines.
const RANK: f64 = 1e-11;

/// Where a parameter's value comes from.
#[derive(Clone, Copy)]
pub(super) enum Slot {
    Variable(usize),
    Known(f64),
}

/// The problem in variables that are left when known and identical ones are gone.
pub(super) struct Reduced {
    pub(super) slots: Vec<Slot>,
    pub(super) count: usize,
    /// The unit of each variable.
    pub(super) units: Vec<f64>,
}

impl Reduced {
    pub(super) fn new(layout: &Layout, options: &Options) -> Result<Self, FeasibilityError> {
        let mut same: Vec<usize> = (0..layout.len()).collect();
        for group in &options.identical {
            let mut bodies = group.iter().map(|label| layout.body(label));
            let Some(first) = bodies.next() else { continue };
            let first = first?;
            for other in bodies {
                for (a, b) in first.columns.iter().zip(other?.columns) {
                    let (from, to) = (same[b], same[*a]);
                    same.iter_mut()
                        .filter(|s| **s == from)
                        .for_each(|s| *s = to);
                }
            }
        }
        let mut known = vec![None; layout.len()];
        for (k, (label, value)) in options.known.iter().enumerate() {
            if !value.is_finite() {
                return Err(FeasibilityError::NotFinite {
                    what: "known",
                    index: k,
                });
            }
            known[same[layout.find(label)?]] = Some(*value);
        }
        let all = layout.units(options.scale);
        let mut places = vec![None; layout.len()];
        let mut units = Vec::new();
        let mut slots = Vec::with_capacity(layout.len());
        for representative in same {
            slots.push(match (known[representative], places[representative]) {
                (Some(value), _) => Slot::Known(value),
                (None, Some(variable)) => Slot::Variable(variable),
                (None, None) => {
                    places[representative] = Some(units.len());
                    units.push(all[representative]);
                    Slot::Variable(units.len() - 1)
                }
            });
        }
        Ok(Self {
            slots,
            count: units.len(),
            units,
        })
    }

    /// The columns of a matrix over all parameters, added up per variable, and what the known
    /// parameters contribute.
    pub(super) fn reduce(&self, matrix: &DMatrix<f64>) -> (DMatrix<f64>, DVector<f64>) {
        let mut out = DMatrix::zeros(matrix.nrows(), self.count);
        let mut constant = DVector::zeros(matrix.nrows());
        for (j, slot) in self.slots.iter().enumerate() {
            match slot {
                Slot::Variable(v) => {
                    let sum = out.column(*v) + matrix.column(j);
                    out.set_column(*v, &sum);
                }
                Slot::Known(value) => constant += matrix.column(j) * *value,
            }
        }
        (out, constant)
    }

    pub(super) fn expand(&self, x: &[f64]) -> Vec<f64> {
        let value = |slot: &Slot| match slot {
            Slot::Variable(v) => x[*v] * self.units[*v],
            Slot::Known(value) => *value,
        };
        self.slots.iter().map(value).collect()
    }

    /// A parameter divided by a unit, as an expression in the variables.
    pub(super) fn expression(&self, parameter: usize, unit: f64) -> Affine {
        match self.slots[parameter] {
            Slot::Variable(v) => Affine {
                terms: vec![(v, self.units[v] / unit)],
                constant: 0.0,
            },
            Slot::Known(value) => Affine {
                terms: Vec::new(),
                constant: value / unit,
            },
        }
    }
}

/// The right singular directions of a matrix.
pub(super) struct Directions {
    pub(super) rank: usize,
    inverse: DMatrix<f64>,
    /// Orthonormal, without effect.
    pub(super) null: Vec<DVector<f64>>,
}

impl Directions {
    /// The eigenvectors of A^T A would square the condition number; those of
    /// `[0 A^T; A 0]` do not, and its eigenvalues are the singular values with both signs.
    pub(super) fn of(a: &DMatrix<f64>) -> Self {
        let (m, n) = a.shape();
        let mut both = DMatrix::zeros(m + n, m + n);
        both.view_mut((n, 0), (m, n)).copy_from(a);
        both.view_mut((0, n), (n, m)).copy_from(&a.transpose());
        let eigen = SymmetricEigen::new(both);
        let largest = eigen.eigenvalues.amax();
        let mut inverse = DMatrix::zeros(n, m);
        let mut basis: Vec<DVector<f64>> = Vec::new();
        for (k, value) in eigen.eigenvalues.iter().enumerate() {
            if *value > RANK * largest {
                // v and u have length 1/sqrt(2) each
                let column = eigen.eigenvectors.column(k);
                let (v, u) = (
                    column.rows(0, n).into_owned(),
                    column.rows(n, m).into_owned(),
                );
                inverse += &v * u.transpose() * (2.0 / value);
                basis.push(v * core::f64::consts::SQRT_2);
            }
        }
        let rank = basis.len();
        let mut null: Vec<DVector<f64>> = Vec::new();
        while rank + null.len() < n {
            // the axis that is the farthest from what is there
            let part = |i: usize| -> f64 { basis.iter().chain(&null).map(|v| v[i] * v[i]).sum() };
            let parts: Vec<f64> = (0..n).map(part).collect();
            let axis = (1..n).fold(0, |best, i| if parts[i] < parts[best] { i } else { best });
            let mut v = DVector::zeros(n);
            v[axis] = 1.0;
            for _ in 0..2 {
                for other in basis.iter().chain(&null) {
                    let along = other.dot(&v);
                    v -= other * along;
                }
            }
            null.push(v.normalize());
        }
        Self {
            rank,
            inverse,
            null,
        }
    }

    pub(super) fn solve(&self, side: &DVector<f64>) -> DVector<f64> {
        &self.inverse * side
    }
}
