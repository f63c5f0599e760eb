//! The family of states that contains the assembly branch: linear relations among angles.

use dashu_ratio::RBig;

use crate::base::certificate::{ClosedState, Float320, rank_of, rates, relations};
use crate::base::null_completion::recognise;
use crate::base::null_completion::scaled_geometry::scaled;
use crate::model::{self, Model};
use crate::spec::{Quantity, Spec};
use crate::sym::Number;

use super::Ranks;
use super::expression::{Names, Point};
use super::mechanism::{Closure, Observer, Scalar, State, Values, closure, ground_frames, links};
use super::residue::Residue;

/// The angle of a coordinate: a constant plus a sum of free angles times factors.
#[derive(Clone, Debug, Default)]
struct AngleForm {
    /// The free angles, as places in [`Branch::free`], with their factors.
    terms: Vec<(usize, RBig)>,
    /// The constant as a multiple of pi, or in rad.
    pi: RBig,
    radians: RBig,
}

/// The relations among the angles on the assembly branch, as they are at its sampled states.
#[derive(Debug)]
pub(super) struct Branch {
    /// The coordinates whose angles are free.
    free: Vec<usize>,
    /// For each free angle the whole number by which factors of all others are fractions.
    parts: Vec<i64>,
    /// For each coordinate that turns a link.
    forms: Vec<Option<AngleForm>>,
    /// For each coordinate, one with proportional rate and the factor.
    proportional: Vec<Option<(usize, RBig)>>,
    /// The values of all coordinates at home.
    home: Vec<Float320>,
    independent: usize,
    slides: Vec<usize>,
}

/// The least common multiple; `None` where it is too large.
fn common_multiple(a: i64, b: i64) -> Option<i64> {
    let (mut x, mut y) = (a, b);
    while y != 0 {
        (x, y) = (y, x % y);
    }
    (a / x).checked_mul(b).filter(|c| *c <= 5040)
}

/// The constant of a relation at home, as a multiple of pi or else in rad; `None` if it is not recognised.
fn constant_of(home: &[Float320], column: usize, factors: &[(usize, RBig)]) -> Option<[RBig; 2]> {
    let mut constant = *home.get(column)?;
    for (coordinate, factor) in factors {
        let factor = Float320::from_number(&Number::from_rational(factor.clone()));
        constant = constant - factor * *home.get(*coordinate)?;
    }
    let of_pi = constant.checked_div(Float320::from_number(&Number::pi()))?;
    if let Some(multiple) = recognise(&of_pi).and_then(|x| x.as_rational()) {
        return Some([multiple, RBig::ZERO]);
    }
    Some([RBig::ZERO, recognise(&constant)?.as_rational()?])
}

impl Branch {
    /// The constants of the relations in rad.
    pub(super) fn radians(&self) -> impl Iterator<Item = &RBig> {
        self.forms.iter().flatten().map(|form| &form.radians)
    }

    /// The relations at closed states, of which the first is home; `None` if factors are fractions of large numbers.
    ///
    /// - `with_relations`: all of them; otherwise every angle is free.
    pub(super) fn new(model: &Model, states: &[ClosedState], with_relations: bool) -> Option<Self> {
        let rows = rates(states);
        let order = || model.independent.iter().chain(&model.dependent).copied();
        let is_joint = |c: &usize| !model.drives.contains(c);
        let turning: Vec<usize> = order()
            .filter(|c| is_joint(c) && !model.slides(*c))
            .collect();
        let found = if with_relations {
            relations(&rows, &turning)
        } else {
            Vec::new()
        };
        let home = states.first()?.q.clone();
        let mut forms: Vec<Option<AngleForm>> = vec![None; model.coordinates.len()];
        // a factor that is no fraction says nothing about frames, nor does a constant that is not recognised
        let mut dependent = Vec::new();
        for relation in found {
            let factors = relation.terms.iter();
            let factors = factors.map(|(c, x)| Some((*c, recognise(x)?.as_rational()?)));
            let Some(factors) = factors.collect::<Option<Vec<(usize, RBig)>>>() else {
                continue;
            };
            if let Some([pi, radians]) = constant_of(&home, relation.column, &factors) {
                dependent.push((relation.column, factors, pi, radians));
            }
        }
        let is_free = |c: &usize| dependent.iter().all(|(column, ..)| column != c);
        let free: Vec<usize> = turning.iter().copied().filter(is_free).collect();
        let mut parts = vec![1; free.len()];
        for (place, coordinate) in free.iter().enumerate() {
            *forms.get_mut(*coordinate)? = Some(AngleForm {
                terms: vec![(place, RBig::ONE)],
                ..AngleForm::default()
            });
        }
        for (column, factors, pi, radians) in dependent {
            let mut terms = Vec::new();
            for (coordinate, factor) in factors {
                let place = free.iter().position(|c| *c == coordinate)?;
                let part = parts.get_mut(place)?;
                *part = common_multiple(*part, i64::try_from(factor.denominator().clone()).ok()?)?;
                terms.push((place, factor));
            }
            *forms.get_mut(column)? = Some(AngleForm { terms, pi, radians });
        }
        let mut proportional: Vec<Option<(usize, RBig)>> = vec![None; model.coordinates.len()];
        let mut leaders: Vec<usize> = Vec::new();
        for c in order() {
            let follows = leaders.iter().find_map(|leader| {
                let relation = relations(&rows, &[*leader, c]).pop();
                let relation = relation.filter(|r| r.column == c)?;
                match relation.terms.as_slice() {
                    [] => Some((*leader, RBig::ZERO)),
                    [(_, factor)] => Some((*leader, recognise(factor)?.as_rational()?)),
                    _ => None,
                }
            });
            let own = follows.unwrap_or((c, RBig::ONE));
            if own.0 == c {
                leaders.push(c);
            }
            *proportional.get_mut(c)? = Some(own);
        }
        Some(Branch {
            free,
            parts,
            forms,
            proportional,
            home,
            independent: model.independent.len(),
            slides: (0..model.coordinates.len())
                .filter(|c| model.slides(*c) && is_joint(c))
                .collect(),
        })
    }

