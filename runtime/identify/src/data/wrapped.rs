//! Positions that are wrapped: they jump from one end of their range to the other, by the same span each time, as
//! an angle within one turn does or a counter that overflows.

use core::f64::consts::TAU;
use std::collections::BTreeMap;

use super::problem::median;

/// The smallest jump over the range of the position.
const MIN_PART: f64 = 0.5;
/// The largest other change over the range.
const MAX_CALM_PART: f64 = 0.1;
/// The number of changes before and behind a jump whose mean is the motion across it.
const AROUND: usize = 5;
/// A position moves across a jump by at least this part of its largest change: one that rests before and behind it
/// has gone to another place.
const MIN_MOTION: f64 = 0.1;
/// The same where the span is a turn.
const MIN_MOTION_OF_TURNS: f64 = 0.02;
/// The largest distance of spans from each other, and from a turn, over the span.
const MAX_SPREAD: f64 = 0.02;
/// The number of jumps by the same span that show that it is one, if it is no turn.
const MIN_JUMPS: usize = 2;
/// The spans of a turn in rad, and in degrees that are read as rad.
const TURNS: [f64; 2] = [TAU, 360.0];
/// The largest number of changes that are kept.
const MAX_KEPT: usize = 10_000;

/// How a position is wrapped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrapped {
    /// The span, in the unit of the position: a turn, or what its jumps show.
    pub span: f64,
    /// The number of jumps.
    pub jumps: usize,
    /// What is added to the first position, so that most are as they were.
    pub added: f64,
}

impl Wrapped {
    /// Whether the span is a turn, in rad or in degrees that are read as rad.
    pub fn is_turn(&self) -> bool {
        TURNS.contains(&self.span)
    }
}

/// A large change with the changes around it.
#[derive(Clone, Copy, Debug)]
struct Jump {
    by: f64,
    /// The number of rows before it.
    rows: usize,
    /// The sum of the changes before it, and their number; the same behind it.
    around: [(f64, usize); 2],
}

impl Jump {
    /// The direction in which a wrapped position moves that jumps so.
    fn direction(&self) -> f64 {
        -self.by.signum()
    }

    /// The means of the changes before and behind the jump, as far as there are any, positive in this direction.
    fn motion(&self) -> impl Iterator<Item = f64> {
        let direction = self.direction();
        let known = self.around.into_iter().filter(|own| own.1 > 0);
        known.map(move |(sum, count)| direction * sum / count as f64)
    }

    /// The span, if the position went on moving.
    fn span(&self) -> f64 {
        let known = self.motion().count().max(1) as f64;
        self.by.abs() + self.motion().sum::<f64>() / known
    }
}

/// Looks for the jumps of one position, row by row.
#[derive(Clone, Debug, Default)]
pub(super) struct WrapFinder {
    last: Option<f64>,
    rows: usize,
    range: Option<[f64; 2]>,
    /// The last changes that were no jump, the newest at the end, and their number.
    changes: [f64; AROUND],
    count: usize,
    jumps: Vec<Jump>,
    /// The largest change that is no jump.
    largest: f64,
    /// Whether there are too many large changes for jumps of a motion.
    is_wild: bool,
}

impl WrapFinder {
    /// Adds the position of the next row.
    pub(super) fn push(&mut self, value: f64) {
        self.rows += 1;
        let [low, high] = self.range.unwrap_or([value, value]);
        self.range = Some([low.min(value), high.max(value)]);
        let Some(last) = self.last.replace(value) else {
            return;
        };
        let by = value - last;
        if !self.is_wild && by.abs() > self.least() {
            let before = (self.changes.iter().sum(), self.count);
            self.jumps.push(Jump {
                by,
                rows: self.rows - 1,
                around: [before, (0.0, 0)],
            });
            self.bound();
            return;
        }
        self.largest = self.largest.max(by.abs());
        self.changes.rotate_left(1);
        if let Some(newest) = self.changes.last_mut() {
            *newest = by;
        }
        self.count = (self.count + 1).min(AROUND);
        if let Some([_, (sum, count)]) = self.jumps.last_mut().map(|jump| &mut jump.around)
            && *count < AROUND
        {
            (*sum, *count) = (*sum + by, *count + 1);
        }
    }

    /// Forgets the row before, which the next one does not follow.
    pub(super) fn pause(&mut self) {
        (self.last, self.changes, self.count) = (None, [0.0; AROUND], 0);
    }

