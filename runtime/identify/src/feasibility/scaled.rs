//! The cones at a point, in the scaling of Nesterov and Todd.

use super::cones::Cone;
use super::symmetric::{
    self, Square, ZERO, cholesky, congruence, inverse, one, product, transposed, upper,
};
use super::triangle::Triangle;

/// Rows are reduced together until there are this many.
const ROWS_TOGETHER: usize = 12;

/// The scaling of one cone at a point, in which its matrix and its dual are the same diagonal
/// matrix.
pub(super) struct Scaled {
    pub(super) inverse: Square,
    pub(super) lambda: [f64; 4],
}

impl Scaled {
    /// Computes G with `G^-1 X G^-T = G^T S G = diag(lambda)`; `None` unless both matrices are
    /// positive definite.
    pub(super) fn new(at: &Square, dual: &Square, size: usize) -> Option<Self> {
        if size == 1 {
            return Self::of_one(at[0][0], dual[0][0]);
        }
        let l = cholesky(at, size)?;
        cholesky(dual, size)?;
        let middle = congruence(&transposed(&l), dual, size);
        let (squares, q) = symmetric::eigen(&middle, size);
        let mut lambda = [0.0; 4];
        let mut inverse = product(&transposed(&q), &inverse(&l, size));
        for k in 0..size {
            if squares[k].is_nan() || squares[k] <= 0.0 {
                return None;
            }
            lambda[k] = squares[k].sqrt();
            let root = lambda[k].sqrt();
            inverse[k].iter_mut().for_each(|x| *x *= root);
        }
        Some(Self { inverse, lambda })
    }

    /// The scaling of a cone of one row.
    fn of_one(at: f64, dual: f64) -> Option<Self> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let root = at.sqrt();
        let square = root * dual * root;
        if !positive(at) || !positive(dual) || !positive(square) {
            return None;
        }
        let lambda = square.sqrt();
        Some(Self {
            inverse: one(1.0 / root * lambda.sqrt()),
            lambda: [lambda, 0.0, 0.0, 0.0],
        })
    }

    /// The largest step that keeps `diag(lambda) + step d` positive semidefinite.
    pub(super) fn step(&self, d: &Square, size: usize) -> f64 {
        if size == 1 {
            let least = d[0][0] / self.lambda[0];
            return if least < 0.0 {
                -1.0 / least
            } else {
                f64::INFINITY
            };
        }
        let mut scaled = ZERO;
        for r in 0..size {
            for c in 0..size {
                scaled[r][c] = d[r][c] / (self.lambda[r] * self.lambda[c]).sqrt();
            }
        }
        let least = symmetric::smallest(&scaled, size);
        if least < 0.0 {
            -1.0 / least
        } else {
            f64::INFINITY
        }
    }
}

/// The number of entries in the upper triangle of a cone's matrix.
fn entries(cone: &Cone) -> usize {
    cone.size * (cone.size + 1) / 2
}

/// Cones that share variables with each other; with other groups they share only variables that
/// occur in all cones.
#[derive(Debug)]
struct Group {
    /// The variables, ascending.
    variables: Vec<usize>,
    cones: Vec<usize>,
    /// The number of entries of these cones.
    height: usize,
}

/// The groups of cones, by their first variables.
#[derive(Debug)]
pub(super) struct Groups {
    all: Vec<Group>,
    /// The place of each cone's first entry among those of all cones.
    places: Vec<usize>,
    variables: usize,
    /// The number of entries of all cones.
    pub(super) height: usize,
}

impl Groups {
    /// Finds the groups of cones over n variables.
    pub(super) fn of(cones: &[Cone], n: usize) -> Self {
        let mut counts = vec![0; n];
        let terms = cones.iter().flat_map(|cone| &cone.terms);
        terms.for_each(|(v, _)| counts[*v] += 1);
        let common = |v: usize| cones.len() > 1 && counts[v] == cones.len();
        let mut groups: Vec<Group> = Vec::new();
        let (mut places, mut height) = (Vec::with_capacity(cones.len()), 0);
        for (k, cone) in cones.iter().enumerate() {
            let own = cone.terms.iter().map(|(v, _)| *v);
            let mut own = Group {
                variables: own.filter(|v| !common(*v)).collect(),
                cones: vec![k],
                height: entries(cone),
            };
            places.push(height);
            height += own.height;
            let (joined, other): (Vec<Group>, Vec<Group>) = groups
                .into_iter()
                .partition(|g| g.variables.iter().any(|v| own.variables.contains(v)));
            groups = other;
            for group in joined {
                own.variables.extend(group.variables);
                own.cones.extend(group.cones);
                own.height += group.height;
            }
            own.variables.sort_unstable();
            own.variables.dedup();
            own.cones.sort_unstable();
            groups.push(own);
        }
        for group in &mut groups {
            group.variables.extend((0..n).filter(|v| common(*v)));
            group.variables.sort_unstable();
        }
        groups.sort_by_key(|g| (g.variables.first().copied(), g.cones.first().copied()));
        Self {
            all: groups,
            places,
            variables: n,
            height,
        }
    }

