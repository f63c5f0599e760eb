//! Exciting trajectories.

use std::fmt::Write as _;

use regen_codegen::explain::lines::columns;
use regen_experiment::excite::{Excitation, Margin};
use regen_experiment::trajectory::Trajectory;
use regen_identify::text::{counted, figure};
use serde::Serialize;

/// The number of limits in the table.
const CLOSEST: usize = 12;

/// An exciting trajectory and how close it comes to each limit, as they are serialised.
#[derive(Clone, Debug, Serialize)]
pub struct Excited<'a> {
    trajectory: &'a Trajectory,
    seed: u64,
    start: usize,
    interrupted: bool,
    limits: Vec<LimitMargin>,
}

#[derive(Clone, Debug, Serialize)]
struct LimitMargin {
    limit: String,
    bound: f64,
    /// The smallest distance from the limit, as a part of half its range.
    #[serde(rename = "left")]
    relative_distance: f64,
    time: f64,
}

impl<'a> Excited<'a> {
    /// The result of a search.
    ///
    /// - `trajectory`: that of `found`;
    /// - `interrupted`: whether the search was interrupted.
    pub fn new(
        trajectory: &'a Trajectory,
        found: &Excitation,
        seed: u64,
        interrupted: bool,
    ) -> Self {
        let limits = found.margins.iter().map(|margin| LimitMargin {
            limit: margin.limit.to_string(),
            bound: margin.limit.bound,
            relative_distance: margin.relative_distance,
            time: margin.time,
        });
        Self {
            trajectory,
            seed,
            start: found.start,
            interrupted,
            limits: limits.collect(),
        }
    }
}

/// An exciting trajectory for people.
pub fn excited_text(trajectory: &Trajectory, found: &Excitation) -> String {
    let figures = found.figures;
    let mut out = format!(
        "{}, {} of {} Hz\n",
        trajectory.robot,
        counted(trajectory.harmonics, "harmonic", "harmonics"),
        figure(trajectory.base_frequency)
    );
    let _ = writeln!(
        out,
        "  condition     {:.4} with scaled columns (Eq. 27), {:.4} without (Eq. 24)\n  \
         -log det      {:.4} (Eq. 26)\n  smallest      singular value {}\n",
        figures.scaled_condition,
        figures.condition,
        figures.determinant,
        figure(figures.smallest_singular)
    );
    let mut margins: Vec<&Margin> = found.margins.iter().collect();
    margins.sort_by(|a, b| a.relative_distance.total_cmp(&b.relative_distance));
    let closest = margins.iter().take(CLOSEST).map(|margin| {
        vec![
            margin.limit.to_string(),
            format!("{:.2}", 100.0 * margin.relative_distance),
            format!("{:.3}", margin.time),
        ]
    });
    let rows: Vec<Vec<String>> = closest.collect();
    out.push_str(&columns(&["closest limits", "left, %", "at, s"], &rows));
    if margins.len() > rows.len() {
        let _ = writeln!(out, "  and {} more, all met", margins.len() - rows.len());
    }
    out
}
