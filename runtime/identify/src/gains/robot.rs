//! Converts the parameters of a robot that was identified before to the base parameters of another
//! model of it.

use regen_runtime::{BaseModel, SizeError};

use super::KnownRobot;
use crate::model::{Covariance, IdentifiedModel};

impl KnownRobot {
    /// Converts an identified model to the base parameters of `model`, such as one that has
    /// payloads as separate bodies. Parameters that `from` lacks are 0.
    ///
    /// - `from`: the model that was identified; its parameters have the same labels in `model`.
    ///
    /// # Errors
    /// When `identified` does not have as many base parameters as `from`.
    ///
    /// ```
    /// # mod models {
    /// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs"));
    /// #     include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum_base.rs"));
    /// # }
    /// # use models::Pendulum;
    /// use regen_identify::IdentifiedModel;
    /// use regen_identify::gains::KnownRobot;
    ///
    /// let identified = IdentifiedModel { beta: vec![0.5, 2.0], ..IdentifiedModel::default() };
    /// let robot = KnownRobot::new(&Pendulum, &Pendulum, &identified)?;
    /// assert_eq!(robot.beta, [0.5, 2.0]);
    /// # Ok::<(), regen_runtime::SizeError>(())
    /// ```
    pub fn new<M, N>(model: &M, from: &N, identified: &IdentifiedModel) -> Result<Self, SizeError>
    where
        M: BaseModel<f64> + ?Sized,
        N: BaseModel<f64> + ?Sized,
    {
        let (info, own) = (model.info(), from.info());
        let places: Vec<Option<usize>> = own
            .parameters
            .iter()
            .map(|parameter| info.parameter_of(&parameter.label()))
            .collect();
        let moved = |beta: &[f64]| -> Result<Vec<f64>, SizeError> {
            let mut phi = vec![0.0; own.parameters.len()];
            let free = vec![0.0; from.base_info().free.len()];
            from.parameters_from_base(beta, &free, &mut phi)?;
            let mut all = vec![0.0; info.parameters.len()];
            for (place, value) in places.iter().zip(phi) {
                if let Some(entry) = place.and_then(|place| all.get_mut(place)) {
                    *entry = value;
                }
            }
            let mut out = vec![0.0; model.base_info().base.len()];
            model.to_base(&all, &mut out)?;
            Ok(out)
        };
        let covariance = match &identified.covariance {
            None => None,
            Some(covariance) => {
                let labels: Vec<&str> = from.base_info().base.iter().map(|b| b.label).collect();
                let mut columns = Vec::with_capacity(labels.len());
                for k in 0..labels.len() {
                    let mut unit = vec![0.0; labels.len()];
                    unit[k] = 1.0;
                    columns.push(moved(&unit)?);
                }
                Some(transformed(model, covariance, &labels, &columns))
            }
        };
        let gains = identified.gains.iter();
        Ok(Self {
            beta: moved(&identified.beta)?,
            gains: gains.map(|g| (g.effort.clone(), g.value)).collect(),
            covariance,
        })
    }
}

/// The covariance of the base parameters of a model and of the gains.
///
/// - `columns`: for each of the labels, the derivatives of the model's base parameters by the
///   parameter with that label.
fn transformed<M: BaseModel<f64> + ?Sized>(
    model: &M,
    covariance: &Covariance,
    labels: &[&str],
    columns: &[Vec<f64>],
) -> Covariance {
    let base = model.base_info().base;
    // each new entry as a sum over old ones: their places and factors
    let mut rows: Vec<Vec<(usize, f64)>> = vec![Vec::new(); base.len()];
    for (label, column) in labels.iter().zip(columns) {
        let Some(place) = covariance.place(label) else {
            continue;
        };
        for (row, factor) in rows.iter_mut().zip(column) {
            if *factor != 0.0 {
                row.push((place, *factor));
            }
        }
    }
    let mut names: Vec<String> = base.iter().map(|b| b.label.to_owned()).collect();
    for (place, label) in covariance.labels.iter().enumerate() {
        if !labels.contains(&label.as_str()) {
            rows.push(vec![(place, 1.0)]);
            names.push(label.clone());
        }
    }
    let mut values = Vec::with_capacity(rows.len() * rows.len());
    for a in &rows {
        for b in &rows {
            let terms = a.iter().flat_map(|x| b.iter().map(move |y| (x, y)));
            let terms = terms.map(|((i, f), (j, g))| f * g * covariance.entry(*i, *j));
            values.push(terms.sum());
        }
    }
    Covariance {
        labels: names,
        values,
    }
}
