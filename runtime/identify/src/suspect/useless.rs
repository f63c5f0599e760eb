//! Efforts of no use: the same in all rows, copies of others, or without their sign. Their equations can be left out where the others
//! determine the parameters.

use super::words::LogColumns;
use super::{DOUBTED_ERROR, MIN_GAIN_PER_COLUMN, Remedy, Sample, Suspicion, WholeFit};
use crate::data::{Assignment, Measured, Quantity};
use regen_runtime::BaseModel;

/// The largest relative change of an effort that is the same throughout.
const MAX_ROUNDING: f64 = 1e-9;

/// The factor by which the errors of other efforts may be larger without the equations of one.
const MAX_LOSS: f64 = 1.02;

/// The assignments that leave equations out, and the errors of the other efforts, percent.
type LeftOut = (Vec<Assignment>, Vec<(String, f64)>);

impl<M: BaseModel<f64> + ?Sized> LogColumns<'_, M> {
    /// The efforts, or moving positions, of no use.
    ///
    /// - `whole`: fits the whole log with other columns.
    pub(super) fn useless(&self, sample: &Sample, whole: &WholeFit<'_>) -> Option<Suspicion> {
        constant(self, sample, whole).or_else(|| copies(self, sample, whole))
    }

    /// The suspicion that efforts have lost their signs.
    pub(super) fn rectified(&self, efforts: &[usize], whole: &WholeFit<'_>) -> Suspicion {
        let names = self.effort_columns(efforts);
        let what = format!(
            "{names} never {change} sign, and {sizes} explained if {was} lost",
            change = if efforts.len() > 1 {
                "change their"
            } else {
                "changes its"
            },
            sizes = if efforts.len() > 1 {
                "their sizes are"
            } else {
                "its size is"
            },
            was = if efforts.len() > 1 {
                "their signs were"
            } else {
                "its sign was"
            },
        );
        let advice =
            "The drive gives the size of its current or effort alone: log it with its sign";
        self.suspicion(
            what,
            Remedy::Read {
                advice: vec![advice.to_owned()],
                columns: self.without_worse(efforts, whole).unwrap_or_default(),
            },
        )
    }

    /// The titles of the columns of efforts, each after its noun.
    fn effort_columns(&self, efforts: &[usize]) -> String {
        let names: Vec<String> = (efforts.iter().copied())
            .map(|k| format!("`{}`", self.effort(k).column))
            .collect();
        let noun = if names.len() > 1 { "columns" } else { "column" };
        format!("{noun} {}", names.join(", "))
    }

    /// The assignments that leave the equations of efforts of no use out, if the others fit no worse then.
    fn without_worse(&self, efforts: &[usize], whole: &WholeFit<'_>) -> Option<Vec<Assignment>> {
        let before = whole(&[]).unwrap_or_default();
        let (columns, errors) = self.without(efforts, whole)?;
        let is_no_worse = errors.iter().all(|(name, error)| {
            let before = before.iter().find(|own| own.0 == *name);
            before.is_none_or(|before| *error < MAX_LOSS * before.1)
        });
        is_no_worse.then_some(columns)
    }

    /// The assignment that leaves out the one of two equal efforts that is the copy: the model explains the other, and
    /// not the other way round.
    fn without_copy(&self, pair: [usize; 2], whole: &WholeFit<'_>) -> Option<Vec<Assignment>> {
        let name = |k: usize| Some(self.name(*self.model.info().actuated.get(k)?));
        let left = |out: usize, kept: usize| -> Option<(Vec<Assignment>, f64)> {
            let (columns, errors) = self.without(&[out], whole)?;
            let kept = name(kept)?;
            let error = errors.iter().find(|own| own.0 == kept)?.1;
            Some((columns, error / 100.0))
        };
        let [a, b] = pair;
        let (first, second) = (left(a, b)?, left(b, a)?);
        let (best, other) = if first.1 < second.1 {
            (first, second)
        } else {
            (second, first)
        };
        let is_told_apart = other.1 > DOUBTED_ERROR.max(MIN_GAIN_PER_COLUMN * best.1);
        (best.1 < DOUBTED_ERROR && is_told_apart).then_some(best.0)
    }

    /// The assignments that leave the equations of some efforts out, and the errors of the others then; `None` where
    /// these do not determine the parameters.
    fn without(&self, efforts: &[usize], whole: &WholeFit<'_>) -> Option<LeftOut> {
        let name = |k: &usize| Some(self.name(*self.model.info().actuated.get(*k)?));
        let names: Option<Vec<String>> = efforts.iter().map(name).collect();
        let names = names?;
        let one = |name: &String| format!("tau_{name}=unmeasured").parse().ok();
        let columns: Option<Vec<Assignment>> = names.iter().map(one).collect();
        let mut errors = whole(columns.as_deref()?)?;
        errors.retain(|own| !names.contains(&own.0));
        (!errors.is_empty()).then_some((columns?, errors))
    }
}

