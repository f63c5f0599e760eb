//! The grouping of parameters by bodies, and the matrix that maps them to base parameters.

use super::error::{finite, size};
use super::{FeasibilityError, InertialParameters, Scale};
use regen_runtime::{BaseInfo, BaseModel, Parameter, Sign, Symbol};

/// The symbols of a body's ten parameters.
pub const SYMBOLS: [&str; 10] = regen_runtime::INERTIAL;

/// The ten parameters of a body among all parameters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Body {
    /// The body's label.
    pub label: String,
    /// The indices of its ten parameters, in the order of [`SYMBOLS`].
    pub columns: [usize; 10],
}

/// The parameters of a robot in groups: ten for each body, single ones (friction, rotors,
/// springs), which dissipate or store energy and are not negative, and those of either sign
/// (offsets, effort terms, constant pulls).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParameterLayout {
    labels: Vec<String>,
    bodies: Vec<Body>,
    single: Vec<usize>,
    any_sign: Vec<usize>,
}

/// The result of checking whether parameters are physical.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// The smallest eigenvalue of each body's pseudo-inertia, in units of the scale.
    pub eigenvalues: Vec<f64>,
    /// The labels of the single parameters that are negative.
    pub negative: Vec<String>,
}

impl Check {
    /// The smallest of the eigenvalues; infinite without bodies, NaN if one is NaN.
    pub fn margin(&self) -> f64 {
        // a NaN among the eigenvalues gives NaN
        let least = |m: f64, x: &f64| if *x >= m { m } else { *x };
        self.eigenvalues.iter().fold(f64::INFINITY, least)
    }

    /// Whether the parameters are physical: no eigenvalue and no single parameter is below zero.
    pub fn is_physical(&self) -> bool {
        self.negative.is_empty() && self.margin() >= 0.0
    }
}

impl ParameterLayout {
    /// Groups parameters by their labels: `Ixx(3)` belongs to body 3, `Fo(q1)` is an offset; a label
    /// without any of these symbols is a single parameter.
    ///
    /// # Errors
    /// When a body lacks one of its ten parameters, or a label occurs twice.
    ///
    /// ```
    /// use regen_identify::feasibility::{ParameterLayout, SYMBOLS};
    ///
    /// let mut labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}(arm)")).collect();
    /// labels.push("Fv(q1)".to_owned());
    /// let layout = ParameterLayout::new(&labels)?;
    /// assert_eq!(layout.bodies()[0].label, "arm");
    /// assert_eq!(layout.single(), [10]);
    /// # Ok::<(), regen_identify::feasibility::FeasibilityError>(())
    /// ```
    pub fn new<S: AsRef<str>>(labels: &[S]) -> Result<Self, FeasibilityError> {
        let labels: Vec<String> = labels.iter().map(|l| l.as_ref().to_owned()).collect();
        let parameters: Vec<_> = labels.iter().map(|l| Parameter::read(l)).collect();
        Self::grouped(&parameters, labels.clone())
    }

