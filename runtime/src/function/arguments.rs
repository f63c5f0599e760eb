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
            /// All arguments.
            pub const ALL: [Argument; [$(stringify!($case)),*].len()] = [$(Argument::$case),*];

            /// The name of the argument in methods and in [`Arguments`].
            pub fn name(self) -> &'static str {
                match self {
                    $(Argument::$case => stringify!($field),)*
                }
            }

            /// The items to which its entries belong, one entry each.
            pub fn size(self) -> Size {
                match self {
                    $(Argument::$case => Size::$size,)*
                }
            }
        }

        impl Argument {
            /// Whether it holds parameters of the robot, which do not change with the state.
            pub fn is_parameter(self) -> bool {
                matches!(self.size(), Size::Parameters | Size::Base | Size::Free)
            }
        }

        /// The arguments of a function by name. A function reads those that its signature lists;
        /// the others may stay empty.
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
            /// All arguments empty.
            pub const EMPTY: Self = Self { $($field: &[],)* };

            /// The entries of one argument.
            #[inline]
            pub fn get(&self, argument: Argument) -> &'a [T] {
                match argument {
                    $(Argument::$case => self.$field,)*
                }
            }

            /// The same with the entries of one argument replaced.
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
    /// The velocities of all coordinates, rad/s or m/s.
    Qd, qd: Coordinates;
    /// The accelerations of all coordinates, rad/s^2 or m/s^2.
    Qdd, qdd: Coordinates;
    /// The velocities of the independent coordinates, rad/s or m/s.
    QdI, qd_i: Independent;
    /// The accelerations of the independent coordinates, rad/s^2 or m/s^2.
    QddI, qdd_i: Independent;
    /// The reference velocities of the independent coordinates, rad/s or m/s.
    QdRI, qd_r_i: Independent;
    /// The reference accelerations of the independent coordinates, rad/s^2 or m/s^2.
    QddRI, qdd_r_i: Independent;
    /// The efforts of the independent coordinates, N m or N.
    TauI, tau_i: Independent;
    /// The dynamic parameters, SI units.
    Phi, phi: Parameters;
    /// The efforts of the actuated coordinates, N m or N.
    TauActuated, tau_actuated: Actuated;
    /// The base parameters, SI units.
    Beta, beta: Base;
    /// The values of the eliminated parameters, SI units.
    Free, free: Free;
}
