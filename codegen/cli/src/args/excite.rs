//! The options of `regen excite`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum, ValueHint};

use super::format::Format;
use super::reading::{PayloadArg, count};

#[derive(Debug, Args)]
#[command(after_help = "\
The independent coordinates follow finite Fourier series (Eq. 25) that make the
observation matrix of the base parameters well conditioned. The limits are those
of the spec, changed by --limit and --cone: positions, velocities, accelerations
and jerks of all coordinates, cones of spherical joints, efforts of the
actuators at the nominal parameters, and a distance from singularities. They
hold over the whole period, between samples too. The loops stay closed on the
branch of `home`.

If no trajectory is within all limits, the limit that prevents it is named, and
the exit code is 4. Ctrl-C ends the search with the best trajectory so far. The
same seed gives the same file, on any number of threads.

Equations are those of Mata et al. (2008); see the README.

With --calibrate the robot is to be measured at rest, to find its geometry: N
poses are chosen by exchange among some hundred within the limits, near home
where there are none, so that the determinant of the normal matrix is large, and
ordered so that each is reached from the one before. Printed are the indices O1
to O5 of observability (Borm 1991, Driels 1990, Nahvi 1994 and 1996, Sun 2008)
and the deviations to expect, beside those of poses at random; sensors whose
noise FILE does not state have 0.05 mm and 0.1 mrad. Collisions are not known.
JSON is that of `regen calibrate`.

Examples:
  regen excite robots/3rps.yaml --out t.json
  regen excite robots/3rps.yaml --harmonics 11 --frequency 0.13333 \\
      --samples 75 --limit q2.velocity=-0.6,0.6 --cone s1=45deg \\
      --cone s2=45deg --seed 7
  regen excite robots/fivebar.yaml --criterion determinant --at-rest \\
      --out t.json
  regen excite arm.yaml --calibrate 30 --measure tracker.yaml --out poses.csv")]
pub(crate) struct ExciteArgs {
    /// The robot's spec
    pub(crate) file: PathBuf,
    /// Where the trajectory, or poses in the columns of --measure as CSV, are written [default: only
    /// the summary is printed; its JSON contains the trajectory]
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Whether the payloads of the spec are carried; required if it has payloads
    #[arg(long, value_enum)]
    pub(crate) payload: Option<PayloadArg>,
    /// The number of harmonics
    #[arg(long, value_name = "N", default_value_t = 11, value_parser = count::<0, 1000>)]
    pub(crate) harmonics: usize,
    /// The frequency of the first harmonic in Hz [default: 2/15, a period of 7.5 s]
    #[arg(long, value_name = "HZ", default_value_t = 1.0 / 7.5, hide_default_value = true)]
    pub(crate) frequency: f64,
    /// The number of samples in a period
    #[arg(long, value_name = "N", default_value_t = 75, value_parser = count::<0, 100_000>)]
    pub(crate) samples: usize,
    /// The measure that the trajectory minimises
    #[arg(long, value_enum, default_value_t)]
    pub(crate) criterion: CriterionArg,
    /// Start and end with velocities and accelerations of zero
    #[arg(long)]
    pub(crate) at_rest: bool,
    /// Replace a limit of the spec: COORDINATE.QUANTITY=LOWEST,HIGHEST, where
    /// QUANTITY is position, velocity, acceleration, jerk or effort (may be repeated)
    #[arg(long, value_name = "LIMIT", allow_hyphen_values = true)]
    pub(crate) limit: Vec<LimitArg>,
    /// Replace a cone of the spec: NAME=ANGLE, in rad, or in degrees as 45deg (may
    /// be repeated)
    #[arg(long, value_name = "CONE")]
    pub(crate) cone: Vec<ConeArg>,
    /// Choose N poses for a calibration of the geometry instead of a trajectory
    #[arg(
        long,
        value_name = "N",
        requires = "measure",
        value_parser = count::<1, 2000>,
        conflicts_with_all = [
            "payload", "harmonics", "frequency", "samples", "criterion", "at_rest", "cone", "starts",
            "steps", "threads",
        ],
    )]
    pub(crate) calibrate: Option<usize>,
    /// The experiment file with the key `calibrate`, which says what is measured at each pose
    #[arg(long, value_name = "FILE", requires = "calibrate", value_hint = ValueHint::FilePath)]
    pub(crate) measure: Option<PathBuf>,
    /// The least pivot of A_e: 1 in the middle of a workspace, 0 at singularities
    /// [default: 0.05]
    #[arg(long, value_name = "PIVOT")]
    pub(crate) margin: Option<f64>,
    /// The seed of the random starts
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    pub(crate) seed: u64,
    /// The number of random starts, of which the best result is used
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = count::<1, 100_000>)]
    pub(crate) starts: usize,
    /// The most steps in the last of the five stages of a start; the others take up to a third
    #[arg(long, value_name = "N", default_value_t = 180, value_parser = count::<0, 1_000_000>)]
    pub(crate) steps: usize,
    /// The number of threads [default: as many as the machine has]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true, value_parser = count::<0, 1024>)]
    pub(crate) threads: usize,
    /// How the summary is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
}

