//! The equations effort by effort. The columns that do not change with the shapes of friction are
//! reduced once; for each shape only the columns of friction are reflected and reduced.

use super::FrictionData;
use super::columns::{FrictionColumns, curved};
use crate::estimate::{EstimateError, QrFactor};
use crate::qr_update::{BLOCK, Reflection, reduce, reduce_and_keep, reflect};
use regen_runtime::Friction;
use regen_runtime::friction::SHAPES;

/// The linear columns of all efforts after their reduction.
#[derive(Clone, Debug)]
pub(super) struct Reduced {
    efforts: Vec<Effort>,
}

/// The rows of one effort that are used.
#[derive(Clone, Debug)]
struct Effort {
    /// The number of each row's equation.
    equations: Vec<usize>,
    /// The linear columns that are not zero in all rows.
    columns: Vec<usize>,
    /// The triangle of these columns, column by column, and its right side.
    r: Vec<f64>,
    z: Vec<f64>,
    blocks: Vec<Block>,
}

/// Rows that were reduced at a time.
#[derive(Clone, Debug)]
struct Block {
    reflections: Vec<Reflection>,
    /// What the reduction left of the columns, see [`reflect`], and of the efforts.
    columns: Vec<f64>,
    side: Vec<f64>,
}

/// The equations for given shapes: the linear columns, those of friction's coefficients, and the
/// derivatives of the latter by the logarithms of the shape parameters.
#[derive(Clone, Debug)]
pub(super) struct Linearised {
    all: QrFactor,
    /// The number of columns without derivatives.
    known: usize,
    /// The labels of the steps of the shape parameters.
    steps: Vec<String>,
    /// For each derivative the step that it belongs to, and the column that is differentiated.
    derived: Vec<(usize, usize)>,
}

impl Reduced {
    /// Reduces the linear columns of each effort.
    pub(super) fn of(data: &FrictionData) -> Result<Self, EstimateError> {
        let efforts = (0..data.dof()).map(|row| Effort::of(data, row));
        Ok(Self {
            efforts: efforts.collect::<Result<_, _>>()?,
        })
    }

    /// The equations for these shapes.
    pub(super) fn linearised(
        &self,
        data: &FrictionData,
        laws: &[Friction],
        shapes: &[[f64; SHAPES]],
    ) -> Result<Linearised, EstimateError> {
        let columns = FrictionColumns {
            laws,
            shapes,
            has_slopes: true,
        };
        let (mut derived, mut step, mut column) = (Vec::new(), 0, data.labels.len());
        for law in laws {
            for _ in law.shape_symbols() {
                derived.extend(curved(*law).into_iter().map(|c| (step, column + c)));
                step += 1;
            }
            column += law.coefficients().len();
        }
        Ok(Linearised {
            all: self.factor(data, &columns)?,
            known: column,
            steps: data.steps(laws),
            derived,
        })
    }

    /// The factor of the linear columns and these columns of friction, of which those behind the coefficients are
    /// without labels.
    pub(super) fn factor(
        &self,
        data: &FrictionData,
        columns: &FrictionColumns<'_>,
    ) -> Result<QrFactor, EstimateError> {
        let mut labels = data.labels.clone();
        labels.extend(data.coefficients(columns.laws));
        let behind = data.labels.len() + columns.count() - labels.len();
        labels.extend((0..behind).map(|k| format!("derivative {k}")));

        let places = columns.places(data);
        let mut own: Vec<OwnColumns> = self
            .efforts
            .iter()
            .enumerate()
            .map(|(row, effort)| OwnColumns::new(effort, row, &places))
            .collect();
        let (mut entries, dof) = (Vec::new(), data.dof());
        let mut next = vec![0; dof];
        data.visit_runs(&mut |run, first| {
            columns.entries(data, run, &mut entries)?;
            for (equation, &sample) in (first..).zip(&run.equations) {
                let values = &entries[sample * places.len()..][..places.len()];
                let rows = self.efforts.iter().zip(&mut own).zip(&mut next);
                for (row, ((effort, own), next)) in rows.enumerate() {
                    if effort.equations.get(*next) == Some(&equation) {
                        own.fill(*next, effort, values, data.weights[equation * dof + row]);
                        *next += 1;
                    }
                }
            }
            Ok(())
        })?;

        let n = labels.len();
        let mut all = QrFactor::new(labels);
        let (mut rows, mut rss) = (0, 0.0);
        for (effort, own) in self.efforts.iter().zip(own) {
            let (w, side, squares) = own.reduced(effort, data.labels.len(), n);
            all.push_block(&w, &side)?;
            rss += squares;
            rows += effort.equations.len();
        }
        with_rest(&all, rss, rows)
    }
}

