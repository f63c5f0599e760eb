//! Friction laws of joints (Eq. 14, 16, 17, 32), one table row per law. Simulation computes efforts
//! from them; identification uses columns that are linear in some coefficients while the shape, in
//! which the law is not linear, is fixed.
//!
//! The elementary functions are those of `libm`: the same digits on every machine.

use crate::Motion;

/// The largest number of coefficients that a law is linear in.
pub const COEFFICIENTS: usize = 4;
/// The largest number of shape parameters, in which a law is not linear.
pub const SHAPES: usize = 2;
/// The largest number of values of a law, coefficients and shape together.
pub const VALUES: usize = 5;

/// The coefficient by which static friction exceeds Coulomb friction.
const EXCESS: &str = "Fs-Fc";
/// The derivatives, all zero, of columns that do not depend on a shape parameter.
const NO_SLOPE: [f64; COEFFICIENTS] = [0.0; COEFFICIENTS];

/// The definition of a law: one row of the table.
struct Law {
    name: &'static str,
    symbols: &'static [&'static str],
    /// The symbols of the coefficients that multiply the columns, in the order of the columns.
    coefficients: &'static [&'static str],
    /// The symbols of the shape parameters, in which the effort is not linear.
    shape: &'static [&'static str],
    /// The value of the first shape parameter at which the law is linear friction, if that requires
    /// one.
    linear_at: Option<f64>,
    /// The columns as a function of the velocity, its sign and the shape.
    columns: fn(f64, f64, [f64; SHAPES]) -> [f64; COEFFICIENTS],
    /// The derivatives of the columns by the logarithm of each shape parameter.
    slopes: fn(f64, f64, [f64; SHAPES]) -> [[f64; COEFFICIENTS]; SHAPES],
}

impl Law {
    /// A law that is linear in all its values, which are its coefficients in this order. The
    /// columns are zero until the caller sets them.
    const fn linear(name: &'static str, symbols: &'static [&'static str]) -> Self {
        Law {
            name,
            symbols,
            coefficients: symbols,
            shape: &[],
            linear_at: None,
            columns: |_, _, _| NO_SLOPE,
            slopes: |_, _, _| [NO_SLOPE; SHAPES],
        }
    }
}

/// The friction law of a joint. `v` is its velocity, rad/s or m/s.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Friction {
    /// No friction.
    None,
    /// `Fv v`.
    Viscous,
    /// `Fc sgn(v)`.
    Coulomb,
    /// `Fv v + Fc sgn(v)`.
    Linear,
    /// `Fv v + Fc+` where v > 0, `Fv v - Fc-` where v < 0.
    CoulombAsymmetric,
    /// `Fv+ v + Fc+` where v > 0, `Fv- v - Fc-` where v < 0 (Eq. 14).
    Asymmetric,
    /// `sgn(v) (Fc + (Fs - Fc) exp(-|v/vs|^delta)) + Fv v` (Eq. 32); no columns in the regressor.
    Stribeck,
    /// `sgn(v) Fc + Fv1 v + Fv2 atan(Fv3 v)` (Eq. 16); no columns in the regressor.
    Atan,
    /// `Fc+ + Fv |v|^delta` where v > 0, `-Fc- - Fv |v|^delta` where v < 0 (Eq. 17); no columns in
    /// the regressor.
    Power,
    /// `sgn(v) (Fc + (Fs - Fc) exp(-(v/vs)^2)) + Fv v`: the steady state of the LuGre model; no
    /// columns in the regressor. C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, "A new
    /// model for control of systems with friction", IEEE Trans. Automatic Control 40(3), 1995.
    Lugre,
}

impl Friction {
    /// All laws.
    pub const ALL: [Friction; 10] = [
        Friction::None,
        Friction::Viscous,
        Friction::Coulomb,
        Friction::Linear,
        Friction::CoulombAsymmetric,
        Friction::Asymmetric,
        Friction::Stribeck,
        Friction::Atan,
        Friction::Power,
        Friction::Lugre,
    ];

