//! Finds dropouts: rows that repeat the one before in some columns, although what they measure went on.
//!
//! A topic that comes late leaves its last message in every row until the next one. Rows of a robot at
//! rest repeat too, so repeated values alone prove nothing. What comes before and after decides: a
//! signal that changes steadily before and after, and has moved by the changes of the meantime, did not
//! rest; nor did one whose noise changes it in every row before and after.

use std::collections::VecDeque;

/// The number of changes before and after a stretch by which it is judged.
const SIDE: usize = 6;
/// The least number of these that are needed.
const MIN_SIDE: usize = 3;
/// Number of the changes next to the stretch whose mean is the speed there.
const SPEED_CHANGES: usize = 4;
/// The least number of repeated rows: a single one is the jitter of a clock.
const MIN_REPEATS: usize = 2;
/// How far the change over a stretch may be from the one that the speeds on both sides predict, as a
/// part of it: a joint that rested, and moves again, has changed by one row's motion.
const PREDICTED_PART: f64 = 0.35;
/// The same, where only the speed behind the stretch is known: in parts of the predicted change.
const LEADING_PARTS: core::ops::RangeInclusive<f64> = 0.4..=2.5;
/// The least predicted change, in root mean squares of the second differences, which contain the noise.
const MIN_CHANGE_NOISE: f64 = 6.0;
/// The least predicted change, in the smallest changes around, which may be steps of an encoder.
const MIN_CHANGE_STEPS: f64 = 4.0;
/// The least predicted change, in changes from row to row.
const MIN_CHANGE_ROWS: f64 = 2.0;
/// Changes of sign among the changes before and after that show noise, with one on either side at least;
/// a smooth signal has one at a turning point.
const MIN_TURNS: usize = 2;
/// Signals with noise repeat by chance where they are rounded; a stretch is a dropout if fewer than this
/// number of so many repetitions are to be expected in the whole log.
const MAX_EXPECTED: f64 = 1e-2;
/// The least number of repeated rows at the end of a log.
const MIN_REPEATS_AT_END: usize = 8;
/// A signal that came to rest had a last change below this part of the mean of those before.
const MIN_UNBRAKED_PART: f64 = 0.7;
/// The same of signals that change in every row, of the larger one of the last two changes before, and
/// of the first two after; 0.57 is that of a constant deceleration.
const MIN_SHARP_PART: f64 = 0.7;
/// The least change over a stretch of one of these signals, in its next change, and of one with noise, in
/// the root mean square of those around.
const MIN_JUMP_RATIO: f64 = 2.0;
/// The number of dropouts of the same signals by which an effort that repeats its largest value is known
/// as another one: alone, it may be at its limit.
const MIN_ALIKE: usize = 2;
/// How many times longer than these another one may be.
const MAX_ALIKE_RATIO: usize = 2;
/// The largest number of stretches that are kept.
const MAX_STRETCHES: usize = 16_384;

/// Consecutive rows that repeat the one before in some entries.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Dropout {
    /// The lines of the first and the last row.
    pub(super) first: u64,
    pub(super) last: u64,
    /// The indices of the entries in [`LogRow::values`](super::reader::LogRow::values), ascending.
    pub(super) entries: Vec<usize>,
    /// The time from the row before to the row after, s; infinite at the ends of the log.
    pub(super) seconds: f64,
    /// Whether one signal repeats alone.
    pub(super) alone: bool,
}

/// What is known of one entry.
#[derive(Clone, Debug, Default)]
struct Signal {
    value: Option<f64>,
    /// The last changes since the last stretch of repeated rows, without the change at its end.
    changes: VecDeque<f64>,
    /// The number of rows that repeat the value so far.
    repeats: usize,
    /// The smallest and the largest value.
    range: Option<(f64, f64)>,
    /// The number of changes, and of rows that repeat the row before by themselves.
    all: usize,
    singles: usize,
}

impl Signal {
    /// Takes the next value; returns the number of rows that repeated the last one, and the change, if
    /// the change ends them.
    fn push(&mut self, value: f64) -> Option<(usize, f64)> {
        let (low, high) = self.range.unwrap_or((value, value));
        self.range = Some((low.min(value), high.max(value)));
        let before = self.value.replace(value)?;
        self.all += 1;
        let change = value - before;
        if change == 0.0 {
            self.repeats += 1;
            return None;
        }
        let repeats = core::mem::take(&mut self.repeats);
        if repeats >= MIN_REPEATS {
            return Some((repeats, change));
        }
        if repeats == 1 {
            self.singles += 1;
            self.add(0.0);
        }
        self.add(change);
        None
    }

