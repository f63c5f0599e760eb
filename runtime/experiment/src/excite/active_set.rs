//! The quadratic programme of one step by the dual active-set method of Goldfarb and Idnani (A
//! numerically stable dual method for solving strictly convex quadratic programs, 1983), where the
//! linearised limits can be met: there the elastic variable of [`Quadratic`](super::quadratic) is 0.
//!
//! The method starts at the minimum without limits and adds violated limits one by one. It needs one
//! step for each limit that is active in the end, and a few more, and each step takes a number of
//! operations quadratic in the number of variables, where an iteration of the interior-point method
//! forms and factors a matrix. Limits that are added later continue from the solution without them.

use super::dense::{Columns, add_scaled, inverse_factor};

/// A limit is met if it is exceeded by at most this, relative to half its range.
const TOLERANCE: f64 = 1e-10;
/// A bound of the box is met if it is exceeded by at most this part of the trust radius.
const BOX_TOLERANCE: f64 = 1e-10;
/// A limit depends linearly on the active ones where the part of its normal that is orthogonal to
/// theirs is at most the square root of this.
const DEPENDENT: f64 = 1e-18;
/// Steps per variable after which the method gives up; usually fewer than two suffice.
const STEPS_PER_VARIABLE: usize = 20;

/// A constraint of the programme, written as `normal . d >= a constant`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Constraint {
    /// The linearised limit with this index.
    Limit(usize),
    /// The upper bound of a variable.
    Upper(usize),
    /// The lower bound of a variable.
    Lower(usize),
}

/// Minimises `g.d + d^T B d / 2` over d, subject to `values_k + rows_k . d <= 0` for all limits k
/// and `|d_i| <= trust_radius`.
pub(super) struct ActiveSet<'a> {
    rows: &'a [Vec<f64>],
    values: &'a [f64],
    /// The length of each row, by which violations are compared.
    lengths: Vec<f64>,
    columns: Columns,
    trust_radius: f64,
    state: State,
}

/// The solution for the limits so far, from which a programme with more limits continues.
pub(super) struct State {
    /// The variables d.
    pub(super) d: Vec<f64>,
    /// The columns of J, n entries each: `J^T B J` is the unit matrix, and the first columns span the
    /// normals of the active constraints as `J^T N = (R, 0)`.
    j: Vec<Vec<f64>>,
    /// The columns of the upper triangle R, the k-th of k + 1 entries.
    r: Vec<Vec<f64>>,
    active: Vec<Constraint>,
    /// The Lagrange multipliers of `active`.
    multipliers: Vec<f64>,
}

impl State {
    /// The minimum without constraints; `None` where the matrix B is not positive definite.
    ///
    /// - `gradient`: g, n entries; `hessian`: B, symmetric, n x n.
    pub(super) fn new(gradient: &[f64], hessian: &[f64]) -> Option<Self> {
        let n = gradient.len();
        let j = inverse_factor(hessian, n)?;
        let mut d = vec![0.0; n];
        for column in &j {
            add_scaled(&mut d, column, -sum_of_products(column, gradient));
        }
        d.iter().all(|x| x.is_finite()).then_some(Self {
            d,
            j,
            r: Vec::new(),
            active: Vec::new(),
            multipliers: Vec::new(),
        })
    }

    /// The multipliers of the first `count` limits, not negative.
    pub(super) fn limit_multipliers(&self, count: usize) -> Vec<f64> {
        let mut out = vec![0.0; count];
        for (constraint, multiplier) in self.active.iter().zip(&self.multipliers) {
            if let Constraint::Limit(k) = constraint
                && let Some(slot) = out.get_mut(*k)
            {
                *slot = *multiplier;
            }
        }
        out
    }

    /// Makes the constraint active whose normal has the products `along` with the columns of J.
    fn add(&mut self, constraint: Constraint, multiplier: f64, mut along: Vec<f64>) {
        let first = self.active.len();
        for k in (first + 1..along.len()).rev() {
            let (a, b) = (along[k - 1], along[k]);
            if b == 0.0 {
                continue;
            }
            let length = length(a, b);
            let (cos, sin) = (a / length, b / length);
            (along[k - 1], along[k]) = (length, 0.0);
            let (left, right) = self.j.split_at_mut(k);
            rotate(&mut left[k - 1], &mut right[0], cos, sin);
        }
        along.truncate(first + 1);
        self.r.push(along);
        self.active.push(constraint);
        self.multipliers.push(multiplier);
    }