    /// A coordinate whose rate is proportional to that of this one, with the factor.
    pub(super) fn proportional(&self, coordinate: usize) -> Option<(usize, &RBig)> {
        let found = self.proportional.get(coordinate)?.as_ref();
        found.map(|(leader, factor)| (*leader, factor))
    }

    /// The size of the factor of [`proportional`](Self::proportional).
    pub(super) fn size(&self, coordinate: usize) -> Option<RBig> {
        let (_, factor) = self.proportional(coordinate)?;
        let number = Number::from_rational(factor.clone());
        number.abs().as_rational()
    }

    /// The sum of the powers of free angles, and of the part of 1 rad, in all coordinates' `exp(i angle)`.
    pub(super) fn exponents(&self, parts_of_radian: f64) -> f64 {
        let forms = self.forms.iter().flatten();
        let terms = forms.flat_map(|form| &form.terms);
        let exponents = terms.map(|(place, factor)| {
            let part = self.parts.get(*place).copied().unwrap_or(1) as f64;
            part * factor.to_f64().value().abs()
        });
        let radians = self.radians().map(|x| x.to_f64().value().abs());
        exponents.sum::<f64>() + parts_of_radian * radians.sum::<f64>()
    }

    /// Whether each coupling between angles holds for all free angles.
    pub(super) fn satisfies_couplings<const P: u64>(
        &self,
        model: &Model,
        closure: &Closure<Residue<P>>,
    ) -> bool {
        let cuts = closure.jacobian.len().saturating_sub(model.couplings.len());
        let rows = closure.jacobian.iter().skip(cuts).zip(&model.couplings);
        let mut turning =
            rows.filter(|(_, form)| !model.drives.contains(&form.key) && !model.slides(form.key));
        turning.all(|(row, _)| self.on_free(row).iter().all(|x| x.is_zero()))
    }

    /// A row of derivatives by all coordinates as one by the free angles.
    fn on_free<S: Scalar + FromFraction>(&self, row: &[S]) -> Vec<S> {
        let mut entries = vec![S::ZERO; self.free.len()];
        for (form, x) in self.forms.iter().zip(row) {
            for (place, factor) in form.iter().flat_map(|form| &form.terms) {
                if let Some(own) = entries.get_mut(*place) {
                    *own = *own + S::from_fraction(factor) * *x;
                }
            }
        }
        entries
    }

    /// Sine and cosine of each coordinate, with random free angles.
    pub(super) fn turns<const P: u64>(
        &self,
        point: &Point<'_, P>,
        mut random: impl FnMut() -> Residue<P>,
    ) -> Option<Vec<[Residue<P>; 2]>> {
        let free: Vec<Residue<P>> = self.free.iter().map(|_| random()).collect();
        let turns = self.forms.iter().map(|form| {
            let Some(form) = form else {
                return Some([Residue::ZERO, Residue::ONE]);
            };
            let mut unit = point.unit(&form.pi, &form.radians)?;
            for (place, factor) in &form.terms {
                let power = factor * RBig::from(*self.parts.get(*place)?);
                let power = power.is_int().then(|| power.numerator().clone())?;
                let power = i64::try_from(power).ok()?;
                unit = unit * free.get(*place)?.signed_power(power);
            }
            point.constants.sin_cos(unit)
        });
        turns.collect()
    }