    fn add(&mut self, change: f64) {
        if self.changes.len() == SIDE {
            self.changes.pop_front();
        }
        self.changes.push_back(change);
    }

    /// Forgets the rows so far, but for what is counted.
    fn pause(&mut self) {
        self.value = None;
        self.repeats = 0;
        self.changes.clear();
    }

    /// The probability that a value repeats by chance, which a single repetition shows; at least that of
    /// one repetition in the log.
    fn chance(&self) -> f64 {
        // of values that repeat with the probability p, the part p (1 - p)^2 are single repetitions
        (3.0 * (self.singles + 1) as f64 / (self.all + 1) as f64).min(0.5)
    }
}

/// A signal at a stretch: its changes on both sides.
#[derive(Clone, Debug)]
struct Member {
    entry: usize,
    value: f64,
    before: Vec<f64>,
    /// The change at the end of the stretch.
    jump: f64,
}

/// A stretch that is judged once more rows are known.
#[derive(Clone, Debug)]
struct Open {
    dropout: Dropout,
    rows: usize,
    members: Vec<Member>,
    /// The number of rows since its end.
    age: usize,
    /// Whether it begins with the log.
    leads: bool,
}

/// A stretch as far as it can be judged before the end of the log.
#[derive(Clone, Debug)]
struct Judged {
    dropout: Dropout,
    rows: usize,
    /// The entries that moved meanwhile.
    moved: Vec<usize>,
    /// The entries that moved meanwhile, unless their changes are few steps of an encoder.
    moved_steps: Vec<usize>,
    /// The entries with noise on both sides, and their values.
    noisy: Vec<(usize, f64)>,
    /// Those of them that do not show more than the noise of one change after the stretch: noise of a clock
    /// ends with the motion, so positions may have rested, and if they did not, then nothing is lost.
    unmoved: Vec<usize>,
    /// The entries that changed in every row on both sides, and did not come to rest; with their values.
    sharp: Vec<(usize, f64)>,
    /// Whether most of what repeats together did so, as far as a few rows on either side tell.
    alike: bool,
}

/// The row at which an entry began to repeat.
#[derive(Clone, Copy, Debug, Default)]
struct Start {
    line: u64,
    /// The time of the row before, s.
    time: f64,
    /// The number of the row, from 0.
    row: usize,
    /// Whether the row before is the first one, of the log or after a fault.
    leads: bool,
}

/// Looks for dropouts in rows that come one by one.
#[derive(Clone, Debug, Default)]
pub(super) struct DropoutFinder {
    signals: Vec<Signal>,
    starts: Vec<Start>,
    open: Vec<Open>,
    judged: Vec<Judged>,
    /// The line and the time of the last row.
    last: Option<(u64, f64)>,
    /// The number of rows, and that of the rows since the start or a fault.
    rows: usize,
    since: usize,
    ended: Vec<(usize, usize, f64)>,
}

impl DropoutFinder {
    /// Takes the next row.
    ///
    /// - `values`: its time, s, then the other entries.
    pub(super) fn push(&mut self, line: u64, values: &[f64]) {
        let Some((&time, rest)) = values.split_first() else {
            return;
        };
        self.signals.resize(rest.len(), Signal::default());
        self.starts.resize(rest.len(), Start::default());
        let mut ended = core::mem::take(&mut self.ended);
        ended.clear();
        let mut begins = false;
        for (k, value) in rest.iter().enumerate() {
            let Some((signal, start)) = self.signals.get_mut(k).zip(self.starts.get_mut(k)) else {
                continue;
            };
            match signal.push(*value) {
                Some((repeats, jump)) => ended.push((k, repeats, jump)),
                None if signal.repeats == 1 => {
                    *start = Start {
                        line,
                        time: self.last.map_or(time, |last| last.1),
                        row: self.rows,
                        leads: self.since == 1,
                    };
                }
                None => begins |= signal.repeats == MIN_REPEATS,
            }
        }
        for open in &mut self.open {
            open.age += 1;
        }
        // a new stretch ends what can be known of the changes after the last one
        let is_due = |open: &Open| open.age >= SIDE || begins;
        while self.open.first().is_some_and(is_due) {
            let open = self.open.remove(0);
            self.judge(open);
        }
        self.close(&ended, time);
        self.ended = ended;
        self.last = Some((line, time));
        self.rows += 1;
        self.since += 1;
    }