    /// The definition of a law.
    fn row(self) -> Law {
        match self {
            Friction::None => Law::linear("none", &[]),
            Friction::Viscous => Law {
                columns: |v, _, _| [v, 0.0, 0.0, 0.0],
                ..Law::linear("viscous", &["Fv"])
            },
            Friction::Coulomb => Law {
                columns: |_, sign, _| [sign, 0.0, 0.0, 0.0],
                ..Law::linear("coulomb", &["Fc"])
            },
            Friction::Linear => Law {
                coefficients: &["Fc", "Fv"],
                columns: |v, sign, _| [sign, v, 0.0, 0.0],
                ..Law::linear("linear", &["Fv", "Fc"])
            },
            Friction::CoulombAsymmetric => Law {
                coefficients: &["Fc+", "Fc-", "Fv"],
                columns: |v, sign, _| [sign.max(0.0), sign.min(0.0), v, 0.0],
                ..Law::linear("coulomb_asymmetric", &["Fv", "Fc+", "Fc-"])
            },
            Friction::Asymmetric => Law {
                coefficients: &["Fc+", "Fc-", "Fv+", "Fv-"],
                columns: |v, sign, _| [sign.max(0.0), sign.min(0.0), v.max(0.0), v.min(0.0)],
                ..Law::linear("asymmetric", &["Fv+", "Fc+", "Fv-", "Fc-"])
            },
            Friction::Stribeck => Law {
                coefficients: &["Fc", EXCESS, "Fv"],
                shape: &["vs", "delta"],
                columns: |v, sign, [vs, delta]| {
                    let e = libm::exp(-libm::pow((v / vs).abs(), delta));
                    [sign, sign * e, v, 0.0]
                },
                slopes: |v, sign, shape| stribeck(v, sign, shape).1,
                ..Law::linear("stribeck", &["Fc", "Fs", "vs", "delta", "Fv"])
            },
            Friction::Atan => Law {
                coefficients: &["Fc", "Fv1", "Fv2"],
                shape: &["Fv3"],
                columns: |v, sign, shape| [sign, v, libm::atan(shape[0] * v), 0.0],
                slopes: |v, _, shape| {
                    let x = shape[0] * v;
                    [[0.0, 0.0, x / (1.0 + x * x), 0.0], NO_SLOPE]
                },
                ..Law::linear("atan", &["Fc", "Fv1", "Fv2", "Fv3"])
            },
            Friction::Power => Law {
                coefficients: &["Fc+", "Fc-", "Fv"],
                shape: &["delta"],
                linear_at: Some(1.0),
                columns: |v, sign, shape| {
                    let power = libm::pow(v.abs(), shape[0]);
                    [sign.max(0.0), sign.min(0.0), sign * power, 0.0]
                },
                slopes: |v, sign, shape| {
                    let delta = shape[0];
                    let power = libm::pow(v.abs(), delta);
                    let by_delta = sign * delta * times_logarithm(power, v.abs());
                    [[0.0, 0.0, by_delta, 0.0], NO_SLOPE]
                },
                ..Law::linear("power", &["Fc+", "Fc-", "Fv", "delta"])
            },
            Friction::Lugre => Law {
                coefficients: &["Fc", EXCESS, "Fv"],
                shape: &["vs"],
                columns: |v, sign, shape| {
                    let ratio = v / shape[0];
                    [sign, sign * libm::exp(-ratio * ratio), v, 0.0]
                },
                slopes: |v, sign, shape| {
                    let square = (v / shape[0]) * (v / shape[0]);
                    let by_vs = sign * libm::exp(-square) * 2.0 * square;
                    [[0.0, by_vs, 0.0, 0.0], NO_SLOPE]
                },
                ..Law::linear("lugre", &["Fc", "Fs", "vs", "Fv"])
            },
        }
    }