    /// Groups the parameters of a model.
    ///
    /// # Errors
    /// When a body lacks one of its ten parameters, or a parameter occurs twice.
    ///
    /// ```
    /// use regen_identify::feasibility::ParameterLayout;
    /// use regen_runtime::{Parameter, Symbol};
    ///
    /// let mut parameters = Symbol::INERTIAL.map(|s| Parameter::new(s, "arm")).to_vec();
    /// parameters.push(Parameter::new(Symbol::Friction("Fv"), "q1"));
    /// let layout = ParameterLayout::of(&parameters)?;
    /// assert_eq!(layout.bodies()[0].label, "arm");
    /// assert_eq!(layout.labels()[10], "Fv(q1)");
    /// # Ok::<(), regen_identify::feasibility::FeasibilityError>(())
    /// ```
    pub fn of(parameters: &[Parameter<'_>]) -> Result<Self, FeasibilityError> {
        let labels = parameters.iter().map(Parameter::label).collect();
        let parameters: Vec<_> = parameters.iter().copied().map(Some).collect();
        Self::grouped(&parameters, labels)
    }

    fn grouped(
        parameters: &[Option<Parameter<'_>>],
        labels: Vec<String>,
    ) -> Result<Self, FeasibilityError> {
        let find = |label: &str| labels.iter().position(|l| l == label);
        let mut bodies: Vec<Body> = Vec::new();
        let (mut single, mut any_sign) = (Vec::new(), Vec::new());
        for (column, (label, parameter)) in labels.iter().zip(parameters).enumerate() {
            if find(label) != Some(column) {
                return Err(FeasibilityError::Duplicate {
                    label: label.clone(),
                });
            }
            let of_joint = |p: &Parameter<'_>| !p.is_inertial() && p.sign() == Sign::Any;
            if parameter.as_ref().is_some_and(of_joint) {
                any_sign.push(column);
                continue;
            }
            let of_body = parameter.filter(Parameter::is_inertial);
            let Some(Parameter { owner: body, .. }) = of_body else {
                single.push(column);
                continue;
            };
            if bodies.iter().any(|b| b.label == body) {
                continue;
            }
            let mut columns = [0; 10];
            for (slot, symbol) in columns.iter_mut().zip(SYMBOLS) {
                let missing = format!("{symbol}({body})");
                *slot = find(&missing).ok_or_else(|| FeasibilityError::Incomplete {
                    body: body.to_owned(),
                    missing,
                })?;
            }
            bodies.push(Body {
                label: body.to_owned(),
                columns,
            });
        }
        Ok(Self {
            labels,
            bodies,
            single,
            any_sign,
        })
    }

    /// The labels of all p parameters.
    pub fn labels(&self) -> &[String] {
        &self.labels
    }

    /// The bodies, in the order of their first parameters.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// The indices of the single parameters, which belong to no body and are not negative.
    pub fn single(&self) -> &[usize] {
        &self.single
    }

    /// The indices of the parameters of either sign that belong to no body: offsets, effort terms
    /// and constant pulls.
    pub fn any_sign(&self) -> &[usize] {
        &self.any_sign
    }

    /// The symbol of a body's parameter; `None` for a parameter of a joint.
    pub(super) fn inertial(&self, column: usize) -> Option<Symbol<'_>> {
        let mut bodies = self.bodies.iter();
        let entry = bodies.find_map(|body| body.columns.iter().position(|c| *c == column))?;
        Symbol::INERTIAL.get(entry).copied()
    }

    /// The number of parameters.
    pub fn len(&self) -> usize {
        self.labels.len()
    }

    /// Whether there are no parameters.
    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// The index of a parameter.
    ///
    /// # Errors
    /// When no parameter has that label.
    pub fn find(&self, label: &str) -> Result<usize, FeasibilityError> {
        let found = self.labels.iter().position(|l| l == label);
        found.ok_or_else(|| FeasibilityError::Unknown {
            what: "parameter",
            label: label.to_owned(),
        })
    }

    /// A body by its label.
    ///
    /// # Errors
    /// When no body has that label.
    pub fn body(&self, label: &str) -> Result<&Body, FeasibilityError> {
        let found = self.bodies.iter().find(|b| b.label == label);
        found.ok_or_else(|| FeasibilityError::Unknown {
            what: "body",
            label: label.to_owned(),
        })
    }

    /// The layout with further single parameters appended.
    ///
    /// # Errors
    /// When a label occurs twice.
    pub fn extended(&self, more: &[String]) -> Result<Self, FeasibilityError> {
        let mut extended = self.clone();
        for label in more {
            if extended.labels.contains(label) {
                return Err(FeasibilityError::Duplicate {
                    label: label.clone(),
                });
            }
            extended.single.push(extended.labels.len());
            extended.labels.push(label.clone());
        }
        Ok(extended)
    }

    /// The layout of the first `count` parameters, without the bodies that are not completely among
    /// them.
    pub(crate) fn first(&self, count: usize) -> Self {
        let inside = |column: &usize| *column < count;
        let bodies = self.bodies.iter();
        let single = self.single.iter().copied();
        let any_sign = self.any_sign.iter().copied();
        Self {
            labels: self.labels.iter().take(count).cloned().collect(),
            bodies: bodies
                .filter(|b| b.columns.iter().all(inside))
                .cloned()
                .collect(),
            single: single.filter(inside).collect(),
            any_sign: any_sign.filter(inside).collect(),
        }
    }

    /// Checks whether parameters are physical, without any solver: by the eigenvalues of the
    /// pseudo-inertias and the signs of the single parameters.
    ///
    /// # Errors
    /// When the length does not fit, or the scale is not positive.
    ///
    /// ```
    /// use regen_identify::feasibility::{ParameterLayout, SYMBOLS, Scale};
    ///
    /// let labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}(1)")).collect();
    /// let layout = ParameterLayout::new(&labels)?;
    /// let ball = [0.1, 0.0, 0.0, 0.1, 0.0, 0.1, 0.0, 0.0, 0.0, 2.0];
    /// assert!(layout.check(&ball, Scale::default())?.is_physical());
    /// // Izz > Ixx + Iyy contradicts the triangle inequality
    /// let impossible = [0.1, 0.0, 0.0, 0.1, 0.0, 0.3, 0.0, 0.0, 0.0, 2.0];
    /// assert!(!layout.check(&impossible, Scale::default())?.is_physical());
    /// # Ok::<(), regen_identify::feasibility::FeasibilityError>(())
    /// ```
    pub fn check(&self, phi: &[f64], scale: Scale) -> Result<Check, FeasibilityError> {
        size("phi", self.len(), phi.len())?;
        if !scale.is_valid() {
            return Err(FeasibilityError::NotFinite {
                what: "scale",
                index: 0,
            });
        }
        let eigenvalue = |body: &Body| scale.smallest_eigenvalue(&body.columns.map(|c| phi[c]));
        // a NaN counts as negative
        let negative = |&&c: &&usize| phi[c].is_nan() || phi[c] < 0.0;
        Ok(Check {
            eigenvalues: self.bodies.iter().map(eigenvalue).collect(),
            negative: self
                .single
                .iter()
                .filter(negative)
                .map(|&c| self.labels[c].clone())
                .collect(),
        })
    }

    /// The unit of each parameter in this scale.
    pub(super) fn units(&self, scale: Scale) -> Vec<f64> {
        let mut units = vec![scale.single(); self.len()];
        let ten: InertialParameters = scale.units();
        for body in &self.bodies {
            for (column, unit) in body.columns.iter().zip(ten) {
                units[*column] = unit;
            }
        }
        units
    }
}

/// The matrix B by which r observed unknowns (base parameters) combine p parameters:
/// `beta = B phi`.
#[derive(Clone, Debug, PartialEq)]
pub struct BaseMap {
    labels: Vec<String>,
    parameters: usize,
    /// B, r x p, row by row.
    rows: Vec<Vec<f64>>,
    /// Linear forms in the parameters that the model takes as zero, each with its name.
    zeros: Vec<(String, Vec<f64>)>,
}

impl BaseMap {
    /// The base parameters of a model.
    ///
    /// # Errors
    /// When a term belongs to none of the parameters.
    pub fn from_base(base: &BaseInfo<'_>, parameters: usize) -> Result<Self, FeasibilityError> {
        let mut rows = Vec::with_capacity(base.base.len());
        for combination in base.base {
            let mut row = vec![0.0; parameters];
            for term in combination.terms {
                let Some(slot) = row.get_mut(term.index) else {
                    return Err(FeasibilityError::Unknown {
                        what: "parameter",
                        label: term.parameter.to_owned(),
                    });
                };
                *slot += term.value;
            }
            rows.push(row);
        }
        Self::new(base.base.iter().map(|b| b.label.to_owned()).collect(), rows)
    }