/// The efforts that are the same throughout: they are not measured, and no unit, sign or offset makes
/// them so.
fn constant<M: BaseModel<f64> + ?Sized>(
    columns: &LogColumns<'_, M>,
    sample: &Sample,
    whole: &WholeFit<'_>,
) -> Option<Suspicion> {
    let is_constant = |k: &usize| {
        if sample.unmeasured.contains(k) {
            return false;
        }
        let values = sample.states.iter().filter_map(|s| s.efforts.get(*k));
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), u| {
            (low.min(*u), high.max(*u))
        });
        // a filter leaves rounding errors
        high - low <= f64::MIN_POSITIVE.max(MAX_ROUNDING * low.abs().max(high.abs()))
    };
    let constant = (0..columns.model.info().actuated.len()).filter(is_constant);
    let constant: Vec<usize> = constant.collect();
    let is_one = match constant.len() {
        0 => return None,
        count => count == 1,
    };
    let what = format!(
        "{} {} the same in all rows: {} not measured",
        columns.effort_columns(&constant),
        if is_one { "is" } else { "are" },
        if is_one {
            "this effort is"
        } else {
            "these efforts are"
        },
    );
    let advice = "No parameter is worth anything with it: log the efforts, or give other columns";
    Some(columns.suspicion(
        what,
        Remedy::Read {
            advice: vec![advice.to_owned()],
            columns: columns.without_worse(&constant, whole).unwrap_or_default(),
        },
    ))
}

/// The efforts, or moving positions, that are the same as others in all rows: one column is a copy.
fn copies<M: BaseModel<f64> + ?Sized>(
    columns: &LogColumns<'_, M>,
    sample: &Sample,
    whole: &WholeFit<'_>,
) -> Option<Suspicion> {
    let efforts = (0..columns.model.info().actuated.len()).map(|k| columns.effort(k).column);
    let positions = sample.measured.iter().map(|c| {
        let of = Quantity::Position(columns.name(*c));
        columns.source(&of).column
    });
    let (efforts, positions): (Vec<String>, Vec<String>) = (efforts.collect(), positions.collect());
    let mut pairs = same(&efforts, sample, |state| &state.efforts);
    // corrected delays of both may differ
    let is_measured = |pair: &&[usize; 2]| !pair.iter().any(|k| sample.unmeasured.contains(k));
    for [a, b] in sample.copied_efforts.iter().filter(is_measured) {
        let are_apart = efforts.get(*a) != efforts.get(*b);
        if are_apart && !pairs.contains(&[*a, *b]) {
            pairs.push([*a, *b]);
        }
    }
    let of_positions = same(&positions, sample, |state| &state.motion[0]);
    let words = |titles: &[String], pairs: &[[usize; 2]]| -> Vec<String> {
        let words = pairs.iter().filter_map(|[a, b]| {
            let (one, other) = (titles.get(*a)?, titles.get(*b)?);
            Some(format!(
                "columns `{one}` and `{other}` have the same values in all rows"
            ))
        });
        words.collect()
    };
    let said = [words(&efforts, &pairs), words(&positions, &of_positions)].concat();
    let left_out = match (&pairs[..], &of_positions[..]) {
        ([pair], []) => columns.without_copy(*pair, whole),
        _ => None,
    };
    let advice = "One of them is a copy, and what it should be is not in the log: log it, or give another column";
    (!said.is_empty()).then(|| {
        columns.suspicion(
            said.join(", and "),
            Remedy::Read {
                advice: vec![advice.to_owned()],
                columns: left_out.unwrap_or_default(),
            },
        )
    })
}

/// The pairs of quantities that are the same at all states and change.
fn same(titles: &[String], sample: &Sample, of: fn(&Measured) -> &Vec<f64>) -> Vec<[usize; 2]> {
    let value = |state: &Measured, k: usize| of(state).get(k).map(|x| x.to_bits());
    let changes = |k: &usize| {
        let first = sample.states.first().map(|state| value(state, *k));
        (sample.states.iter()).any(|state| Some(value(state, *k)) != first)
    };
    let twin = |k: usize| {
        let twin = (0..k).find(|j| {
            let mut states = sample.states.iter();
            titles[*j] != titles[k] && states.all(|state| value(state, *j) == value(state, k))
        });
        twin.map(|j| [j, k])
    };
    (0..titles.len()).filter(changes).filter_map(twin).collect()
}

