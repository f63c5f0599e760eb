//! The decision whether a physical robot can have given base parameters, with a proof either way.

use super::error::{finite, size};
use super::inertia::{ENTRIES, TRIANGLE, eigenvalues, functional};
use super::least_defect::least_defect;
use super::program::{Affine, Program};
use super::{BaseMap, Bound, FeasibilityError, Options, ParameterLayout, Scale};

/// A certificate whose defect is only rounding counts as a proof when a robot that escapes it must
/// be at least this many times as large as the base parameters.
const MIN_ESCAPE_RATIO: f64 = 1e6;
/// The tolerances of the solver that are tried until there is a proof.
const ACCURACIES: [f64; 3] = [1e-11, 1e-13, 1e-9];
/// Parameters reproduce base parameters when the difference is at most this fraction of the base
/// parameter or of the terms that it is the sum of.
const REPRODUCTION_TOLERANCE: f64 = 1e-11;

/// Weights on base parameters for which the weighted sum is not negative for any physical robot,
/// but is negative for the given values: a proof that no physical robot has these values.
#[derive(Clone, Debug, PartialEq)]
pub struct InfeasibilityCertificate {
    /// One weight for each base parameter, then one for each of [`BaseMap::zeros`].
    pub weights: Vec<f64>,
    /// The weighted sum of the given base parameters; negative.
    pub value: f64,
    /// By how much the functional can be negative: minus the smallest eigenvalue of its matrices
    /// for the bodies, or minus its smallest factor of a single parameter; 0 for an exact proof.
    pub defect: f64,
}

impl InfeasibilityCertificate {
    /// Computes value and defect of weights without the solver: the functional's matrices follow
    /// from the weights, and their eigenvalues decide.
    ///
    /// # Errors
    /// When lengths do not fit.
    pub fn new(
        layout: &ParameterLayout,
        combinations: &BaseMap,
        beta: &[f64],
        scale: Scale,
        weights: Vec<f64>,
    ) -> Result<Self, FeasibilityError> {
        size("beta", combinations.rows().len(), beta.len())?;
        size(
            "weights",
            beta.len() + combinations.zeros().len(),
            weights.len(),
        )?;
        size("parameters", layout.len(), combinations.parameters())?;
        let units = layout.units(scale);
        let mut c = vec![0.0; layout.len()];
        let zeros = combinations.zeros().iter().map(|(_, row)| row);
        for (row, weight) in combinations.rows().iter().chain(zeros).zip(&weights) {
            for (sum, factor) in c.iter_mut().zip(row) {
                *sum += weight * factor;
            }
        }
        for (sum, unit) in c.iter_mut().zip(&units) {
            *sum *= unit;
        }
        let of_bodies = layout
            .bodies()
            .iter()
            .map(|body| eigenvalues(&functional(&body.columns.map(|k| c[k])))[0]);
        let of_single = layout.single().iter().map(|k| c[*k]);
        // an offset of either sign has no bound: its factor must be 0
        let of_offsets = layout.any_sign().iter().map(|k| -c[*k].abs());
        let all = of_bodies.chain(of_single).chain(of_offsets);
        // weights so large that a sum overflows prove nothing
        let worst = |x: f64| if x.is_nan() { f64::NEG_INFINITY } else { x };
        let least = all.map(worst).fold(0.0, f64::min);
        Ok(Self {
            value: weights.iter().zip(beta).map(|(w, b)| w * b).sum(),
            weights,
            defect: -least,
        })
    }

    /// The size that a physical robot must have at least to escape the proof, as the sum of the
    /// traces of all pseudo-inertias, of the single parameters and of the sizes of the offsets, in
    /// units of the scale; infinite if the proof is exact.
    pub fn escape(&self) -> f64 {
        if self.defect > 0.0 {
            -self.value / self.defect
        } else {
            f64::INFINITY
        }
    }
}

/// Whether a physical robot can have given base parameters.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// A physical robot has these base parameters.
    Feasible {
        /// The p parameters of such a robot, SI.
        phi: Vec<f64>,
        /// The smallest eigenvalue of its pseudo-inertias, in units of the scale; the search stops
        /// at 1.
        margin: f64,
    },
    /// No physical robot has these base parameters.
    Infeasible {
        /// The proof, which is checked without the solver.
        certificate: InfeasibilityCertificate,
    },
    /// The values are so close to the border of the feasible set that double precision cannot
    /// decide.
    Undecided {
        /// The smallest eigenvalue that was reached, in units of the scale.
        margin: f64,
    },
}

