//! Base parameters: the combinations of the dynamic parameters that the forces depend on, and
//! the interface of models that compute with them.

use crate::{Arguments, BaseFunction, Condition, Model, Scalar, SizeError};

/// A parameter in a combination.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseTerm<'a> {
    /// The parameter's label.
    pub parameter: &'a str,
    /// Its place among the regressor's columns.
    pub index: usize,
    /// The factor as an expression in the spec's geometry names.
    pub coefficient: &'a str,
    /// The factor's value.
    pub value: f64,
}

/// A base parameter: a kept parameter, which gives it its label, plus multiples of others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseParameter<'a> {
    /// The kept parameter's label.
    pub label: &'a str,
    /// The combination, the kept parameter first with factor 1.
    pub terms: &'a [BaseTerm<'a>],
}

/// The certificate of a base: the rank at random closed states in multiple precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Certificate {
    /// Columns: dynamic parameters.
    pub columns: usize,
    /// Their rank.
    pub rank: usize,
    /// States sampled.
    pub states: usize,
    /// Decimal digits carried.
    pub digits: usize,
    /// The smallest number that counted, as a part of the largest.
    pub smallest_kept: f64,
    /// The largest number that did not count, as a part of the largest.
    pub largest_dropped: f64,
}

/// The base of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseInfo<'a> {
    /// The base parameters, in the order of `beta`.
    pub base: &'a [BaseParameter<'a>],
    /// Labels of the eliminated parameters, in the order of `free`.
    pub free: &'a [&'a str],
    /// Its certificate, if there is one.
    pub certificate: Option<Certificate>,
    /// Whether the base is certified to be minimal.
    pub complete: bool,
}

/// A [`Model`] with base parameters. `rank` is the number of them.
pub trait BaseModel<T: Scalar = f64>: Model<T> {
    /// The combinations and their certificate.
    fn base_info(&self) -> BaseInfo<'_>;

    /// Forms in the parameters that this base takes as zero: what `base: zero`, `equal` and `drop`
    /// of the spec say, each under the label of the parameter that it takes out. Only parameters
    /// that fulfil them have the forces that their base parameters give. Empty for a spec without
    /// such choices.
    fn zeros(&self) -> &[BaseParameter<'_>] {
        &[]
    }

    /// Computes a function over base parameters, as [`Model::eval`] does the others.
    ///
    /// # Errors
    /// When a length does not fit: the first of the arguments in order, then of `out`.
    fn eval_base(
        &self,
        function: BaseFunction,
        arguments: Arguments<'_, T>,
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError>;

    /// The reduced regressor `W_red` (Eq. 23).
    ///
    /// - `q`, `qd`, `qdd`: n; `out`: `dof * rank`, column by column.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn base_regressor(
        &self,
        q: &[T],
        qd: &[T],
        qdd: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            qd,
            qdd,
            ..Arguments::EMPTY
        };
        self.eval_base(BaseFunction::BaseRegressor, arguments, out)
    }

    /// The base parameters of given parameters.
    ///
    /// - `phi`: p; `out`: rank.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn to_base(&self, phi: &[T], out: &mut [T]) -> Result<(), SizeError> {
        let arguments = Arguments {
            phi,
            ..Arguments::EMPTY
        };
        self.eval_base(BaseFunction::ToBase, arguments, out)
            .map(drop)
    }

    /// Parameters that have given base parameters: all of them, as `free` takes all values.
    ///
    /// - `beta`: rank; `free`: values of the eliminated parameters; `out`: p.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn parameters_from_base(&self, beta: &[T], free: &[T], out: &mut [T]) -> Result<(), SizeError> {
        let arguments = Arguments {
            beta,
            free,
            ..Arguments::EMPTY
        };
        self.eval_base(BaseFunction::FromBase, arguments, out)
            .map(drop)
    }

    /// Inverse dynamics from base parameters.
    ///
    /// - `q`, `qd`, `qdd`: n; `beta`: rank; `out`: dof.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn base_inverse_dynamics(
        &self,
        q: &[T],
        qd: &[T],
        qdd: &[T],
        beta: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            qd,
            qdd,
            beta,
            ..Arguments::EMPTY
        };
        self.eval_base(BaseFunction::BaseInverseDynamics, arguments, out)
    }

    /// Gravity from base parameters.
    ///
    /// - `q`: n; `beta`: rank; `out`: dof.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn base_gravity(&self, q: &[T], beta: &[T], out: &mut [T]) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            beta,
            ..Arguments::EMPTY
        };
        self.eval_base(BaseFunction::BaseGravity, arguments, out)
    }

    /// The efforts at zero independent accelerations, less gravity, from base parameters.
    ///
    /// - `q`, `qd`: n; `beta`: rank; `out`: dof.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn base_bias_forces(
        &self,
        q: &[T],
        qd: &[T],
        beta: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            qd,
            beta,
            ..Arguments::EMPTY
        };
        self.eval_base(BaseFunction::BaseBiasForces, arguments, out)
    }

    /// The mass matrix from base parameters.
    ///
    /// - `q`: n; `beta`: rank; `out`: `dof * dof`, row by row.
    ///
    /// # Errors
    /// When a length does not fit.
    #[inline]
    fn base_mass_matrix(
        &self,
        q: &[T],
        beta: &[T],
        out: &mut [T],
    ) -> Result<Condition<T>, SizeError> {
        let arguments = Arguments {
            q,
            beta,
            ..Arguments::EMPTY
        };
        self.eval_base(BaseFunction::BaseMassMatrix, arguments, out)
    }
}
