//! A motion of the independent coordinates for a simulation or a view: from a file or gentle.

use std::f64::consts::TAU;
use std::path;

use regen_runtime::Model;
use regen_runtime::simulate::Reference;

use crate::exit::Failure;
use crate::interpreted::Interpreted;
use crate::sweep;

/// Finite Fourier series with one fundamental frequency.
pub(crate) struct Path {
    name: String,
    frequency: f64,
    offset: Vec<f64>,
    /// Of each coordinate, by harmonic.
    cosine: Vec<Vec<f64>>,
    sine: Vec<Vec<f64>>,
}

impl Path {
    /// The trajectory in a file, or a gentle motion about home.
    pub(crate) fn of(file: Option<&path::Path>, model: &Interpreted<'_>) -> Result<Self, Failure> {
        let info = model.info();
        let Some(file) = file else {
            let amplitudes = sweep::gentle(model)?;
            let dof = amplitudes.len();
            let alone = |(k, a): (usize, &f64)| {
                let mut sine = vec![0.0; dof];
                sine[k] = *a;
                sine
            };
            return Ok(Self {
                name: "gentle swing about home".to_owned(),
                frequency: 0.1,
                offset: info.independent.iter().map(|c| info.home[*c]).collect(),
                cosine: vec![vec![0.0; dof]; dof],
                sine: amplitudes.iter().enumerate().map(alone).collect(),
            });
        };
        Err(Failure::Input(file.display().to_string()))
    }

    /// What it is called.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Its period, s.
    pub(crate) fn period(&self) -> f64 {
        1.0 / self.frequency
    }

    /// The independent coordinates at its start.
    pub(crate) fn start(&self) -> Vec<f64> {
        let harmonics = self.cosine.iter().zip(&self.offset);
        harmonics.map(|(c, o)| o + c.iter().sum::<f64>()).collect()
    }
}

impl Reference for Path {
    fn at(&self, t: f64, q: &mut [f64], qd: &mut [f64], qdd: &mut [f64]) {
        let series = self.offset.iter().zip(self.cosine.iter().zip(&self.sine));
        let slots = q.iter_mut().zip(qd).zip(qdd);
        for (((q, qd), qdd), (offset, (cosine, sine))) in slots.zip(series) {
            (*q, *qd, *qdd) = (*offset, 0.0, 0.0);
            for (k, (a, b)) in cosine.iter().zip(sine).enumerate() {
                let w = TAU * self.frequency * (k + 1) as f64;
                let (s, c) = (libm::sin(w * t), libm::cos(w * t));
                *q += a * c + b * s;
                *qd += w * (b * c - a * s);
                *qdd -= w * w * (a * c + b * s);
            }
        }
    }
}
