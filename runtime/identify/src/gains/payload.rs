//! A payload: its known parameters, and its base parameters as functions of the unknown ones.

use nalgebra::{DMatrix, DVector};
use regen_runtime::{BaseModel, Symbol};

use super::GainError;

/// The known parameters of a payload; those that are `None` are identified.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KnownPayload {
    /// The label of its body in the description.
    pub body: String,
    /// Its mass, kg.
    pub mass: Option<f64>,
    /// Its centre of mass in the frame of the body, m.
    pub com: Option<[f64; 3]>,
    /// Ixx, Ixy, Ixz, Iyy, Iyz, Izz about its centre of mass, kg m^2.
    pub inertia: Option<[f64; 6]>,
}

/// The ten inertial parameters of a body about the origin of its frame, in the order and units of
/// [`Symbol::INERTIAL`]: inertia kg m^2, first moments kg m, mass kg.
pub(super) type InertialParameters = [f64; 10];

/// The index of the first of the three first moments in [`InertialParameters`].
const MOMENT: usize = 6;
/// The index of the mass in [`InertialParameters`].
const MASS: usize = 9;
/// Masses below this count as zero where something is divided by them, kg.
const TINY_MASS: f64 = 1e-12;
/// The number of steps towards given base parameters; without a known centre or inertia one suffices.
const CLOSEST_STEPS: usize = 20;
/// A vector counts as a combination of others if less than this part of its length is orthogonal
/// to them: the coefficients of base parameters are exact up to rounding.
const DEPENDENT: f64 = 1e-9;

/// A payload in a fit: its unknowns are those of its ten parameters that are not known.
#[derive(Clone, Debug)]
pub(super) struct Load {
    pub(super) known: KnownPayload,
    /// The indices of its base parameters among those of the model.
    pub(super) base: Vec<usize>,
    /// The coefficients of the inertial parameters in each of its base parameters.
    combinations: Vec<InertialParameters>,
    /// The indices of the unknowns in [`InertialParameters`].
    pub(super) unknown: Vec<usize>,
}

/// A physical quantity of a payload that the result contains: its mass, a coordinate of its centre
/// of mass, or an entry of its inertia about the centre of mass.
pub(super) struct PhysicalValue {
    pub(super) name: &'static str,
    pub(super) unit: &'static str,
    pub(super) value: f64,
    /// Whether the caller gave it.
    pub(super) known: bool,
    /// Its derivatives with respect to the unknowns.
    pub(super) slope: Vec<f64>,
}

impl Load {
    /// The payload in the base parameters of a model.
    ///
    /// # Errors
    /// [`GainError::NoPayload`] if no base parameter contains parameters of the payload's body, or
    /// one contains other parameters beside them.
    pub(super) fn new<M: BaseModel<f64> + ?Sized>(
        model: &M,
        known: &KnownPayload,
    ) -> Result<Self, GainError> {
        let info = model.info();
        let refused = || GainError::NoPayload(known.body.clone());
        let place = |index: usize| {
            let parameter = info.parameters.get(index)?;
            let own = parameter.owner == known.body;
            let symbols = Symbol::INERTIAL.iter();
            let place = symbols.into_iter().position(|s| *s == parameter.symbol);
            place.filter(|_| own)
        };
        let (mut base, mut combinations) = (Vec::new(), Vec::new());
        for (k, parameter) in model.base_info().base.iter().enumerate() {
            let places: Vec<Option<usize>> =
                parameter.terms.iter().map(|t| place(t.index)).collect();
            if places.iter().all(Option::is_none) {
                continue;
            }
            let mut ten = [0.0; 10];
            for (place, term) in places.into_iter().zip(parameter.terms) {
                // a base parameter that combines the body's parameters with others belongs to a body
                // that the robot always carries
                let entry = place.and_then(|place| ten.get_mut(place));
                *entry.ok_or_else(refused)? += term.value;
            }
            base.push(k);
            combinations.push(ten);
        }
        if base.is_empty() {
            return Err(refused());
        }
        let mut unknown = Vec::new();
        if known.inertia.is_none() {
            unknown.extend(0..MOMENT);
        }
        if known.com.is_none() {
            unknown.extend(MOMENT..MASS);
        }
        if known.mass.is_none() {
            unknown.push(MASS);
        }
        Ok(Self {
            known: known.clone(),
            base,
            combinations,
            unknown,
        })
    }