    /// The smallest jump in the range so far.
    fn least(&self) -> f64 {
        self.range
            .map_or(0.0, |[low, high]| MIN_PART * (high - low))
    }

    /// Leaves out the jumps that are small in the range so far.
    fn settle(&mut self) {
        let least = self.least();
        let all = core::mem::take(&mut self.jumps);
        let (jumps, other): (Vec<Jump>, Vec<Jump>) =
            all.into_iter().partition(|jump| jump.by.abs() > least);
        let other = other.iter().map(|jump| jump.by.abs());
        self.largest = other.fold(self.largest, f64::max);
        self.jumps = jumps;
    }

    /// Keeps the memory bounded.
    fn bound(&mut self) {
        if self.jumps.len() > MAX_KEPT {
            self.settle();
            self.is_wild = self.jumps.len() > MAX_KEPT / 2;
        }
    }

    /// How the position is wrapped; `None` if it is not.
    pub(super) fn finish(mut self) -> Option<Wrapped> {
        self.settle();
        let [low, high] = self.range?;
        let (width, calm) = (high - low, self.largest);
        let is_calm = calm > 0.0 && calm < MAX_CALM_PART * width;
        if self.is_wild || self.jumps.is_empty() || !is_calm {
            return None;
        }
        let spans: Vec<f64> = self.jumps.iter().map(Jump::span).collect();
        let span = median(&spans);
        let is_near = |own: f64| (own - span).abs() < MAX_SPREAD * span;
        let turn = TURNS.into_iter().find(|turn| is_near(*turn));
        let (least, needed) = if turn.is_some() {
            (MIN_MOTION_OF_TURNS * calm, 1)
        } else {
            (MIN_MOTION * calm, MIN_JUMPS)
        };
        // from one end of the range to the other, and not back
        let can_wrap = |jump: &Jump| {
            let from_end_to_end = jump.by.abs() > width - 2.0 * calm;
            from_end_to_end && is_near(jump.span()) && jump.motion().all(|own| own > -least)
        };
        let goes_on =
            |jump: &&Jump| jump.motion().count() > 0 && jump.motion().all(|own| own > least);
        let is_wrapped =
            self.jumps.iter().all(can_wrap) && self.jumps.iter().filter(goes_on).count() >= needed;
        let span = turn.unwrap_or(span);
        is_wrapped.then(|| Wrapped {
            span,
            jumps: self.jumps.len(),
            added: -span * self.usual_spans(),
        })
    }

    /// The number of spans beyond those of the first row that most rows are at.
    fn usual_spans(&self) -> f64 {
        let mut at: BTreeMap<i64, usize> = BTreeMap::new();
        let (mut spans, mut begin) = (0, 0);
        let ends = self.jumps.iter().map(|jump| (jump.rows, jump.by < 0.0));
        for (end, is_up) in ends.chain([(self.rows, true)]) {
            *at.entry(spans).or_default() += end.saturating_sub(begin);
            begin = end;
            spans += if is_up { 1 } else { -1 };
        }
        // of equal numbers that nearest to the first row
        let most = at.iter().max_by_key(|(spans, rows)| (**rows, -spans.abs()));
        most.map_or(0.0, |own| *own.0 as f64)
    }
}

/// Takes back the jumps of a wrapped position, row by row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unwrapper {
    /// The entry of the row.
    entry: usize,
    wrapped: Wrapped,
    last: Option<f64>,
    /// What is added to the position.
    added: f64,
}

impl Unwrapper {
    /// - `entry`: that of the position in the rows.
    pub(super) fn new(entry: usize, wrapped: Wrapped) -> Self {
        Self {
            entry,
            wrapped,
            last: None,
            added: wrapped.added,
        }
    }

    /// Makes the position of the next row follow that of the row before; returns whether it jumped by a span that is
    /// known from the jumps alone.
    pub(super) fn apply(&mut self, row: &mut [f64]) -> bool {
        let Some(value) = row.get_mut(self.entry) else {
            return false;
        };
        let last = self.last.replace(*value).unwrap_or(*value);
        let span = self.wrapped.span;
        let spans = ((*value - last) / span).round();
        self.added -= span * spans;
        *value += self.added;
        spans != 0.0 && !self.wrapped.is_turn()
    }
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::*;
    use crate::data::{Checks, Logs, Policy, Settings};
    use crate::suspect::swings_for_tests::{Written, swings};

