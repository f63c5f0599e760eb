//! Base parameters, the combinations of the dynamic parameters on which the efforts depend, and
//! the interface of models that compute with them.

use crate::{Arguments, BaseFunction, Condition, Model, Scalar, SizeError};

/// A dynamic parameter in the linear combination of a base parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseTerm<'a> {
    /// The parameter's label.
    pub parameter: &'a str,
    /// The index of its column in the regressor.
    pub index: usize,
    /// The factor as an expression in the description's geometry names.
    pub coefficient: &'a str,
    /// The numerical value of the factor.
    pub value: f64,
}

/// A base parameter: one dynamic parameter, after which it is labelled, plus multiples of
/// eliminated ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseParameter<'a> {
    /// The label, which is that of the first parameter of the combination.
    pub label: &'a str,
    /// The linear combination; the first term has the factor 1.
    pub terms: &'a [BaseTerm<'a>],
}

/// The certificate of a set of base parameters: the rank of the observation matrix at random closed
/// states, in multiple precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Certificate {
    /// The number of columns, which is that of the dynamic parameters.
    pub columns: usize,
    /// The rank of the columns.
    pub rank: usize,
    /// The number of sampled states.
    pub states: usize,
    /// The number of decimal digits of the arithmetic.
    pub digits: usize,
    /// The smallest pivot of the elimination, relative to the largest entry: it counts as nonzero.
    pub smallest_pivot: f64,
    /// The largest remainder of the elimination that counts as zero, relative to the largest entry.
    pub largest_remainder: f64,
}

/// The base parameters of a model and their certificate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseInfo<'a> {
    /// The base parameters, in the order of `beta`.
    pub base: &'a [BaseParameter<'a>],
    /// Labels of the eliminated parameters, in the order of `free`.
    pub free: &'a [&'a str],
    /// The certificate, if there is one.
    pub certificate: Option<Certificate>,
    /// Whether the number of base parameters is certified to be minimal.
    pub complete: bool,
}

/// A [`Model`] with base parameters. `rank` is the number of base parameters.
pub trait BaseModel<T: Scalar = f64>: Model<T> {
    /// The base parameters and their certificate.
    fn base_info(&self) -> BaseInfo<'_>;

    /// The linear combinations of the dynamic parameters that these base parameters assume to be
    /// zero, as chosen by `base: zero`, `equal` and `drop` of the description; each has the label
    /// of the parameter that it eliminates. The efforts computed from base parameters hold only for
    /// parameters that fulfil these equations. Empty for a description without such choices.
    fn zeros(&self) -> &[BaseParameter<'_>] {
        &[]
    }

    /// Computes a function of base parameters, as [`Model::eval`] does the others.
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
    /// - `q`, `qd`, `qdd`: n; `out`: `dof * rank`, column-major.
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

    /// The base parameters of given dynamic parameters.
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

    /// The dynamic parameters that have given base parameters and given eliminated parameters. All
    /// solutions are reached by varying `free`.
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

    /// The efforts of the independent coordinates, from base parameters.
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

    /// The gravity vector of the reduced model, from base parameters.
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

    /// The mass matrix of the independent coordinates, from base parameters.
    ///
    /// - `q`: n; `beta`: rank; `out`: `dof * dof`, row-major.
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
