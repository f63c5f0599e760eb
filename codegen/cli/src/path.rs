//! A motion of the independent coordinates for a simulation or a view: from a file or gentle.

use std::path;

use regen_experiment::reach;
use regen_experiment::simulate::Reference;
use regen_identify::signals::Fourier;

use crate::exit::Failure;
use crate::trajectory::Trajectory;
use regen_interpreted::Interpreted;

/// The fundamental frequency of the motion that is made without a file, Hz.
const GENTLE: f64 = 0.1;

/// A finite Fourier series of the independent coordinates and its name.
pub(crate) struct Path {
    name: String,
    series: Fourier,
    dof: usize,
}

impl Path {
    /// The trajectory in a file, or a gentle motion about home.
    pub(crate) fn of(file: Option<&path::Path>, model: &Interpreted<'_>) -> Result<Self, Failure> {
        let info = model.info();
        let dof = info.dof();
        if let Some(file) = file {
            return Ok(Self {
                name: file.display().to_string(),
                series: Trajectory::read(file, &info)?.series()?,
                dof,
            });
        }
        let amplitudes = reach::gentle(model)?;
        let home = info.independent.iter().map(|c| info.home[*c]);
        let signals: Vec<_> = home
            .zip(amplitudes)
            .enumerate()
            .map(|(k, (home, amplitude))| {
                let mut sine = vec![0.0; dof];
                sine[k] = amplitude;
                (home, vec![0.0; dof], sine)
            })
            .collect();
        let series = Fourier::of_positions(GENTLE, &signals);
        Ok(Self {
            name: "gentle swing about home".to_owned(),
            series: series.map_err(|why| Failure::Input(why.to_string()))?,
            dof,
        })
    }

    /// What it is called.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Its period, s.
    pub(crate) fn period(&self) -> f64 {
        1.0 / self.series.frequency()
    }

    /// The independent coordinates at a time, s.
    pub(crate) fn position(&self, t: f64) -> Vec<f64> {
        (0..self.dof).map(|k| self.series.at(k, t)[0]).collect()
    }
}

impl Reference for Path {
    fn at(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        let slots = q.iter_mut().zip(qd).zip(qdd).enumerate();
        for (k, ((q, qd), qdd)) in slots {
            [*q, *qd, *qdd] = self.series.at(k, t);
        }
    }
}
