//! A run as the CSV file that identification reads.

use std::fmt::Write as _;

use regen_runtime::Info;

use super::{Log, Noise, Reference, Settings};

/// Which columns a log is written with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LogColumns {
    /// Positions and efforts as they were measured.
    #[default]
    Measured,
    /// The same and the commanded positions of the actuated joints as `cmd_NAME`, if there were
    /// controllers.
    Commanded,
    /// Motion and efforts as they are, with velocities and accelerations of all coordinates.
    Exact,
}

impl Log {
    /// The log as a CSV file: t, positions and efforts as they were measured, named as
    /// identification expects them. Coordinates that loops do not give are measured too, as the
    /// actuated ones are.
    ///
    /// - `settings`: those of the run, whose sensors measure;
    /// - `settle`: what of the run's beginning is left out, s; the file's time begins behind it;
    /// - `columns`: which columns are written.
    ///
    /// ```
    /// # mod models { include!(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/models/pendulum.rs")); }
    /// use regen_experiment::simulate::{LogColumns, Settings, simulate};
    /// use regen_runtime::Model;
    ///
    /// let pendulum = models::Pendulum;
    /// let start = |_: f64, q: &mut [f64], _: &mut [f64], _: &mut [f64]| q[0] = 0.4;
    /// let settings = Settings { duration: 0.5, ..Settings::default() };
    /// let log = simulate(&pendulum, &[0.02, 0.1], &start, &settings)?;
    /// let info = Model::<f64>::info(&pendulum);
    /// let text = log.csv(&info, &settings, 0.0, LogColumns::Exact);
    /// assert_eq!(text.lines().next(), Some("t,q1,qd_q1,qdd_q1,tau_q1"));
    /// assert_eq!(text.lines().count(), 1 + log.t.len());
    /// assert!(log.tracking(&info, &start) < 0.9);
    /// # Ok::<(), regen_experiment::simulate::SimulationError>(())
    /// ```
    pub fn csv(
        &self,
        info: &Info<'_>,
        settings: &Settings,
        settle: f64,
        columns: LogColumns,
    ) -> String {
        let exact = columns == LogColumns::Exact;
        let commanded = columns == LogColumns::Commanded && self.command.len() == self.effort.len();
        let name = |k: usize| info.coordinates.get(k).copied().unwrap_or("?");
        let (n, a) = (info.coordinates.len(), info.actuated.len());
        let passive: Vec<usize> = if exact {
            Vec::new()
        } else {
            // coordinates that loops do not give are measured too, as the others are
            let all = info.independent.iter().copied();
            all.filter(|c| !info.actuated.contains(c)).collect()
        };
        let mut text = "t".to_owned();
        if exact {
            for prefix in ["", "qd_", "qdd_"] {
                for k in 0..n {
                    let _ = write!(text, ",{prefix}{}", name(k));
                }
            }
        } else {
            for k in info.actuated.iter().chain(&passive) {
                let _ = write!(text, ",{}", name(*k));
            }
        }
        if commanded {
            for k in info.actuated {
                let _ = write!(text, ",cmd_{}", name(*k));
            }
        }
        for k in info.actuated {
            let _ = write!(text, ",tau_{}", name(*k));
        }
        text.push('\n');

        // apart from the seeds of the runs themselves
        let mut noise = Noise::new(settings.seed ^ (1 << 63));
        for (row, t) in self.t.iter().enumerate() {
            let of = |values: &[f64], width: usize| {
                let values = values.iter().skip(row * width).take(width);
                values.copied().collect::<Vec<f64>>()
            };
            let q = of(&self.q, n);
            let mut values = if exact {
                [q, of(&self.qd, n), of(&self.qdd, n), of(&self.effort, a)].concat()
            } else {
                let mut values = of(&self.measured_position, a);
                for k in &passive {
                    let truth = q.get(*k).copied().unwrap_or(f64::NAN);
                    values.push(settings.sensors.position(truth, &mut noise));
                }
                if commanded {
                    values.extend(of(&self.command, a));
                }
                values.extend(of(&self.measured_effort, a));
                values
            };
            // the half step keeps a sample at its end
            if *t + 0.5 * settings.period < settle {
                continue;
            }
            values.insert(0, t - settle);
            for (k, value) in values.iter().enumerate() {
                let comma = if k == 0 { "" } else { "," };
                let _ = write!(text, "{comma}{value}");
            }
            text.push('\n');
        }
        text
    }

    /// The independent coordinate that is farthest from the reference compared with its range there, and
    /// the part of the range; `None` where no coordinate moves.
    pub fn stray<'i, R: Reference + ?Sized>(
        &self,
        info: &Info<'i>,
        reference: &R,
    ) -> Option<(&'i str, f64)> {
        let (n, dof) = (info.coordinates.len(), info.dof());
        let (mut q, mut qd, mut qdd) = (vec![0.0; dof], vec![0.0; dof], vec![0.0; dof]);
        let mut seen = vec![[0.0_f64, f64::INFINITY, f64::NEG_INFINITY]; dof];
        for (t, row) in self.t.iter().zip(self.q.chunks_exact(n.max(1))) {
            reference.at(*t, &mut q, &mut qd, &mut qdd);
            for ((c, wanted), [off, low, high]) in info.independent.iter().zip(&q).zip(&mut seen) {
                *off = off.max((row[*c] - wanted).abs());
                (*low, *high) = (low.min(*wanted), high.max(*wanted));
            }
        }
        let parts = seen.iter().map(|[off, low, high]| off / (high - low));
        let (k, part) = parts
            .enumerate()
            .filter(|(_, part)| part.is_finite())
            .max_by(|(_, a), (_, b)| a.total_cmp(b))?;
        let name = info.coordinates.get(*info.independent.get(k)?)?;
        Some((name, part))
    }

    /// The largest distance of an independent coordinate from the reference, rad or m.
    pub fn tracking<R: Reference + ?Sized>(&self, info: &Info<'_>, reference: &R) -> f64 {
        let (n, dof) = (info.coordinates.len(), info.dof());
        let mut tracking: f64 = 0.0;
        let (mut q, mut qd, mut qdd) = (vec![0.0; dof], vec![0.0; dof], vec![0.0; dof]);
        for (t, row) in self.t.iter().zip(self.q.chunks_exact(n.max(1))) {
            reference.at(*t, &mut q, &mut qd, &mut qdd);
            for (c, wanted) in info.independent.iter().zip(&q) {
                tracking = tracking.max((row[*c] - wanted).abs());
            }
        }
        tracking
    }
}