    /// The law's name in a spec and in files.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// The symbols of the law's values, in the order of [`Joint::nominal`](crate::Joint::nominal);
    /// for a law that is linear in all of them, also the order of its columns in the regressor.
    ///
    /// ```
    /// use regen_runtime::Friction;
    ///
    /// assert_eq!(Friction::Linear.symbols(), ["Fv", "Fc"]);
    /// assert_eq!(Friction::Stribeck.symbols(), ["Fc", "Fs", "vs", "delta", "Fv"]);
    /// ```
    pub fn symbols(self) -> &'static [&'static str] {
        self.row().symbols
    }

    /// Whether the effort is linear in all values, which then are parameters with columns in the
    /// regressor.
    pub fn is_linear(self) -> bool {
        self.shape_symbols().is_empty()
    }

    /// The symbols of the shape parameters, in which the effort is not linear. Their values are
    /// positive.
    pub fn shape_symbols(self) -> &'static [&'static str] {
        self.row().shape
    }

    /// The symbols of the coefficients that multiply the [`columns`](Self::columns). None is
    /// negative in a joint that dissipates; `Fs-Fc` is the excess of static over Coulomb friction.
    pub fn coefficients(self) -> &'static [&'static str] {
        self.row().coefficients
    }

    /// The columns at a velocity `v`, rad/s or m/s: one for each coefficient, then zeros.
    ///
    /// - `sign`: sgn(v), or a smooth function in its place;
    /// - `shape`: values of [`shape_symbols`](Self::shape_symbols), SI.
    pub fn columns(self, v: f64, sign: f64, shape: [f64; SHAPES]) -> [f64; COEFFICIENTS] {
        (self.row().columns)(v, sign, shape)
    }

    /// The derivatives of the columns by the logarithm of each shape parameter, then zeros.
    pub fn slopes(self, v: f64, sign: f64, shape: [f64; SHAPES]) -> [[f64; COEFFICIENTS]; SHAPES] {
        (self.row().slopes)(v, sign, shape)
    }

    /// The [`columns`](Self::columns) and the [`slopes`](Self::slopes), which take less time
    /// together.
    pub fn columns_and_slopes(
        self,
        v: f64,
        sign: f64,
        shape: [f64; SHAPES],
    ) -> ([f64; COEFFICIENTS], [[f64; COEFFICIENTS]; SHAPES]) {
        match self {
            Friction::Stribeck => stribeck(v, sign, shape),
            law => (law.columns(v, sign, shape), law.slopes(v, sign, shape)),
        }
    }

    /// Splits values in the order of [`symbols`](Self::symbols) into coefficients and shape. A
    /// missing value counts as 0.
    pub fn split(self, values: &[f64]) -> ([f64; COEFFICIENTS], [f64; SHAPES]) {
        let law = self.row();
        let value = |symbol: &str| {
            let place = law.symbols.iter().position(|s| *s == symbol);
            place.and_then(|k| values.get(k)).copied().unwrap_or(0.0)
        };
        let (mut coefficients, mut shape) = ([0.0; COEFFICIENTS], [0.0; SHAPES]);
        for (slot, symbol) in coefficients.iter_mut().zip(law.coefficients) {
            *slot = match *symbol {
                EXCESS => value("Fs") - value("Fc"),
                symbol => value(symbol),
            };
        }
        for (slot, symbol) in shape.iter_mut().zip(law.shape) {
            *slot = value(symbol);
        }
        (coefficients, shape)
    }

    /// Joins coefficients and a shape to values in the order of [`symbols`](Self::symbols), then
    /// zeros. The inverse of [`split`](Self::split).
    pub fn join(self, coefficients: &[f64], shape: [f64; SHAPES]) -> [f64; VALUES] {
        let law = self.row();
        let coefficient = |symbol: &str| {
            let place = law.coefficients.iter().position(|s| *s == symbol);
            place.and_then(|k| coefficients.get(k)).copied()
        };
        let mut values = [0.0; VALUES];
        for (slot, symbol) in values.iter_mut().zip(law.symbols) {
            let shape_of = || {
                let mut all = law.shape.iter().zip(shape);
                all.find(|(s, _)| s == &symbol).map(|(_, value)| value)
            };
            *slot = match *symbol {
                // the static friction is the Coulomb friction plus the excess
                "Fs" => coefficient("Fc").unwrap_or(0.0) + coefficient(EXCESS).unwrap_or(0.0),
                symbol => coefficient(symbol).or_else(shape_of).unwrap_or(0.0),
            };
        }
        values
    }

    /// The coefficients and the shape with which this law equals linear friction of these Fc and
    /// Fv. A law without one of the two terms takes the other only.
    ///
    /// - `shape`: returned unchanged where linear friction does not depend on it.
    pub fn of_linear(
        self,
        [fc, fv]: [f64; 2],
        mut shape: [f64; SHAPES],
    ) -> ([f64; COEFFICIENTS], [f64; SHAPES]) {
        let law = self.row();
        let mut coefficients = [0.0; COEFFICIENTS];
        for (slot, symbol) in coefficients.iter_mut().zip(law.coefficients) {
            *slot = match *symbol {
                "Fc" | "Fc+" | "Fc-" => fc,
                symbol if VISCOUS.contains(&symbol) => fv,
                _ => 0.0,
            };
        }
        if let (Some(linear), [first, ..]) = (law.linear_at, &mut shape) {
            *first = linear;
        }
        (coefficients, shape)
    }

    /// The effort that friction takes from a joint, N or N m: positive where it opposes a
    /// positive velocity.
    ///
    /// - `values`: in the order of [`symbols`](Self::symbols), SI; a missing one counts as 0;
    /// - `v`: rad/s or m/s; `sign`: sgn(v), or a smooth function in its place.
    pub fn effort(self, values: &[f64], v: f64, sign: f64) -> f64 {
        let (coefficients, shape) = self.split(values);
        let columns = self.columns(v, sign, shape);
        let used = columns.iter().zip(coefficients);
        used.take(self.coefficients().len())
            .map(|(c, x)| c * x)
            .sum()
    }
}