    /// The base parameters of a model, with the forms that its spec takes as zero.
    ///
    /// # Errors
    /// When a term belongs to none of the parameters.
    pub fn from_model<M: BaseModel<f64> + ?Sized>(
        model: &M,
        parameters: usize,
    ) -> Result<Self, FeasibilityError> {
        let mut zeros = Vec::with_capacity(model.zeros().len());
        for form in model.zeros() {
            let mut row = vec![0.0; parameters];
            for term in form.terms {
                let slot = row.get_mut(term.index);
                *slot.ok_or_else(|| FeasibilityError::Unknown {
                    what: "parameter",
                    label: term.parameter.to_owned(),
                })? += term.value;
            }
            zeros.push((form.label.to_owned(), row));
        }
        Self::from_base(&model.base_info(), parameters)?.with_zeros(zeros)
    }

    /// Combinations from their r labels and r rows of p factors.
    ///
    /// # Errors
    /// When lengths do not fit or a factor is not finite.
    pub fn new(labels: Vec<String>, rows: Vec<Vec<f64>>) -> Result<Self, FeasibilityError> {
        size("rows", labels.len(), rows.len())?;
        let parameters = rows.first().map_or(0, Vec::len);
        for row in &rows {
            size("row", parameters, row.len())?;
            finite("row", row)?;
        }
        Ok(Self {
            labels,
            parameters,
            rows,
            zeros: Vec::new(),
        })
    }

