//! How the scalars of the geometry follow from what is unknown of it.

use nalgebra::DMatrix;

/// The unit of an unknown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Unit {
    /// rad
    Angle,
    /// m
    Length,
    /// rad/(N m), of a joint that yields to its effort.
    AngleByEffort,
    /// m/N, of one that shifts.
    LengthByEffort,
    /// None of these: a ratio, or a name that enters lengths and angles.
    Plain,
}

impl Unit {
    /// Whether it is that of a compliance.
    pub fn is_compliance(self) -> bool {
        matches!(self, Self::AngleByEffort | Self::LengthByEffort)
    }
}

/// A number of the geometry that is unknown.
#[derive(Clone, Debug, PartialEq)]
pub struct Unknown {
    /// Its name, such as `a`, `q3.alpha` or `tool.x`.
    pub name: String,
    /// Its unit.
    pub unit: Unit,
    /// The value that the description states.
    pub nominal: f64,
}

/// The geometry of a mechanism as a function of what is unknown of it.
pub trait Geometry {
    /// The unknowns, those first that are kept where several cannot be told apart.
    fn unknowns(&self) -> &[Unknown];

    /// The scalars of the geometry for values of the unknowns; `None` where an expression has no
    /// finite value.
    fn scalars(&self, values: &[f64]) -> Option<Vec<f64>>;

    /// The derivatives of the scalars by the unknowns, one column for each of them.
    fn slopes(&self, values: &[f64]) -> DMatrix<f64>;
}

/// A geometry of which only some unknowns vary.
pub(crate) struct Kept<'a> {
    inner: &'a dyn Geometry,
    values: Vec<f64>,
    /// The places of the unknowns that vary.
    pub(crate) places: Vec<usize>,
    unknowns: Vec<Unknown>,
}

impl<'a> Kept<'a> {
    /// The unknowns of these columns, behind those of instruments; the others keep their values.
    pub(crate) fn new(
        inner: &'a dyn Geometry,
        values: &[f64],
        columns: &[usize],
        freedoms: usize,
    ) -> Self {
        let all = inner.unknowns();
        let places = columns.iter().filter_map(|c| c.checked_sub(freedoms));
        let places: Vec<usize> = places.filter(|place| *place < all.len()).collect();
        Self {
            inner,
            values: values.to_vec(),
            unknowns: places.iter().map(|place| all[*place].clone()).collect(),
            places,
        }
    }

    pub(crate) fn nominal(&self) -> Vec<f64> {
        self.places
            .iter()
            .map(|place| self.values[*place])
            .collect()
    }

    /// The values of all unknowns.
    pub(crate) fn whole(&self, values: &[f64]) -> Vec<f64> {
        let mut out = self.values.clone();
        for (place, value) in self.places.iter().zip(values) {
            out[*place] = *value;
        }
        out
    }
}

impl Geometry for Kept<'_> {
    fn unknowns(&self) -> &[Unknown] {
        &self.unknowns
    }

    fn scalars(&self, values: &[f64]) -> Option<Vec<f64>> {
        self.inner.scalars(&self.whole(values))
    }

    fn slopes(&self, values: &[f64]) -> DMatrix<f64> {
        self.inner
            .slopes(&self.whole(values))
            .select_columns(&self.places)
    }
}
