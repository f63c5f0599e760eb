//! Sets up the equations of a state of motion: equations of motion or energy balances.

use crate::estimate::{EstimateError, Origin};
use regen_runtime::{BaseModel, Status};

/// A sample of a log: a whole state of motion with its efforts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateSample<'a> {
    /// Time, s.
    pub time: f64,
    /// All coordinates, rad or m.
    pub q: &'a [f64],
    /// All velocities, rad/s or m/s.
    pub qd: &'a [f64],
    /// All accelerations, rad/s^2 or m/s^2.
    pub qdd: &'a [f64],
    /// The left side of Eq. 10 in the order of `Info::independent`, N or N m: see
    /// [`Model::generalized_forces`](regen_runtime::Model::generalized_forces).
    pub tau: &'a [f64],
    /// The efforts of the actuated joints as they were measured, in the order of
    /// `Info::actuated`, N or N m; empty where they are not known.
    pub efforts: &'a [f64],
    /// Whether each coordinate rests, or moves so slowly that noise decides on the direction of
    /// its friction; empty where that is not known.
    pub still: &'a [bool],
    /// The weight of each equation in this row, which multiplies the weight of the effort.
    pub weights: &'a [f64],
    /// Whether the row follows the one before it without a gap.
    pub follows: bool,
}

/// The kind of equations that are set up.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum EquationKind {
    /// The equations of motion (Eq. 20), one for each independent coordinate.
    #[default]
    Forces,
    /// The energy balance over windows of this length, which needs no accelerations: the
    /// work of the efforts is the change of kinetic energy plus the work against gravity and
    /// friction.
    Energy {
        /// The length of the windows, s.
        window: f64,
    },
}

impl EquationKind {
    /// The name of the kind in files.
    ///
    /// ```
    /// use regen_identify::identify::EquationKind;
    ///
    /// assert_eq!(EquationKind::Forces.name(), "forces");
    /// assert_eq!(EquationKind::Energy { window: 0.5 }.name(), "energy over 0.5 s");
    /// ```
    pub fn name(self) -> String {
        match self {
            Self::Forces => "forces".to_owned(),
            Self::Energy { window } => format!("energy over {window} s"),
        }
    }
}

/// The equations of one sample in the base parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Equations<'a> {
    /// The sample's time, s.
    pub time: f64,
    /// The regressor, column-major: one row for each entry of `tau`.
    pub w: &'a [f64],
    /// The right-hand sides, N or N m, or J; empty where the sample gives no equation.
    pub tau: &'a [f64],
    /// The factor on each equation; 0 where it is left out.
    pub weights: &'a [f64],
    /// Whether the sample follows the one before it without a gap.
    pub follows: bool,
}

/// Factor on the velocities so small that terms quadratic in them vanish, while their signs, on
/// which friction depends, remain.
const VANISHING_VELOCITY: f64 = 1e-150;

/// Sets up the equations of samples.
#[derive(Debug)]
pub struct EquationBuilder<'m, M: ?Sized> {
    model: &'m M,
    kind: EquationKind,
    /// For each base parameter, dynamic parameters for which it is 1 and all others are 0, as
    /// indices and values: the one it is named by, and those that the spec's choices about the
    /// base tie to it.
    alone: Vec<Vec<(usize, f64)>>,
    w: Vec<f64>,
    tau: Vec<f64>,
    weights: Vec<f64>,
    energy: Option<Balance>,
    singular: usize,
}

/// The current window of the energy balance.
#[derive(Clone, Debug)]
struct Balance {
    /// The time at the start, s.
    start: f64,
    /// The row of the kinetic energy at the start.
    kinetic: Vec<f64>,
    /// Integrals from the start: of `Power::row`, and of the efforts' power in J.
    dissipated: Vec<f64>,
    work: f64,
    last: Power,
    weights: f64,
}

/// The power at one sample.
#[derive(Clone, Debug)]
struct Power {
    time: f64,
    /// The row of the power against gravity and friction in the base parameters.
    row: Vec<f64>,
    /// The power of the efforts, W.
    efforts: f64,
}

impl<'m, M: BaseModel<f64> + ?Sized> EquationBuilder<'m, M> {
    /// Prepares the equations of a model.
    pub fn new(model: &'m M, kind: EquationKind) -> Self {
        let base = model.base_info();
        let size = model.info().parameters.len();
        let free = vec![0.0; base.free.len()];
        let alone = (0..base.base.len()).map(|k| {
            let mut unit = vec![0.0; base.base.len()];
            let mut phi = vec![0.0; size];
            if let Some(one) = unit.get_mut(k) {
                *one = 1.0;
            }
            // the lengths are the model's own, so this does not fail
            match model.parameters_from_base(&unit, &free, &mut phi) {
                Ok(()) => phi.into_iter().enumerate().filter(|x| x.1 != 0.0).collect(),
                Err(_) => Vec::new(),
            }
        });
        Self {
            model,
            kind,
            alone: alone.collect(),
            w: Vec::new(),
            tau: Vec::new(),
            weights: Vec::new(),
            energy: None,
            singular: 0,
        }
    }

    /// The robot, the model and the kind of these equations, as files of QR factors record them.
    pub fn origin(&self) -> Origin {
        let info = self.model.info();
        let efforts = match self.kind {
            EquationKind::Forces => info
                .independent
                .iter()
                .map(|&c| info.coordinates[c].to_owned())
                .collect(),
            EquationKind::Energy { .. } => vec!["energy".to_owned()],
        };
        let base = self.model.base_info().base.iter();
        Origin {
            robot: info.name.to_owned(),
            model: super::digest(self.model),
            kind: self.kind.name(),
            efforts,
            labels: base.map(|p| p.label.to_owned()).collect(),
        }
    }

