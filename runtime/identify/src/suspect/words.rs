//! Describes a change of columns in words, and as the assignments of columns that make it.

use regen_runtime::{BaseModel, Parameter, Symbol};

use super::judge::{EffortChange, MIN_COMPARED_PART, MIN_CORRELATION, Remedy, Suspicion};
use super::positions::Contradiction;
use super::{
    Change, CutOff, Drift, Drifting, FarEffort, Nominal, Parts, Reading, Sample, Shift, Spikes,
    left_of,
};
use crate::data::{Assignment, Quantity};
use crate::text;

/// Factors between units, with their description.
const UNITS: [(f64, &str); 5] = [
    (1e-3, "1000 times too large, as in mN m or mm"),
    (1e3, "1000 times too small, as in kN"),
    (std::f64::consts::PI / 180.0, "in degrees"),
    (9.806_65, "in kgf, or without a gain of about 10"),
    (0.01, "in cm"),
];

/// The same for positions.
const POSITION_UNITS: [(f64, &str); 3] = [
    (std::f64::consts::PI / 180.0, "to be in degrees"),
    (1e-3, "to be in mm"),
    (0.01, "to be in cm"),
];

/// The evidence of the nominal bodies for the signs that a change flips, where they agree with it.
fn agreeing(change: &Change, nominal: &[Nominal]) -> Option<String> {
    let turned = |effort: usize| change.efforts.get(effort).is_some_and(|r| r.factor < 0.0);
    let agree = nominal.iter().filter(|n| {
        turned(n.effort) && n.part >= MIN_COMPARED_PART && n.correlation >= MIN_CORRELATION
    });
    let figures: Vec<String> = agree.map(|n| format!("{:.3}", n.correlation)).collect();
    (!figures.is_empty()).then(|| {
        format!(
            "the weights and inertias of the nominal bodies contradict the signs without that \
             (correlation with it {})",
            figures.join(", ")
        )
    })
}

/// A log and the assignment of its columns.
#[derive(Debug)]
pub struct LogColumns<'a, M: ?Sized> {
    /// The name of the log.
    pub file: &'a str,
    /// The assignments of columns that do not have the names of their quantities.
    pub given: &'a [Assignment],
    /// The model whose quantities the columns contain.
    pub model: &'a M,
}

/// A factor rounded to three significant digits, all that a fit determines of it.
pub(super) fn rounded(factor: f64) -> f64 {
    format!("{factor:.2e}").parse().unwrap_or(factor)
}

