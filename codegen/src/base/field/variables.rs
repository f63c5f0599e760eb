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
    Sin(Number),
    /// The cosine of an angle in rad.
    Cos(Number),
    /// A constant that is not a polynomial in the other variables, as it is printed.
    Written(Coefficient),
}

/// All variables with their values.
#[derive(Debug, Default)]
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

    /// The variable as it is printed.
    pub(super) fn name(&self, index: usize) -> Coefficient {
        match self.all.get(index).map(|v| &v.0) {
            Some(Variable::Name(name)) => Coefficient::Name(name.clone()),
            Some(Variable::Written(expression)) => expression.clone(),
            Some(Variable::Sin(angle)) => Coefficient::call(Function::Sin, angle.into()),
            Some(Variable::Cos(angle)) => Coefficient::call(Function::Cos, angle.into()),
            None => Coefficient::Name("?".to_owned()),
        }
    }
}