    /// The rows of the scaled cones.
    pub(super) fn rows<'a>(&'a self, cones: &'a [Cone], scaled: &[Scaled]) -> ScaledRows<'a> {
        let blocks = self.all.iter().map(|group| {
            let height = group.height;
            let mut block = vec![0.0; group.variables.len() * height];
            let mut first = 0;
            for k in &group.cones {
                let (cone, scaled) = (&cones[*k], &scaled[*k]);
                for (v, m) in &cone.terms {
                    let Ok(column) = group.variables.binary_search(v) else {
                        continue;
                    };
                    let own = congruence(&scaled.inverse, m, cone.size);
                    let column = &mut block[column * height + first..];
                    if cone.size == 1 {
                        column[0] += own[0][0];
                        continue;
                    }
                    for (slot, (r, c)) in column.iter_mut().zip(upper(cone.size)) {
                        *slot += if r == c {
                            own[r][c]
                        } else {
                            core::f64::consts::SQRT_2 * own[r][c]
                        };
                    }
                }
                first += entries(cone);
            }
            block
        });
        ScaledRows {
            groups: self,
            cones,
            blocks: blocks.collect(),
        }
    }
}

/// The derivatives of the entries of the scaled cones' matrices by the variables. Entries off the
/// diagonals are multiplied by sqrt(2); vectors of entries are in the order of the cones.
pub(super) struct ScaledRows<'a> {
    groups: &'a Groups,
    cones: &'a [Cone],
    /// For each group its entries by its variables, column by column.
    blocks: Vec<Vec<f64>>,
}

impl ScaledRows<'_> {
    /// Each group with its rows.
    fn each(&self) -> impl Iterator<Item = (&Group, &[f64])> {
        let blocks = self.blocks.iter().map(Vec::as_slice);
        self.groups.all.iter().zip(blocks)
    }

    /// The places of a group's entries among those of all cones.
    fn places(&self, group: &Group) -> impl Iterator<Item = usize> {
        group.cones.iter().flat_map(|k| {
            let first = self.groups.places[*k];
            first..first + entries(&self.cones[*k])
        })
    }

    /// The change of the entries for a change of the variables.
    pub(super) fn along(&self, x: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.groups.height];
        let mut sums = Vec::new();
        for (group, block) in self.each() {
            sums.clear();
            sums.resize(group.height, 0.0);
            for (v, column) in group
                .variables
                .iter()
                .zip(block.chunks_exact(group.height.max(1)))
            {
                for (sum, b) in sums.iter_mut().zip(column) {
                    *sum += b * x[*v];
                }
            }
            for (place, sum) in self.places(group).zip(&sums) {
                out[place] = *sum;
            }
        }
        out
    }

    /// Adds the products of all columns with a vector of entries to `out`, one for each variable.
    pub(super) fn add_products(&self, of: &[f64], out: &mut [f64]) {
        let mut own = Vec::new();
        for (group, block) in self.each() {
            own.clear();
            own.extend(self.places(group).map(|place| of[place]));
            for (v, column) in group
                .variables
                .iter()
                .zip(block.chunks_exact(group.height.max(1)))
            {
                out[*v] += column.iter().zip(&own).map(|(b, x)| b * x).sum::<f64>();
            }
        }
    }

    /// The triangular factor of these rows and of those of `triangle`.
    pub(super) fn reduced(&self, mut triangle: Triangle) -> Triangle {
        let n = self.groups.variables;
        let (mut together, mut first) = (Vec::new(), 0);
        for (group, block) in self.each() {
            let Some(start) = group.variables.first() else {
                continue;
            };
            if together.is_empty() {
                first = *start;
            }
            let width = n - first;
            let own = Triangle::of_columns(block.to_vec(), group.variables.len());
            for k in 0..group.variables.len() {
                let from = together.len();
                together.resize(from + width, 0.0);
                for (v, x) in group.variables[k..].iter().zip(own.row(k)) {
                    together[from + v - first] = *x;
                }
            }
            if together.len() >= ROWS_TOGETHER * width {
                triangle.add(&mut together, first);
                together.clear();
            }
        }
        triangle.add(&mut together, first);
        triangle
    }

    /// The variables of each group with the triangular factor of its rows.
    pub(super) fn triangles(&self) -> impl Iterator<Item = (&[usize], Triangle)> {
        self.each().map(|(group, block)| {
            let own = Triangle::of_columns(block.to_vec(), group.variables.len());
            (group.variables.as_slice(), own)
        })
    }

    /// The smallest entries whose products with the columns are `side`; `None` if there are none.
    pub(super) fn least_entries(&self, side: &[f64]) -> Option<Vec<f64>> {
        let triangle = self.reduced(Triangle::zero(self.groups.variables));
        Some(self.along(&triangle.solve(side)?))
    }
}
