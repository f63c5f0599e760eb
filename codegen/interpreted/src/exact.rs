//! Factors of combinations of geometry errors as expressions in lengths of the description.

use regen_calibrate::{Fixed, Geometry, Problem, Unit, Why};
use regen_codegen::spec::Expr;
use regen_codegen::sym::Number;

use crate::kinematics::{Described, is_free};

/// How closely a factor is a multiple of a form in every geometry.
const CLOSE: f64 = 1e-6;
/// How closely the square of a number is a ratio.
const EXACT: f64 = 1e-7;
/// The largest numbers of such ratios: few enough that no other number is one by chance.
const LARGEST_BELOW: u32 = 12;
const LARGEST_ABOVE: u32 = 144;
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

    /// The lengths above and below the line.
    fn parts(self, lengths: &[Length]) -> [Option<&str>; 2] {
        let name = |k: usize| Some(lengths[k].name.as_str());
        match self {
            Self::One => [None, None],
            Self::Length(k) => [name(k), None],
            Self::Inverse(k) => [None, name(k)],
            Self::Ratio(k, l) => [name(k), name(l)],
        }
    }
}

/// A positive number as a root of a ratio: `whole sqrt(root) / below`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Surd {
    whole: u32,
    root: u32,
    below: u32,
}

impl Surd {
    /// The root of a ratio of small numbers that a number is, if it is one.
    fn of(number: f64) -> Option<Self> {
        let square = number * number;
        let found = (1..=LARGEST_BELOW).find_map(|below| {
            let own = square * f64::from(below);
            let mut all = 1..=LARGEST_ABOVE;
            let above = all.find(|above| (own - f64::from(*above)).abs() <= EXACT * own);
            above.map(|above| (above, below))
        });
        let (above, below) = found?;
        // sqrt(p / q) = sqrt(p q) / q, and squares leave the root
        let (mut whole, mut root, mut below) = (1, above * below, below);
        for k in (2..=root).rev() {
            while root % (k * k) == 0 {
                root /= k * k;
                whole *= k;
            }
        }
        for k in (2..=below).rev() {
            while whole % k == 0 && below % k == 0 {
                whole /= k;
                below /= k;
            }
        }
        Some(Self { whole, root, below })
    }

    /// It times a form.
    fn text(self, form: Form, lengths: &[Length]) -> String {
        let [above, below] = form.parts(lengths);
        let mut up = Vec::new();
        if self.whole > 1 {
            up.push(self.whole.to_string());
        }
        if self.root > 1 {
            up.push(format!("sqrt({})", self.root));
        }
        up.extend(above.map(str::to_owned));
        let mut down = Vec::new();
        if self.below > 1 {
            down.push(self.below.to_string());
        }
        down.extend(below.map(str::to_owned));
        let up = if up.is_empty() {
            "1".to_owned()
        } else {
            up.join("*")
        };
        match &down[..] {
            [] => up,
            [one] => format!("{up}/{one}"),
            _ => format!("{up}/({})", down.join("*")),
        }
    }
}

/// The number that a factor is of a form in every geometry.
fn multiple(factors: &[f64], form: Form, values: &[Vec<f64>]) -> Option<f64> {
    let mut ratios = factors
        .iter()
        .zip(values)
        .map(|(f, own)| f / form.value(own));
    let first = ratios.next()?;
    let is_same = ratios.all(|ratio| (ratio - first).abs() <= CLOSE * first.abs());
    (is_same && first.is_finite()).then_some(first)
}

/// The two numbers of which a factor is the sum of two lengths in every geometry.
fn sum_of(factors: &[f64], (k, l): (usize, usize), values: &[Vec<f64>]) -> Option<[f64; 2]> {
    let [a, b, c] = values else { return None };
    let [x, y, z] = factors else { return None };
    let determinant = a[k] * b[l] - a[l] * b[k];
    let first = (x * b[l] - y * a[l]) / determinant;
    let second = (a[k] * y - b[k] * x) / determinant;
    let off = first * c[k] + second * c[l] - z;
    (off.abs() <= CLOSE * z.abs()).then_some([first, second])
}

/// A factor as an expression: a root of a ratio times a form, or the sum of two lengths times such roots.
fn expression(
    factors: &[f64],
    forms: &[Form],
    lengths: &[Length],
    values: &[Vec<f64>],
) -> Option<String> {
    let minus = |number: f64| if number < 0.0 { "-" } else { "" };
    let single = forms.iter().find_map(|form| {
        let number = multiple(factors, *form, values)?;
        let surd = Surd::of(number.abs())?;
        Some(format!("{}{}", minus(number), surd.text(*form, lengths)))
    });
    single.or_else(|| {
        let all = 0..lengths.len();
        let mut pairs = all.flat_map(|l| (0..l).map(move |k| (k, l)));
        pairs.find_map(|(k, l)| {
            let [first, second] = sum_of(factors, (k, l), values)?;
            let text = |number: f64, length: usize| {
                let surd = Surd::of(number.abs())?;
                Some(surd.text(Form::Length(length), lengths))
            };
            let sign = if first * second < 0.0 { "-" } else { "+" };
            let (a, b) = (text(first, k)?, text(second, l)?);
            Some(format!("{}({a} {sign} {b})", minus(first)))
        })
    })
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
    /// length of the description, the inverse of one or a ratio of two, times the root of a ratio of small
    /// numbers, or a sum of two lengths so, with a sign. `None` for those that are no such expression:
    /// each is compared at the description and at two other geometries.
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
        let exact = |own: &Fixed, (by, factor): &(String, f64)| {
            // those that poses do not show have factors of the poses
            if own.why != Why::Absorbed {
                return None;
            }
            let mut factors = vec![*factor];
            for other in &others {
                factors.push(of(other, &own.name, by)?);
            }
            expression(&factors, &forms, &lengths, &values)
        };
        let fixed = fixed.iter();
        fixed
            .map(|own| own.by.iter().map(|by| exact(own, by)).collect())
            .collect()
    }

    fn values(&self, lengths: &[Length]) -> Vec<f64> {
        lengths.iter().map(|own| self.value(own.place)).collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn factors_are_expressions_where_they_follow_the_lengths_and_nothing_elsewhere() {
        let name = |name: &str| Length {
            name: name.to_owned(),
            place: Place::Name(0),
        };
        let lengths = [name("a"), name("b")];
        let forms = [
            Form::One,
            Form::Length(0),
            Form::Inverse(0),
            Form::Ratio(0, 1),
        ];
        let values = [vec![0.3, 0.5], vec![0.31, 0.49], vec![0.29, 0.52]];
        let of = |factor: &dyn Fn(f64, f64) -> f64| {
            let factors: Vec<f64> = values.iter().map(|own| factor(own[0], own[1])).collect();
            expression(&factors, &forms, &lengths, &values)
        };
        let root = 3_f64.sqrt();
        let is = |text: &str| Some(text.to_owned());
        assert_eq!(of(&|_, _| -root / 2.0), is("-sqrt(3)/2"));
        assert_eq!(of(&|a, _| 1.0 / (2.0 * a)), is("1/(2*a)"));
        assert_eq!(
            of(&|a, b| 2.0 * root / 3.0 * a / b),
            is("2*sqrt(3)*a/(3*b)")
        );
        assert_eq!(of(&|a, b| b - root * a), is("-(sqrt(3)*a - b)"));
        // a number of an angle, and what no lengths follow
        assert_eq!(of(&|_, _| 50_f64.to_radians().cos()), None);
        assert_eq!(of(&|a, b| a * a + b), None);
    }
}
