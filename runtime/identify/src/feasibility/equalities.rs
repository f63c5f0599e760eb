//! Equations between parameters, and what is left when they are solved.

use super::FeasibilityError;
use super::program::Affine;

/// A coefficient below this part of the largest one of its equation has cancelled.
const CANCELLED: f64 = 1e-11;
/// What an equation without unknowns may be off, as a part of what it was a sum of.
const AGREES: f64 = 1e-9;

/// Sums of multiples of parameters, in their units, that are zero.
#[derive(Clone, Debug)]
pub(super) struct Equality {
    pub(super) form: Affine,
    /// Who asks for it, in words.
    pub(super) source: String,
    /// Part of what a user asks for: it must act, or some of its group must.
    pub(super) group: Option<usize>,
    /// How well its factors are known: those below this part of the largest are taken as zero.
    pub(super) rounded: f64,
}

/// All parameters as expressions in those that are left.
#[derive(Clone, Debug)]
pub(super) struct Solved {
    /// One for each parameter, in units.
    pub(super) expressions: Vec<Affine>,
    /// The parameter that each variable is.
    pub(super) variables: Vec<usize>,
}

/// A form with the parameters that are gone replaced, its terms in order; and the size of what
/// was added up in each.
fn substituted(form: &Affine, gone: &[Option<Affine>]) -> (Vec<f64>, Vec<f64>, f64, f64) {
    let n = gone.len();
    let (mut terms, mut sizes) = (vec![0.0; n], vec![0.0_f64; n]);
    let (mut constant, mut size) = (form.constant, form.constant.abs());
    let mut add = |k: usize, x: f64| {
        terms[k] += x;
        sizes[k] = sizes[k].max(x.abs());
    };
    for &(k, factor) in &form.terms {
        match &gone[k] {
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

/// Solves equations one after another, each for the parameter with its largest factor.
pub(super) fn solve(
    parameters: usize,
    equalities: &[Equality],
) -> Result<Solved, FeasibilityError> {
    let mut gone: Vec<Option<Affine>> = vec![None; parameters];
    let mut acting: Vec<(usize, &str, bool)> = Vec::new();
    for equality in equalities {
        let largest = equality.form.terms.iter().map(|(_, f)| f.abs());
        let largest = largest.fold(0.0, f64::max);
        let (mut terms, sizes, constant, size) = substituted(&equality.form, &gone);
        for (x, size) in terms.iter_mut().zip(&sizes) {
            if x.abs() <= CANCELLED * size || x.abs() <= equality.rounded * largest {
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
            match acting.iter_mut().find(|(g, ..)| *g == group) {
                Some((.., acts)) => *acts |= pivot.is_some(),
                None => acting.push((group, &equality.source, pivot.is_some())),
            }
        }
        let Some(pivot) = pivot else {
            // of the size of what was added up, or of the implied equation's own accuracy
            if constant.abs() > AGREES.max(equality.rounded) * size.max(largest) {
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
        let mut one = vec![None; parameters];
        one[pivot] = Some(by);
        for slot in &mut gone {
            let uses = |old: &Affine| old.terms.iter().any(|(j, _)| *j == pivot);
            let Some(old) = slot.take_if(|old| uses(old)) else {
                continue;
            };
            let (terms, sizes, constant, _) = substituted(&old, &one);
            *slot = Some(Affine {
                terms: (0..parameters)
                    .filter(|j| terms[*j].abs() > CANCELLED * sizes[*j])
                    .map(|j| (j, terms[j]))
                    .collect(),
                constant,
            });
        }
        gone[pivot] = one[pivot].take();
    }
    if let Some((_, source, _)) = acting.iter().find(|(.., acts)| !acts) {
        return Err(FeasibilityError::Idle(format!(
            "{source} says nothing that the rest does not say already"
        )));
    }
    let variables: Vec<usize> = (0..parameters).filter(|k| gone[*k].is_none()).collect();
    let mut place = vec![0; parameters];
    for (v, k) in variables.iter().enumerate() {
        place[*k] = v;
    }
    let expressions = gone.into_iter().enumerate().map(|(k, by)| match by {
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