/// The symbols of viscous friction: efforts over velocities.
const VISCOUS: [&str; 4] = ["Fv", "Fv+", "Fv-", "Fv1"];
/// The symbols of efforts.
const FORCES: [&str; 6] = ["Fc", "Fc+", "Fc-", "Fs", EXCESS, "Fv2"];

/// Finds the symbol of a law's value or coefficient by its text in labels.
pub(crate) fn symbol(text: &str) -> Option<&'static str> {
    let mut symbols = Friction::ALL
        .iter()
        .flat_map(|law| law.symbols().iter().chain(law.coefficients()));
    symbols.find(|symbol| **symbol == text).copied()
}

/// The SI unit of a friction symbol; `SI` where the joint's motion or the symbol is unknown.
pub(crate) fn unit(symbol: &str, motion: Option<Motion>) -> &'static str {
    let [turn, shift] = match symbol {
        _ if VISCOUS.contains(&symbol) => ["N m s/rad", "N s/m"],
        _ if FORCES.contains(&symbol) => ["N m", "N"],
        "vs" => ["rad/s", "m/s"],
        "Fv3" => ["s/rad", "s/m"],
        "delta" => ["1", "1"],
        _ => ["SI", "SI"],
    };
    match motion {
        Some(Motion::Rotation) => turn,
        Some(Motion::Translation) => shift,
        None => "SI",
    }
}

/// A friction law with its values.
///
/// ```
/// use regen_runtime::{Friction, JointFriction};
///
/// let stribeck = JointFriction {
///     law: Friction::Stribeck,
///     values: [2.0, 3.0, 0.1, 2.0, 5.0],
/// };
/// // far above the Stribeck velocity: Coulomb and viscous friction
/// assert!((stribeck.effort(1.0) - 7.0).abs() < 1e-12);
/// // it opposes the motion, whatever its direction
/// assert_eq!(stribeck.effort(-1.0), -stribeck.effort(1.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointFriction {
    /// The law.
    pub law: Friction,
    /// The values in the order of [`Friction::symbols`], SI, then zeros.
    pub values: [f64; VALUES],
}

impl JointFriction {
    /// No friction.
    pub const NONE: JointFriction = JointFriction {
        law: Friction::None,
        values: [0.0; VALUES],
    };

    /// The effort that friction takes from the joint at a velocity (Eq. 14, 16, 17, 32), N or N m
    /// over rad/s or m/s; positive where it opposes a positive velocity, 0 at rest.
    pub fn effort(&self, v: f64) -> f64 {
        let sign = if v == 0.0 { 0.0 } else { v.signum() };
        self.law.effort(&self.values, v, sign)
    }

    /// As [`effort`](Self::effort) with tanh(v/width) in place of sgn(v): smooth where the joint
    /// reverses. `width` is a velocity, rad/s or m/s.
    pub fn smooth_effort(&self, v: f64, width: f64) -> f64 {
        self.law.effort(&self.values, v, libm::tanh(v / width))
    }

    /// The same law with all efforts multiplied by `by`; its velocities and exponents do not
    /// change.
    #[must_use]
    pub fn scaled(&self, by: f64) -> Self {
        let (mut coefficients, shape) = self.law.split(&self.values);
        for value in &mut coefficients {
            *value *= by;
        }
        let values = self.law.join(&coefficients, shape);
        Self {
            law: self.law,
            values,
        }
    }
}

/// A power far above those whose exponential is not 0.
const LARGEST_POWER: f64 = 1e300;

/// The columns of Stribeck's law and their slopes, with one power for all of them.
fn stribeck(
    v: f64,
    sign: f64,
    [vs, delta]: [f64; SHAPES],
) -> ([f64; COEFFICIENTS], [[f64; COEFFICIENTS]; SHAPES]) {
    let ratio = (v / vs).abs();
    // finite, since the exponential of its negative is 0 and times infinity not a number
    let power = libm::pow(ratio, delta).min(LARGEST_POWER);
    let e = libm::exp(-power);
    let by_vs = sign * e * delta * power;
    let by_delta = -sign * e * delta * times_logarithm(power, ratio);
    (
        [sign, sign * e, v, 0.0],
        [[0.0, by_vs, 0.0, 0.0], [0.0, by_delta, 0.0, 0.0]],
    )
}

/// `power ln(base)`; 0 at the base 0, the limit there.
fn times_logarithm(power: f64, base: f64) -> f64 {
    if power > 0.0 && base > 0.0 {
        power * libm::log(base)
    } else {
        0.0
    }
}