    /// A motion of some swings, in rad, with noise.
    fn motion(k: usize) -> f64 {
        let noise = (k * 7919 % 1009) as f64 / 1009.0 - 0.5;
        2.5 * (0.01 * k as f64).sin() + 1e-4 * noise
    }

    fn found(position: impl Fn(usize) -> f64) -> Option<Wrapped> {
        let mut finder = WrapFinder::default();
        (0..2000).for_each(|k| finder.push(position(k)));
        finder.finish()
    }

    /// The position `value` within `span` from `low`.
    fn within(value: f64, low: f64, span: f64) -> f64 {
        low + (value - low).rem_euclid(span)
    }

    #[test]
    fn positions_that_are_wrapped_are_found_with_their_spans_and_follow_the_motion_again() {
        for (low, span, is_turn) in [(-1.2, TAU, true), (0.0, TAU, true), (-0.4, 1.3, false)] {
            let wrapped = found(|k| within(motion(k), low, span)).unwrap();
            assert!(
                (wrapped.span - span).abs() < if is_turn { 1e-15 } else { 2e-4 },
                "{wrapped:?}"
            );
            let mut unwrapper = Unwrapper::new(1, wrapped);
            let (mut start, mut unchanged) = (None, 0);
            for k in 0..2000 {
                let own = within(motion(k), low, span);
                let mut row = [0.0, own];
                unwrapper.apply(&mut row);
                unchanged += usize::from((row[1] - own).abs() < 0.5 * span);
                let start = *start.get_or_insert(row[1] - motion(k));
                assert!((row[1] - motion(k) - start).abs() < 2e-3, "{k} {row:?}");
            }
            assert!(unchanged > 2000 / 5, "{unchanged}");
        }
        let degrees = found(|k| within(motion(k).to_degrees(), 0.0, 360.0)).unwrap();
        assert_eq!(degrees.span, 360.0);
        // one jump tells a turn, as of a joint that goes on
        let once = found(|k| within(0.003 * k as f64 + 0.01 * motion(k), -3.0, TAU)).unwrap();
        assert_eq!((once.span, once.jumps), (TAU, 1));
    }

    #[test]
    fn other_jumps_are_no_wraps() {
        assert_eq!(found(motion), None);
        let burst = |k: usize| motion(k) + if (700..720).contains(&k) { 4.0 } else { 0.0 };
        assert_eq!(found(burst), None);
        // it rests at one place, and then at another one
        let steps = |k: usize| {
            1e-3 * motion(k)
                + if (k / 100).is_multiple_of(2) {
                    0.0
                } else {
                    TAU
                }
        };
        assert_eq!(found(steps), None);
        let lost_count = |k: usize| motion(k) - if k > 900 { 1.0 } else { 0.0 };
        assert_eq!(found(lost_count), None);
        let noise = |k: usize| (k * 7919 % 1009) as f64;
        assert_eq!(found(noise), None);
    }

    #[test]
    fn a_log_with_a_wrapped_position_is_read_as_the_motion_is_unless_outliers_are_kept() {
        let model = swings(false);
        let read = |low: f64, settings: &Settings| -> (Vec<f64>, usize) {
            let mut text = "t,q1,q2,q3,tau_q1,tau_q2,tau_q3\n".to_owned();
            for k in 0..2000 {
                let q = motion(k);
                let own = within(q, low, TAU);
                let _ = writeln!(text, "{},{own:.7},{q:.7},{q:.7},1,2,{q}", 0.01 * k as f64);
            }
            let file = Written::new(&format!("wrapped{low}"), &text);
            let logs = Logs::open(&model, std::slice::from_ref(&file.0), settings).unwrap();
            let found = logs.in_memory(2000).unwrap().positions().unwrap();
            (found[0].signals[0].clone(), logs.reports()[0].wrapped.len())
        };
        // without its jumps it keeps its place for most of the time
        let (plain, none) = read(-3.1, &Settings::default());
        let (found, one) = read(-1.2, &Settings::default());
        assert_eq!((none, one), (0, 1));
        let farthest = plain.iter().zip(&found).map(|(a, b)| (a - b).abs());
        assert!(farthest.fold(0.0, f64::max) < 1e-6);
        let kept = Settings {
            checks: Checks {
                outliers: Some(Policy::Keep),
                ..Checks::default()
            },
            ..Settings::default()
        };
        let (raw, none) = read(-1.2, &kept);
        assert_eq!(none, 0);
        assert!(raw.iter().any(|q| *q > 4.0));
    }
}