/// The factor with further squared residuals, and with another number of rows.
fn with_rest(factor: &QrFactor, rss: f64, rows: usize) -> Result<QrFactor, EstimateError> {
    QrFactor::from_parts(
        factor.labels().to_vec(),
        factor.r().to_vec(),
        factor.z().to_vec(),
        factor.rss() + rss,
        rows,
    )
}

impl Effort {
    fn of(data: &FrictionData, row: usize) -> Result<Self, EstimateError> {
        let (dof, r) = (data.dof(), data.labels.len());
        let used = |k: &usize| data.weights[k * dof + row] != 0.0;
        let equations: Vec<usize> = (0..data.len()).filter(used).collect();
        let entry = |equation: usize, column: usize| data.w[(equation * r + column) * dof + row];
        let occurs = |c: &usize| equations.iter().any(|k| entry(*k, *c) != 0.0);
        let columns: Vec<usize> = (0..r).filter(occurs).collect();
        let n = columns.len();
        let (mut triangle, mut z) = (vec![0.0; n * n], vec![0.0; n]);
        let mut blocks = Vec::with_capacity(equations.len().div_ceil(BLOCK));
        for some in equations.chunks(BLOCK) {
            let mut block = Vec::with_capacity(n * some.len());
            for column in &columns {
                block.extend(some.iter().map(|k| entry(*k, *column)));
            }
            let mut side: Vec<f64> = some.iter().map(|k| data.tau[k * dof + row]).collect();
            let finite = |values: &[f64]| values.iter().all(|x| x.is_finite());
            if !finite(&block) || !finite(&side) {
                let first = some.first().copied().unwrap_or(0);
                return Err(EstimateError::NotFinite {
                    what: "w",
                    row: first,
                });
            }
            let reflections =
                reduce_and_keep(&mut triangle, &mut z, &mut block, &mut side, some.len());
            blocks.push(Block {
                reflections,
                columns: block,
                side,
            });
        }
        Ok(Self {
            equations,
            columns,
            r: triangle,
            z,
            blocks,
        })
    }
}

/// The columns of friction that act on one effort.
struct OwnColumns {
    /// The place of each column among the entries of a sample, and its number among the columns
    /// after the linear ones.
    places: Vec<(usize, usize)>,
    /// The entries of each block, column by column.
    blocks: Vec<Vec<f64>>,
}

impl OwnColumns {
    fn new(effort: &Effort, row: usize, places: &[(usize, usize)]) -> Self {
        let on_row = places.iter().enumerate().filter(|(_, (_, i))| *i == row);
        let mut places: Vec<(usize, usize)> = on_row.map(|(k, (column, _))| (k, *column)).collect();
        places.sort_by_key(|(_, column)| *column);
        let sizes = effort.blocks.iter().map(|block| block.side.len());
        Self {
            blocks: sizes.map(|rows| vec![0.0; rows * places.len()]).collect(),
            places,
        }
    }

    /// Fills in row number `at` from the entries of its sample.
    fn fill(&mut self, at: usize, effort: &Effort, values: &[f64], weight: f64) {
        let (block, row) = (at / BLOCK, at % BLOCK);
        let Some((entries, rows)) = self.blocks.get_mut(block).zip(effort.blocks.get(block)) else {
            return;
        };
        let columns = entries.chunks_exact_mut(rows.side.len().max(1));
        for (column, (place, _)) in columns.zip(&self.places) {
            column[row] = weight * values[*place];
        }
    }

