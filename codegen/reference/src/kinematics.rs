//! Frames of bodies as products of homogeneous 4 x 4 matrices, for real and dual coordinates. Dual
//! numbers along the curve q(t) give the time derivatives of the frames.

use num_dual::{Dual2, Dual2_64};

use crate::mechanism::{CutSide, Mechanism, SwingLimit};
use crate::scalar::{Mat4, Scalar, constant_matrix, mul, rotation, translation};

/// The frame of a node in the world, as a homogeneous matrix, with its first and second time
/// derivatives (m, m/s and m/s^2 in the last column).
#[derive(Clone, Debug)]
pub struct Motion {
    /// The frame.
    pub pose: Mat4<f64>,
    /// Its first derivative.
    pub rate: Mat4<f64>,
    /// Its second derivative.
    pub second: Mat4<f64>,
}

impl Mechanism {
    /// The frames of all nodes in the world, for the coordinates `q` (rad or m). A parent comes
    /// before its children in the list of nodes.
    pub fn frames<T: Scalar>(&self, q: &[T]) -> Vec<Mat4<T>> {
        let mut out: Vec<Mat4<T>> = Vec::with_capacity(self.nodes.len());
        for node in &self.nodes {
            let offset = constant_matrix(&node.offset);
            let placed = match node.parent {
                Some(parent) => mul(&out[parent], &offset),
                None => offset,
            };
            out.push(match node.motion {
                None => placed,
                Some(m) => {
                    let (axis, q) = (m.axis.index(), q[m.coordinate]);
                    let turned = mul(&placed, &rotation(axis, q * m.turn));
                    mul(&turned, &translation(axis, q * m.slide))
                }
            });
        }
        out
    }

    /// The frames of all nodes and their time derivatives, for the coordinates and their first and
    /// second time derivatives.
    pub fn motions(&self, q: &[f64], qd: &[f64], qdd: &[f64]) -> Vec<Motion> {
        let curve: Vec<Dual2_64> = (0..self.n())
            .map(|k| Dual2::new(q[k], qd[k], qdd[k]))
            .collect();
        self.frames(&curve)
            .iter()
            .map(|m| Motion {
                pose: m.map(|row| row.map(|x| x.re)),
                rate: m.map(|row| row.map(|x| x.v1)),
                second: m.map(|row| row.map(|x| x.v2)),
            })
            .collect()
    }

    /// The frames of the bodies in the world: the nine entries of the rotation matrix row by row,
    /// then the origin (m).
    pub fn poses(&self, q: &[f64]) -> Vec<[f64; 12]> {
        let frames = self.frames(q);
        self.bodies
            .iter()
            .map(|body| {
                let m = &frames[body.node];
                let mut out = [0.0; 12];
                for i in 0..3 {
                    out[3 * i..3 * i + 3].copy_from_slice(&m[i][..3]);
                    out[9 + i] = m[i][3];
                }
                out
            })
            .collect()
    }

    /// For each cone limit, the cosine of the angle between the z axes of its two frames.
    pub fn cone_cosines(&self, q: &[f64]) -> Vec<f64> {
        let frames = self.frames(q);
        let z = |side: &CutSide| {
            let frame = match side.node {
                Some(node) => mul(&frames[node], &side.offset),
                None => side.offset,
            };
            [frame[0][2], frame[1][2], frame[2][2]]
        };
        let cosine = |cone: &SwingLimit| {
            let (a, b) = (z(&cone.sides[0]), z(&cone.sides[1]));
            a.iter().zip(b).map(|(x, y)| x * y).sum()
        };
        self.cones.iter().map(cosine).collect()
    }
}