/// The measure that a trajectory minimises
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum CriterionArg {
    /// A small condition number, columns scaled to unit length (Eq. 27)
    #[default]
    Scaled,
    /// A small condition number (Eq. 24)
    Condition,
    /// A small -log det(W^T W) (Eq. 26)
    Determinant,
    /// A large smallest singular value
    Smallest,
}

/// A limit given with `--limit`, such as `q2.velocity=-0.6,0.6`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LimitArg {
    pub(crate) coordinate: String,
    pub(crate) quantity: String,
    pub(crate) range: [f64; 2],
}

/// A cone given with `--cone`, such as `s1=45deg`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ConeArg {
    pub(crate) name: String,
    /// The largest angle between the two z axes, rad.
    pub(crate) angle: f64,
}

impl FromStr for LimitArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let form = "COORDINATE.QUANTITY=LOWEST,HIGHEST is needed";
        let (target, range) = text.split_once('=').ok_or(form)?;
        let (coordinate, quantity) = target.rsplit_once('.').ok_or(form)?;
        if !["position", "velocity", "acceleration", "jerk", "effort"].contains(&quantity) {
            return Err(format!(
                "{quantity}: position, velocity, acceleration, jerk or effort is needed"
            ));
        }
        let (low, high) = range.split_once(',').ok_or(form)?;
        let number = |text: &str| {
            let text = text.trim();
            text.parse().map_err(|why| format!("{text}: {why}"))
        };
        Ok(Self {
            coordinate: coordinate.to_owned(),
            quantity: quantity.to_owned(),
            range: [number(low)?, number(high)?],
        })
    }
}

impl FromStr for ConeArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, angle) = text.split_once('=').ok_or("NAME=ANGLE is needed")?;
        let (digits, factor) = match angle.trim().strip_suffix("deg") {
            Some(digits) => (digits, std::f64::consts::PI / 180.0),
            None => (angle.trim(), 1.0),
        };
        let value: f64 = digits.parse().map_err(|why| format!("{digits}: {why}"))?;
        Ok(Self {
            name: name.to_owned(),
            angle: value * factor,
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn limits_and_cones_are_read_and_mistakes_explained() {
        let limit: LimitArg = "u1.3.velocity=-0.6,1e3".parse().unwrap();
        assert_eq!(limit.coordinate, "u1.3");
        assert_eq!(
            limit.range.map(f64::to_bits),
            [-0.6_f64, 1e3].map(f64::to_bits)
        );
        let cone: ConeArg = "s1=45deg".parse().unwrap();
        assert!((cone.angle - std::f64::consts::FRAC_PI_4).abs() < 1e-15);
        assert!("q=1".parse::<LimitArg>().unwrap_err().contains("is needed"));
        assert!(
            "q.speed=1,2"
                .parse::<LimitArg>()
                .unwrap_err()
                .contains("speed")
        );
        assert!("s1=x".parse::<ConeArg>().unwrap_err().contains('x'));
    }
}