    /// Removes an active constraint.
    fn remove(&mut self, at: usize) {
        self.active.remove(at);
        self.multipliers.remove(at);
        self.r.remove(at);
        for k in at..self.r.len() {
            let own = &self.r[k];
            let (a, b) = (own[k], own[k + 1]);
            let length = length(a, b);
            if length > 0.0 {
                let (cos, sin) = (a / length, b / length);
                for column in &mut self.r[k..] {
                    let (x, y) = (column[k], column[k + 1]);
                    column[k] = cos * x + sin * y;
                    column[k + 1] = cos * y - sin * x;
                }
                let (left, right) = self.j.split_at_mut(k + 1);
                rotate(&mut left[k], &mut right[0], cos, sin);
            }
            self.r[k].truncate(k + 1);
        }
    }
}

/// The length of the vector (a, b), whose entries are far from overflow.
fn length(a: f64, b: f64) -> f64 {
    (a * a + b * b).sqrt()
}

/// Replaces `a` by `cos a + sin b` and `b` by `cos b - sin a`.
fn rotate(a: &mut [f64], b: &mut [f64], cos: f64, sin: f64) {
    for (a, b) in a.iter_mut().zip(b) {
        let (x, y) = (*a, *b);
        *a = cos * x + sin * y;
        *b = cos * y - sin * x;
    }
}

