//! Factors of combinations of geometry errors as expressions in lengths of the description.

use regen_calibrate::{Fixed, Geometry, Problem, Unit, Why};
use regen_codegen::spec::Expr;
use regen_codegen::sym::Number;

use crate::kinematics::{Described, is_free};

/// How closely a factor is that of an expression.
const CLOSE: f64 = 1e-6;
/// How two other geometries change the lengths: by thousandths that go on by the first number from the
/// second, and around at 61.
const CHANGES: [(i64, i64); 2] = [(37, 5), (23, 17)];

/// A length of the description that has a name.
struct Length {
    name: String,
    place: Place,
}

#[derive(Clone, Copy)]
enum Place {
    /// The constant of `geometry` with this index.
    Name(usize),
    /// The scalar of a placement, which is a number.
    Scalar(usize),
}

/// The form of a factor.
#[derive(Clone, Copy)]
enum Form {
    One,
    Length(usize),
    Inverse(usize),
    Ratio(usize, usize),
}

impl Form {
    fn value(self, lengths: &[f64]) -> f64 {
        match self {
            Self::One => 1.0,
            Self::Length(k) => lengths[k],
            Self::Inverse(k) => 1.0 / lengths[k],
            Self::Ratio(k, l) => lengths[k] / lengths[l],
        }
    }

    fn text(self, lengths: &[Length]) -> String {
        let name = |k: usize| lengths[k].name.as_str();
        match self {
            Self::One => "1".to_owned(),
            Self::Length(k) => name(k).to_owned(),
            Self::Inverse(k) => format!("1/{}", name(k)),
            Self::Ratio(k, l) => format!("{}/{}", name(k), name(l)),
        }
    }
}

impl Described {
    /// The lengths, and other free constants of `geometry`, which may be factors.
    fn lengths(&self) -> Vec<Length> {
        let names = self.names.iter().enumerate();
        let names = names.filter(|(_, (_, expr))| is_free(expr));
        let names = names.map(|(k, (name, _))| Length {
            name: name.clone(),
            place: Place::Name(k),
        });
        let numbers = self
            .errors
            .iter()
            .filter(|own| own.unit == Unit::Length && is_free(&self.scalars[own.scalar]));
        let numbers = numbers.map(|own| Length {
            name: own.name.clone(),
            place: Place::Scalar(own.scalar),
        });
        let all = names
            .chain(numbers)
            .filter(|own| self.value(own.place) != 0.0);
        all.collect()
    }

    fn value(&self, place: Place) -> f64 {
        let expr = match place {
            Place::Name(k) => &self.names[k].1,
            Place::Scalar(k) => &self.scalars[k],
        };
        self.evaluate(expr, &[], 0).value
    }

    /// The same mechanism with other lengths; `None` where its loops do not close near home.
    fn varied(
        &self,
        lengths: &[Length],
        (step, first): (i64, i64),
        measured: &[usize],
    ) -> Option<Self> {
        let mut out = self.clone();
        let mut place = first;
        for own in lengths {
            let change = place - 30;
            place = (place + step) % 61;
            let expr = match own.place {
                Place::Name(k) => &mut out.names[k].1,
                Place::Scalar(k) => &mut out.scalars[k],
            };
            let number = |value: i64| Box::new(Expr::Number(Number::from_i64(value)));
            let factor = Expr::Div(number(1000 + change), number(1000));
            *expr = Expr::Mul(Box::new(expr.clone()), Box::new(factor));
        }
        let scalars = out.with(&[]).ok()?.scalars(&[])?;
        let split = out.kinematics.split(&scalars, measured)?;
        let home = out.kinematics.home.clone();
        out.kinematics.home = out.kinematics.close(&scalars, &split, home)?;
        Some(out)
    }

    /// The factors with which errors that cannot be told apart are found as one, as expressions: 1, a
    /// length of the description, the inverse of one or a ratio of two, with a sign. `None` for those that
    /// are no such expression: each is compared at the description and at two other geometries.
    ///
    /// - `problem`: that of which the errors stay at their nominal values.
    /// - `fixed`: these, as [`Problem::known`] or a fit has them.
    ///
    /// Returned is a list for each, in the order of its [`by`](Fixed::by).
    pub fn exact_factors(
        &self,
        problem: &Problem<'_>,
        fixed: &[Fixed],
    ) -> Vec<Vec<Option<String>>> {
        let none = || fixed.iter().map(|own| vec![None; own.by.len()]).collect();
        let lengths = self.lengths();
        let unknowns = problem.geometry.unknowns().iter();
        let names: Vec<String> = unknowns.map(|own| own.name.clone()).collect();
        let mut values = vec![self.values(&lengths)];
        let mut others = Vec::new();
        for changes in CHANGES {
            let other = self.varied(&lengths, changes, problem.measured);
            let Some(other) = other else { return none() };
            let Ok(geometry) = other.with(&names) else {
                return none();
            };
            let own = Problem {
                kinematics: &other.kinematics,
                geometry: &geometry,
                poses: &[],
                ..*problem
            };
            let Ok(known) = own.known() else {
                return none();
            };
            values.push(other.values(&lengths));
            others.push(known.fixed);
        }
        let all = 0..lengths.len();
        let ratios = all
            .clone()
            .flat_map(|k| all.clone().map(move |l| Form::Ratio(k, l)));
        let forms: Vec<Form> = std::iter::once(Form::One)
            .chain(all.clone().map(Form::Length))
            .chain(all.clone().map(Form::Inverse))
            .chain(ratios)
            .collect();
        let of = |fixed: &[Fixed], name: &str, by: &str| {
            let own = fixed.iter().find(|own| own.name == name)?;
            own.by.iter().find(|(own, _)| own == by).map(|own| own.1)
        };
        let expression = |own: &Fixed, (by, factor): &(String, f64)| {
            // those that poses do not show have factors of the poses
            if own.why != Why::Absorbed {
                return None;
            }
            let mut factors = vec![*factor];
            for other in &others {
                factors.push(of(other, &own.name, by)?);
            }
            let form = forms.iter().find(|form| {
                let sign = (form.value(&values[0]) * factor).signum();
                let mut pairs = factors.iter().zip(&values);
                pairs.all(|(factor, values)| {
                    let value = sign * form.value(values);
                    (factor - value).abs() <= CLOSE * factor.abs()
                })
            })?;
            let sign = if form.value(&values[0]) * factor < 0.0 {
                "-"
            } else {
                ""
            };
            Some(format!("{sign}{}", form.text(&lengths)))
        };
        let fixed = fixed.iter();
        fixed
            .map(|own| own.by.iter().map(|by| expression(own, by)).collect())
            .collect()
    }

    fn values(&self, lengths: &[Length]) -> Vec<f64> {
        lengths.iter().map(|own| self.value(own.place)).collect()
    }
}