impl Verdict {
    /// Whether a physical robot was found.
    pub fn is_feasible(&self) -> bool {
        matches!(self, Self::Feasible { .. })
    }
}

/// The role of a parameter: its index among the free ones, or the combination that it leads.
pub(super) enum Role {
    Free(usize),
    Lead(usize),
}

/// Assigns the roles of all parameters and returns the number of free ones. Each combination is led
/// by a parameter that has the factor 1 there and occurs in no other.
pub(super) fn roles(combinations: &BaseMap) -> Result<(Vec<Role>, usize), FeasibilityError> {
    let p = combinations.parameters();
    let mut lead = vec![None; p];
    for (k, row) in combinations.rows().iter().enumerate() {
        #[allow(clippy::float_cmp, reason = "a leading factor is 1 as it is written")]
        let own = |&j: &usize| {
            row[j] == 1.0
                && lead[j].is_none()
                && combinations
                    .rows()
                    .iter()
                    .enumerate()
                    .all(|(other, r)| other == k || r[j] == 0.0)
        };
        let Some(j) = (0..p).find(own) else {
            return Err(FeasibilityError::Unknown {
                what: "parameter that is only in the combination",
                label: combinations.labels()[k].clone(),
            });
        };
        lead[j] = Some(k);
    }
    let mut free = 0;
    let role = |lead: Option<usize>| {
        if let Some(k) = lead {
            return Role::Lead(k);
        }
        free += 1;
        Role::Free(free - 1)
    };
    let roles = lead.into_iter().map(role).collect();
    Ok((roles, free))
}

/// The combinations and the zero forms, rewritten so that each is led by a parameter of its own,
/// with their values; and each as a sum of the given combinations and zero forms.
pub(super) struct LeadingForms {
    pub(super) combinations: BaseMap,
    pub(super) values: Vec<f64>,
    sums: Vec<Vec<f64>>,
}

/// Adds the zero forms to the combinations, each led by a parameter of its own, by elimination.
pub(super) fn with_leads(
    combinations: &BaseMap,
    beta: &[f64],
) -> Result<LeadingForms, FeasibilityError> {
    let (own, _) = roles(combinations)?;
    let r = combinations.rows().len();
    let zeros = combinations.zeros();
    let mut rows = combinations.rows().to_vec();
    let mut labels = combinations.labels().to_vec();
    let mut values = beta.to_vec();
    let unit = |k: usize| -> Vec<f64> {
        let all = 0..r + zeros.len();
        all.map(|j| if j == k { 1.0 } else { 0.0 }).collect()
    };
    let mut sums: Vec<Vec<f64>> = (0..r).map(unit).collect();
    let mut leads = vec![0; r];
    for (j, role) in own.iter().enumerate() {
        if let Role::Lead(k) = role {
            leads[*k] = j;
        }
    }
    let subtract = |a: &mut [f64], b: &[f64], factor: f64| {
        for (x, y) in a.iter_mut().zip(b) {
            *x -= factor * y;
        }
    };
    for (k, (name, zero)) in zeros.iter().enumerate() {
        let (mut row, mut sum, mut value) = (zero.clone(), unit(r + k), 0.0);
        let size = row.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        for (place, &j) in leads.iter().enumerate() {
            let factor = row[j];
            if factor != 0.0 {
                subtract(&mut row, &rows[place], factor);
                subtract(&mut sum, &sums[place], factor);
                value -= factor * values[place];
                row[j] = 0.0;
            }
        }
        let pivot = (0..row.len()).fold(0, |b, j| if row[j].abs() > row[b].abs() { j } else { b });
        let lead = row.get(pivot).copied().unwrap_or(0.0);
        // the form follows from the others and is not needed
        if lead.abs() <= REPRODUCTION_TOLERANCE * size {
            continue;
        }
        for x in row.iter_mut().chain(&mut sum) {
            *x /= lead;
        }
        value /= lead;
        row[pivot] = 1.0;
        for place in 0..rows.len() {
            let factor = rows[place][pivot];
            if factor != 0.0 {
                subtract(&mut rows[place], &row, factor);
                subtract(&mut sums[place], &sum, factor);
                values[place] -= factor * value;
                rows[place][pivot] = 0.0;
            }
        }
        rows.push(row);
        sums.push(sum);
        values.push(value);
        leads.push(pivot);
        labels.push(name.clone());
    }
    Ok(LeadingForms {
        combinations: BaseMap::new(labels, rows)?,
        values,
        sums,
    })
}

