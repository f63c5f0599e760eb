//! Unknown drive gains, and payloads that some runs carry, in rehearsals.

use regen_experiment::instruments::instrumental_with_gains;
use regen_identify::data::{Assignment, Quantity, Run};
use regen_identify::gains::{KnownPayload, Plan};
use regen_identify::model::{Gain, IdentifiedModel, Interval};
use regen_identify::session::{Session, loaded_residuals, with_gains};
use regen_response::Number;
use regen_runtime::{BaseModel, Info, Model, Symbol};

use crate::error::RehearseError;
use crate::estimate::{Estimated, Estimator, Made, converged, gains, read};

/// What the runs carry, and which efforts are logged as currents of unknown gain.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Loads {
    /// All payloads of the model, with what is known of them; the simulated ones have these values.
    pub payloads: Vec<KnownPayload>,
    /// For each run, the payload that it carries, as an index into `payloads`; `None`, or no entry,
    /// if it carries none. The run that is only predicted comes last.
    pub carried: Vec<Option<usize>>,
    /// The coordinates whose efforts are logged as currents of unknown gain, with their true gains,
    /// N m/A or N/A, not 0.
    pub gains: Vec<(String, f64)>,
}

/// The names of a payload's values, see [`regen_identify::model::PayloadValue`].
const VALUES: [&str; 10] = [
    "m", "cx", "cy", "cz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz",
];

impl Loads {
    /// The payload that a run carries.
    pub(crate) fn of_run(&self, number: usize) -> Option<&KnownPayload> {
        let carried = self.carried.get(number).copied().flatten();
        carried.and_then(|k| self.payloads.get(k))
    }

    /// The labels of the payloads.
    fn bodies(&self) -> Vec<String> {
        self.payloads.iter().map(|own| own.body.clone()).collect()
    }

    /// The payloads that some run carries.
    fn used(&self) -> impl Iterator<Item = &KnownPayload> {
        let used = |k: &usize| self.carried.contains(&Some(*k));
        let all = self.payloads.iter().enumerate();
        all.filter(move |(k, _)| used(k)).map(|(_, own)| own)
    }

    /// The parameters, with the known values of the payloads in place of their nominal ones.
    pub(crate) fn known(&self, info: &Info<'_>, parameters: &[f64]) -> Vec<f64> {
        let mut out = parameters.to_vec();
        for payload in &self.payloads {
            let places = places(info, &payload.body);
            let ten = places.map(|place| place.and_then(|k| out.get(k)).copied().unwrap_or(0.0));
            let mut values = about_centre(&ten);
            if let Some(mass) = payload.mass {
                values[0] = mass;
            }
            if let Some(com) = payload.com {
                values[1..4].copy_from_slice(&com);
            }
            if let Some(inertia) = payload.inertia {
                values[4..].copy_from_slice(&inertia);
            }
            for (place, value) in places.iter().zip(about_origin(&values)) {
                if let Some(slot) = place.and_then(|k| out.get_mut(k)) {
                    *slot = value;
                }
            }
        }
        out
    }

    /// The parameters of a run: those of payloads that it does not carry are 0.
    pub(crate) fn carrying(&self, info: &Info<'_>, known: &[f64], number: usize) -> Vec<f64> {
        let mut out = known.to_vec();
        let carried = self.of_run(number).map(|own| own.body.as_str());
        for payload in self
            .payloads
            .iter()
            .filter(|p| Some(p.body.as_str()) != carried)
        {
            for place in places(info, &payload.body).into_iter().flatten() {
                if let Some(slot) = out.get_mut(place) {
                    *slot = 0.0;
                }
            }
        }
        out
    }

    /// Reads the logged efforts (N m or N) as currents in A: divides them by the true gains, so that
    /// these gains are what identification has to find.
    pub(crate) fn columns(&self) -> impl Iterator<Item = Assignment> {
        self.gains.iter().map(|(name, gain)| Assignment {
            unit: Some("A"),
            factor: 1.0 / gain,
            ..Assignment::new(Quantity::Effort(name.clone()), &format!("tau_{name}"))
        })
    }

    /// The labels and true values of the gains and payloads, which are scored after the base
    /// parameters.
    ///
    /// - `known`: the true parameters.
    pub(crate) fn truth(&self, info: &Info<'_>, known: &[f64]) -> (Vec<String>, Vec<f64>) {
        let gains = self.gains.iter();
        let (mut labels, mut values): (Vec<String>, Vec<f64>) = gains
            .map(|(name, gain)| (format!("gain({name})"), *gain))
            .unzip();
        for payload in self.used() {
            let places = places(info, &payload.body);
            let ten = places.map(|k| k.and_then(|k| known.get(k)).copied().unwrap_or(0.0));
            for (name, value) in VALUES.iter().zip(about_centre(&ten)) {
                labels.push(format!("{name} of {}", payload.body));
                values.push(value);
            }
        }
        (labels, values)
    }

    /// The values of an estimate in the order of [`Self::truth`], with their intervals; NaN for
    /// values that the estimate lacks.
    pub(crate) fn found(&self, model: &IdentifiedModel) -> (Vec<f64>, Vec<Option<Interval>>) {
        let gains = self.gains.iter().map(|(name, _)| {
            let own = model.gains.iter().find(|gain| gain.effort == *name);
            own.map_or((f64::NAN, None), |gain| (gain.value, gain.interval))
        });
        let payloads = self.used().flat_map(|payload| {
            let own = model.payloads.iter().find(|own| own.body == payload.body);
            VALUES.iter().map(move |name| {
                let values = own.map_or(&[][..], |own| own.values.as_slice());
                let value = values.iter().find(|value| value.name == *name);
                value.map_or((f64::NAN, None), |value| (value.value, value.interval))
            })
        });
        gains.chain(payloads).unzip()
    }

