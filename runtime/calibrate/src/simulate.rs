//! Simulated measurements of a mechanism whose geometry differs from its description.

use nalgebra::{DVector, Matrix3, Rotation3, Vector3};

use crate::equations::{Pose, Problem};
use crate::fit::CalibrateError;
use crate::placed::Placed;
use crate::sensor::{Kind, Sensor};
use crate::structure::{Reached, Structure};

/// What is simulated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Simulation {
    /// The number of poses.
    pub poses: usize,
    /// The standard deviation of the errors of the geometry, rad and m; of a joint that yields, of what its
    /// largest effort does to it.
    pub errors: f64,
    /// The noise of sensors whose noise is not stated: of lengths, m, and of angles, rad.
    pub noise: [f64; 2],
    /// The seed of the random numbers: the same one gives the same poses.
    pub seed: u64,
}

/// Random numbers, the same ones in every run (Marsaglia's xorshift).
pub(crate) struct Draws(u64);

impl Draws {
    pub(crate) fn new(seed: u64) -> Self {
        let mut out = Self(0x9E37_79B9_7F4A_7C15 ^ seed.wrapping_mul(0xD134_2543_DE82_EF95));
        for _ in 0..16 {
            out.uniform();
        }
        out
    }

    /// A number between 0 and 1.
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A number of the normal distribution (Box and Muller).
    pub(crate) fn normal(&mut self) -> f64 {
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.uniform()));
        radius * libm::cos(core::f64::consts::TAU * self.uniform())
    }
}

impl Problem<'_> {
    /// For each unknown that is a compliance the largest of its efforts, as so many states show them.
    fn largest_efforts(&self, start: &Reached, states: usize) -> Vec<Option<f64>> {
        let mut out = vec![None; start.nominal.len()];
        let Some(efforts) = self.efforts else {
            return out;
        };
        let states = self.drawn_states(start, states, &mut Draws::new(0));
        let all: Vec<Vec<f64>> = states.iter().filter_map(|q| efforts.at(q)).collect();
        let slopes = self.geometry.slopes(&start.nominal);
        for (c, place) in self.kinematics.compliances.iter().enumerate() {
            let Some(place) = *place else { continue };
            let largest = all.iter().map(|own| own[c].abs()).fold(0.0, f64::max);
            for (k, out) in out.iter_mut().enumerate() {
                if slopes[(place, k)] != 0.0 {
                    *out = Some(largest);
                }
            }
        }
        out
    }

    /// Poses of a mechanism with errors, measured with noise, and the true values of the unknowns.
    /// These are what a fit without noise finds, since errors that cannot be told apart are found as one.
    ///
    /// # Errors
    /// When the readings do not determine states of the mechanism, or its loops do not close.
    pub fn simulate(&self, what: &Simulation) -> Result<(Vec<f64>, Vec<Pose>), CalibrateError> {
        let start = self.start()?;
        let structure = Structure::new(self, &start)?;
        let mut draws = Draws::new(what.seed);
        let unknowns = self.geometry.unknowns();
        let largest = self.largest_efforts(&start, what.poses);
        let held = structure.held.iter().zip(&largest);
        let errors: Vec<f64> = held
            .map(|(held, largest)| {
                let error = what.errors * draws.normal();
                match largest {
                    _ if *held => 0.0,
                    // joints yield, and never the other way
                    Some(effort) if *effort > 0.0 => error.abs() / effort,
                    Some(_) => 0.0,
                    None => error,
                }
            })
            .collect();
        let values = unknowns.iter().zip(&errors);
        let values: Vec<f64> = values.map(|(own, error)| own.nominal + error).collect();
        let freedoms = self.freedoms();
        let combined = structure.combinations(&structure.selection, freedoms);
        let combined = combined * DVector::from_vec(errors);
        let kept = structure.selection.kept.iter();
        let kept = kept.filter_map(|c| unknowns.get(c.checked_sub(freedoms)?));
        let linear: Vec<(&str, f64)> = kept
            .zip(combined.iter())
            .map(|(own, error)| (own.name.as_str(), own.nominal + error))
            .collect();
        let scalars = self
            .geometry
            .scalars(&values)
            .ok_or(CalibrateError::NotClosed)?;
        let placed = Placed::new(self.kinematics, &scalars);
        let mut poses = Vec::new();
        let mut states = Vec::new();
        // states of the description are states of the mechanism after a small motion
        for state in self.drawn_states(&start, 2 * what.poses, &mut draws) {
            let Some(state) = placed.close(&start.split, state) else {
                continue;
            };
            if poses.len() == what.poses {
                break;
            }
            let frames = placed.at(&state, None).frames(|frame| self.is_seen(frame));
            let sensors = self.sensors.iter().map(|sensor| {
                let mut values = sensor.predict(&frames, &self.kinematics.gravity);
                let [length, angle] = [
                    sensor.noise.unwrap_or(what.noise[0]),
                    sensor.noise_of_angles.unwrap_or(what.noise[1]),
                ];
                let positions = match sensor.kind {
                    Kind::Pose => {
                        let turn = Vector3::from_fn(|_, _| angle * draws.normal());
                        let turned =
                            Rotation3::new(turn).matrix() * Matrix3::from_row_slice(&values[..9]);
                        values[..9].copy_from_slice(turned.transpose().as_slice());
                        &mut values[9..]
                    }
                    _ => &mut values[..],
                };
                let noise = if sensor.kind == Kind::Gravity {
                    angle * Vector3::from(self.kinematics.gravity).norm()
                } else {
                    length
                };
                for x in positions {
                    *x += noise * draws.normal();
                }
                Some(values)
            });
            let values = sensors.collect();
            let Some(readings) = self.readings(&scalars, &state) else {
                continue;
            };
            let readings = readings.iter().zip(self.noise_of_readings);
            let readings =
                readings.map(|(reading, noise)| reading + noise.unwrap_or(0.0) * draws.normal());
            states.push(state);
            poses.push(Pose {
                row: poses.len() as u64 + 2,
                readings: readings.collect(),
                values,
            });
        }
        if poses.len() < what.poses {
            return Err(CalibrateError::NotClosed);
        }
        let clean = self.noiseless(&scalars, &states);
        Ok((self.found_without_noise(&clean, &linear, what.noise), poses))
    }

    /// The values that poses without noise lead to, those of the linear equations where they do not determine
    /// them.
    ///
    /// - `linear`: the names of what is found, with values by the derivatives at the description.
    fn found_without_noise(
        &self,
        poses: &[Pose],
        linear: &[(&str, f64)],
        noise: [f64; 2],
    ) -> Vec<f64> {
        let sensors = self.sensors.iter().map(|sensor| Sensor {
            noise: sensor.noise.or(Some(noise[0])),
            noise_of_angles: sensor.noise_of_angles.or(Some(noise[1])),
            ..sensor.clone()
        });
        let problem = Problem {
            sensors: &sensors.collect::<Vec<_>>(),
            noise_of_readings: &vec![Some(noise[1]); self.measured.len()],
            tolerance: None,
            poses,
            ..*self
        };
        let fit = problem.calibrate(0.95).ok().filter(|fit| fit.converged);
        let found = |name: &str| {
            let mut estimates = fit.as_ref()?.estimates.iter();
            Some(estimates.find(|own| own.name == name)?.value)
        };
        let values = linear.iter();
        values
            .map(|(name, value)| found(name).unwrap_or(*value))
            .collect()
    }
}