/// All parameters with given base parameters, from values of the free ones.
pub(super) fn complete(
    combinations: &BaseMap,
    roles: &[Role],
    beta: &[f64],
    free: &[f64],
) -> Vec<f64> {
    let mut phi: Vec<f64> = roles
        .iter()
        .map(|role| match role {
            Role::Free(f) => free[*f],
            Role::Lead(_) => 0.0,
        })
        .collect();
    let sums: Vec<f64> = combinations
        .rows()
        .iter()
        .zip(beta)
        .map(|(row, b)| b - row.iter().zip(&phi).map(|(f, x)| f * x).sum::<f64>())
        .collect();
    for (slot, role) in phi.iter_mut().zip(roles) {
        if let Role::Lead(k) = role {
            *slot = sums[*k];
        }
    }
    phi
}

/// Each parameter, in its unit, as an expression in the free parameters, which are the first
/// variables, in their units; and the units of the free parameters.
pub(super) fn expressions(
    combinations: &BaseMap,
    roles: &[Role],
    units: &[f64],
    beta: &[f64],
) -> (Vec<Affine>, Vec<f64>) {
    let free_units: Vec<f64> = roles
        .iter()
        .zip(units)
        .filter_map(|(role, unit)| matches!(role, Role::Free(_)).then_some(*unit))
        .collect();
    let expression = |(role, unit): (&Role, &f64)| match role {
        Role::Free(f) => Affine {
            terms: vec![(*f, 1.0)],
            constant: 0.0,
        },
        Role::Lead(k) => {
            let row = &combinations.rows()[*k];
            let others = roles
                .iter()
                .zip(row)
                .filter_map(|(role, factor)| match role {
                    Role::Free(f) if *factor != 0.0 => Some((*f, -factor * free_units[*f] / unit)),
                    _ => None,
                });
            Affine {
                terms: others.collect(),
                constant: beta[*k] / unit,
            }
        }
    };
    let all = roles.iter().zip(units).map(expression).collect();
    (all, free_units)
}

/// Whether parameters have the given base parameters, up to rounding of the sums.
pub(super) fn reproduces(combinations: &BaseMap, phi: &[f64], beta: &[f64]) -> bool {
    let mut rows = combinations.rows().iter().zip(beta);
    rows.all(|(row, b)| {
        let terms = || row.iter().zip(phi).map(|(f, x)| f * x);
        let size = terms().map(f64::abs).sum::<f64>();
        (terms().sum::<f64>() - b).abs() <= REPRODUCTION_TOLERANCE * size.max(b.abs())
    })
}