    /// The same payload with parameters that are affine in its unknowns: an inertia that is known
    /// about an unknown centre of mass is treated as unknown, since the parallel-axis term is
    /// quadratic.
    pub(super) fn affine(&self) -> Self {
        if self.known.com.is_some() || self.known.inertia.is_none() {
            return self.clone();
        }
        Self {
            known: KnownPayload {
                inertia: None,
                ..self.known.clone()
            },
            unknown: (0..MOMENT).chain(self.unknown.iter().copied()).collect(),
            ..self.clone()
        }
    }

    /// Initial unknowns where no estimate exists: a mass of 1 kg at the origin.
    pub(super) fn initial(&self) -> Vec<f64> {
        let one = |place: &usize| f64::from(*place == MASS);
        self.unknown.iter().map(one).collect()
    }

    /// The unknowns for which the base parameters are closest to these.
    ///
    /// - `from`: unknowns to begin with;
    /// - `moved`: which of them may change.
    pub(super) fn closest(&self, base: &[f64], from: &[f64], moved: &[usize]) -> Vec<f64> {
        let mut out = from.to_vec();
        // a payload that is wholly known has nothing to move
        let steps = if moved.is_empty() { 0 } else { CLOSEST_STEPS };
        for _ in 0..steps {
            let all = self.columns(&out);
            let columns = moved.iter().flat_map(|k| all[*k].iter().copied());
            let columns = DMatrix::from_vec(self.base.len(), moved.len(), columns.collect());
            let pairs = base.iter().zip(self.values(&out));
            let off = DVector::from_iterator(self.base.len(), pairs.map(|(x, y)| x - y));
            // the smallest step, where the base parameters do not determine all unknowns
            let Ok(step) = columns.svd(true, true).solve(&off, DEPENDENT) else {
                break;
            };
            for (place, dx) in moved.iter().zip(&step) {
                out[*place] += dx;
            }
        }
        out
    }

    /// The ten parameters for these unknowns.
    pub(super) fn inertial_parameters(&self, unknown: &[f64]) -> InertialParameters {
        let mut ten = [0.0; 10];
        if let Some(mass) = self.known.mass {
            ten[MASS] = mass;
        }
        for (place, value) in self.unknown.iter().zip(unknown) {
            ten[*place] = *value;
        }
        if let Some(com) = self.known.com {
            for (k, c) in com.into_iter().enumerate() {
                ten[MOMENT + k] = ten[MASS] * c;
            }
        }
        if let Some(inertia) = self.known.inertia {
            let moved = steiner(&ten).0;
            for k in 0..MOMENT {
                ten[k] = inertia[k] + moved[k];
            }
        }
        ten
    }

    /// The derivatives of the ten parameters with respect to each unknown.
    fn slopes(&self, unknown: &[f64]) -> Vec<InertialParameters> {
        let ten = self.inertial_parameters(unknown);
        let by = steiner(&ten).1;
        let one = |place: &usize| {
            let mut out = [0.0; 10];
            out[*place] = 1.0;
            if let (MASS, Some(com)) = (*place, self.known.com) {
                out[MOMENT..MASS].copy_from_slice(&com);
            }
            if self.known.inertia.is_some() {
                for k in 0..MOMENT {
                    out[k] = (0..4).map(|j| by[k][j] * out[MOMENT + j]).sum();
                }
            }
            out
        };
        self.unknown.iter().map(one).collect()
    }

    /// The base parameters of given ten parameters.
    fn to_base(&self, ten: &InertialParameters) -> Vec<f64> {
        let rows = self.combinations.iter();
        rows.map(|row| row.iter().zip(ten).map(|(a, b)| a * b).sum())
            .collect()
    }

    /// The base parameters for these unknowns.
    pub(super) fn values(&self, unknown: &[f64]) -> Vec<f64> {
        self.to_base(&self.inertial_parameters(unknown))
    }

    /// The derivatives of the base parameters with respect to each unknown.
    pub(super) fn columns(&self, unknown: &[f64]) -> Vec<Vec<f64>> {
        let slopes = self.slopes(unknown);
        slopes.iter().map(|slope| self.to_base(slope)).collect()
    }

    /// The indices of unknowns whose [`columns`](Self::columns) are a basis of the span of all.
    pub(super) fn independent(&self, unknown: &[f64]) -> Vec<usize> {
        let mut basis: Vec<Vec<f64>> = Vec::new();
        let mut kept = Vec::new();
        for (k, column) in self.columns(unknown).into_iter().enumerate() {
            if let Some(own) = beyond(&basis, &column) {
                basis.push(own);
                kept.push(k);
            }
        }
        kept
    }