    /// The model with the true base parameters and gains.
    pub(crate) fn true_model(&self, base: &[f64]) -> IdentifiedModel {
        let gains = self.gains.iter().map(|(effort, value)| Gain {
            effort: effort.clone(),
            value: *value,
            interval: None,
        });
        IdentifiedModel {
            beta: base.to_vec(),
            gains: gains.collect(),
            ..IdentifiedModel::default()
        }
    }

    /// eps_RA of a model on a run, percent; not finite where it is not defined.
    pub(crate) fn error<M: BaseModel<f64> + ?Sized>(
        &self,
        session: &Session<'_, M>,
        run: &Run,
        number: usize,
        model: &IdentifiedModel,
    ) -> Result<f64, RehearseError> {
        let carried = self.of_run(number).map(|own| own.body.as_str());
        let (errors, ..) = loaded_residuals(session, run, model, &self.bodies(), carried)?;
        Ok(errors.relative_absolute())
    }

    /// The estimate from the runs of a seed.
    ///
    /// - `made`: how the runs were simulated.
    pub(crate) fn estimate<M>(
        &self,
        session: &Session<'_, M>,
        runs: &[Run],
        estimator: &Estimator,
        made: &Made<'_>,
    ) -> Result<Estimated, RehearseError>
    where
        M: BaseModel<f64> + BaseModel<Number> + ?Sized + Sync,
    {
        let plan = Plan {
            unknown_gains: self.gains.iter().map(|(name, _)| name.clone()).collect(),
            payloads: self.payloads.clone(),
            robot: None,
        };
        let runs = runs.iter().enumerate();
        let runs: Vec<(Run, Option<usize>)> = runs
            .map(|(k, run)| (run.clone(), self.carried.get(k).copied().flatten()))
            .collect();
        if let Estimator::Instrumental { along } = estimator {
            let gains = gains(&Model::<f64>::info(session.model), &made.settings.pid);
            let reference = along.then_some((made.motion, gains.as_slice()));
            let found = instrumental_with_gains(session, &plan, &runs, reference)?.found;
            let (has_converged, rounds) = (found.instrumental.converged, found.instrumental.rounds);
            return Ok(converged(found.fit.model, has_converged, rounds));
        }
        if let Estimator::Didim(settings) = estimator {
            let in_amperes = session.in_amperes();
            let (mut all, mut carried) = (Vec::new(), Vec::new());
            for (run, own) in &runs {
                all.extend(read(&in_amperes, std::slice::from_ref(run))?);
                carried.resize(all.len(), *own);
            }
            return settings.estimate(&in_amperes, &all, made, Some((&plan, &carried)));
        }
        let physical = match estimator {
            Estimator::Physical {
                knowledge, draws, ..
            } => Some((knowledge, *draws)),
            _ => None,
        };
        let fits = with_gains(session, &plan, &runs, physical)?;
        Ok(Ok(match fits.physical {
            Some(physical) => physical.model,
            None => fits.free.model,
        }))
    }
}

/// The places of a body's ten parameters, in the order of [`Symbol::INERTIAL`].
fn places(info: &Info<'_>, body: &str) -> [Option<usize>; 10] {
    Symbol::INERTIAL.map(|symbol| {
        let own = |p: &regen_runtime::Parameter<'_>| p.symbol == symbol && p.owner == body;
        info.parameters.iter().position(own)
    })
}

/// The inertia of a point mass about the origin: Ixx Ixy Ixz Iyy Iyz Izz, kg m^2.
fn of_point(mass: f64, [x, y, z]: [f64; 3]) -> [f64; 6] {
    [
        mass * (y * y + z * z),
        -mass * x * y,
        -mass * x * z,
        mass * (x * x + z * z),
        -mass * y * z,
        mass * (x * x + y * y),
    ]
}

/// Converts ten parameters about the origin of the body's frame, in the order of
/// [`Symbol::INERTIAL`], into mass, centre of mass and inertia about it; a body without mass has its
/// centre at the origin.
fn about_centre(ten: &[f64; 10]) -> [f64; 10] {
    let mass = ten[9];
    let over = if mass == 0.0 { 0.0 } else { 1.0 / mass };
    let centre = [ten[6] * over, ten[7] * over, ten[8] * over];
    let moved = of_point(mass, centre);
    let mut out = [
        mass, centre[0], centre[1], centre[2], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    ];
    for (slot, (whole, by)) in out[4..].iter_mut().zip(ten.iter().zip(moved)) {
        *slot = whole - by;
    }
    out
}

/// The inverse of [`about_centre`].
fn about_origin(values: &[f64; 10]) -> [f64; 10] {
    let [mass, x, y, z, ..] = *values;
    let moved = of_point(mass, [x, y, z]);
    let mut out = [0.0; 10];
    for (slot, (own, by)) in out.iter_mut().zip(values[4..].iter().zip(moved)) {
        *slot = own + by;
    }
    out[6..].copy_from_slice(&[mass * x, mass * y, mass * z, mass]);
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_about_the_centre_are_those_of_a_rod_by_hand() {
        // a rod of 2 kg and 0.6 m along x, held at its end
        let values = [2.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.06, 0.0, 0.06];
        let ten = about_origin(&values);
        // m l^2 / 3
        assert!((ten[3] - 0.24).abs() < 1e-15 && (ten[5] - 0.24).abs() < 1e-15);
        assert_eq!((ten[6], ten[9]), (0.6, 2.0));
        for (a, b) in about_centre(&ten).iter().zip(values) {
            assert!((a - b).abs() < 1e-15);
        }
    }
}