    /// Adds linear forms in the p parameters that the model takes as zero, from `base: zero`,
    /// `equal` and `drop` of its spec. The combinations describe the forces only for parameters
    /// that fulfil these equations, so verdicts and fits include them.
    ///
    /// # Errors
    /// When lengths do not fit or a factor is not finite.
    pub fn with_zeros(mut self, zeros: Vec<(String, Vec<f64>)>) -> Result<Self, FeasibilityError> {
        for (_, row) in &zeros {
            size("zeros", self.parameters, row.len())?;
            finite("zeros", row)?;
        }
        self.zeros = zeros;
        Ok(self)
    }

    /// The linear forms that are zero, each with its name and p factors.
    pub fn zeros(&self) -> &[(String, Vec<f64>)] {
        &self.zeros
    }

    /// The identity: each parameter is a combination without others, for factors of a full
    /// regressor.
    pub fn identity<S: AsRef<str>>(labels: &[S]) -> Self {
        let n = labels.len();
        let row = |k: usize| (0..n).map(|j| if j == k { 1.0 } else { 0.0 }).collect();
        Self {
            labels: labels.iter().map(|l| l.as_ref().to_owned()).collect(),
            parameters: n,
            rows: (0..n).map(row).collect(),
            zeros: Vec::new(),
        }
    }

    /// The labels of the r combinations.
    pub fn labels(&self) -> &[String] {
        &self.labels
    }

    /// The number p of parameters.
    pub fn parameters(&self) -> usize {
        self.parameters
    }

    /// The rows of B: the p factors of each combination.
    pub fn rows(&self) -> &[Vec<f64>] {
        &self.rows
    }

    /// Computes `B phi`, the values of the r combinations.
    ///
    /// # Errors
    /// When the length does not fit.
    pub fn apply(&self, phi: &[f64]) -> Result<Vec<f64>, FeasibilityError> {
        size("phi", self.parameters, phi.len())?;
        let dot = |row: &Vec<f64>| row.iter().zip(phi).map(|(a, b)| a * b).sum();
        Ok(self.rows.iter().map(dot).collect())
    }

    /// The map of some of the combinations, in the given order.
    ///
    /// # Errors
    /// When a combination does not exist.
    pub fn select(&self, kept: &[usize]) -> Result<Self, FeasibilityError> {
        let mut labels = Vec::new();
        let mut rows = Vec::new();
        for &k in kept {
            let (Some(label), Some(row)) = (self.labels.get(k), self.rows.get(k)) else {
                return Err(FeasibilityError::Size {
                    what: "combinations",
                    expected: self.labels.len(),
                    got: k + 1,
                });
            };
            labels.push(label.clone());
            rows.push(row.clone());
        }
        Ok(Self {
            labels,
            parameters: self.parameters,
            rows,
            zeros: self.zeros.clone(),
        })
    }

    /// The map with further parameters appended, each as a combination without others.
    #[must_use]
    pub fn extended(&self, more: &[String]) -> Self {
        let parameters = self.parameters + more.len();
        let mut rows = self.rows.clone();
        for row in &mut rows {
            row.resize(parameters, 0.0);
        }
        for k in 0..more.len() {
            let mut row = vec![0.0; parameters];
            row[self.parameters + k] = 1.0;
            rows.push(row);
        }
        let mut zeros = self.zeros.clone();
        for (_, row) in &mut zeros {
            row.resize(parameters, 0.0);
        }
        Self {
            labels: [self.labels.as_slice(), more].concat(),
            parameters,
            rows,
            zeros,
        }
    }
}
