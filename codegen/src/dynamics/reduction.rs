//! Reduction from all coordinates to the independent ones: the velocities of the closed mechanism
//! are `qd = J qd_i` with `J = [1; -X]` (Eq. 8, 10).

use crate::model::Model;
use crate::sym::{Ex, Graph};

/// The matrix J of `qd = J qd_i`: all coordinates by independent ones.
#[derive(Clone, Debug)]
pub struct Reduction {
    rows: Vec<Vec<Ex>>,
}

impl Reduction {
    /// Builds J from X, which is dependent by independent (empty for a tree).
    pub fn new(g: &mut Graph, model: &Model, x: &[Vec<Ex>]) -> Self {
        let width = model.independent.len();
        let mut rows = vec![vec![Ex::ZERO; width]; model.coordinates.len()];
        for (j, &c) in model.independent.iter().enumerate() {
            rows[c][j] = Ex::ONE;
        }
        for (row, &c) in x.iter().zip(&model.dependent) {
            rows[c] = row.iter().map(|e| g.neg(*e)).collect();
        }
        Reduction { rows }
    }

    /// The number of independent coordinates.
    pub fn width(&self) -> usize {
        self.rows.first().map_or(0, Vec::len)
    }

    /// The entry of J for a coordinate and the index of an independent one.
    pub fn at(&self, coordinate: usize, independent: usize) -> Ex {
        self.rows[coordinate][independent]
    }

    /// `J^T v`, which is v_i - X^T v_e; `v` is by coordinate.
    pub fn reduce(&self, g: &mut Graph, v: &[Ex]) -> Vec<Ex> {
        (0..self.width())
            .map(|j| {
                let column: Vec<Ex> = self.rows.iter().map(|r| r[j]).collect();
                g.dot(&column, v)
            })
            .collect()
    }

    /// `M J` for a matrix M whose columns are by coordinate.
    pub fn times(&self, g: &mut Graph, m: &[Vec<Ex>]) -> Vec<Vec<Ex>> {
        let columns: Vec<Vec<Ex>> = (0..self.width()).map(|j| self.column(j)).collect();
        m.iter()
            .map(|row| columns.iter().map(|column| g.dot(row, column)).collect())
            .collect()
    }

    /// `J^T M` for a matrix M whose rows are by coordinate.
    pub fn reduce_rows(&self, g: &mut Graph, m: &[Vec<Ex>]) -> Vec<Vec<Ex>> {
        let count = m.first().map_or(0, Vec::len);
        let mut reduced = vec![Vec::with_capacity(count); self.width()];
        for k in 0..count {
            let column: Vec<Ex> = m.iter().map(|row| row[k]).collect();
            for (row, entry) in reduced.iter_mut().zip(self.reduce(g, &column)) {
                row.push(entry);
            }
        }
        reduced
    }

    /// The rates of all coordinates for a unit rate of one independent one.
    pub fn column(&self, independent: usize) -> Vec<Ex> {
        self.rows.iter().map(|r| r[independent]).collect()
    }

    /// `J^T M J` for a symmetric M over all coordinates.
    pub fn reduce_matrix(&self, g: &mut Graph, m: &[Vec<Ex>]) -> Vec<Vec<Ex>> {
        let width = self.width();
        let n = self.rows.len();
        let columns: Vec<Vec<Ex>> = (0..width)
            .map(|j| self.rows.iter().map(|r| r[j]).collect())
            .collect();
        let mut reduced = vec![vec![Ex::ZERO; width]; width];
        for j in 0..width {
            let mj: Vec<Ex> = (0..n).map(|k| g.dot(&m[k], &columns[j])).collect();
            for i in 0..=j {
                let entry = g.dot(&columns[i], &mj);
                reduced[i][j] = entry;
                reduced[j][i] = entry;
            }
        }
        reduced
    }
}
