//! Linear equations between parameters, solved by elimination.

use super::FeasibilityError;
use super::program::Affine;

/// After an elimination, a coefficient counts as zero below this fraction of the largest term it
/// was summed from.
const CANCELLATION_PART: f64 = 1e-11;
/// An equation whose unknowns have all been eliminated is a contradiction when its constant exceeds
/// this fraction of the terms it was summed from.
const CONTRADICTION_TOLERANCE: f64 = 1e-9;

/// An equation: a sum of multiples of parameters, in their units, is zero.
#[derive(Clone, Debug)]
pub(super) struct Equality {
    pub(super) form: Affine,
    /// The source of the equation, as a phrase for error messages.
    pub(super) source: String,
    /// The constraint of the user that the equation is part of: at least one equation of a group
    /// must remove an unknown.
    pub(super) group: Option<usize>,
    /// The accuracy of the factors: those below this fraction of the largest count as zero.
    pub(super) rounded: f64,
}

/// All parameters as affine expressions in the variables that remain after the elimination.
#[derive(Clone, Debug)]
pub(super) struct Solved {
    /// One expression for each parameter, in its unit.
    pub(super) expressions: Vec<Affine>,
    /// For each variable, the index of the parameter that it is.
    pub(super) variables: Vec<usize>,
}

/// Substitutes the eliminated parameters into a form. Returns the factors of all parameters, the
/// largest term that was added up in each, the constant, and the largest term of the constant.
fn substituted(form: &Affine, eliminated: &[Option<Affine>]) -> (Vec<f64>, Vec<f64>, f64, f64) {
    let n = eliminated.len();
    let (mut terms, mut sizes) = (vec![0.0; n], vec![0.0_f64; n]);
    let (mut constant, mut size) = (form.constant, form.constant.abs());
    let mut add = |k: usize, x: f64| {
        terms[k] += x;
        sizes[k] = sizes[k].max(x.abs());
    };
    for &(k, factor) in &form.terms {
        match &eliminated[k] {
            None => add(k, factor),
            Some(by) => {
                for &(other, more) in &by.terms {
                    add(other, factor * more);
                }
                constant += factor * by.constant;
                size = size.max((factor * by.constant).abs());
            }
        }
    }
    (terms, sizes, constant, size)
}

/// Solves the equations one after another, each for the parameter with its largest factor.
pub(super) fn solve(
    parameters: usize,
    equalities: &[Equality],
) -> Result<Solved, FeasibilityError> {
    let mut eliminated: Vec<Option<Affine>> = vec![None; parameters];
    // each group of equations with its source, and whether one of them removed an unknown
    let mut groups: Vec<(usize, &str, bool)> = Vec::new();
    for equality in equalities {
        let largest = equality.form.terms.iter().map(|(_, f)| f.abs());
        let largest = largest.fold(0.0, f64::max);
        let (mut terms, sizes, constant, size) = substituted(&equality.form, &eliminated);
        for (x, size) in terms.iter_mut().zip(&sizes) {
            if x.abs() <= CANCELLATION_PART * size || x.abs() <= equality.rounded * largest {
                *x = 0.0;
            }
        }
        let pivot = (0..parameters).fold(None, |best: Option<usize>, k| {
            let more = best.is_none_or(|b| terms[k].abs() > terms[b].abs());
            if terms[k] != 0.0 && more {
                Some(k)
            } else {
                best
            }
        });
        if let Some(group) = equality.group {
            match groups.iter_mut().find(|(g, ..)| *g == group) {
                Some((.., acts)) => *acts |= pivot.is_some(),
                None => groups.push((group, &equality.source, pivot.is_some())),
            }
        }
        let Some(pivot) = pivot else {
            // relative to the terms that were added up, or to the accuracy of an equation that
            // follows from others
            if constant.abs() > CONTRADICTION_TOLERANCE.max(equality.rounded) * size.max(largest) {
                return Err(FeasibilityError::Contradiction(equality.source.clone()));
            }
            continue;
        };
        let lead = terms[pivot];
        let by = Affine {
            terms: (0..parameters)
                .filter(|k| *k != pivot && terms[*k] != 0.0)
                .map(|k| (k, -terms[k] / lead))
                .collect(),
            constant: if constant == 0.0 {
                0.0
            } else {
                -constant / lead
            },
        };
        // the new substitution is applied to the parameters that were eliminated before
        let mut one = vec![None; parameters];
        one[pivot] = Some(by);
        for slot in &mut eliminated {
            let uses = |old: &Affine| old.terms.iter().any(|(j, _)| *j == pivot);
            let Some(old) = slot.take_if(|old| uses(old)) else {
                continue;
            };
            let (terms, sizes, constant, _) = substituted(&old, &one);
            *slot = Some(Affine {
                terms: (0..parameters)
                    .filter(|j| terms[*j].abs() > CANCELLATION_PART * sizes[*j])
                    .map(|j| (j, terms[j]))
                    .collect(),
                constant,
            });
        }
        eliminated[pivot] = one[pivot].take();
    }
    if let Some((_, source, _)) = groups.iter().find(|(.., acts)| !acts) {
        return Err(FeasibilityError::Idle(format!(
            "{source} says nothing that the rest does not say already"
        )));
    }
    let variables: Vec<usize> = (0..parameters)
        .filter(|k| eliminated[*k].is_none())
        .collect();
    let mut place = vec![0; parameters];
    for (v, k) in variables.iter().enumerate() {
        place[*k] = v;
    }
    let expressions = eliminated.into_iter().enumerate().map(|(k, by)| match by {
        None => Affine {
            terms: vec![(place[k], 1.0)],
            constant: 0.0,
        },
        Some(mut by) => {
            for (j, _) in &mut by.terms {
                *j = place[*j];
            }
            by
        }
    });
    Ok(Solved {
        expressions: expressions.collect(),
        variables,
    })
}
