//! The finite Fourier series (Eq. 25), fitted to samples of several signals at once.

use std::f64::consts::TAU;

use super::SignalError;
use crate::qr_update::{BLOCK, reduce};

/// Fourier series of signals with one fundamental frequency.
#[derive(Clone, Debug, PartialEq)]
pub struct Fourier {
    frequency: f64,
    harmonics: usize,
    /// For each signal: the constant, then cosine and sine of each harmonic.
    coefficients: Vec<Vec<f64>>,
}

impl Fourier {
    /// Builds a series from its coefficients as in Eq. 25: for each signal q0, a_j and b_j, where
    /// a_j and b_j multiply the velocity's cosines and sines.
    ///
    /// - `frequency`: of the fundamental, Hz.
    ///
    /// # Errors
    /// When the frequency is not positive or the lengths differ.
    ///
    /// ```
    /// use regen_identify::signals::Fourier;
    ///
    /// let series = Fourier::new(0.5, &[(1.0, vec![2.0], vec![0.0])])?;
    /// let [q, qd, qdd] = series.at(0, 0.0);
    /// assert_eq!((q, qd, qdd), (1.0, 2.0, 0.0));
    /// # Ok::<(), regen_identify::signals::SignalError>(())
    /// ```
    pub fn new(frequency: f64, signals: &[(f64, Vec<f64>, Vec<f64>)]) -> Result<Self, SignalError> {
        let harmonics = signals.first().map_or(0, |s| s.1.len());
        if !(frequency > 0.0 && frequency.is_finite()) {
            return Err(SignalError::Setting("the frequency must be positive"));
        }
        let fits = |s: &(f64, Vec<f64>, Vec<f64>)| s.1.len() == harmonics && s.2.len() == harmonics;
        if !signals.iter().all(fits) {
            return Err(SignalError::Setting(
                "all signals must have as many sines as cosines",
            ));
        }
        let coefficients = signals
            .iter()
            .map(|(constant, a, b)| {
                let pairs = a.iter().zip(b).enumerate();
                let pairs = pairs.flat_map(|(j, (a, b))| {
                    let w = TAU * frequency * (j + 1) as f64;
                    [-b / w, a / w]
                });
                core::iter::once(*constant).chain(pairs).collect()
            })
            .collect();
        Ok(Self {
            frequency,
            harmonics,
            coefficients,
        })
    }

    /// Builds a series from the coefficients of the positions: for each signal its constant, then
    /// the factors of the cosines and of the sines,
    /// `q0 + sum_k c_k cos(2 pi f k t) + s_k sin(...)`.
    ///
    /// - `frequency`: f, Hz.
    ///
    /// # Errors
    /// When the frequency is not positive or the lengths differ.
    ///
    /// ```
    /// use regen_identify::signals::Fourier;
    ///
    /// let series = Fourier::of_positions(0.5, &[(1.0, vec![0.25], vec![2.0])])?;
    /// assert_eq!(series.at(0, 0.0)[0], 1.25);
    /// assert_eq!(series.coefficients(0), (1.0, vec![0.25], vec![2.0]));
    /// # Ok::<(), regen_identify::signals::SignalError>(())
    /// ```
    pub fn of_positions(
        frequency: f64,
        signals: &[(f64, Vec<f64>, Vec<f64>)],
    ) -> Result<Self, SignalError> {
        // `new` checks the frequency and the lengths
        let mut series = Self::new(frequency, signals)?;
        for (row, (_, cosine, sine)) in series.coefficients.iter_mut().zip(signals) {
            let pairs = cosine.iter().zip(sine).flat_map(|(c, s)| [*c, *s]);
            row.truncate(1);
            row.extend(pairs);
        }
        Ok(series)
    }

    /// The coefficients of a signal's positions: its constant, and the factors of the cosines and
    /// of the sines; NaN and empty lists if there is no such signal.
    pub fn coefficients(&self, signal: usize) -> (f64, Vec<f64>, Vec<f64>) {
        let row = self.coefficients.get(signal);
        let (constant, rest) = row.and_then(|row| row.split_first()).unzip();
        let (pairs, _) = rest.unwrap_or(&[]).as_chunks::<2>();
        (
            constant.copied().unwrap_or(f64::NAN),
            pairs.iter().map(|pair| pair[0]).collect(),
            pairs.iter().map(|pair| pair[1]).collect(),
        )
    }

    /// The frequency of the fundamental, Hz.
    pub fn frequency(&self) -> f64 {
        self.frequency
    }

    /// A signal's value and its first and second derivative at `time` in s; NaN if there is no
    /// such signal.
    pub fn at(&self, signal: usize, time: f64) -> [f64; 3] {
        let own = self.coefficients.get(signal).map(Vec::as_slice);
        let mut out = [[f64::NAN; 3]];
        self.fill(own, time, &mut out);
        out[0]
    }

    /// The values of all signals with their first and second derivatives at `time` in s, as
    /// [`at`](Self::at) gives those of one.
    pub fn all(&self, time: f64) -> Vec<[f64; 3]> {
        let mut out = vec![[f64::NAN; 3]; self.coefficients.len()];
        self.fill(self.coefficients.iter().map(Vec::as_slice), time, &mut out);
        out
    }