/// The scalar product, as eight sums side by side, which are then added in order: the compiler can
/// compute them in vector registers, and the result is the same in any.
fn sum_of_products(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let ((first, a_rest), (second, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let rest = a_rest.iter().zip(b_rest);
    let rest: f64 = rest.map(|(a, b)| a * b).sum();
    for (a, b) in first.iter().zip(second) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    sums.iter().sum::<f64>() + rest
}

impl<'a> ActiveSet<'a> {
    /// - `state`: of the programme without limits, or with the first ones of these;
    /// - `rows`: the gradient of each limit's value, n entries each; `values`: their values.
    pub(super) fn new(
        state: State,
        rows: &'a [Vec<f64>],
        values: &'a [f64],
        trust_radius: f64,
    ) -> Self {
        let lengths = rows.iter().map(|row| sum_of_products(row, row).sqrt());
        Self {
            rows,
            values,
            lengths: lengths.collect(),
            columns: Columns::of_rows(rows, state.d.len()),
            trust_radius,
            state,
        }
    }

    /// Solves the programme; `None` where no step meets all limits, or rounding errors prevent it.
    pub(super) fn solve(mut self) -> Option<State> {
        let most = STEPS_PER_VARIABLE * (1 + self.state.d.len());
        let mut slacks = self.slacks();
        for _ in 0..most {
            let Some((constraint, mut slack)) = self.most_violated(&slacks) else {
                return Some(self.state);
            };
            let mut multiplier = 0.0;
            loop {
                let along = self.along(constraint);
                let first = self.state.active.len();
                let (dependent, free) = along.split_at(first);
                let change = self.changes(dependent);
                // the longest step that leaves all multipliers positive, and what it makes zero
                let mut dual = f64::INFINITY;
                let mut blocking = None;
                for (at, (u, r)) in self.state.multipliers.iter().zip(&change).enumerate() {
                    if *r > 0.0 && u / r < dual {
                        (dual, blocking) = (u / r, Some(at));
                    }
                }
                // the step that meets the constraint
                let square: f64 = sum_of_products(free, free);
                let whole = sum_of_products(&along, &along);
                let primal = if square > DEPENDENT * whole {
                    -slack / square
                } else {
                    f64::INFINITY
                };
                let part = dual.min(primal);
                if !part.is_finite() {
                    return None;
                }
                for (u, r) in self.state.multipliers.iter_mut().zip(&change) {
                    *u = (*u - part * r).max(0.0);
                }
                multiplier += part;
                if primal.is_finite() {
                    let mut step = vec![0.0; self.state.d.len()];
                    for (column, factor) in self.state.j[first..].iter().zip(free) {
                        add_scaled(&mut step, column, *factor);
                    }
                    add_scaled(&mut self.state.d, &step, part);
                    slack += part * square;
                    let moved = self.columns.times(&step);
                    add_scaled(&mut slacks, &moved, -part);
                }
                if primal <= dual {
                    self.state.add(constraint, multiplier, along);
                    break;
                }
                if let Some(at) = blocking {
                    self.state.remove(at);
                }
            }
        }
        None
    }

    /// By how much each limit is met.
    fn slacks(&self) -> Vec<f64> {
        let along = self.columns.times(&self.state.d);
        let pairs = along.iter().zip(self.values);
        pairs.map(|(along, value)| -(value + along)).collect()
    }

    /// The constraint that is violated most, in the distance of d, and its slack; `slacks`: those of
    /// the limits.
    fn most_violated(&self, slacks: &[f64]) -> Option<(Constraint, f64)> {
        let mut found = None;
        let mut most = 0.0;
        let mut consider = |constraint: Constraint, slack: f64, length: f64, tolerance: f64| {
            if slack < -tolerance && slack < most * length {
                if self.state.active.contains(&constraint) {
                    return;
                }
                most = slack / length;
                found = Some((constraint, slack));
            }
        };
        for (k, (slack, length)) in slacks.iter().zip(&self.lengths).enumerate() {
            consider(Constraint::Limit(k), *slack, *length, TOLERANCE);
        }
        let tolerance = BOX_TOLERANCE * self.trust_radius;
        for (k, x) in self.state.d.iter().enumerate() {
            let radius = self.trust_radius;
            consider(Constraint::Upper(k), radius - x, 1.0, tolerance);
            consider(Constraint::Lower(k), radius + x, 1.0, tolerance);
        }
        found
    }

    /// The products of a constraint's normal with the columns of J.
    fn along(&self, constraint: Constraint) -> Vec<f64> {
        let columns = self.state.j.iter();
        match constraint {
            Constraint::Limit(k) => {
                let row = self.rows.get(k).map_or(&[][..], Vec::as_slice);
                columns.map(|c| -sum_of_products(c, row)).collect()
            }
            Constraint::Upper(k) => columns.map(|c| -c[k]).collect(),
            Constraint::Lower(k) => columns.map(|c| c[k]).collect(),
        }
    }

    /// By how much the multiplier of each active constraint falls for each unit of the new one:
    /// the solution of `R x = side`.
    fn changes(&self, side: &[f64]) -> Vec<f64> {
        let mut x = side.to_vec();
        for (k, column) in self.state.r.iter().enumerate().rev() {
            let (above, own) = x.split_at_mut(k);
            own[0] /= column[k];
            add_scaled(above, column, -own[0]);
        }
        x
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::quadratic::Quadratic;
    use super::*;

    /// The steps of random programmes are those of the interior-point method, also where limits are
    /// added to a solved programme.
    #[test]
    fn steps_are_those_of_the_interior_point_method() {
        let mut seed = 7_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 33) as f64 / 2_f64.powi(30) - 1.0
        };
        let mut active = 0;
        for case in 0..80 {
            let (n, k) = (1 + case % 11, case % 37);
            let root: Vec<f64> = (0..n * n).map(|_| random()).collect();
            let mut hessian = vec![0.0; n * n];
            for i in 0..n {
                for j in 0..n {
                    hessian[i * n + j] = (0..n).map(|l| root[i * n + l] * root[j * n + l]).sum();
                }
                hessian[i * n + i] += 0.1;
            }
            let gradient: Vec<f64> = (0..n).map(|_| 5.0 * random()).collect();
            let rows: Vec<Vec<f64>> = (0..k)
                .map(|_| (0..n).map(|_| 3.0 * random()).collect())
                .collect();
            // standing still meets all limits
            let values: Vec<f64> = (0..k).map(|_| -0.3 * random().abs()).collect();
            let trust_radius = 0.3;
            let expected = Quadratic {
                gradient: &gradient,
                hessian: &hessian,
                rows: &rows,
                values: &values,
                trust_radius,
                // exceeding a limit never pays
                penalty: 1e4,
            };
            let expected = expected.solve().unwrap();
            let mut state = State::new(&gradient, &hessian).unwrap();
            for count in [k / 2, k] {
                let (rows, values) = (&rows[..count], &values[..count]);
                state = ActiveSet::new(state, rows, values, trust_radius)
                    .solve()
                    .unwrap();
            }
            // the tolerance of the interior-point method is 1e-9 of sizes up to 1e4, and the Hessian
            // is at least 0.1
            for (found, expected) in state.d.iter().zip(&expected.d) {
                assert!(
                    (found - expected).abs() < 1e-4,
                    "{case}: {found} {expected}"
                );
            }
            let multipliers = state.limit_multipliers(k);
            for (found, expected) in multipliers.iter().zip(&expected.multipliers) {
                active += usize::from(*found > 1e-3);
                assert!(
                    (found - expected).abs() < 1e-2,
                    "{case}: {found} {expected}"
                );
            }
        }
        assert!(active > 30, "{active}");
    }

    #[test]
    fn limits_that_no_step_meets_have_no_solution() {
        let rows = [vec![1.0, 0.0], vec![-1.0, 0.0]];
        for (values, solved) in [
            ([-0.1, 0.05], true),
            ([0.1, 0.05], false),
            ([0.7, -1.0], false),
        ] {
            let state = State::new(&[0.3, 0.1], &[1.0, 0.0, 0.0, 1.0]).unwrap();
            let found = ActiveSet::new(state, &rows, &values, 0.5).solve();
            assert_eq!(found.is_some(), solved, "{values:?}");
        }
        assert!(State::new(&[1.0], &[-1.0]).is_none());
    }
}