    /// Opens a stretch for each set of entries that ended at this row.
    fn close(&mut self, ended: &[(usize, usize, f64)], time: f64) {
        for (at, (k, rows, _)) in ended.iter().enumerate() {
            let is_known = ended.iter().take(at).any(|(_, other, _)| other == rows);
            let Some((start, (last, _))) = self.starts.get(*k).copied().zip(self.last) else {
                continue;
            };
            if is_known {
                continue;
            }
            // entries that began earlier and still repeat, or end here too, were not written either
            let covers = |(k, signal): (usize, &Signal)| {
                let began = self.starts.get(k)?.row;
                let ends = ended.iter().any(|(other, ..)| *other == k);
                let repeats = ends || signal.repeats >= MIN_REPEATS;
                (repeats && began <= start.row).then_some(k + 1)
            };
            let entries = self.signals.iter().enumerate().filter_map(covers).collect();
            let own = ended.iter().filter(|(_, other, _)| other == rows);
            let members = own.filter_map(|(k, _, jump)| {
                let signal = self.signals.get_mut(*k)?;
                let before = core::mem::take(&mut signal.changes).into_iter().collect();
                Some(Member {
                    entry: k + 1,
                    value: signal.value? - jump,
                    before,
                    jump: *jump,
                })
            });
            let members: Vec<Member> = members.collect();
            self.open.push(Open {
                dropout: Dropout {
                    first: start.line,
                    last,
                    entries,
                    seconds: if start.leads {
                        f64::INFINITY
                    } else {
                        time - start.time
                    },
                    alone: members.len() == 1,
                },
                rows: *rows,
                members,
                age: 0,
                leads: start.leads,
            });
        }
    }

    /// Starts anew: the next row does not follow the last one.
    pub(super) fn pause(&mut self) {
        for open in core::mem::take(&mut self.open) {
            self.judge(open);
        }
        self.signals.iter_mut().for_each(Signal::pause);
        self.since = 0;
    }

    /// Judges a stretch by the changes since.
    fn judge(&mut self, open: Open) {
        let (mut moved, mut moved_steps) = (Vec::new(), Vec::new());
        let (mut noisy, mut sharp) = (Vec::new(), Vec::new());
        let mut unmoved = Vec::new();
        let mut alike = 0;
        let mut jumps = false;
        for member in &open.members {
            let Some(signal) = self.signals.get(member.entry - 1) else {
                continue;
            };
            let after: Vec<f64> = signal.changes.iter().take(open.age).copied().collect();
            match has_moved(open.rows, member, &after, open.leads) {
                Some(Steps::Many) => moved.push(member.entry),
                Some(Steps::Few) => moved_steps.push(member.entry),
                None => {}
            }
            let sides = [is_sharp(&member.before, true), is_sharp(&after, false)];
            let lengths = [member.before.len(), after.len()];
            if !open.leads && sides == [true; 2] && lengths.iter().all(|n| *n >= MIN_SIDE) {
                sharp.push((member.entry, member.value));
            }
            // a joint that rested has changed by one row's motion
            let next = after.first().or(member.before.last());
            jumps |= next.is_some_and(|next| member.jump.abs() >= MIN_JUMP_RATIO * next.abs());
            let fits = |(sharp, length): (bool, usize)| sharp || length == 0;
            let all = sides.into_iter().zip(lengths).all(fits);
            alike += usize::from(all && sides.contains(&true));
            if !open.leads && has_noise(&member.before, &after) {
                noisy.push((member.entry, member.value));
                let around = member.before.iter().chain(&after);
                let square = around.clone().map(|c| c * c).sum::<f64>();
                let usual = (square / around.count().max(1) as f64).sqrt();
                if member.jump.abs() < MIN_JUMP_RATIO * usual {
                    unmoved.push(member.entry);
                }
            }
        }
        self.keep(Judged {
            dropout: open.dropout,
            rows: open.rows,
            moved,
            moved_steps,
            noisy,
            unmoved,
            sharp: if jumps { sharp } else { Vec::new() },
            alike: !open.leads && alike > 0 && 2 * alike >= open.members.len(),
        });
    }