    /// Reduces these columns after the linear ones. Returns rows of all `n` columns, of which the
    /// first `linear` are the linear ones, column by column, their right sides, and the sum of the
    /// squared residuals that the reduced rows do not contain.
    fn reduced(mut self, effort: &Effort, linear: usize, n: usize) -> (Vec<f64>, Vec<f64>, f64) {
        let (first, later) = (effort.columns.len(), self.places.len());
        let mut tops = vec![0.0; first * later];
        let (mut r, mut z) = (vec![0.0; later * later], vec![0.0; later]);
        let mut rss = 0.0;
        for (block, own) in effort.blocks.iter().zip(&mut self.blocks) {
            let rows = block.side.len();
            reflect(&block.reflections, &block.columns, &mut tops, own, rows);
            rss += reduce(&mut r, &mut z, own, &mut block.side.clone(), rows);
        }
        let height = first + later;
        let mut w = vec![0.0; height * n];
        for (k, column) in effort.columns.iter().enumerate() {
            w[column * height..][..first].copy_from_slice(&effort.r[k * first..][..first]);
        }
        for (k, (_, column)) in self.places.iter().enumerate() {
            let out = &mut w[(linear + column) * height..][..height];
            out[..first].copy_from_slice(&tops[k * first..][..first]);
            out[first..].copy_from_slice(&r[k * later..][..later]);
        }
        z.splice(0..0, effort.z.iter().copied());
        (w, z, rss)
    }
}

impl Linearised {
    /// The factor of the linear columns and of the columns of friction's coefficients.
    pub(super) fn factor(&self) -> Result<QrFactor, EstimateError> {
        let (n, known) = (self.all.columns(), self.known);
        let columns = self.all.r().chunks_exact(n.max(1)).take(known);
        let r = columns.flat_map(|c| c[..known].iter().copied()).collect();
        let (z, rest) = self.all.z().split_at(known);
        let rest: f64 = rest.iter().map(|x| x * x).sum();
        QrFactor::from_parts(
            self.all.labels()[..known].to_vec(),
            r,
            z.to_vec(),
            self.all.rss() + rest,
            self.all.rows(),
        )
    }

    /// The factor with one more column for each shape parameter: the derivative of the effort by
    /// the logarithm of that parameter, for the values `x` of the columns of
    /// [`factor`](Self::factor), times `reach`. The unknown of that column is 1 plus the step in
    /// units of `reach`.
    pub(super) fn with_steps(&self, x: &[f64], reach: f64) -> Result<QrFactor, EstimateError> {
        let (n, known) = (self.all.columns(), self.known);
        let mut w = self.all.r()[..known * n].to_vec();
        let mut z = self.all.z().to_vec();
        w.resize((known + self.steps.len()) * n, 0.0);
        let derivatives = self.all.r()[known * n..].chunks_exact(n.max(1));
        for (column, (step, of)) in derivatives.zip(&self.derived) {
            let factor = reach * x.get(*of).copied().unwrap_or(0.0);
            let out = &mut w[(known + step) * n..][..n];
            for ((sum, side), d) in out.iter_mut().zip(&mut z).zip(column) {
                *sum += factor * d;
                *side += factor * d;
            }
        }
        let labels = [&self.all.labels()[..known], &self.steps].concat();
        let mut factor = QrFactor::new(labels);
        factor.push_block(&w, &z)?;
        with_rest(&factor, self.all.rss(), self.all.rows())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::signals::Smoothing;
    use crate::states::Filtering;
    use crate::states::FrictionJoint;

    /// Equations of two efforts with the friction of three joints, one of which acts on one effort
    /// alone, in two runs, with rows that are left out and a linear column of zeros.
    fn data(filter: Smoothing) -> FrictionData {
        let joint = |(k, friction): (usize, Friction)| FrictionJoint {
            name: format!("q{k}"),
            friction,
        };
        let laws = [Friction::Stribeck, Friction::Power, Friction::Atan];
        let joints: Vec<FrictionJoint> = laws.into_iter().enumerate().map(joint).collect();
        let labels = ["a", "b", "c"].map(String::from);
        let mut data = FrictionData::new(&labels, &joints, 2)
            .unwrap()
            .filtered(Filtering {
                smoothing: filter,
                ..Filtering::default()
            });
        for k in 0..700 {
            let t = 0.01 * f64::from(k);
            let entry = |i: usize| (t * (1.0 + 0.3 * i as f64) + i as f64).sin();
            if k == 400 {
                data.interrupt();
            }
            let qd = [entry(1), 0.3 * entry(2), 2.0 * entry(3)];
            let directions = [1.0, 0.2, 0.0, 1.0, entry(4), 0.5];
            let known = core::iter::repeat_n(true, data.dof);
            data.push_sample(t, &qd, &directions, known).unwrap();
            let w = [entry(5), 0.0, entry(6), entry(7), 0.0, entry(8)];
            let weights = [2.0, if k % 9 == 0 { 0.0 } else { 0.5 }];
            if k % 400 > 30 && k % 400 < 280 && k % 5 != 0 {
                let tau = [entry(9) * qd[0].signum(), entry(10)];
                data.push_equations(t, &w, &tau, &weights).unwrap();
            }
        }
        data
    }

    /// Changes the entries of a row; also returns what is added to its effort.
    type Change<'a> = dyn Fn(&[f64]) -> (Vec<f64>, f64) + 'a;

    /// Reduces the rows one after the other, without those that are left out.
    fn directly(
        data: &FrictionData,
        columns: &FrictionColumns<'_>,
        change: &Change<'_>,
    ) -> QrFactor {
        let n = change(&vec![0.0; data.labels.len() + columns.count()])
            .0
            .len();
        let mut factor = QrFactor::new((0..n).map(|k| k.to_string()).collect());
        data.visit(columns, &mut |rows| {
            for i in (0..2).filter(|i| rows.weights[*i] != 0.0) {
                let row: Vec<f64> = rows.w.iter().skip(i).step_by(2).copied().collect();
                let (row, more) = change(&row);
                factor.push_block(&row, &[rows.tau[i] + more])?;
            }
            Ok(())
        })
        .unwrap();
        factor
    }

    /// Compares R^T R, R^T z, the squared residuals and the number of rows.
    fn assert_same(a: &QrFactor, b: &QrFactor) {
        let n = a.columns();
        assert_eq!((n, a.rows()), (b.columns(), b.rows()));
        let products = |f: &QrFactor| -> Vec<f64> {
            let columns = || f.r().chunks_exact(n).chain([f.z()]);
            let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(a, b)| a * b).sum::<f64>();
            let products = columns().flat_map(|x| columns().map(move |y| dot(x, y)));
            products.chain([f.rss()]).collect()
        };
        let (a, b) = (products(a), products(b));
        let largest = a.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        for (x, y) in a.iter().zip(&b) {
            assert!((x - y).abs() < 1e-13 * largest, "{x} {y}");
        }
    }