#[cfg(test)]
mod tests {
    use super::super::suspicions;
    use super::super::swings_for_tests::{columns, sample, swings, with};
    use super::*;

    /// What is told of a sample, and the columns of the remedy, if fits of the whole log leave so much of the efforts:
    /// with all of them, and without the one of this name.
    fn told(of: &Sample, without: &str, left: [f64; 2]) -> (String, Vec<String>) {
        let model = swings(false);
        let whole = |columns: &[Assignment]| {
            let is_without = columns
                .iter()
                .any(|own| own.quantity.to_string() == without);
            let error = left[usize::from(is_without)];
            Some(
                ["q1", "q2", "q3"]
                    .map(|name| (name.to_owned(), error))
                    .to_vec(),
            )
        };
        let found = columns(&model).useless(of, &whole);
        let Some(found) = found else {
            return <_>::default();
        };
        let Remedy::Read { columns, .. } = &found.remedy else {
            panic!("{found:?}")
        };
        let columns = columns
            .iter()
            .map(|own| format!("{}={}", own.quantity, own.column));
        (found.what.clone(), columns.collect())
    }

    #[test]
    fn the_equations_of_a_useless_effort_are_left_out_where_the_others_fit_no_worse_then() {
        let constant = with(|s| s.efforts[1] = 3.0);
        let (what, columns) = told(&constant, "tau_q2", [90.0, 5.0]);
        assert!(what.contains("`tau_q2` is the same in all rows"), "{what}");
        assert_eq!(columns, ["tau_q2=unmeasured"]);
        assert_eq!(told(&constant, "tau_q2", [10.0, 60.0]).1, [""; 0]);
        // one of two is the copy, or nothing tells which
        let copied = with(|s| s.efforts[2] = s.efforts[0]);
        assert_eq!(
            told(&copied, "tau_q3", [90.0, 5.0]).1,
            ["tau_q3=unmeasured"]
        );
        assert_eq!(
            told(&copied, "tau_q1", [90.0, 5.0]).1,
            ["tau_q1=unmeasured"]
        );
        assert_eq!(told(&copied, "", [5.0, 5.0]).1, [""; 0]);
    }

    #[test]
    fn an_effort_without_its_sign_is_left_out_where_the_others_fit_no_worse_then() {
        let model = swings(false);
        let sample = with(|s| s.efforts[1] = s.efforts[1].abs());
        let told = |without: f64| {
            let whole = |columns: &[Assignment]| {
                let error = if columns.is_empty() { 10.0 } else { without };
                Some(["q1", "q3"].map(|name| (name.to_owned(), error)).to_vec())
            };
            let found = suspicions(&columns(&model), &sample, None, &whole, &mut |_, _| {});
            assert_eq!(found.len(), 1);
            assert_eq!(
                found[0].what,
                "column `tau_q2` never changes its sign, and its size is explained if its sign was lost"
            );
            found[0].remedy.gives_columns()
        };
        assert!(told(5.0));
        assert!(!told(20.0));
    }

    #[test]
    fn efforts_and_positions_that_are_copies_are_named() {
        let model = swings(false);
        let first = |of: &Sample| {
            let found = suspicions(&columns(&model), of, None, &|_| None, &mut |_, _| {});
            found
                .first()
                .map(|own| own.what.clone())
                .unwrap_or_default()
        };
        assert_eq!(first(&sample()), "");
        assert_eq!(
            first(&with(|s| s.efforts[2] = s.efforts[0])),
            "columns `tau_q1` and `tau_q3` have the same values in all rows"
        );
        // delays that are corrected hide a copy
        let late = Sample {
            copied_efforts: vec![[0, 2]],
            ..sample()
        };
        assert_eq!(
            first(&late),
            "columns `tau_q1` and `tau_q3` have the same values in all rows"
        );
        assert_eq!(
            first(&with(|s| s.motion[0][1] = s.motion[0][0])),
            "columns `q1` and `q2` have the same values in all rows"
        );
        assert_eq!(
            first(&with(|s| s.efforts[1] = 3.0)),
            "column `tau_q2` is the same in all rows: this effort is not measured"
        );
    }
}
