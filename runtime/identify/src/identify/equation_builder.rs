//! Sets up the equations of identification, which are linear in the base parameters, from samples
//! of the motion and the efforts: equations of motion or energy balances.

use crate::estimate::{EstimateError, Origin};
use crate::states::StateSample;
use regen_runtime::{BaseModel, Condition, Status};

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
    /// The kind of a name in files; `None` if there is none.
    ///
    /// ```
    /// use regen_identify::identify::EquationKind;
    ///
    /// let kind = EquationKind::Energy { window: 0.5 };
    /// assert_eq!(EquationKind::of_name(&kind.name()), Some(kind));
    /// assert_eq!(EquationKind::of_name("energy"), None);
    /// ```
    pub fn of_name(name: &str) -> Option<Self> {
        let window = name.strip_prefix("energy over ");
        match window.and_then(|rest| rest.strip_suffix(" s")?.parse().ok()) {
            Some(window) if 0.0 < window && window < f64::INFINITY => Some(Self::Energy { window }),
            _ => (name == Self::Forces.name()).then_some(Self::Forces),
        }
    }

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
    /// The regressor of the r base parameters, `tau.len()` x r, column-major; its contents are
    /// stale where `tau` is empty.
    pub w: &'a [f64],
    /// The right-hand sides: `dof` entries in N or N m, or one entry in J; empty where A_e is
    /// singular, and at the samples inside a window of an energy balance.
    pub tau: &'a [f64],
    /// The factor on each equation, as many as `tau`; 0 for an equation that is left out.
    pub weights: &'a [f64],
    /// Whether the sample follows the one before it without a gap.
    pub follows: bool,
    /// The residuals of the equations with the right parameters if the controller holds efforts from
    /// row to row, filtered like `tau`; empty where that is not known.
    pub held: &'a [f64],
}

/// Factor on the velocities, so small that terms quadratic in them underflow to 0, while their
/// signs, on which friction depends, remain.
const VANISHING_VELOCITY: f64 = 1e-150;

/// Sets up the equations of one sample after the other.
#[derive(Debug)]
pub struct EquationBuilder<'m, M: ?Sized> {
    model: &'m M,
    kind: EquationKind,
    /// For each base parameter k, the sparse phi (indices and values) with beta_k = 1 and all other
    /// base parameters and free parameters 0, so that W phi is the k-th column of the base
    /// regressor: the parameter that beta_k is named by, and those that the spec's choices about
    /// the base tie to it.
    representatives: Vec<Vec<(usize, f64)>>,
    /// The buffers of [`Equations`].
    w: Vec<f64>,
    tau: Vec<f64>,
    weights: Vec<f64>,
    /// The current window of the energy balance; `None` before the first sample and after a gap or
    /// a singularity.
    balance: Option<Balance>,
    /// The number of samples without equations because A_e is singular.
    singular: usize,
}

/// The current window of the energy balance.
#[derive(Clone, Debug)]
struct Balance {
    /// The time at the start of the window, s.
    start_time: f64,
    /// The kinetic energy at the start as a row over the base parameters.
    initial_kinetic: Vec<f64>,
    /// The work against gravity and friction since the start as a row over the base parameters: the
    /// integral of `Power::row`.
    opposed: Vec<f64>,
    /// The work of the efforts since the start, J.
    work: f64,
    /// The power at the last sample, for the trapezoidal rule.
    last_power: Power,
    /// The weight of the equation: that of the first equation of the sample at the start.
    weight: f64,
}

/// The power at one sample.
#[derive(Clone, Debug)]
struct Power {
    /// The time of the sample, s.
    time: f64,
    /// The power against gravity and friction as a row over the base parameters.
    row: Vec<f64>,
    /// The power of the efforts, W.
    efforts: f64,
}

