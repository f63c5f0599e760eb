//! The friction laws of joints, one table row per law, from which the reader, its errors, the JSON
//! Schema, the parameters and the generated modules follow.
//!
//! The runtime has the same table with the efforts (`regen_runtime::Friction`). Neither crate
//! depends on the other; a test checks that the two tables are equal.

use super::shape::choices;

/// Defines the laws in order: variant, word in specs, whether the effort is linear in all its
/// coefficients, their symbols in order, meaning.
macro_rules! laws {
    ($($law:ident $word:literal $linear:literal [$($symbol:literal)*] $meaning:literal;)+) => {
        /// The friction law of a joint, by its effort at the velocity qd.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Friction {
            $(#[doc = concat!("`", $word, "`: ", $meaning, ".")] $law,)+
        }

        choices! { Friction, "friction kind" { $($word => $law: $meaning,)+ } }

        impl Friction {
            /// All laws.
            pub const ALL: &'static [Friction] = &[$(Friction::$law),+];

            /// The law's word in a spec.
            pub fn word(self) -> &'static str {
                match self { $(Friction::$law => $word,)+ }
            }

            /// The variant's name in Rust.
            pub fn name(self) -> &'static str {
                match self { $(Friction::$law => stringify!($law),)+ }
            }

            /// Whether the effort is linear in all its coefficients, which then are parameters with
            /// columns of the regressor.
            pub fn is_linear(self) -> bool {
                match self { $(Friction::$law => $linear,)+ }
            }

            /// The symbols of all its coefficients, in order.
            pub fn symbols(self) -> &'static [&'static str] {
                match self { $(Friction::$law => &[$($symbol),*],)+ }
            }
        }
    };
}

laws! {
    None "none" true [] "no friction";
    Viscous "viscous" true ["Fv"] "Fv qd";
    Coulomb "coulomb" true ["Fc"] "Fc sgn(qd)";
    Linear "linear" true ["Fv" "Fc"] "Fv qd + Fc sgn(qd)";
    CoulombAsymmetric "coulomb_asymmetric" true ["Fv" "Fc+" "Fc-"] "Fv qd, Fc+ where qd > 0, -Fc- where qd < 0";
    Asymmetric "asymmetric" true ["Fv+" "Fc+" "Fv-" "Fc-"] "Fv+ qd + Fc+ where qd > 0, Fv- qd - Fc- where qd < 0";
    Stribeck "stribeck" false ["Fc" "Fs" "vs" "delta" "Fv"] "sgn(qd) (Fc + (Fs - Fc) exp(-|qd/vs|^delta)) + Fv qd; nonlinear, adds no parameters";
    Atan "atan" false ["Fc" "Fv1" "Fv2" "Fv3"] "sgn(qd) Fc + Fv1 qd + Fv2 atan(Fv3 qd); nonlinear, adds no parameters";
    Power "power" false ["Fc+" "Fc-" "Fv" "delta"] "Fc+ + Fv |qd|^delta where qd > 0, -Fc- - Fv |qd|^delta where qd < 0; nonlinear, adds no parameters";
    Lugre "lugre" false ["Fc" "Fs" "vs" "Fv"] "sgn(qd) (Fc + (Fs - Fc) exp(-(qd/vs)^2)) + Fv qd, the LuGre model's steady state; nonlinear, adds no parameters";
}

impl Friction {
    /// The symbols of the parameters that the law adds, in the order of its columns.
    pub fn parameters(self) -> &'static [&'static str] {
        if self.is_linear() {
            self.symbols()
        } else {
            &[]
        }
    }

    /// The symbols that `nominal` may contain: of laws with a coefficient for each direction, also
    /// the unsigned symbol for both.
    pub(super) fn nominal(self) -> &'static [&'static str] {
        match self {
            Self::CoulombAsymmetric => &["Fv", "Fc", "Fc+", "Fc-"],
            Self::Asymmetric => &["Fv", "Fc", "Fv+", "Fv-", "Fc+", "Fc-"],
            Self::Power => &["Fc", "Fc+", "Fc-", "Fv", "delta"],
            other => other.symbols(),
        }
    }
}