    fn keep(&mut self, judged: Judged) {
        let unmoved = judged.moved.is_empty() && judged.moved_steps.is_empty();
        let is_smooth = judged.noisy.is_empty() && judged.sharp.is_empty();
        let is_evident = judged.alike || !(unmoved && is_smooth);
        if is_evident && self.judged.len() < MAX_STRETCHES {
            self.judged.push(judged);
        }
    }

    /// Judges rows that repeat up to the end of the log.
    fn judge_end(&mut self) {
        let Some((last, _)) = self.last else {
            return;
        };
        let shortest = |signal: &&Signal| signal.repeats >= MIN_REPEATS_AT_END;
        let repeats = self.signals.iter().filter(shortest).map(|s| s.repeats);
        let Some(rows) = repeats.min() else {
            return;
        };
        let (mut entries, mut moved, mut noisy) = (Vec::new(), Vec::new(), Vec::new());
        let mut first = last;
        for (k, signal) in self.signals.iter().enumerate() {
            if signal.repeats < rows {
                continue;
            }
            entries.push(k + 1);
            if signal.repeats > rows {
                continue;
            }
            first = self.starts.get(k).map_or(first, |start| start.line);
            let before: Vec<f64> = signal.changes.iter().copied().collect();
            let speed = mean(before.iter().rev());
            let unbraked = before.last().is_some_and(|c| c / speed > MIN_UNBRAKED_PART);
            let least = MIN_CHANGE_NOISE * roughness(&[&before]);
            if before.len() == SIDE && unbraked && speed.abs() > least {
                moved.push(k + 1);
            }
            if has_noise(&before, &before) {
                noisy.push((k + 1, signal.value.unwrap_or_default()));
            }
        }
        // a joint that hits an end stop does not brake either
        if moved.len() < 2 {
            moved.clear();
        }
        let alone = entries.len() == 1;
        self.keep(Judged {
            dropout: Dropout {
                first,
                last,
                entries,
                seconds: f64::INFINITY,
                alone,
            },
            rows,
            moved,
            moved_steps: Vec::new(),
            unmoved: noisy.iter().map(|(entry, _)| *entry).collect(),
            noisy,
            sharp: Vec::new(),
            alike: false,
        });
    }

    /// The dropouts, in the order of their rows.
    ///
    /// - `efforts`: the entries that are efforts, which may stay at their limit.
    pub(super) fn finish(mut self, efforts: core::ops::Range<usize>) -> Vec<Dropout> {
        for open in core::mem::take(&mut self.open) {
            self.judge(open);
        }
        self.judge_end();
        let judged = core::mem::take(&mut self.judged);
        let (mut certain, mut others) = (Vec::new(), Vec::new());
        for judged in judged {
            match self.evidence(&judged, &efforts) {
                Evidence::Enough => certain.push(judged),
                Evidence::IfAlike => others.push(judged),
                Evidence::None => {}
            }
        }
        let is_alike = |own: &Judged| {
            let alike = certain.iter().filter(|other| {
                let longest = MAX_ALIKE_RATIO * other.rows;
                other.dropout.entries == own.dropout.entries && own.rows <= longest
            });
            alike.take(MIN_ALIKE).count() == MIN_ALIKE
        };
        others.retain(is_alike);
        certain.append(&mut others);
        let mut out: Vec<Dropout> = certain.into_iter().map(|own| own.dropout).collect();
        out.sort_by_key(|dropout| (dropout.first, dropout.last));
        out
    }
}

/// What speaks for a dropout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Evidence {
    Enough,
    /// Only if the log has more certain ones of the same signals: too few rows around it tell, or an
    /// effort repeats its largest or smallest value, or 0, as a drive at its limit or without current.
    IfAlike,
    None,
}