    /// The number of samples that gave no equation because A_e is singular there.
    pub fn singular(&self) -> usize {
        self.singular
    }

    /// Sets up the equations of a sample; an energy balance at the sample that ends its window.
    ///
    /// # Errors
    /// When a length does not fit the model.
    pub fn observe(&mut self, row: &StateSample<'_>) -> Result<Equations<'_>, EstimateError> {
        self.tau.clear();
        self.weights.clear();
        let regular = match self.kind {
            EquationKind::Forces => self.forces(row)?,
            EquationKind::Energy { window } => self.energy(row, window)?,
        };
        if !regular {
            self.tau.clear();
            self.weights.clear();
            self.singular += 1;
            self.energy = None;
        }
        Ok(Equations {
            time: row.time,
            w: &self.w,
            tau: &self.tau,
            weights: &self.weights,
            follows: row.follows,
        })
    }

    fn forces(&mut self, row: &StateSample<'_>) -> Result<bool, EstimateError> {
        let dof = self.model.info().dof();
        self.w.clear();
        self.w.resize(dof * self.alone.len(), 0.0);
        let condition = self
            .model
            .base_regressor(row.q, row.qd, row.qdd, &mut self.w)?;
        self.tau.extend_from_slice(row.tau);
        self.weights.extend_from_slice(row.weights);
        super::require("tau", dof, self.tau.len())?;
        super::require("weights", dof, self.weights.len())?;
        Ok(condition.status() != Status::Singular && self.w.iter().all(|x| x.is_finite()))
    }

    fn energy(&mut self, row: &StateSample<'_>, window: f64) -> Result<bool, EstimateError> {
        let info = self.model.info();
        super::require("tau", info.dof(), row.tau.len())?;
        super::require("qd", info.coordinates.len(), row.qd.len())?;
        let Some((kinetic, power)) = self.power(row)? else {
            return Ok(false);
        };
        if !row.follows {
            self.energy = None;
        }
        let weights = row.weights.first().copied().unwrap_or(1.0);
        let mut balance = match self.energy.take() {
            Some(mut balance) => {
                let half = 0.5 * (power.time - balance.last.time);
                let rows = power.row.iter().zip(&balance.last.row);
                for (sum, (a, b)) in balance.dissipated.iter_mut().zip(rows) {
                    *sum += half * (a + b);
                }
                balance.work += half * (power.efforts + balance.last.efforts);
                balance.last = power;
                balance
            }
            None => Balance {
                start: power.time,
                kinetic: kinetic.clone(),
                dissipated: vec![0.0; power.row.len()],
                work: 0.0,
                last: power,
                weights,
            },
        };
        // a window ends at the first sample that completes its length, but for rounding of times
        if balance.last.time - balance.start >= window * (1.0 - 1e-9) {
            let gained = kinetic.iter().zip(&balance.kinetic).map(|(a, b)| a - b);
            let lost = gained.zip(&balance.dissipated).map(|(g, d)| g + d);
            self.w = lost.collect();
            self.tau.push(balance.work);
            self.weights.push(balance.weights);
            balance = Balance {
                start: balance.last.time,
                kinetic,
                dissipated: vec![0.0; balance.dissipated.len()],
                work: 0.0,
                last: balance.last,
                weights,
            };
        }
        self.energy = Some(balance);
        Ok(true)
    }

    /// The row of the kinetic energy and the power at a sample; `None` where A_e is singular.
    fn power(&self, row: &StateSample<'_>) -> Result<Option<(Vec<f64>, Power)>, EstimateError> {
        let info = self.model.info();
        let (dof, n) = (info.dof(), info.coordinates.len());
        let qd_i: Vec<f64> = info.independent.iter().map(|&c| row.qd[c]).collect();
        let size = dof * info.parameters.len();
        let still = vec![0.0; n];
        let none = vec![0.0; dof];
        let (mut moved, mut rest, mut slow) = (vec![0.0; size], vec![0.0; size], vec![0.0; size]);
        // at rest, accelerations fulfil the same closure equations as velocities, so that
        // W(q, 0, qd) - W(q, 0, 0) is the regressor of the momentum; times qd_i^T it gives 2 T
        let c = self.model.regressor(row.q, &still, row.qd, &mut moved)?;
        let _ = self.model.regressor(row.q, &still, &still, &mut rest)?;
        // vanishing velocities with full reference velocities leave gravity and friction only
        let creep: Vec<f64> = row.qd.iter().map(|v| VANISHING_VELOCITY * v).collect();
        // its condition is that of the same A_e as above
        let _ = self
            .model
            .adaptive_regressor(row.q, &creep, &qd_i, &none, &mut slow)?;
        let along = |matrix: &[f64], parameters: &[(usize, f64)]| -> f64 {
            let column = |(c, value): &(usize, f64)| -> f64 {
                let entries = matrix.iter().skip(c * dof).zip(&qd_i);
                value * entries.map(|(w, v)| w * v).sum::<f64>()
            };
            parameters.iter().map(column).sum()
        };
        let kinetic: Vec<f64> = self
            .alone
            .iter()
            .map(|own| 0.5 * (along(&moved, own) - along(&rest, own)))
            .collect();
        let power: Vec<f64> = self.alone.iter().map(|own| along(&slow, own)).collect();
        let finite = kinetic.iter().chain(&power).all(|x| x.is_finite());
        if c.status() == Status::Singular || !finite {
            return Ok(None);
        }
        let efforts = row.tau.iter().zip(&qd_i).map(|(t, v)| t * v).sum();
        Ok(Some((
            kinetic,
            Power {
                time: row.time,
                row: power,
                efforts,
            },
        )))
    }
}