    /// The mass, the centre of mass and the inertia about it, as far as they are known or the base
    /// parameters determine them.
    pub(super) fn physical_values(&self, unknown: &[f64]) -> Vec<PhysicalValue> {
        let ten = self.inertial_parameters(unknown);
        let slopes = self.slopes(unknown);
        // a quantity is determined if its gradient is in the span of the base parameters' gradients
        let columns = self.columns(unknown);
        let mut rows: Vec<Vec<f64>> = Vec::new();
        for k in 0..self.base.len() {
            let row: Vec<f64> = columns.iter().map(|column| column[k]).collect();
            rows.extend(beyond(&rows, &row));
        }
        let (moved, by) = steiner(&ten);
        let mass = ten[MASS];
        let mut out = Vec::new();
        let mut add =
            |name, unit, known: bool, value: f64, of: &dyn Fn(&InertialParameters) -> f64| {
                let slope: Vec<f64> = slopes.iter().map(of).collect();
                if known || value.is_finite() && beyond(&rows, &slope).is_none() {
                    out.push(PhysicalValue {
                        name,
                        unit,
                        value,
                        known,
                        slope,
                    });
                }
            };
        let known = &self.known;
        add("m", "kg", known.mass.is_some(), mass, &|d| d[MASS]);
        for (k, name) in ["cx", "cy", "cz"].into_iter().enumerate() {
            let value = known.com.map_or(ten[MOMENT + k] / mass, |com| com[k]);
            add(name, "m", known.com.is_some(), value, &|d| {
                (d[MOMENT + k] - ten[MOMENT + k] / mass * d[MASS]) / mass
            });
        }
        let names = ["Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"];
        for (k, name) in names.into_iter().enumerate() {
            let value = known.inertia.map_or(ten[k] - moved[k], |given| given[k]);
            add(name, "kg m^2", known.inertia.is_some(), value, &|d| {
                let moved: f64 = (0..4).map(|j| by[k][j] * d[MOMENT + j]).sum();
                d[k] - moved
            });
        }
        out
    }
}

/// The quantity with this name in [`Load::physical_values`], from the ten parameters.
pub(super) fn physical_value(name: &str, ten: &InertialParameters) -> f64 {
    let place = |names: &[&str]| names.iter().position(|own| *own == name);
    if let Some(k) = place(&["cx", "cy", "cz"]) {
        return ten[MOMENT + k] / ten[MASS];
    }
    match place(&["Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"]) {
        Some(k) => ten[k] - steiner(ten).0[k],
        None => ten[MASS],
    }
}

/// The component of a vector orthogonal to an orthonormal basis, scaled to length 1; `None` if the
/// vector is in the span of the basis up to [`DEPENDENT`].
fn beyond(basis: &[Vec<f64>], vector: &[f64]) -> Option<Vec<f64>> {
    let length = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let whole = length(vector);
    let mut own = vector.to_vec();
    // Gram-Schmidt twice, so that the result is orthogonal to rounding
    for _ in 0..2 {
        for unit in basis {
            let part: f64 = unit.iter().zip(&own).map(|(a, b)| a * b).sum();
            for (x, u) in own.iter_mut().zip(unit) {
                *x -= part * u;
            }
        }
    }
    let left = length(&own);
    (left > DEPENDENT * whole && left > 0.0).then(|| own.iter().map(|x| x / left).collect())
}

