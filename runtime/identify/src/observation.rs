//! The observation matrix of a trajectory (Eq. 12): the regressor at many samples.

use regen_runtime::{Condition, Model, SizeError, State};

/// One state of a trajectory: n coordinates, velocities and accelerations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample<'a> {
    /// All coordinates, rad or m.
    pub q: &'a [f64],
    /// All velocities, rad/s or m/s.
    pub qd: &'a [f64],
    /// All accelerations, rad/s^2 or m/s^2.
    pub qdd: &'a [f64],
}

impl<'a> From<&'a State> for Sample<'a> {
    fn from(state: &'a State) -> Self {
        Self {
            q: &state.q,
            qd: &state.qd,
            qdd: &state.qdd,
        }
    }
}

/// The observation matrix: the regressors of all samples, stacked (Eq. 12).
#[derive(Clone, Debug, PartialEq)]
pub struct ObservationMatrix {
    /// The matrix W, `rows` times `columns`, column-major: column j starts at `j * rows`. The rows
    /// are sample by sample, `dof` rows each. Rows of a sample where A_e is singular may be
    /// infinite or NaN.
    pub w: Vec<f64>,
    /// The number of rows: dof times the number of samples.
    pub rows: usize,
    /// The number of columns, one per dynamic parameter.
    pub columns: usize,
    /// The number of rows of each sample, one per independent coordinate.
    pub dof: usize,
    /// The condition of A_e at each sample.
    pub conditions: Vec<Condition<f64>>,
}

/// Evaluates the regressor at every sample and stacks the results.
///
/// # Errors
/// When a sample's arrays do not fit the model.
///
/// ```
/// # mod models { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/slider_crank.rs")); }
/// # use models::SliderCrank;
/// use regen_identify::observation::{Sample, observation_matrix};
/// use regen_runtime::LoopClosure;
///
/// let model = SliderCrank::default();
/// let mut closure = LoopClosure::new(&model)?;
/// let states = [closure.solve_state(&[0.1], &[1.0], &[5.0])?, closure.solve_state(&[0.2], &[2.0], &[6.0])?];
/// let samples: Vec<Sample> = states.iter().map(Sample::from).collect();
/// let observation_matrix = observation_matrix(&model, &samples)?;
/// assert_eq!((observation_matrix.rows, observation_matrix.columns), (2, 3));
/// // The crank's inertia multiplies its accelerations, its friction the velocities.
/// assert_eq!(observation_matrix.column(0), [5.0, 6.0]);
/// assert_eq!(observation_matrix.column(1), [1.0, 2.0]);
/// # Ok::<(), regen_runtime::ClosureError>(())
/// ```
pub fn observation_matrix<M: Model<f64> + ?Sized>(
    model: &M,
    samples: &[Sample<'_>],
) -> Result<ObservationMatrix, SizeError> {
    let info = model.info();
    let (dof, columns) = (info.dof(), info.parameters.len());
    let rows = dof * samples.len();
    let mut w = vec![0.0; rows * columns];
    let mut block = vec![0.0; dof * columns];
    let mut conditions = Vec::with_capacity(samples.len());
    for (k, sample) in samples.iter().enumerate() {
        conditions.push(model.regressor(sample.q, sample.qd, sample.qdd, &mut block)?);
        for (j, column) in block.chunks_exact(dof.max(1)).enumerate() {
            let start = j * rows + k * dof;
            w[start..start + dof].copy_from_slice(column);
        }
    }
    Ok(ObservationMatrix {
        w,
        rows,
        columns,
        dof,
        conditions,
    })
}

impl ObservationMatrix {
    /// The column of the parameter with this index, `rows` long; empty if there is no such
    /// parameter.
    pub fn column(&self, parameter: usize) -> &[f64] {
        if parameter >= self.columns {
            return &[];
        }
        &self.w[parameter * self.rows..(parameter + 1) * self.rows]
    }

    /// Divides each column by the absolute value of its largest entry, zero columns by 1; returns
    /// the divisors: the diagonal of C^-1 of Eq. 27. Dividing the estimates of the scaled system by
    /// these divisors gives the parameters.
    #[must_use = "the divisors convert the estimates of the scaled system to the parameters"]
    pub fn scale_columns(&mut self) -> Vec<f64> {
        if self.rows == 0 {
            return vec![1.0; self.columns];
        }
        self.w
            .chunks_exact_mut(self.rows)
            .map(|column| {
                let largest = column.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
                let divisor = if largest > 0.0 { largest } else { 1.0 };
                for x in column {
                    *x /= divisor;
                }
                divisor
            })
            .collect()
    }
}