    #[test]
    fn factors_are_those_of_all_rows() {
        let shapes = [[0.2, 1.4], [0.7, 1.0], [3.0, 1.0]];
        let filter = Smoothing::Butterworth {
            order: 3,
            cutoff: 9.0,
        };
        for filter in [Smoothing::None, filter] {
            let data = data(filter);
            let laws = &data.laws.clone();
            let x: Vec<f64> = (0..12).map(|k| 0.4 + 0.3 * f64::from(k)).collect();
            let found = data.linearised(laws, &shapes).unwrap();
            let columns = FrictionColumns {
                laws,
                shapes: &shapes,
                has_slopes: true,
            };
            let whole = directly(&data, &columns, &|row| (row.to_vec(), 0.0));
            assert_same(&whole, &found.all);
            assert!(whole.rss() > 1.0);
            // a step has the sum of the slopes of its parameter times their coefficients, also beside the efforts
            let known = data.labels.len() + data.coefficients(laws).len();
            for reach in [1.0, 0.1] {
                let stepped = directly(&data, &columns, &|row| {
                    let mut steps = vec![0.0; found.steps.len()];
                    for (slope, (step, of)) in row[known..].iter().zip(&found.derived) {
                        steps[*step] += reach * x[*of] * slope;
                    }
                    let side = steps.iter().sum();
                    ([&row[..known], &steps].concat(), side)
                });
                assert_same(&stepped, &found.with_steps(&x, reach).unwrap());
            }
            let columns = FrictionColumns {
                has_slopes: false,
                ..columns
            };
            let plain = directly(&data, &columns, &|row| (row.to_vec(), 0.0));
            assert_same(&plain, &found.factor().unwrap());
            assert_same(&plain, &data.factor(laws, &shapes).unwrap());

            let linear = &data.linear_laws();
            let columns = FrictionColumns {
                laws: linear,
                shapes: &[],
                has_slopes: true,
            };
            let plain = directly(&data, &columns, &|row| (row.to_vec(), 0.0));
            assert_same(&plain, &data.linear_factor().unwrap());
        }
    }
}