/// The parallel-axis (Steiner) term: the inertia about the origin of the whole mass at the centre
/// of mass, kg m^2, and its derivatives with respect to mx, my, mz and m; zero without a mass.
fn steiner(ten: &InertialParameters) -> ([f64; 6], [[f64; 4]; 6]) {
    let [x, y, z, m] = [ten[6], ten[7], ten[8], ten[9]];
    if m.abs() < TINY_MASS {
        return ([0.0; 6], [[0.0; 4]; 6]);
    }
    let whole = [
        y * y + z * z,
        -x * y,
        -x * z,
        x * x + z * z,
        -y * z,
        x * x + y * y,
    ];
    let by = [
        [0.0, 2.0 * y, 2.0 * z],
        [-y, -x, 0.0],
        [-z, 0.0, -x],
        [2.0 * x, 0.0, 2.0 * z],
        [0.0, -z, -y],
        [2.0 * x, 2.0 * y, 0.0],
    ];
    let mut slopes = [[0.0; 4]; 6];
    for ((row, by), own) in slopes.iter_mut().zip(&by).zip(&whole) {
        *row = [by[0] / m, by[1] / m, by[2] / m, -own / (m * m)];
    }
    (whole.map(|value| value / m), slopes)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn load(known: KnownPayload) -> Load {
        let mut combinations = vec![[0.0; 10]; 10];
        for (k, row) in combinations.iter_mut().enumerate() {
            row[k] = 1.0;
        }
        let mut unknown = Vec::new();
        for (is_known, places) in [
            (known.inertia.is_some(), 0..MOMENT),
            (known.com.is_some(), MOMENT..MASS),
            (known.mass.is_some(), MASS..MASS + 1),
        ] {
            if !is_known {
                unknown.extend(places);
            }
        }
        Load {
            known,
            base: (0..10).collect(),
            combinations,
            unknown,
        }
    }

    fn every_knowledge() -> Vec<Load> {
        let mut out = Vec::new();
        for bits in 0..8 {
            out.push(load(KnownPayload {
                body: "load".to_owned(),
                mass: (bits & 1 > 0).then_some(2.0),
                com: (bits & 2 > 0).then_some([0.1, -0.2, 0.3]),
                inertia: (bits & 4 > 0).then_some([0.5, 0.01, -0.02, 0.4, 0.03, 0.3]),
            }));
        }
        out
    }

    #[test]
    fn slopes_are_the_derivatives_of_the_parameters_whatever_is_known() {
        let at = [0.9, 0.05, 0.02, 0.8, -0.03, 0.7, 0.2, -0.5, 0.3, 1.7];
        for load in every_knowledge() {
            let point: Vec<f64> = load.unknown.iter().map(|k| at[*k]).collect();
            for (k, slope) in load.slopes(&point).iter().enumerate() {
                let step = 1e-6;
                let moved = |by: f64| {
                    let mut point = point.clone();
                    point[k] += by;
                    load.inertial_parameters(&point)
                };
                let (plus, minus) = (moved(step), moved(-step));
                for j in 0..10 {
                    let numeric = (plus[j] - minus[j]) / (2.0 * step);
                    assert!(
                        (numeric - slope[j]).abs() < 1e-8,
                        "{:?} {k} {j}",
                        load.known
                    );
                }
            }
        }
    }

    #[test]
    fn a_known_inertia_about_the_centre_of_mass_is_reported_as_it_was_given() {
        for load in every_knowledge() {
            let at = [0.9, 0.05, 0.02, 0.8, -0.03, 0.7, 0.2, -0.5, 0.3, 1.7];
            let point: Vec<f64> = load.unknown.iter().map(|k| at[*k]).collect();
            let ten = load.inertial_parameters(&point);
            let (moved, _) = steiner(&ten);
            if let Some(given) = load.known.inertia {
                for k in 0..6 {
                    assert!((ten[k] - moved[k] - given[k]).abs() < 1e-12);
                }
            }
            // the base parameters are all ten parameters, so that every quantity is determined
            assert_eq!(load.physical_values(&point).len(), 10);
            assert_eq!(load.independent(&point).len(), load.unknown.len());
        }
    }

    #[test]
    fn the_closest_unknowns_have_the_given_base_parameters() {
        let at = [0.9, 0.05, 0.02, 0.8, -0.03, 0.7, 0.2, -0.5, 0.3, 1.7];
        for load in every_knowledge() {
            let point: Vec<f64> = load.unknown.iter().map(|k| at[*k]).collect();
            let all: Vec<usize> = (0..load.unknown.len()).collect();
            let found = load.closest(&load.values(&point), &load.initial(), &all);
            let found = load.values(&found);
            for (x, y) in found.iter().zip(load.values(&point)) {
                assert!((x - y).abs() < 1e-9, "{:?}: {x} {y}", load.known);
            }
        }
    }

    #[test]
    fn quantities_that_base_parameters_do_not_determine_are_left_out() {
        let mut joined = load(KnownPayload::default());
        // a pendulum: Izz and mx, and nothing of the mass alone
        let mut own = [[0.0; 10]; 2];
        (own[0][5], own[1][6]) = (1.0, 1.0);
        joined.combinations = own.to_vec();
        joined.base = vec![0, 1];
        let point = vec![0.1; 10];
        assert!(joined.physical_values(&point).is_empty());
        // with the mass known, its centre along x is determined
        joined.known.mass = Some(2.0);
        joined.unknown = (0..9).collect();
        let values = joined.physical_values(&[0.1; 9]);
        let names: Vec<&str> = values.iter().map(|value| value.name).collect();
        assert_eq!(names, ["m", "cx"]);
    }
}