impl DropoutFinder {
    fn evidence(&self, judged: &Judged, efforts: &core::ops::Range<usize>) -> Evidence {
        // an effort has a step where its joint comes to rest, and another one where it starts again
        let with_motion = judged.dropout.entries.iter().any(|k| !efforts.contains(k));
        let counts = |entry: &usize| !(with_motion && efforts.contains(entry));
        if judged.moved.iter().any(counts) {
            return Evidence::Enough;
        }
        let signal = |entry: usize| self.signals.get(entry - 1);
        let chance = |entry: usize| signal(entry).map_or(0.0, |own| own.chance().ln());
        // whether so many repetitions are no chance
        let is_rare = |entries: &[usize]| {
            let exponent: f64 = entries.iter().map(|entry| chance(*entry)).sum();
            let expected = self.rows as f64 * (exponent * judged.rows as f64).exp();
            !entries.is_empty() && expected < MAX_EXPECTED
        };
        let steps: Vec<usize> = judged.moved_steps.iter().copied().filter(counts).collect();
        if is_rare(&steps) {
            return Evidence::Enough;
        }
        let sharp = judged.sharp.iter().copied();
        let sharp: Vec<(usize, f64)> = sharp.filter(|(entry, _)| counts(entry)).collect();
        let is_limited = |(entry, value): &(usize, f64)| {
            let range = signal(*entry).and_then(|own| own.range);
            let is_limit = range.is_some_and(|(low, high)| *value <= low || *value >= high);
            efforts.contains(entry) && (is_limit || *value == 0.0)
        };
        let entries = |all: &[(usize, f64)], limited: bool| {
            let own = all.iter().filter(|own| limited || !is_limited(own));
            own.map(|(entry, _)| *entry).collect::<Vec<usize>>()
        };
        let tells = |entry: &usize| efforts.contains(entry) || !judged.unmoved.contains(entry);
        let noisy = judged.noisy.iter().copied();
        let noisy: Vec<(usize, f64)> = noisy.filter(|(entry, _)| tells(entry)).collect();
        let are_rare = |limited: bool| {
            let both = [&noisy, &sharp];
            both.into_iter().any(|all| is_rare(&entries(all, limited)))
        };
        if are_rare(false) {
            Evidence::Enough
        } else if judged.alike || are_rare(true) {
            Evidence::IfAlike
        } else {
            Evidence::None
        }
    }
}

/// The mean of the first changes.
fn mean<'a>(changes: impl Iterator<Item = &'a f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for change in changes.take(SPEED_CHANGES) {
        sum += change;
        count += 1.0;
    }
    sum / f64::max(count, 1.0)
}

/// The root mean square of the second differences.
fn roughness(sides: &[&[f64]]) -> f64 {
    let pairs = sides.iter().flat_map(|side| side.windows(2));
    let (mut sum, mut count) = (0.0, 0.0);
    for pair in pairs {
        if let [a, b] = pair {
            sum += (b - a) * (b - a);
            count += 1.0;
        }
    }
    (sum / f64::max(count, 1.0)).sqrt()
}

/// The size of changes in steps of an encoder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Steps {
    Many,
    Few,
}

/// Whether a signal that repeated over so many rows went on meanwhile, by its changes on both sides.
///
/// - `leads`: whether nothing is known of the time before.
fn has_moved(rows: usize, member: &Member, after: &[f64], leads: bool) -> Option<Steps> {
    let before = &member.before[..];
    let zeros = |side: &[f64]| side.iter().filter(|c| **c == 0.0).count();
    if after.len() < MIN_SIDE || zeros(after) > 1 {
        return None;
    }
    if !leads && (before.len() < MIN_SIDE || zeros(before) > 1) {
        return None;
    }
    let fast = mean(after.iter());
    let slow = if leads {
        fast
    } else {
        mean(before.iter().rev())
    };
    let predicted = 0.5 * (rows + 1) as f64 * (fast + slow);
    let sides = before.iter().chain(after).map(|c| c.abs());
    let smallest = sides.filter(|c| *c > 0.0).fold(f64::INFINITY, f64::min);
    let least = (MIN_CHANGE_NOISE * roughness(&[before, after]))
        .max(MIN_CHANGE_ROWS * fast.abs().max(slow.abs()));
    let is_predicted = if leads {
        LEADING_PARTS.contains(&(member.jump / predicted))
    } else {
        (member.jump - predicted).abs() <= PREDICTED_PART * predicted.abs()
    };
    let moved = predicted.abs() >= least && is_predicted;
    let steps = if predicted.abs() >= MIN_CHANGE_STEPS * smallest {
        Steps::Many
    } else {
        Steps::Few
    };
    moved.then_some(steps)
}