    /// Computes signals of these coefficients, one entry of `out` for each.
    fn fill<'a>(
        &self,
        signals: impl IntoIterator<Item = &'a [f64], IntoIter: Clone>,
        time: f64,
        out: &mut [[f64; 3]],
    ) {
        let signals = signals.into_iter();
        for (out, c) in out.iter_mut().zip(signals.clone()) {
            *out = [c.first().copied().unwrap_or(f64::NAN), 0.0, 0.0];
        }
        for j in 0..self.harmonics {
            let w = TAU * self.frequency * (j + 1) as f64;
            let (sin, cos) = libm::sincos(w * time);
            for (out, c) in out.iter_mut().zip(signals.clone()) {
                let Some([a, b]) = c.get(1 + 2 * j..3 + 2 * j) else {
                    continue;
                };
                out[0] += a * cos + b * sin;
                out[1] += w * (b * cos - a * sin);
                out[2] -= w * w * (a * cos + b * sin);
            }
        }
    }

    /// The number of harmonics.
    pub fn harmonics(&self) -> usize {
        self.harmonics
    }
}

/// A least-squares fit of Fourier series, to which samples are added one by one in fixed memory.
#[derive(Clone, Debug)]
pub struct FourierFit {
    frequency: f64,
    harmonics: usize,
    signals: usize,
    /// The QR factor of the observation matrix, with the signals as its last columns; n x n,
    /// column-major.
    r: Vec<f64>,
    samples: usize,
    /// Rows not reduced yet, column-major with a stride of [`BLOCK`].
    pending: Vec<f64>,
    /// The number of these rows.
    waiting: usize,
}

impl FourierFit {
    /// Starts a fit.
    ///
    /// - `frequency`: of the fundamental, Hz.
    ///
    /// # Errors
    /// When the frequency is not positive or the number of harmonics is not 1 to 200.
    pub fn new(frequency: f64, harmonics: usize, signals: usize) -> Result<Self, SignalError> {
        if !(frequency > 0.0 && frequency.is_finite()) {
            return Err(SignalError::Setting("the frequency must be positive"));
        }
        if !(1..=200).contains(&harmonics) {
            return Err(SignalError::Setting("harmonics must be 1 to 200"));
        }
        let n = 1 + 2 * harmonics + signals;
        Ok(Self {
            frequency,
            harmonics,
            signals,
            r: vec![0.0; n * n],
            samples: 0,
            pending: vec![0.0; n * BLOCK],
            waiting: 0,
        })
    }

    fn columns(&self) -> usize {
        1 + 2 * self.harmonics + self.signals
    }

    /// Adds a sample of all signals.
    ///
    /// - `time`: s; `values`: one for each signal.
    ///
    /// # Errors
    /// When the number of values does not fit or one is not finite.
    pub fn push(&mut self, time: f64, values: &[f64]) -> Result<(), SignalError> {
        if values.len() != self.signals {
            return Err(SignalError::Length {
                times: self.signals,
                values: values.len(),
            });
        }
        if !time.is_finite() || values.iter().any(|x| !x.is_finite()) {
            return Err(SignalError::NotFinite {
                sample: self.samples,
            });
        }
        let row = self.waiting;
        let mut slots = self.pending.iter_mut().skip(row).step_by(BLOCK);
        let mut put = |value: f64| {
            if let Some(slot) = slots.next() {
                *slot = value;
            }
        };
        put(1.0);
        for j in 1..=self.harmonics {
            let (sin, cos) = libm::sincos(TAU * self.frequency * j as f64 * time);
            put(cos);
            put(sin);
        }
        for x in values {
            put(*x);
        }
        self.samples += 1;
        self.waiting += 1;
        if self.waiting == BLOCK {
            self.flush();
        }
        Ok(())
    }

    fn flush(&mut self) {
        let (n, rows) = (self.columns(), self.waiting);
        let mut block: Vec<f64> = self
            .pending
            .chunks_exact(BLOCK)
            .flat_map(|column| column[..rows].iter().copied())
            .collect();
        // the right-hand side is empty, as the signals are columns of the matrix
        let (mut z, mut side) = (vec![0.0; n], vec![0.0; rows]);
        reduce(&mut self.r, &mut z, &mut block, &mut side, rows);
        self.waiting = 0;
    }

    /// The same fit with all samples reduced.
    pub(super) fn reduced(mut self) -> Self {
        self.flush();
        self
    }

    /// The sum of the squared residuals of each signal, of a fit whose samples are reduced.
    pub(super) fn residual_squares(&self) -> Vec<f64> {
        let (n, basis) = (self.columns(), 1 + 2 * self.harmonics);
        let columns = self.r.chunks_exact(n.max(1)).skip(basis);
        let squares = columns.map(|column| column.iter().skip(basis).map(|x| x * x).sum());
        squares.collect()
    }

    /// Solves for the series by least squares.
    ///
    /// # Errors
    /// When the samples do not determine the coefficients: too few, or too short a part of the
    /// period.
    pub fn finish(mut self) -> Result<Fourier, SignalError> {
        self.flush();
        let (n, basis) = (self.columns(), 1 + 2 * self.harmonics);
        let few = SignalError::TooFew {
            samples: self.samples,
            needed: basis,
        };
        if self.samples < basis {
            return Err(few);
        }
        let pivot = |k: usize| self.r[k * n + k];
        let length = |k: usize| {
            let column = &self.r[k * n..=k * n + k];
            column.iter().map(|x| x * x).sum::<f64>().sqrt()
        };
        if (0..basis).any(|k| pivot(k) <= 1e-10 * length(k)) {
            return Err(SignalError::Setting(
                "the samples do not determine the Fourier series: they cover too short a part of \
                 the period, or the frequency is wrong",
            ));
        }
        let mut coefficients = Vec::with_capacity(self.signals);
        for s in 0..self.signals {
            let start = (basis + s) * n;
            let mut x = self.r[start..start + basis].to_vec();
            for k in (0..basis).rev() {
                x[k] /= pivot(k);
                for i in 0..k {
                    x[i] -= self.r[k * n + i] * x[k];
                }
            }
            coefficients.push(x);
        }
        Ok(Fourier {
            frequency: self.frequency,
            harmonics: self.harmonics,
            coefficients,
        })
    }
}