/// Decides whether any physical robot has the given base parameters (Yoshida and Khalil, 2000).
///
/// A semidefinite programme maximises the margin of all bodies over all parameters that have these
/// base parameters. Its solution or its dual is the proof, or the solution of a second programme that
/// seeks the best functional, and it is checked here without the solver:
/// [`Verdict::Feasible`] holds parameters whose eigenvalues were computed,
/// [`Verdict::Infeasible`] a functional whose eigenvalues were computed.
///
/// - `beta`: r base parameters, SI, of these combinations.
///
/// # Errors
/// When lengths do not fit, a value is not finite, or a combination has no parameter that occurs in
/// no other combination.
///
/// ```
/// use regen_identify::feasibility::{BaseMap, ParameterLayout, SYMBOLS, Scale, Verdict, verdict};
///
/// let labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}(1)")).collect();
/// let layout = ParameterLayout::new(&labels)?;
/// // only Izz and mx are observed: any mx is possible, because the mass is free
/// let all = BaseMap::identity(&labels);
/// let observed = all.select(&[5, 6])?;
/// assert!(verdict(&layout, &observed, &[0.1, -3.0], Scale::default())?.is_feasible());
/// let Verdict::Infeasible { certificate } =
///     verdict(&layout, &observed, &[-0.1, 0.0], Scale::default())?
/// else {
///     panic!("a moment of inertia cannot be negative");
/// };
/// assert!(certificate.weights[0] > 0.0 && certificate.value < 0.0);
/// # Ok::<(), regen_identify::feasibility::FeasibilityError>(())
/// ```
pub fn verdict(
    layout: &ParameterLayout,
    combinations: &BaseMap,
    beta: &[f64],
    scale: Scale,
) -> Result<Verdict, FeasibilityError> {
    size("parameters", layout.len(), combinations.parameters())?;
    size("beta", combinations.rows().len(), beta.len())?;
    finite("beta", beta)?;
    if !scale.is_valid() {
        return Err(FeasibilityError::NotFinite {
            what: "scale",
            index: 0,
        });
    }
    let given = (combinations, beta);
    let leading = with_leads(combinations, beta)?;
    let (combinations, beta) = (&leading.combinations, leading.values.as_slice());
    let (roles, free) = roles(combinations)?;
    let units = layout.units(scale);
    let mut program = Program::default();
    let (expressions, free_units) = expressions(combinations, &roles, &units, beta);
    program.variables(free);
    let margin = program.variables(1);

    // a single parameter that is a base parameter without others needs no solver
    let alone = |j: &usize| expressions[*j].terms.is_empty();
    let certify = |weights: Vec<f64>| {
        let mut sums = vec![0.0; given.1.len() + given.0.zeros().len()];
        for (weight, row) in weights.iter().zip(&leading.sums) {
            for (sum, factor) in sums.iter_mut().zip(row) {
                *sum += weight * factor;
            }
        }
        InfeasibilityCertificate::new(layout, given.0, given.1, scale, sums)
    };
    for j in layout.single().iter().copied().filter(alone) {
        if let Role::Lead(k) = roles[j]
            && beta[k] < 0.0
        {
            let mut weights = vec![0.0; beta.len()];
            weights[k] = 1.0;
            let certificate = certify(weights)?;
            return Ok(Verdict::Infeasible { certificate });
        }
    }

    let mut rows: Vec<(usize, Vec<usize>)> = Vec::new();
    for &j in layout.single().iter().filter(|j| !alone(j)) {
        let mut above = expressions[j].clone();
        above.terms.push((margin, -1.0));
        rows.push((program.not_negative(&above), vec![j]));
    }
    let cap = Affine {
        terms: vec![(margin, -1.0)],
        constant: 1.0,
    };
    program.not_negative(&cap);
    for body in layout.bodies() {
        let triangle = body_triangle(&expressions, &body.columns, |diagonal| {
            diagonal.terms.push((margin, -1.0));
        });
        rows.push((program.semidefinite(4, &triangle), body.columns.to_vec()));
    }
    program.minimise(margin, -1.0);
    // without a proof only the margin is returned: the last digits of a dual that just fails to be
    // a proof depend on where the solver stops
    let mut margin_reached = f64::NEG_INFINITY;
    for accuracy in ACCURACIES {
        let solved = program.solve(accuracy)?;
        let free_values: Vec<f64> = (0..free).map(|f| solved.x[f] * free_units[f]).collect();
        let phi = complete(combinations, &roles, beta, &free_values);
        let check = layout.check(&phi, scale)?;
        if check.is_physical() && reproduces(combinations, &phi, beta) {
            let margin = check.margin();
            return Ok(Verdict::Feasible { phi, margin });
        }

        // the dual matrices as factors of all parameters; the factors of the leading parameters are the
        // weights
        let mut c = vec![0.0; layout.len()];
        for (row, columns) in &rows {
            if let [single] = columns[..] {
                c[single] += solved.z[*row];
                continue;
            }
            for (k, ((r, s), entry)) in TRIANGLE.into_iter().zip(ENTRIES).enumerate() {
                let twice = if r == s {
                    1.0
                } else {
                    core::f64::consts::SQRT_2
                };
                for (parameter, factor) in entry {
                    c[columns[*parameter]] += solved.z[row + k] * twice * factor;
                }
            }
        }
        let mut weights = vec![0.0; beta.len()];
        for (j, role) in roles.iter().enumerate() {
            if let Role::Lead(k) = role {
                weights[*k] = c[j] / units[j];
            }
        }
        let certificate = certify(weights)?;
        if proves(&certificate, given.0, given.1, &units) {
            return Ok(Verdict::Infeasible { certificate });
        }
        margin_reached = margin_reached.max(check.margin());
    }
    // the dual may miss a proof far from the border
    let is_outside = margin_reached < 0.0;
    for accuracy in ACCURACIES.into_iter().filter(|_| is_outside) {
        let weights = least_defect(layout, combinations, beta, &units, accuracy)?;
        let certificate = certify(weights)?;
        if proves(&certificate, given.0, given.1, &units) {
            return Ok(Verdict::Infeasible { certificate });
        }
    }
    Ok(Verdict::Undecided {
        margin: margin_reached,
    })
}