/// Whether a signal changes in every row on one side of a stretch, and neither brakes before nor starts
/// from rest behind it.
fn is_sharp(changes: &[f64], is_before: bool) -> bool {
    let mean = changes.iter().map(|c| c.abs()).sum::<f64>() / changes.len().max(1) as f64;
    let near: Vec<f64> = if is_before {
        changes.iter().rev().take(2).copied().collect()
    } else {
        changes.iter().take(2).copied().collect()
    };
    let next = near.into_iter().fold(0.0, |m: f64, c| m.max(c.abs()));
    !changes.is_empty() && next >= MIN_SHARP_PART * mean && !changes.contains(&0.0)
}

/// Whether a signal has noise that changes it in every row, on both sides of a stretch.
fn has_noise(before: &[f64], after: &[f64]) -> bool {
    let turns = |side: &[f64]| side.windows(2).filter(|p| p[0] * p[1] < 0.0).count();
    let sides = [before, after];
    let is_rough = |side: &[f64]| side.len() >= MIN_SIDE && !side.contains(&0.0) && turns(side) > 0;
    sides.into_iter().all(is_rough) && turns(before) + turns(after) >= MIN_TURNS
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Noise between -1 and 1, the same in every run.
    fn noise(row: usize, column: usize) -> f64 {
        let mixed = (row as u64 * 7 + column as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (mixed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// Two joints that swing, with noise, and the efforts at them, with more noise.
    fn swinging(row: usize) -> [f64; 4] {
        let t = 0.0025 * row as f64;
        [
            (5.0 * t).sin() + 1e-5 * noise(row, 0),
            (7.0 * t).cos() + 1e-5 * noise(row, 1),
            3.0 * (5.0 * t).cos() + 0.1 * noise(row, 2),
            2.0 * (7.0 * t).sin() + 0.1 * noise(row, 3),
        ]
    }

    /// The dropouts of rows at 400 Hz: first and last row, and the entries.
    fn found(rows: usize, values: impl Fn(usize) -> [f64; 4]) -> Vec<(u64, u64, Vec<usize>)> {
        let mut finder = DropoutFinder::default();
        for row in 0..rows {
            let [a, b, c, d] = values(row);
            finder.push(row as u64, &[0.0025 * row as f64, a, b, c, d]);
        }
        let found = finder.finish(3..5).into_iter();
        found.map(|d| (d.first, d.last, d.entries)).collect()
    }

    /// The rows of `values`, of which some entries repeat those of the row before the first one.
    fn late(
        stretches: &[(usize, usize)],
        entries: &[usize],
        values: impl Fn(usize) -> [f64; 4],
    ) -> impl Fn(usize) -> [f64; 4] {
        move |row| {
            let mut own = values(row);
            let held = stretches.iter().find(|(a, b)| (*a..=*b).contains(&row));
            if let Some((first, _)) = held {
                let last = values(first.saturating_sub(1));
                for entry in entries {
                    own[entry - 1] = last[entry - 1];
                }
            }
            own
        }
    }

    #[test]
    fn late_topics_are_found_with_their_rows_and_entries_wherever_they_begin() {
        let all: &[usize] = &[1, 2, 3, 4];
        for entries in [all, &[1, 2], &[3, 4], &[2], &[4]] {
            for rows in [3, 12, 17, 40, 200] {
                let at = |k: usize| 150 + 311 * k + 7 * rows;
                let stretches: Vec<(usize, usize)> =
                    (0..4).map(|k| (at(k), at(k) + rows - 1)).collect();
                let held: Vec<_> = found(3200, late(&stretches, entries, swinging));
                let wanted = stretches
                    .iter()
                    .map(|(a, b)| (*a as u64, *b as u64, entries.to_vec()));
                let wanted: Vec<_> = wanted.collect();
                // one joint alone may be near its turning point, or return to the same angle
                if entries == [2] && rows >= 3 {
                    assert!(
                        held.iter().all(|own| wanted.contains(own)),
                        "{rows} {held:?}"
                    );
                } else {
                    assert_eq!(held, wanted, "{entries:?} {rows}");
                }
            }
        }
    }

    #[test]
    fn dropouts_close_to_each_other_and_at_the_ends_are_found() {
        let stretches = [(0, 9), (40, 50), (56, 66), (72, 90), (780, 799)];
        let held = found(800, late(&stretches, &[1, 2, 3, 4], swinging));
        let rows: Vec<(u64, u64)> = held.iter().map(|own| (own.0, own.1)).collect();
        // the first row is no repetition
        assert_eq!(rows, [(1, 9), (40, 50), (56, 66), (72, 90), (780, 799)]);
    }

    #[test]
    fn rest_is_no_dropout() {
        let eased = |k: f64| k - (core::f64::consts::TAU * k).sin() / core::f64::consts::TAU;
        // moves after 200 rows, rests from 600 to 700, and from 1100 on
        let moved = |row: usize| {
            let part = |start: f64| ((row as f64 - start) / 400.0).clamp(0.0, 1.0);
            eased(part(200.0)) + eased(part(700.0))
        };
        let still = |row: usize| [moved(row), -moved(row), 2.0 + moved(row), 1.0];
        assert_eq!(found(1400, still), []);
        // with noise in the efforts, and with an encoder
        let noisy = |row: usize| {
            let [a, b, c, d] = still(row);
            let counts = |x: f64| (x * 4096.0).round() / 4096.0;
            [
                counts(a),
                counts(b),
                c + 0.1 * noise(row, 2),
                d + 0.1 * noise(row, 3),
            ]
        };
        assert_eq!(found(1400, noisy), []);
        // efforts in few steps, which often repeat
        let coarse = |row: usize| noisy(row).map(|x| (x * 20.0).round() / 20.0);
        assert_eq!(found(1400, coarse), []);
        // a joint that stops and starts with its friction, without noise
        let friction = |row: usize| {
            let x = moved(row);
            let rests = moved(row + 1) - x <= 0.0 || x - moved(row.max(1) - 1) <= 0.0;
            let f = if rests { 0.7 } else { 0.2 };
            [x, -x, 3.0 * x.sin() + f, x.cos() - f]
        };
        assert_eq!(found(1400, friction), []);
        // measured at instants off those of the rows: noise that ends with the motion
        let off = |row: usize| {
            let t = row as f64 + 2.0 * noise(row, 4);
            let move_of = |k: u32| eased(((t - 60.0 * f64::from(k)) / 40.0).clamp(0.0, 1.0));
            let x: f64 = (0..20).map(move_of).sum();
            [
                x,
                -x,
                3.0 * x.sin() + 0.1 * noise(row, 2),
                x.cos() + 0.1 * noise(row, 3),
            ]
        };
        assert_eq!(found(1300, off), []);
        // everything as in the first row, for long
        let waits = |row: usize| swinging(row.saturating_sub(300));
        assert_eq!(
            found(1400, |row| if row < 300 { [0.1; 4] } else { waits(row) }),
            []
        );
    }

    #[test]
    fn rows_that_are_written_more_often_than_they_are_read_are_no_dropouts() {
        for hold in [2, 3, 5, 10] {
            assert_eq!(found(2000, |row| swinging(row / hold * hold)), [], "{hold}");
        }
        // efforts at their limit
        let limited = |row: usize| swinging(row).map(|x| x.clamp(-1.5, 1.5));
        assert_eq!(found(2000, limited), []);
    }

    #[test]
    fn steady_changes_are_smooth_and_alternating_ones_are_rough() {
        assert!(roughness(&[&[2.0; 6], &[5.0; 6]]) <= 0.0);
        assert!((roughness(&[&[1.0, -1.0, 1.0, -1.0]]) - 2.0).abs() < 1e-12);
        assert!((roughness(&[&[1.0, 3.0, 2.0], &[]]) - 2.5_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_value_repeats_by_chance_at_least_as_if_it_had_done_so_once() {
        let mut signal = Signal::default();
        for k in 0..100 {
            signal.push(f64::from(k * k));
        }
        let without = signal.chance();
        assert!((without - 3.0 / 100.0).abs() < 1e-12, "{without}");
        // a single repetition
        signal.push(99.0 * 99.0);
        signal.push(0.0);
        assert!((signal.chance() - 6.0 / 102.0).abs() < 1e-12);
    }
}