    /// The derivatives of the lengths by the free angles and the slides.
    pub(super) fn restricted<S: Scalar + FromFraction>(&self, closure: &Closure<S>) -> Vec<Vec<S>> {
        let rows = closure.jacobian.iter().zip(&closure.is_length);
        let rows = rows.filter(|(_, is_length)| **is_length);
        let of_row = |(row, _): (&Vec<S>, &bool)| {
            let mut entries = self.on_free(row);
            let slides = self.slides.iter();
            entries.extend(slides.map(|c| row.get(*c).copied().unwrap_or(S::ZERO)));
            entries
        };
        rows.map(of_row).collect()
    }

    /// The ranks at home, in multiple precision; `None` unless the family has as many degrees of freedom as the
    /// mechanism.
    pub(super) fn ranks_at_home(
        &self,
        spec: &Spec,
        model: &Model,
        (names, nonlinear): (&Names<'_>, &[usize]),
    ) -> Option<Ranks> {
        let at_home = |model: &Model, more: &dyn Fn(&mut State<Float320>)| {
            let mut state = State {
                turns: self
                    .home
                    .iter()
                    .map(|q| <[_; 2]>::from(q.sin_cos()))
                    .collect(),
                slides: vec![Float320::ZERO; self.home.len()],
                shifts: vec![[Float320::ZERO; 3]; ground_frames(model)],
            };
            for c in &self.slides {
                *state.slides.get_mut(*c)? = *self.home.get(*c)?;
            }
            more(&mut state);
            let all = links(model, &Given, &state)?;
            let number = |x: &Number| Some(Float320::from_number(x));
            closure(model, &Given, (&state, &all), Observer::World, number)
        };
        let closed = at_home(model, &|_| {})?;
        // the mobility is that of the tangent space, and no more
        let n = self.home.len();
        if rank(closed.jacobian.clone()) + self.independent != n {
            return None;
        }
        let motion = rank(self.restricted(&closed));
        if self.free.len() + self.slides.len() != motion + self.independent {
            return None;
        }
        // lengths are linear: differences are derivatives
        let lengths = closed.lengths();
        let mut columns = Vec::new();
        let mut add = |other: Option<Closure<Float320>>| {
            let other = other?.lengths();
            let difference = other.iter().zip(&lengths).map(|(a, b)| *a - *b);
            columns.push(difference.collect::<Vec<Float320>>());
            Some(())
        };
        for (_, group) in names.linear(nonlinear) {
            let twice = scaled(spec, &[(group, Number::from_i64(2))])?;
            add(at_home(&model::build(&twice), &|_| {}))?;
        }
        for c in &self.slides {
            add(at_home(model, &|state| {
                if let Some(slide) = state.slides.get_mut(*c) {
                    *slide = *slide + Float320::ONE;
                }
            }))?;
        }
        for frame in 0..ground_frames(model) {
            for axis in 0..3 {
                add(at_home(model, &|state| {
                    if let Some(shift) = state.shifts.get_mut(frame) {
                        shift[axis] = Float320::ONE;
                    }
                }))?;
            }
        }
        Some(Ranks {
            motion,
            lengths: rank(columns),
        })
    }
}

fn rank(rows: Vec<Vec<Float320>>) -> usize {
    rank_of(rows, Float320::ONE).0
}

/// The values that the spec gives.
struct Given;

impl Values<Float320> for Given {
    fn length(&self, quantity: &Quantity) -> Option<Float320> {
        Some(Float320::from_number(&quantity.value))
    }

    fn sin_cos(&self, quantity: &Quantity) -> Option<[Float320; 2]> {
        let (sin, cos) = quantity.value.sin_cos();
        Some([sin, cos].map(|x| Float320::from_number(&x)))
    }
}

/// Numbers that fractions have an image in.
pub(super) trait FromFraction {
    fn from_fraction(value: &RBig) -> Self;
}

impl FromFraction for Float320 {
    fn from_fraction(value: &RBig) -> Self {
        Float320::from_number(&Number::from_rational(value.clone()))
    }
}

impl<const P: u64> FromFraction for Residue<P> {
    fn from_fraction(value: &RBig) -> Self {
        // factors are fractions of small numbers, whose denominators P does not divide
        Residue::of_fraction(value).unwrap_or(Residue::ZERO)
    }
}