impl<'m, M: BaseModel<f64> + ?Sized> EquationBuilder<'m, M> {
    /// Prepares the equations of a model; the first energy balance starts at the first sample.
    pub fn new(model: &'m M, kind: EquationKind) -> Self {
        let base = model.base_info();
        let size = model.info().parameters.len();
        let free = vec![0.0; base.free.len()];
        let representatives = (0..base.base.len()).map(|k| {
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
            representatives: representatives.collect(),
            w: Vec::new(),
            tau: Vec::new(),
            weights: Vec::new(),
            balance: None,
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

    /// Sets up the equations of a sample.
    ///
    /// An energy balance gives one equation at the sample that ends its window; at the other
    /// samples, inside an incomplete window, `tau` of the result is empty. A gap or a singularity
    /// starts a new window. Where A_e is singular, `tau` is empty too.
    ///
    /// # Errors
    /// When a length does not fit the model.
    pub fn observe(&mut self, sample: &StateSample<'_>) -> Result<Equations<'_>, EstimateError> {
        self.tau.clear();
        self.weights.clear();
        let regular = match self.kind {
            EquationKind::Forces => self.set_up_forces(sample)?,
            EquationKind::Energy { window } => self.extend_balance(sample, window)?,
        };
        Ok(self.finished(sample, regular))
    }

    /// The equations of motion of a sample whose base regressor is known; `None` where A_e is
    /// singular.
    ///
    /// - `w`: its entries, column by column; `condition`: that of the function that computed them.
    ///
    /// # Errors
    /// When a length does not fit the model.
    pub(super) fn observe_computed<'a>(
        &mut self,
        sample: &StateSample<'a>,
        w: &'a [f64],
        condition: Condition<f64>,
    ) -> Result<Option<Equations<'a>>, EstimateError> {
        if !self.is_regular(sample, w, condition)? {
            self.skip();
            return Ok(None);
        }
        Ok(Some(Equations {
            time: sample.time,
            w,
            tau: sample.tau,
            weights: sample.weights,
            follows: sample.follows,
            held: &[],
        }))
    }

    /// Counts a sample where A_e is singular, which ends the window of an energy balance.
    fn skip(&mut self) {
        self.singular += 1;
        self.balance = None;
    }

    /// The equations as they were set up; none where A_e is singular.
    fn finished(&mut self, sample: &StateSample<'_>, regular: bool) -> Equations<'_> {
        if !regular {
            self.tau.clear();
            self.weights.clear();
            self.skip();
        }
        Equations {
            time: sample.time,
            w: &self.w,
            tau: &self.tau,
            weights: &self.weights,
            follows: sample.follows,
            held: &[],
        }
    }

    /// Sets up the equations of motion at a sample; returns false where A_e is singular.
    fn set_up_forces(&mut self, sample: &StateSample<'_>) -> Result<bool, EstimateError> {
        let dof = self.model.info().dof();
        self.w.clear();
        self.w.resize(dof * self.representatives.len(), 0.0);
        let condition = self
            .model
            .base_regressor(sample.q, sample.qd, sample.qdd, &mut self.w)?;
        self.set_sides(sample, condition)
    }

    /// Sets efforts and weights of the equations of motion; returns false where A_e is singular.
    fn set_sides(
        &mut self,
        sample: &StateSample<'_>,
        condition: Condition<f64>,
    ) -> Result<bool, EstimateError> {
        self.tau.extend_from_slice(sample.tau);
        self.weights.extend_from_slice(sample.weights);
        self.is_regular(sample, &self.w, condition)
    }

    /// Whether a sample with this base regressor gives equations of motion.
    fn is_regular(
        &self,
        sample: &StateSample<'_>,
        w: &[f64],
        condition: Condition<f64>,
    ) -> Result<bool, EstimateError> {
        let dof = self.model.info().dof();
        crate::estimate::require("tau", dof, sample.tau.len())?;
        crate::estimate::require("weights", dof, sample.weights.len())?;
        Ok(condition.status() != Status::Singular && all_finite(w))
    }

    /// Extends the energy balance by a sample, and sets up its equation if the sample ends the
    /// window; returns false where A_e is singular.
    fn extend_balance(
        &mut self,
        sample: &StateSample<'_>,
        window: f64,
    ) -> Result<bool, EstimateError> {
        let info = self.model.info();
        crate::estimate::require("tau", info.dof(), sample.tau.len())?;
        crate::estimate::require("qd", info.coordinates.len(), sample.qd.len())?;
        if sample.bridged || sample.weights.contains(&0.0) {
            // neither the work across a gap nor that of an effort without a value is known
            self.balance = None;
            return Ok(true);
        }
        let Some((kinetic, power)) = self.power(sample)? else {
            return Ok(false);
        };
        if !sample.follows {
            self.balance = None;
        }
        let weight = sample.weights.first().copied().unwrap_or(1.0);
        let mut balance = match self.balance.take() {
            Some(mut balance) => {
                let half = 0.5 * (power.time - balance.last_power.time);
                let rows = power.row.iter().zip(&balance.last_power.row);
                for (sum, (a, b)) in balance.opposed.iter_mut().zip(rows) {
                    *sum += half * (a + b);
                }
                balance.work += half * (power.efforts + balance.last_power.efforts);
                balance.last_power = power;
                balance
            }
            None => Balance {
                start_time: power.time,
                initial_kinetic: kinetic.clone(),
                opposed: vec![0.0; power.row.len()],
                work: 0.0,
                last_power: power,
                weight,
            },
        };
        // a window ends at the first sample that completes its length, up to rounding of the times
        if balance.last_power.time - balance.start_time >= window * (1.0 - 1e-9) {
            let kinetic_change = kinetic
                .iter()
                .zip(&balance.initial_kinetic)
                .map(|(a, b)| a - b);
            let equation_row = kinetic_change.zip(&balance.opposed).map(|(g, d)| g + d);
            self.w = equation_row.collect();
            self.tau.push(balance.work);
            self.weights.push(balance.weight);
            balance = Balance {
                start_time: balance.last_power.time,
                initial_kinetic: kinetic,
                opposed: vec![0.0; balance.opposed.len()],
                work: 0.0,
                last_power: balance.last_power,
                weight,
            };
        }
        self.balance = Some(balance);
        Ok(true)
    }

    /// The kinetic energy at a sample as a row over the base parameters, and the power; `None`
    /// where A_e is singular.
    fn power(&self, sample: &StateSample<'_>) -> Result<Option<(Vec<f64>, Power)>, EstimateError> {
        let info = self.model.info();
        let (dof, n) = (info.dof(), info.coordinates.len());
        let qd_i: Vec<f64> = info.independent.iter().map(|&c| sample.qd[c]).collect();
        let size = dof * info.parameters.len();
        let zero_qd = vec![0.0; n];
        let zero_qdd_i = vec![0.0; dof];
        let (mut w_accelerated, mut w_rest, mut w_opposing) =
            (vec![0.0; size], vec![0.0; size], vec![0.0; size]);
        // at rest, accelerations fulfil the same closure equations as velocities, so that
        // W(q, 0, qd) - W(q, 0, 0) is the regressor of the momentum; times qd_i^T it gives 2 T
        let condition = self
            .model
            .regressor(sample.q, &zero_qd, sample.qd, &mut w_accelerated)?;
        let _ = self
            .model
            .regressor(sample.q, &zero_qd, &zero_qd, &mut w_rest)?;
        // vanishing velocities with full reference velocities leave gravity and friction only
        let vanishing_qd: Vec<f64> = sample.qd.iter().map(|v| VANISHING_VELOCITY * v).collect();
        // its condition is that of the same A_e as above
        let _ = self.model.adaptive_regressor(
            sample.q,
            &vanishing_qd,
            &qd_i,
            &zero_qdd_i,
            &mut w_opposing,
        )?;
        // qd_i^T W phi
        let power_of = |matrix: &[f64], parameters: &[(usize, f64)]| -> f64 {
            let column = |(c, value): &(usize, f64)| -> f64 {
                let entries = matrix.iter().skip(c * dof).zip(&qd_i);
                value * entries.map(|(w, v)| w * v).sum::<f64>()
            };
            parameters.iter().map(column).sum()
        };
        let kinetic: Vec<f64> = self
            .representatives
            .iter()
            .map(|phi| 0.5 * (power_of(&w_accelerated, phi) - power_of(&w_rest, phi)))
            .collect();
        let opposing_power: Vec<f64> = self
            .representatives
            .iter()
            .map(|phi| power_of(&w_opposing, phi))
            .collect();
        let finite = kinetic.iter().chain(&opposing_power).all(|x| x.is_finite());
        if condition.status() == Status::Singular || !finite {
            return Ok(None);
        }
        let efforts = sample.tau.iter().zip(&qd_i).map(|(t, v)| t * v).sum();
        Ok(Some((
            kinetic,
            Power {
                time: sample.time,
                row: opposing_power,
                efforts,
            },
        )))
    }
}

/// Whether all numbers are finite; looks at all of them, without a branch for each.
fn all_finite(values: &[f64]) -> bool {
    values.iter().fold(true, |finite, x| finite & x.is_finite())
}
