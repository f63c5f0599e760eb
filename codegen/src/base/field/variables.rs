//! The variables of expressions: geometry names, and sines and cosines of angles that have no exact
//! value.

use crate::base::Coefficient;
use crate::spec::Function;
use crate::sym::Number;

/// A variable of the expressions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Variable {
    /// A geometry name.
    Name(String),
    /// The sine of an angle in rad.
    Sin(Argument),
    /// The cosine of an angle in rad.
    Cos(Argument),
    /// A constant that is not a polynomial in the other variables, as it is printed.
    Written(Coefficient),
}

/// An angle in rad of which no exact sine is known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Argument {
    /// A number.
    Constant(Number),
    /// An expression in geometry names, with its value.
    Named(Coefficient, Number),
}

impl Argument {
    fn written(&self) -> Coefficient {
        match self {
            Argument::Constant(angle) => angle.into(),
            Argument::Named(angle, _) => angle.clone(),
        }
    }
}

/// All variables with their values.
#[derive(Clone, Debug, Default)]
pub(crate) struct Variables {
    all: Vec<(Variable, Number)>,
}

impl Variables {
    /// The index of a variable, which is added if it is new.
    pub(super) fn index(&mut self, variable: Variable, value: Number) -> usize {
        if let Some(at) = self.all.iter().position(|(v, _)| *v == variable) {
            return at;
        }
        self.all.push((variable, value));
        self.all.len() - 1
    }

    /// For a sine, the index of the cosine of the same angle.
    pub(super) fn cosine_of(&self, index: usize) -> Option<usize> {
        let (Variable::Sin(angle), _) = self.all.get(index)? else {
            return None;
        };
        let cosine = Variable::Cos(angle.clone());
        self.all.iter().position(|(v, _)| *v == cosine)
    }

    /// The indices of all sines.
    pub(super) fn sines(&self) -> impl Iterator<Item = usize> + '_ {
        let all = self.all.iter().enumerate();
        all.filter(|(_, (v, _))| matches!(v, Variable::Sin(_)))
            .map(|(i, _)| i)
    }

    /// The number of variables.
    pub(super) fn count(&self) -> usize {
        self.all.len()
    }

    /// The value of a variable.
    pub(super) fn value(&self, index: usize) -> Option<&Number> {
        self.all.get(index).map(|v| &v.1)
    }

    /// Whether a variable depends on geometry names.
    pub(super) fn is_named(&self, index: usize) -> bool {
        match self.all.get(index).map(|v| &v.0) {
            Some(Variable::Name(_)) => true,
            Some(Variable::Sin(angle) | Variable::Cos(angle)) => {
                matches!(angle, Argument::Named(..))
            }
            Some(Variable::Written(expression)) => expression.mentions_names(),
            None => false,
        }
    }

    /// For a sine of a named angle, the indices of sine and cosine of twice the angle, which are added
    /// if they are new.
    pub(super) fn doubled(&mut self, sine: usize) -> Option<(usize, usize)> {
        let (Variable::Sin(Argument::Named(angle, value)), _) = self.all.get(sine)? else {
            return None;
        };
        let double = value.add(value);
        let (sin, cos) = double.sin_cos();
        let angle = Argument::Named(angle.doubled(), double);
        Some((
            self.index(Variable::Sin(angle.clone()), sin),
            self.index(Variable::Cos(angle), cos),
        ))
    }

    /// The indices of all sines of angles in geometry names, each with that of its cosine.
    pub(super) fn named_sines(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let named = self.sines().filter(|sine| self.is_named(*sine));
        named.filter_map(|sine| Some((sine, self.cosine_of(sine)?)))
    }

    /// For a sine or a cosine, its angle as it is printed, and the angle's value if it has names.
    pub(super) fn angle_of(&self, index: usize) -> Option<(Coefficient, Option<&Number>)> {
        match self.all.get(index).map(|v| &v.0)? {
            Variable::Sin(angle) | Variable::Cos(angle) => {
                let value = match angle {
                    Argument::Named(_, value) => Some(value),
                    Argument::Constant(_) => None,
                };
                Some((angle.written(), value))
            }
            Variable::Name(_) | Variable::Written(_) => None,
        }
    }

    /// The variable as it is printed.
    pub(super) fn name(&self, index: usize) -> Coefficient {
        match self.all.get(index).map(|v| &v.0) {
            Some(Variable::Name(name)) => Coefficient::Name(name.clone()),
            Some(Variable::Written(expression)) => expression.clone(),
            Some(Variable::Sin(angle)) => Coefficient::call(Function::Sin, angle.written()),
            Some(Variable::Cos(angle)) => Coefficient::call(Function::Cos, angle.written()),
            None => Coefficient::Name("?".to_owned()),
        }
    }
}
