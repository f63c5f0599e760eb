//! The arguments of all functions, by name.

use super::Size;

macro_rules! arguments {
    ($($(#[$doc:meta])* $case:ident, $field:ident: $size:ident;)*) => {
        /// An argument of a function.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Argument {
            $($(#[$doc])* $case,)*
        }

        impl Argument {
            /// All of them.
            pub const ALL: [Argument; [$(stringify!($case)),*].len()] = [$(Argument::$case),*];

            /// Its name, in methods and in [`Arguments`].
            pub fn name(self) -> &'static str {
                match self {
                    $(Argument::$case => stringify!($field),)*
                }
            }

            /// What its elements belong to.
            pub fn size(self) -> Size {
                match self {
                    $(Argument::$case => Size::$size,)*
                }
            }
        }

        /// Arguments by name. A function reads those that its signature lists; the others may
        /// stay empty.
        ///
        /// ```
        /// use regen_runtime::Arguments;
        /// use regen_runtime::function::Argument;
        ///
        /// let arguments = Arguments { q: &[0.1, 0.2], ..Arguments::EMPTY };
        /// assert_eq!(arguments.get(Argument::Q), [0.1, 0.2]);
        /// assert_eq!(arguments.with(Argument::Phi, &[3.0]).phi, [3.0]);
        /// ```
        #[derive(Clone, Copy, Debug)]
        pub struct Arguments<'a, T> {
            $($(#[$doc])* pub $field: &'a [T],)*
        }

        impl<'a, T> Arguments<'a, T> {
            /// None given.
            pub const EMPTY: Self = Self { $($field: &[],)* };

            /// The entries of one.
            #[inline]
            pub fn get(&self, argument: Argument) -> &'a [T] {
                match argument {
                    $(Argument::$case => self.$field,)*
                }
            }

            /// The same with other entries of one.
            #[inline]
            #[must_use]
            pub fn with(self, argument: Argument, entries: &'a [T]) -> Self {
                let mut arguments = self;
                match argument {
                    $(Argument::$case => arguments.$field = entries,)*
                }
                arguments
            }
        }
    };
}

arguments! {
    /// The coordinates, rad or m.
    Q, q: Coordinates;
    /// The velocities of all coordinates.
    Qd, qd: Coordinates;
    /// The accelerations of all coordinates.
    Qdd, qdd: Coordinates;
    /// The velocities of the independent coordinates.
    QdI, qd_i: Independent;
    /// The accelerations of the independent coordinates.
    QddI, qdd_i: Independent;
    /// The reference velocities of the independent coordinates.
    QdRI, qd_r_i: Independent;
    /// The reference accelerations of the independent coordinates.
    QddRI, qdd_r_i: Independent;
    /// The dynamic parameters.
    Phi, phi: Parameters;
    /// The efforts of the actuated coordinates, N m or N.
    TauActuated, tau_actuated: Actuated;
    /// The base parameters.
    Beta, beta: Base;
    /// The values of the eliminated parameters.
    Free, free: Free;
}