impl<M: BaseModel<f64> + ?Sized> LogColumns<'_, M> {
    /// The name of a coordinate.
    pub(super) fn name(&self, coordinate: usize) -> String {
        let names = self.model.info().coordinates;
        names
            .get(coordinate)
            .map_or_else(String::new, |n| (*n).to_owned())
    }

    /// The present assignment of a quantity.
    pub(super) fn source(&self, quantity: &Quantity) -> Assignment {
        let found = self.given.iter().find(|a| a.quantity == *quantity);
        let own = || Assignment::new(quantity.clone(), &quantity.to_string());
        found.cloned().unwrap_or_else(own)
    }

    /// The present assignment of an effort.
    pub(super) fn effort(&self, effort: usize) -> Assignment {
        let coordinate = self.model.info().actuated.get(effort).copied();
        let name = coordinate.map_or_else(String::new, |c| self.name(c));
        self.source(&Quantity::Effort(name))
    }

    /// The factor that belongs to the joint and not to the column: the torque constant of a
    /// current, else 1.
    pub(super) fn drive_gain(&self, quantity: &Quantity) -> f64 {
        let source = self.source(quantity);
        if source.is_current() {
            source.gain.unwrap_or(1.0)
        } else {
            1.0
        }
    }

    /// The assignments that flip the signs of these efforts.
    pub(super) fn with_flipped_signs(&self, efforts: &[usize]) -> Vec<Assignment> {
        let each = efforts.iter().map(|k| {
            let source = self.effort(*k);
            Assignment {
                factor: -source.factor,
                ..source
            }
        });
        each.collect()
    }

    /// A suspicion that is not about errors.
    pub(super) fn suspicion(&self, what: String, remedy: Remedy) -> Suspicion {
        Suspicion {
            file: self.file.to_owned(),
            what,
            error: None,
            changed: None,
            left_in_sample: None,
            efforts: Vec::new(),
            remedy,
        }
    }

    /// The suspicion that a position contradicts the others, which are enough to know it.
    pub(super) fn contradicting(&self, sample: &Sample, found: Contradiction) -> Option<Suspicion> {
        let name = self.name(*sample.measured.get(found.place)?);
        let source = self.source(&Quantity::Position(name.clone()));
        let known = POSITION_UNITS.iter().find_map(|(factor, words)| {
            let near = (found.factor.abs() * factor - 1.0).abs() < 0.02;
            near.then_some((factor.copysign(found.factor), *words))
        });
        let one = (found.factor.abs() - 1.0).abs() < 0.02;
        let shifted = one && found.factor > 0.0;
        let (factor, words) = match known {
            _ if shifted => (1.0, format!("is {} off", text::figure(found.offset))),
            _ if one => (-1.0, "has the other sign".to_owned()),
            Some((factor, words)) => (factor, format!("looks {words}")),
            None => {
                let times = text::figure_of(3, found.factor);
                (
                    rounded(1.0 / found.factor),
                    format!("is {times} times that"),
                )
            }
        };
        let column = &source.column;
        let what = format!(
            "column `{column}` contradicts the other positions, which determine `{name}` without it: it \
             {words}"
        );
        let remedy = if shifted {
            let offset = text::figure(source.offset - found.offset);
            Remedy::Read {
                advice: vec![format!(
                    "Give `{name}` in the columns of the experiment file `offset: {offset}`, or leave \
                     the column out"
                )],
                columns: Vec::new(),
            }
        } else {
            Remedy::columns(vec![Assignment {
                factor: source.factor * factor,
                ..source
            }])
        };
        Some(self.suspicion(what, remedy))
    }

    /// The suspicion that these efforts are not what acted in some rows.
    pub(super) fn spikes(&self, spikes: &[Spikes]) -> Option<Suspicion> {
        let one = |own: &Spikes| {
            let source = self.effort(own.effort);
            let (rows, first) = match own.rows {
                1 => ("1 row".to_owned(), ""),
                count => (format!("{count} rows"), "the first is "),
            };
            format!(
                "column `{}` jumps by up to {} in {rows} and is back in the next ({first}row {})",
                source.column,
                text::figure_of(3, (own.largest / source.factor).abs()),
                own.row
            )
        };
        let words: Vec<String> = spikes.iter().map(one).collect();
        let advice =
            "Leave these rows out, or give --huber 1.345 without a filter, which would spread \
                      them"
                .to_owned();
        (!words.is_empty()).then(|| {
            let remedy = Remedy::Read {
                advice: vec![advice],
                columns: Vec::new(),
            };
            self.suspicion(words.join(", and "), remedy)
        })
    }

    /// The suspicion that something is of the wrong sign, as these coordinates have negative inertias.
    pub(super) fn light(&self, coordinates: &[usize]) -> Suspicion {
        let names = coordinates.iter().map(|c| format!("`{}`", self.name(*c)));
        let names = names.collect::<Vec<_>>().join(", ");
        self.suspicion(
            format!("these parameters make the inertia of {names} negative"),
            Remedy::Read {
                advice: vec![
                    "The sign of an effort or of a position, the delay of an effort or the spec's \
                     gravity may be wrong"
                        .to_owned(),
                ],
                columns: Vec::new(),
            },
        )
    }

    /// The suspicion that efforts are cut off.
    pub(super) fn cut_off(&self, efforts: &[CutOff]) -> Option<Suspicion> {
        let one = |own: &CutOff| {
            let source = self.effort(own.effort);
            let [at, needed] =
                [own.at, own.needed].map(|x| text::figure_of(3, (x / source.factor).abs()));
            format!(
                "column `{}` is cut off where its size is about {at}, in {:.0} % of the rows, where the model needs up to \
                 {needed}",
                source.column,
                100.0 * own.part
            )
        };
        let words: Vec<String> = efforts.iter().map(one).collect();
        let advice = "The actuator or its sensor is saturated: leave these rows out, or log a motion that \
                      needs less";
        (!words.is_empty()).then(|| {
            let remedy = Remedy::Read {
                advice: vec![advice.to_owned()],
                columns: Vec::new(),
            };
            self.suspicion(words.join(", and "), remedy)
        })
    }

    /// The suspicion that a log is of two parts.
    ///
    /// - `before`: the errors of the equations of the whole log.
    pub(super) fn divided(&self, parts: &Parts, before: &[f64]) -> Suspicion {
        let time = text::figure_of(3, parts.time);
        let mut out = self.suspicion(
            format!("up to about {time} s and from there on, other parameters fit"),
            Remedy::Read {
                advice: vec![
                    "A payload, a tool, a gain or a unit changes, or another run begins: find the row, and \
                     give the parts as runs of their own, by `times` in an experiment file"
                        .to_string(),
                ],
                columns: Vec::new(),
            },
        );
        let percent = |errors: &[f64]| Some(100.0 * errors.iter().fold(0.0, |m: f64, e| m.max(*e)));
        (out.error, out.changed) = (percent(before), percent(&parts.after));
        out
    }

    /// The suspicion that efforts drift over the log.
    pub(super) fn drifting(&self, drifts: &[Drift]) -> Option<Suspicion> {
        let one = |own: &Drift| {
            let source = self.effort(own.effort);
            let column = source.column;
            match own.change {
                Drifting::Constant(change) => {
                    let change = text::figure_of(3, change / source.factor);
                    format!(
                        "column `{column}` drifts by {change} from what the model explains of it"
                    )
                }
                Drifting::Gain(change) => {
                    let how = if change > 0.0 { "grows" } else { "shrinks" };
                    let percent = text::figure_of(2, 100.0 * change.abs());
                    format!(
                        "column `{column}` {how} by {percent} % over the log beside what the model explains of it"
                    )
                }
            }
        };
        let words: Vec<String> = drifts.iter().map(one).collect();
        let advice = "Its sensor or the friction of its joint warms up: take the zero of the sensor again \
                      before each run, log runs that are shorter, or log after the robot has warmed up";
        (!words.is_empty()).then(|| {
            let remedy = Remedy::Read {
                advice: vec![advice.to_owned()],
                columns: Vec::new(),
            };
            self.suspicion(words.join(", and "), remedy)
        })
    }

    /// The suspicion that efforts are not what acted in a part of the log.
    pub(super) fn far(&self, efforts: &[FarEffort]) -> Option<Suspicion> {
        let one = |own: &FarEffort| {
            let source = self.effort(own.effort);
            let size = |x: f64| text::figure_of(3, (x / source.factor).abs());
            let [first, last] = own.times.map(text::figure);
            let when = if first == last {
                format!("at {first} s")
            } else {
                format!("from {first} s to {last} s")
            };
            format!(
                "column `{}` is up to {} off what the model explains of it {when}, and {} elsewhere",
                source.column,
                size(own.largest),
                size(own.usual),
            )
        };
        let words: Vec<String> = efforts.iter().map(one).collect();
        (!words.is_empty()).then(|| self.suspicion(words.join(", and "), Remedy::Bounded))
    }

    /// The suspicion that these efforts have constant offsets, which direction-dependent friction
    /// has absorbed; `None` if there are none.
    pub(super) fn shifted(&self, shifts: &[Shift]) -> Option<Suspicion> {
        let mut words = Vec::new();
        let mut subtract = Vec::new();
        for shift in shifts {
            let source = self.effort(shift.effort);
            let coordinate = self.model.info().actuated.get(shift.effort).copied();
            let name = coordinate.map_or_else(String::new, |c| self.name(c));
            let offset = shift.offset / source.factor;
            let [forward, back] = shift.friction;
            words.push(format!(
                "column `{}` looks shifted by a constant {offset:.4} +- {} (Fc+({name}) is \
                 {forward:.4} and Fc-({name}) is {back:.4})",
                source.column,
                rounded((shift.sigma / source.factor).abs()),
            ));
            subtract.push(format!("{offset:.4} from column `{}`", source.column));
        }
        let advice = format!(
            "Subtract {}, or add to the spec what pulls one way, such as a spring or a cable; \
             while the joint moves, Fc+ and Fc- take a constant up",
            subtract.join(" and ")
        );
        (!words.is_empty()).then(|| {
            let what = words.join(", and ") + ": friction does not drive a joint one way";
            let advice = vec![advice];
            self.suspicion(
                what,
                Remedy::Read {
                    advice,
                    columns: Vec::new(),
                },
            )
        })
    }

    /// The suspicion that a change of columns corrects the log; `None` if it changes nothing.
    ///
    /// - `nominal`: the comparison with the nominal bodies' efforts, with the change.
    pub(super) fn change(
        &self,
        change: &Change,
        sample: &Sample,
        nominal: &[Nominal],
    ) -> Option<Suspicion> {
        let info = self.model.info();
        let efforts: Vec<Quantity> = info
            .actuated
            .iter()
            .map(|c| Quantity::Effort(self.name(*c)))
            .collect();
        let positions: Vec<Quantity> = sample
            .measured
            .iter()
            .map(|c| Quantity::Position(self.name(*c)))
            .collect();
        let own: Vec<f64> = efforts.iter().map(|e| self.drive_gain(e)).collect();
        let (mut words, mut columns, mut advice) = (Vec::new(), Vec::new(), Vec::new());
        words.extend(self.clock(change, sample, &mut columns, &mut advice));
        self.describe(&positions, &change.positions, &[], &mut words, &mut columns);
        columns.extend(self.with_derivatives(&columns, sample));
        for (place, late) in &change.late {
            let column = positions.get(*place).map(|of| self.source(of).column);
            let column = column.unwrap_or_default();
            words.push(format!("column `{column}` looks {:.0} ms late", 1e3 * late));
            let quantity = positions.get(*place);
            let own = quantity.map(|of| self.late(of, *late, &mut columns));
            columns.extend(own);
        }
        if change.behind != 0.0 {
            let when = if change.behind > 0.0 { "late" } else { "early" };
            words.push(format!(
                "all efforts look {} ms {when}",
                text::figure_of(3, 1e3 * change.behind.abs())
            ));
            let option = |(k, c): (usize, &usize)| {
                let corrected = sample.delays.get(k).copied().unwrap_or(0.0);
                let all = text::figure_of(3, change.behind + corrected);
                format!("--delay {}={all}", self.name(*c))
            };
            let options: Vec<String> = info.actuated.iter().enumerate().map(option).collect();
            advice.push(format!("Give {}", options.join(" ")));
        }
        let mut read = change.efforts.clone();
        for (reading, offset) in read.iter_mut().zip(&change.offsets) {
            reading.offset = -offset;
        }
        self.describe(&efforts, &read, &own, &mut words, &mut columns);
        // friction of each direction identifies a constant, too, or else the spec can
        let is_apart = |name: &String| {
            let forward = Parameter::new(Symbol::Friction("Fc+"), name);
            !info.parameters.contains(&forward)
        };
        let shifted = info.actuated.iter().zip(&change.offsets);
        let shifted = shifted.filter(|(_, offset)| **offset != 0.0);
        let joints = shifted.map(|(c, _)| self.name(*c)).filter(is_apart);
        let joints: Vec<String> = joints.map(|name| format!("`{name}`")).collect();
        if !joints.is_empty() {
            advice.push(format!(
                "Give {} `offset: true` in the spec, which identifies the constant, or take it off",
                joints.join(" and ")
            ));
        }
        if words.is_empty() {
            return None;
        }
        if change.sign {
            words.push("friction drives the joint without that".to_owned());
        }
        words.extend(agreeing(change, nominal));
        let percent = |errors: &[f64]| {
            let worst = errors.iter().copied().reduce(f64::max);
            worst.map(|worst| 100.0 * worst)
        };
        let names = info.independent.iter().map(|c| self.name(*c));
        let each = names.zip(&change.after).enumerate();
        let each = each.map(|(k, (name, after))| EffortChange {
            name,
            error: change.before.get(k).map(|before| 100.0 * before),
            changed: 100.0 * after,
        });
        Some(Suspicion {
            file: self.file.to_owned(),
            what: words.join(", and "),
            error: percent(&change.before),
            changed: percent(&change.after),
            left_in_sample: (!change.after.is_empty()).then(|| left_of(&change.after)),
            efforts: each.collect(),
            remedy: Remedy::Read { advice, columns },
        })
    }

    /// The assignment of a position, with those of other changes, that reads its column so much later, s.
    fn late(&self, quantity: &Quantity, late: f64, others: &mut Vec<Assignment>) -> Assignment {
        let known = others.iter().position(|own| own.quantity == *quantity);
        let source = known.map_or_else(|| self.source(quantity), |place| others.remove(place));
        let late = text::figure_of(3, source.late + late);
        Assignment {
            late: late.parse().unwrap_or(source.late),
            ..source
        }
    }

    /// The words on times of another rate, with what reads them; `None` if they are right.
    fn clock(
        &self,
        change: &Change,
        sample: &Sample,
        columns: &mut Vec<Assignment>,
        advice: &mut Vec<String>,
    ) -> Option<String> {
        if (change.times - 1.0).abs() < f64::EPSILON {
            return None;
        }
        let [old, new] =
            [1.0, change.times].map(|times| text::figure_of(4, 1.0 / (sample.step * times)));
        let mut time = self.source(&Quantity::Time);
        let is_given = self.given.iter().any(|a| a.quantity == Quantity::Time);
        if let (Some(title), false) = (&sample.time_column, is_given) {
            time.column.clone_from(title);
        }
        if sample.titles.contains(&time.column) {
            columns.push(Assignment {
                factor: time.factor * change.times,
                ..time
            });
        } else {
            advice.push(format!("Give --rate {new}"));
        }
        Some(format!(
            "the rate of the rows looks like {new} Hz and not {old} Hz"
        ))
    }

    /// The assignments of the velocities and accelerations that the log has, which agree with its positions,
    /// where these are read in another way.
    fn with_derivatives(&self, positions: &[Assignment], sample: &Sample) -> Vec<Assignment> {
        let kinds: [fn(String) -> Quantity; 2] = [Quantity::Velocity, Quantity::Acceleration];
        let names = |of: &Quantity| of.coordinate().map(str::to_owned);
        let measured = sample.measured.iter().map(|c| self.name(*c));
        let sources: Vec<(String, Assignment)> = measured
            .map(|name| (name.clone(), self.source(&Quantity::Position(name))))
            .collect();
        let mut out = Vec::new();
        for (new, kind) in positions
            .iter()
            .flat_map(|new| kinds.map(|kind| (new, kind)))
        {
            let from = sources.iter().find(|(_, own)| own.column == new.column);
            let (Some(to), Some((from, old))) = (names(&new.quantity), from) else {
                continue;
            };
            // another zero changes no derivative
            if *from == to && (new.factor - old.factor).abs() < f64::EPSILON {
                continue;
            }
            let source = self.source(&kind(from.clone()));
            if sample.titles.contains(&source.column) {
                out.push(Assignment {
                    quantity: kind(to),
                    factor: source.factor * new.factor / old.factor,
                    ..source
                });
            }
        }
        out
    }

    /// Appends the words and the assignments for the changed quantities of one kind.
    fn describe(
        &self,
        quantities: &[Quantity],
        read: &[Reading],
        own: &[f64],
        words: &mut Vec<String>,
        columns: &mut Vec<Assignment>,
    ) {
        let column = |k: usize| {
            quantities
                .get(k)
                .map_or_else(String::new, |q| self.source(q).column)
        };
        let plain = |k: usize, r: &Reading| {
            r.from == k && (r.factor - 1.0).abs() < f64::EPSILON && r.offset == 0.0
        };
        let changed = read.iter().enumerate().filter(|(k, r)| !plain(*k, r));
        let changed: Vec<(usize, &Reading)> = changed.collect();
        let moved: Vec<usize> = changed
            .iter()
            .filter(|(k, r)| r.from != *k)
            .map(|c| c.0)
            .collect();
        if !moved.is_empty() {
            let names: Vec<String> = moved.iter().map(|k| format!("`{}`", column(*k))).collect();
            words.push(format!("columns {} look swapped", names.join(" and ")));
        }
        let mut units: Vec<(f64, Vec<String>)> = Vec::new();
        let (mut turned, mut shifted) = (Vec::new(), Vec::new());
        for (k, r) in &changed {
            let constant = own.get(*k).zip(own.get(r.from)).map_or(1.0, |(a, b)| a / b);
            let factor = r.factor / constant;
            if factor < 0.0 {
                turned.push(format!("`{}`", column(r.from)));
            }
            let size = factor.abs();
            if (size - 1.0).abs() > 1e-9 {
                let same = units
                    .iter_mut()
                    .find(|(f, _)| (size / *f - 1.0).abs() < 1e-9);
                match same {
                    Some((_, names)) => names.push(format!("`{}`", column(r.from))),
                    None => units.push((size, vec![format!("`{}`", column(r.from))])),
                }
            }
            let (Some(to), Some(from)) = (quantities.get(*k), quantities.get(r.from)) else {
                continue;
            };
            let source = self.source(from);
            let factor = if UNITS.iter().any(|u| (size / u.0 - 1.0).abs() < 1e-9)
                || (size - 1.0).abs() < 1e-9
            {
                r.factor
            } else if matches!(to, Quantity::Position(_)) {
                let ratio = text::figure_of(5, size);
                ratio.parse().unwrap_or(size).copysign(factor)
            } else {
                rounded(size).copysign(factor) * constant
            };
            if r.offset != 0.0 {
                let value = text::figure_of(5, -r.offset / (factor * source.factor));
                let unit = if source.unit.is_some() {
                    " in its unit"
                } else {
                    ""
                };
                shifted.push(if matches!(to, Quantity::Effort(_)) {
                    format!(
                        "column `{}` contains a constant of {value}{unit} that the model lacks",
                        source.column
                    )
                } else {
                    format!(
                        "column `{}` looks shifted by {value}{unit}: its zero is not that of the spec",
                        source.column
                    )
                });
            }
            let offset = text::figure_of(6, source.offset * factor + r.offset);
            columns.push(Assignment {
                quantity: to.clone(),
                factor: source.factor * factor,
                offset: offset.parse().unwrap_or(r.offset),
                ..source
            });
        }
        match &turned[..] {
            [] => {}
            [one] => words.push(format!("column {one} looks as if its sign were flipped")),
            more => words.push(format!(
                "columns {} look as if their signs were flipped",
                more.join(", ")
            )),
        }
        for (size, names) in units {
            let unit = UNITS.iter().find(|u| (size / u.0 - 1.0).abs() < 1e-9);
            let missing = match quantities.first() {
                Some(Quantity::Position(_)) => "a gear's ratio",
                _ => "a gain",
            };
            let what = unit.map_or_else(
                || {
                    let times = 1.0 / size;
                    format!("{times:.3} times what it should be: {missing} or a unit is missing")
                },
                |own| own.1.to_owned(),
            );
            let plural = if names.len() > 1 {
                ("columns", "look")
            } else {
                ("column", "looks")
            };
            words.push(format!(
                "{} {} {} {what}",
                plural.0,
                names.join(", "),
                plural.1
            ));
        }
        words.extend(shifted);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::swings_for_tests::{Swings, sample, swings};
    use super::*;

    fn said(change: &Change, given: &[Assignment], titles: &[&str]) -> Suspicion {
        let model: Swings = swings(false);
        let columns = LogColumns {
            file: "log.csv",
            given,
            model: &model,
        };
        let sample = Sample {
            titles: titles.iter().map(|title| (*title).to_owned()).collect(),
            time_column: Some("stamp".to_owned()),
            ..sample()
        };
        columns.change(change, &sample, &[]).unwrap()
    }

    fn columns_of(found: &Suspicion) -> Vec<(String, f64)> {
        let Remedy::Read { columns, .. } = &found.remedy else {
            panic!("{found:?}");
        };
        columns
            .iter()
            .map(|own| (own.column.clone(), own.factor))
            .collect()
    }

    #[test]
    fn signs_units_and_other_factors_of_efforts_have_words_of_their_own() {
        let with = |factor: f64| {
            let mut change = Change::none(3, 3);
            change.efforts[1].factor = factor;
            said(&change, &[], &[])
        };
        let sign = with(-1.0);
        assert_eq!(
            sign.what,
            "column `tau_q2` looks as if its sign were flipped"
        );
        assert_eq!(columns_of(&sign), [("tau_q2".to_owned(), -1.0)]);
        let unit = with(1e-3);
        assert_eq!(
            unit.what,
            "column `tau_q2` looks 1000 times too large, as in mN m or mm"
        );
        let other = with(0.25);
        assert!(
            other.what.contains("looks 4.000 times what it should be"),
            "{}",
            other.what
        );
        // efforts with the same factor are told together
        let mut change = Change::none(3, 3);
        change.efforts[0].factor = 1e-3;
        change.efforts[2].factor = 1e-3;
        let both = said(&change, &[], &[]);
        assert!(
            both.what
                .starts_with("columns `tau_q1`, `tau_q3` look 1000 times"),
            "{}",
            both.what
        );
    }

    #[test]
    fn a_late_position_is_read_so_much_later_with_its_other_changes() {
        let mut change = Change::none(3, 3);
        change.positions[1].factor = -1.0;
        change.late = vec![(1, 0.0314), (2, 0.05)];
        let given: Assignment = "q3=leg:late:0.01".parse().unwrap();
        let found = said(&change, &[given], &[]);
        let Remedy::Read { advice, columns } = &found.remedy else {
            panic!("{found:?}");
        };
        let read = columns
            .iter()
            .map(|own| (own.column.as_str(), own.factor, own.late));
        assert_eq!(
            read.collect::<Vec<_>>(),
            [("q2", -1.0, 0.0314), ("leg", 1.0, 0.06)]
        );
        assert!(advice.is_empty() && found.what.contains("column `leg` looks 50 ms late"));
    }

    #[test]
    fn another_rate_is_a_factor_on_the_column_that_the_times_are_read_from() {
        let mut change = Change::none(3, 3);
        change.times = 0.4;
        let found = said(&change, &[], &["stamp", "q1"]);
        assert_eq!(columns_of(&found), [("stamp".to_owned(), 0.4)]);
        assert!(
            found.what.contains("looks like 125.0 Hz and not 50.00 Hz"),
            "{}",
            found.what
        );
        // the assignment of another quantity says nothing of the times
        let given: Assignment = "tau_q1=motor".parse().unwrap();
        let found = said(&change, &[given], &["stamp", "q1"]);
        assert_eq!(columns_of(&found), [("stamp".to_owned(), 0.4)]);
        let given: Assignment = "t=clock:ms".parse().unwrap();
        let found = said(&change, &[given], &["stamp", "clock"]);
        let [(title, factor)] = &columns_of(&found)[..] else {
            panic!("{found:?}");
        };
        assert!(title == "clock" && (factor - 4e-4).abs() < 1e-12);
        // rows without a column of times have a rate
        let found = said(&change, &[], &["q1"]);
        assert!(
            matches!(&found.remedy, Remedy::Read { advice, .. } if advice == &["Give --rate 125.0"])
        );
    }

    #[test]
    fn a_position_that_is_a_multiple_of_what_the_others_say_is_divided_by_it() {
        let model: Swings = swings(false);
        let columns = LogColumns {
            file: "log.csv",
            given: &[],
            model: &model,
        };
        let with = |factor: f64| {
            let found = Contradiction {
                place: 1,
                factor,
                offset: 0.0,
            };
            columns.contradicting(&sample(), found).unwrap()
        };
        let found = with(2.5);
        assert!(
            found.what.ends_with("it is 2.50 times that"),
            "{}",
            found.what
        );
        assert_eq!(columns_of(&found), [("q2".to_owned(), 0.4)]);
        assert!(with(1e3).what.ends_with("it looks to be in mm"));
        assert_eq!(columns_of(&with(-1.0)), [("q2".to_owned(), -1.0)]);
    }
}