/// The lowest and the highest value that a linear form in the parameters has for physical robots: 0 and
/// infinite, or the reverse, where it has one sign.
pub(crate) fn physical_range(
    layout: &ParameterLayout,
    form: &[f64],
    options: &Options,
) -> (f64, f64) {
    let units = layout.units(options.scale);
    let scaled: Vec<f64> = form.iter().zip(&units).map(|(f, unit)| f * unit).collect();
    let size = scaled.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let at = |k: usize| scaled.get(k).copied().unwrap_or_default();
    let free = |k: &usize| {
        let own = |b: &&Bound| layout.labels().get(*k) == Some(&b.parameter);
        let own = options.bounds.iter().find(own);
        layout.any_sign().contains(k) || own.is_some_and(|b| b.lowest < 0.0)
    };
    let singles = || layout.single().iter().chain(layout.any_sign());
    let is_positive = |sign: f64| {
        let bodies = layout.bodies().iter();
        let of_bodies =
            bodies.map(|b| eigenvalues(&functional(&b.columns.map(|k| sign * at(k))))[0]);
        let of_singles = singles().map(|k| {
            if free(k) {
                -at(*k).abs()
            } else {
                sign * at(*k)
            }
        });
        let least = of_bodies.chain(of_singles).fold(0.0, f64::min);
        least >= -REPRODUCTION_TOLERANCE * size
    };
    let end = |sign: f64| {
        if is_positive(-sign) {
            0.0
        } else {
            sign * f64::INFINITY
        }
    };
    (end(-1.0), end(1.0))
}

/// Whether a certificate for these base parameters counts as a proof.
fn proves(
    certificate: &InfeasibilityCertificate,
    combinations: &BaseMap,
    beta: &[f64],
    units: &[f64],
) -> bool {
    // the largest base parameter with a weight: others, such as a large coefficient of friction, do
    // not count
    let largest = beta
        .iter()
        .zip(combinations.rows())
        .zip(&certificate.weights)
        .filter(|(_, weight)| **weight != 0.0)
        .map(|((b, row), _)| {
            let unit = row.iter().zip(units).map(|(f, u)| f.abs() * u);
            b.abs() / unit.fold(f64::MIN_POSITIVE, f64::max)
        })
        .fold(1.0, f64::max);
    certificate.value < 0.0 && certificate.escape() >= MIN_ESCAPE_RATIO * largest
}

/// Whether the weights of another certificate prove that no physical robot has these base parameters.
pub(super) fn refutes(
    layout: &ParameterLayout,
    combinations: &BaseMap,
    beta: &[f64],
    scale: Scale,
    weights: &[f64],
) -> Result<bool, FeasibilityError> {
    let certificate =
        InfeasibilityCertificate::new(layout, combinations, beta, scale, weights.to_vec())?;
    Ok(proves(
        &certificate,
        combinations,
        beta,
        &layout.units(scale),
    ))
}

/// An entry of a pseudo-inertia in terms of the parameters' expressions.
pub(super) fn combine(
    expressions: &[Affine],
    columns: &[usize; 10],
    entry: &[(usize, f64)],
) -> Affine {
    let mut sum = Affine::default();
    for (parameter, factor) in entry {
        let expression = &expressions[columns[*parameter]];
        sum.constant += factor * expression.constant;
        for (variable, value) in &expression.terms {
            match sum.terms.iter_mut().find(|(v, _)| v == variable) {
                Some((_, slot)) => *slot += factor * value,
                None => sum.terms.push((*variable, factor * value)),
            }
        }
    }
    sum
}

/// The upper triangle of a body's pseudo-inertia, after `change` of each entry on the diagonal.
pub(super) fn body_triangle(
    expressions: &[Affine],
    columns: &[usize; 10],
    change: impl Fn(&mut Affine),
) -> Vec<Affine> {
    let entry = |((r, s), entry): ((usize, usize), &[(usize, f64)])| {
        let mut sum = combine(expressions, columns, entry);
        if r == s {
            change(&mut sum);
        }
        sum
    };
    TRIANGLE.into_iter().zip(ENTRIES).map(entry).collect()
}
