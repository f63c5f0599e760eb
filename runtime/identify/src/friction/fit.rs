//! The nonlinear fit: an outer search over the shape parameters, with a convex programme for all
//! other parameters inside.

use super::FrictionData;
use super::columns::curved;
use super::likelihood::Shapes;
use super::reduced::Linearised;
use super::starts::{STARTS, ranges, start, within};
use super::values::{explained, symbols};
use crate::estimate::QrFactor;
use crate::feasibility::{
    BaseMap, Bound, FeasibilityError, Known, Options, ParameterLayout, PhysicalFit, identify,
    identify_like,
};
use crate::intervals::seed;
use regen_runtime::friction::{SHAPES, VALUES};
use regen_runtime::{Friction, JointFriction};

/// The largest number of steps from each start, and then from the best of the points reached.
const STEPS_PER_START: usize = 3;
const MAX_STEPS: usize = 40;
/// The search ends when a step lowers the cost by less than this relative amount.
const MIN_RELATIVE_GAIN: f64 = 1e-9;
/// The trust region, a bound on the change of the logarithm of each shape parameter: its initial
/// size, its largest size, and the size at which the search ends.
const INITIAL_REACH: f64 = 0.5;
const MAX_REACH: f64 = 1.0;
const MIN_REACH: f64 = 1e-6;
/// How often the shapes of all joints are searched on grids.
const MAX_SCANS: usize = 2;

/// The friction of one joint.
#[derive(Clone, Debug, PartialEq)]
pub struct JointFit {
    /// The coordinate's name.
    pub name: String,
    /// The friction law.
    pub friction: Friction,
    /// The law's values in the order of [`Friction::symbols`], SI.
    pub values: Vec<f64>,
}

impl JointFit {
    /// The friction effort at a velocity `v` (Eq. 14, 16, 17, 32), N or N m over rad/s or m/s. A
    /// positive effort at a positive velocity opposes the motion.
    ///
    /// ```
    /// use regen_identify::friction::JointFit;
    /// use regen_runtime::Friction;
    ///
    /// let joint = JointFit {
    ///     name: "q1".to_owned(),
    ///     friction: Friction::Stribeck,
    ///     values: vec![2.0, 3.0, 0.1, 2.0, 5.0],
    /// };
    /// // far above the Stribeck velocity: Coulomb and viscous friction
    /// assert!((joint.effort(1.0) - 7.0).abs() < 1e-12);
    /// assert_eq!(joint.effort(-1.0), -joint.effort(1.0));
    /// ```
    pub fn effort(&self, v: f64) -> f64 {
        self.law().effort(v)
    }

    /// The law with its values, as the runtime evaluates it.
    pub fn law(&self) -> JointFriction {
        let mut values = [0.0; VALUES];
        for (slot, value) in values.iter_mut().zip(&self.values) {
            *slot = *value;
        }
        JointFriction {
            law: self.friction,
            values,
        }
    }
}

/// The result of a fit with nonlinear friction.
#[derive(Clone, Debug, PartialEq)]
pub struct FrictionFit {
    /// The friction of each joint.
    pub joints: Vec<JointFit>,
    /// All p parameters of the layout, SI; they are physical.
    pub phi: Vec<f64>,
    /// The base parameters of `phi`, SI.
    pub beta: Vec<f64>,
    /// The sum of squared residuals of the weighted equations.
    pub squared_residual: f64,
    /// The sum of squared residuals with linear friction (viscous and Coulomb) at the same joints,
    /// under the same constraints: never smaller.
    pub linear_squared_residual: f64,
    /// Whether the search ended because further steps gained nothing, not because it reached its
    /// limit of steps.
    pub converged: bool,
    /// The number of convex programmes that were solved.
    pub programmes: usize,
    /// A bound on the relative distance of the objective from the optimum for these shapes, see
    /// [`PhysicalFit::gap`].
    pub gap: f64,
    /// The seed of the draws of intervals: from the fit of linear friction without constraints, so
    /// that it depends on the log alone and not on the path of the search.
    pub(super) seed: u64,
    pub(super) point: Optimum,
}

/// The point at which the search ended.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Optimum {
    /// The law of each joint: its own, or linear friction if that fits as well.
    pub(super) laws: Vec<Friction>,
    /// The base parameters and the linear coefficients of friction, SI.
    pub(super) values: Vec<f64>,
    pub(super) shapes: Vec<[f64; SHAPES]>,
}

/// The arguments and state of the search.
struct Search<'a> {
    data: &'a FrictionData,
    /// The law of each joint: its own, or one that it contains.
    laws: Vec<Friction>,
    combinations: BaseMap,
    layout: ParameterLayout,
    options: &'a Options,
    /// The ranges of the shapes of each joint.
    ranges: Vec<[(f64, f64); SHAPES]>,
    /// What the fit of the first shapes found, from which the others begin.
    known: Option<Known>,
    /// What the first step found, for the steps in which the same shape parameters act.
    step_known: Option<(Vec<bool>, Known)>,
    programmes: usize,
}

/// Shapes of all joints with the best parameters for them.
#[derive(Clone)]
struct Point {
    shapes: Vec<[f64; SHAPES]>,
    equations: Linearised,
    solution: PhysicalFit,
    /// The minimised cost: squared residuals plus the squared deviations from priors.
    cost: f64,
}

impl<'a> Search<'a> {
    /// A search for the shapes of these laws.
    fn new(
        data: &'a FrictionData,
        laws: &[Friction],
        combinations: &BaseMap,
        layout: &ParameterLayout,
        options: &'a Options,
    ) -> Result<Self, FeasibilityError> {
        let coefficients = data.coefficients(laws);
        Ok(Self {
            data,
            laws: laws.to_vec(),
            combinations: combinations.extended(&coefficients),
            layout: layout.extended(&coefficients)?,
            options,
            ranges: shape_ranges(data, laws),
            known: None,
            step_known: None,
            programmes: 0,
        })
    }

    /// The best point reached from all starts, and whether the search converged.
    fn best(&mut self) -> Result<(Point, bool), FeasibilityError> {
        let fastest = self.data.fastest();
        let mut points = Vec::with_capacity(STARTS);
        for which in 0..STARTS {
            points.push(self.point(self.start(which, &fastest))?);
        }
        let composed = self.composed(&points)?;
        if points.iter().all(|point| point.shapes != composed) {
            points.push(self.point(composed)?);
        }
        points.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        points.truncate(2);
        let mut best: Option<Point> = None;
        for point in points {
            let (end, _) = self.descend(point, STEPS_PER_START);
            if best.as_ref().is_none_or(|b| end.cost < b.cost) {
                best = Some(end);
            }
        }
        let best = best.ok_or(FeasibilityError::Size {
            what: "starts",
            expected: STARTS,
            got: 0,
        })?;
        let (mut best, mut is_end) = self.descend(best, MAX_STEPS);
        for _ in 0..MAX_SCANS {
            let shapes = self.scanned(&best)?;
            if shapes == best.shapes {
                break;
            }
            let point = self.point(shapes)?;
            let (point, _) = self.descend(point, STEPS_PER_START);
            if point.cost >= best.cost {
                break;
            }
            (best, is_end) = self.descend(point, MAX_STEPS);
        }
        Ok((best, is_end))
    }

    /// The shapes of one start.
    fn start(&self, which: usize, fastest: &[f64]) -> Vec<[f64; SHAPES]> {
        let joints = self.laws.iter().zip(fastest).zip(&self.ranges);
        joints
            .map(|((law, fastest), ranges)| start(*law, which, *fastest, ranges))
            .collect()
    }

    /// The shapes, each replaced by one of a grid that explains more with the others as they are.
    fn scanned(&self, point: &Point) -> Result<Vec<[f64; SHAPES]>, FeasibilityError> {
        let mut shapes = point.shapes.clone();
        for (joint, (law, ranges)) in self.laws.iter().zip(&self.ranges).enumerate() {
            let own = self.data.of_joint(joint, &self.laws, &point.shapes, None)?;
            let known = shapes.get(joint).copied().unwrap_or([1.0; SHAPES]);
            let of_joint = Shapes {
                data: &own,
                law: *law,
                ranges: *ranges,
            };
            let (shape, least) = of_joint.best_of_grid()?;
            let gains = least < of_joint.cost(known)?;
            if let (Some(slot), true) = (shapes.get_mut(joint), gains) {
                *slot = shape;
            }
        }
        Ok(shapes)
    }

    fn solve(
        &mut self,
        factor: &QrFactor,
        combinations: &BaseMap,
        layout: &ParameterLayout,
        options: &Options,
    ) -> Result<PhysicalFit, FeasibilityError> {
        self.programmes += 1;
        identify(factor, combinations, layout, options)
    }

    /// The layout and combinations of the linear columns, with the coefficients `more` in place of
    /// those of nonlinear friction.
    fn linear_friction_problem(
        &self,
        more: &[String],
    ) -> Result<(ParameterLayout, BaseMap), FeasibilityError> {
        let base = self.data.labels.len();
        let p = self.layout.len() - self.data.coefficients(&self.laws).len();
        let layout = self.layout.first(p).extended(more)?;
        let kept: Vec<usize> = (0..base).collect();
        let rows = self.combinations.select(&kept)?;
        let cut = rows.rows().iter().map(|row| row[..p].to_vec()).collect();
        let combinations = BaseMap::new(rows.labels().to_vec(), cut)?.extended(more);
        Ok((layout, combinations))
    }

    /// The options of the fit for a layout with more parameters, without choosing what the
    /// observations leave open.
    fn padded(&self, layout: &ParameterLayout) -> Options {
        let mut options = self.options.clone();
        options.rough = true;
        if !options.reference.is_empty() {
            options.reference.resize(layout.len(), None);
        }
        options
    }

    /// The squared residuals plus the squared deviations from priors.
    fn cost(&self, solution: &PhysicalFit) -> f64 {
        let noise = self.options.noise.unwrap_or(1.0);
        let beliefs = self.options.priors.iter().filter_map(|prior| {
            let at = self.layout.find(&prior.parameter).ok()?;
            Some(((solution.phi[at] - prior.value) / prior.deviation * noise).powi(2))
        });
        solution.squared_residual + beliefs.sum::<f64>()
    }

    /// Solves for the best parameters with these shapes.
    fn point(&mut self, shapes: Vec<[f64; SHAPES]>) -> Result<Point, FeasibilityError> {
        let equations = self.data.linearised(&self.laws, &shapes)?;
        let factor = equations.factor()?;
        let (combinations, layout) = (self.combinations.clone(), self.layout.clone());
        let options = self.padded(&layout);
        self.programmes += 1;
        let known = match self.known.take() {
            Some(known) => known,
            None => Known::of(&factor, &combinations, &layout, &options)?,
        };
        let solution = identify_like(&factor, &combinations, &layout, &options, &known);
        self.known = Some(known);
        let solution = solution?;
        let cost = self.cost(&solution);
        Ok(Point {
            shapes,
            equations,
            solution,
            cost,
        })
    }

    /// For each joint, the shape of that point whose columns explain most of its effort. Where the
    /// constraints leave a law no part in the fit, its shape has no effect and no slope leads away;
    /// this finds the joints that another start serves better.
    fn composed(&self, points: &[Point]) -> Result<Vec<[f64; SHAPES]>, FeasibilityError> {
        let mut shapes = self.start(0, &self.data.fastest());
        let mut most = vec![0.0; shapes.len()];
        for point in points {
            let factor = point.equations.factor()?;
            let mut first = self.data.labels.len();
            let joints = self.laws.iter().zip(&point.shapes);
            for ((law, from), (shape, most)) in joints.zip(shapes.iter_mut().zip(&mut most)) {
                let columns: Vec<usize> = curved(*law).into_iter().map(|c| first + c).collect();
                let part = explained(&factor, &columns, &point.solution.beta)?;
                if part > *most {
                    (*shape, *most) = (*from, part);
                }
                first += law.coefficients().len();
            }
        }
        Ok(shapes)
    }

    /// Solves again with the same shapes and chooses what the observations leave open.
    fn finished(&mut self, point: &Point) -> Result<PhysicalFit, FeasibilityError> {
        let factor = point.equations.factor()?;
        let (combinations, layout) = (self.combinations.clone(), self.layout.clone());
        let options = Options {
            rough: self.options.rough,
            ..self.padded(&layout)
        };
        self.programmes += 1;
        let known = self.known.as_ref().map(Known::proofs).unwrap_or_default();
        identify_like(&factor, &combinations, &layout, &options, &known)
    }

    /// The Gauss-Newton step of the shape logarithms without constraints, cut to the trust region.
    fn free_step(&self, from: &Point, reach: f64) -> Option<Vec<f64>> {
        let factor = from.equations.with_steps(&from.solution.beta, 1.0).ok()?;
        let values = factor.solve().ok()?;
        let known = self.combinations.labels().len();
        let steps: Vec<f64> = values[known..].iter().map(|s| s - 1.0).collect();
        let longest = steps.iter().fold(0.0, |m: f64, s| m.max(s.abs()));
        let part = if longest > reach {
            reach / longest
        } else {
            1.0
        };
        Some(steps.iter().map(|s| s * part).collect())
    }

    /// The steps of the shape logarithms that solve the linearised problem with its constraints,
    /// within the trust region.
    fn step(&mut self, from: &Point, reach: f64) -> Result<Vec<f64>, FeasibilityError> {
        let factor = from.equations.with_steps(&from.solution.beta, reach)?;
        let known = self.combinations.labels().len();
        // a shape parameter whose coefficient is 0 has no effect: it takes no step
        let lengths = factor.column_norms();
        let acting: Vec<bool> = lengths[known..].iter().map(|l| *l > 0.0).collect();
        let kept: Vec<usize> = (0..factor.columns())
            .filter(|c| *c < known || lengths[*c] > 0.0)
            .collect();
        let factor = factor.select(&kept)?;
        let steps = factor.labels()[known..].to_vec();
        let layout = self.layout.extended(&steps)?;
        let combinations = self.combinations.extended(&steps);
        let mut options = self.padded(&layout);
        options.bounds.extend(steps.iter().map(|label| Bound {
            parameter: label.clone(),
            lowest: 0.0,
            highest: 2.0,
        }));
        self.programmes += 1;
        let known = match self.step_known.take() {
            Some((same, known)) if same == acting => known,
            _ => Known::of(&factor, &combinations, &layout, &options)?,
        };
        let solution = identify_like(&factor, &combinations, &layout, &options, &known);
        self.step_known = Some((acting.clone(), known));
        let solution = solution?;
        let mut values = solution.phi[self.layout.len()..].iter();
        let step = |acts: &bool| {
            let value = if *acts { values.next() } else { None };
            value.map_or(0.0, |s| reach * (s - 1.0))
        };
        Ok(acting.iter().map(step).collect())
    }

    /// The shapes after steps of their logarithms, kept in their range.
    fn moved(&self, shapes: &[[f64; SHAPES]], by: &[f64]) -> Vec<[f64; SHAPES]> {
        let mut by = by.iter();
        let laws = self.laws.iter().zip(&self.ranges);
        let pairs = shapes.iter().zip(laws);
        pairs
            .map(|(shape, (law, ranges))| {
                let mut out = *shape;
                for value in out.iter_mut().take(law.shape_symbols().len()) {
                    *value *= by.next().copied().unwrap_or(0.0).exp();
                }
                within(ranges, out)
            })
            .collect()
    }

    /// Descends by at most `most` steps; returns the point reached and whether the search
    /// converged.
    fn descend(&mut self, mut at: Point, most: usize) -> (Point, bool) {
        let mut reach = INITIAL_REACH;
        for _ in 0..most {
            // if no constraint is active, plain least squares is exact and quick; if a programme
            // fails, only this step is too long
            let free = self.free_step(&at, reach);
            let next = free
                .and_then(|by| self.point(self.moved(&at.shapes, &by)).ok())
                .filter(|next| next.cost < at.cost)
                .or_else(|| {
                    let by = self.step(&at, reach).ok()?;
                    self.point(self.moved(&at.shapes, &by)).ok()
                });
            match next {
                Some(next) if next.cost < at.cost => {
                    let gain = at.cost - next.cost;
                    let worth = gain > MIN_RELATIVE_GAIN * at.cost;
                    at = next;
                    if !worth {
                        return (at, true);
                    }
                    reach = (2.0 * reach).min(MAX_REACH);
                }
                _ => reach /= 4.0,
            }
            if reach < MIN_REACH {
                return (at, true);
            }
        }
        (at, false)
    }
}

/// The exponent with which Stribeck's law is the one of LuGre at constant velocity.
const LUGRE_EXPONENT: f64 = 2.0;

/// The law with one shape parameter less that a law contains; itself where there is none.
fn contained(law: Friction) -> Friction {
    match law {
        Friction::Stribeck => Friction::Lugre,
        law => law,
    }
}

/// Fits nonlinear friction together with all other parameters.
///
/// - `combinations`: how the r columns of the data combine the p parameters of `layout`; neither
///   includes nonlinear friction;
/// - `options`: constraints and priors, as for [`identify`].
///
/// The result is never worse than linear friction at the same joints: the search starts there and
/// takes only steps that lower the cost.
///
/// # Errors
/// As [`identify`].
pub fn fit(
    data: &FrictionData,
    combinations: &BaseMap,
    layout: &ParameterLayout,
    options: &Options,
) -> Result<FrictionFit, FeasibilityError> {
    let mut search = Search::new(data, &data.laws, combinations, layout, options)?;
    let (mut straight, seed) = linear(&mut search, true)?;
    let (mut best, mut converged) = search.best()?;
    // no law ends above one that it contains: the search starts where that one's ends, too
    let contained: Vec<Friction> = data.laws.iter().map(|law| contained(*law)).collect();
    if contained != data.laws {
        let mut inner = Search::new(data, &contained, combinations, layout, options)?;
        let (point, _) = inner.best()?;
        search.programmes += inner.programmes;
        let pairs = data.laws.iter().zip(&contained).zip(point.shapes);
        let shapes = pairs.map(|((law, inner), shape)| {
            if law == inner {
                shape
            } else {
                [shape[0], LUGRE_EXPONENT]
            }
        });
        let point = search.point(shapes.collect())?;
        let (end, is_end) = search.descend(point, MAX_STEPS);
        if end.cost < best.cost {
            (best, converged) = (end, is_end);
        }
    }
    best.solution = search.finished(&best)?;

    // Programmes are solved to a tolerance: if nothing is gained, the result is linear friction,
    // which every law contains as a special case.
    let inertial = layout.len();
    let gained = best.solution.squared_residual <= straight.squared_residual;
    if !gained && !options.rough {
        straight = linear(&mut search, false)?.0;
    }
    let (taken, laws) = if gained {
        (&best.solution, data.laws.clone())
    } else {
        (&straight, data.linear_laws())
    };
    let values = symbols(data, &laws, &taken.phi[inertial..], &best.shapes);
    let joints = data
        .joints
        .iter()
        .zip(values)
        .map(|(joint, values)| JointFit {
            name: joint.name.clone(),
            friction: joint.friction,
            values,
        });
    let observed = combinations.labels().len();
    Ok(FrictionFit {
        joints: joints.collect(),
        phi: taken.phi[..inertial].to_vec(),
        beta: taken.beta[..observed].to_vec(),
        squared_residual: taken.squared_residual,
        linear_squared_residual: straight.squared_residual,
        converged,
        programmes: search.programmes,
        gap: taken.gap,
        seed,
        point: Optimum {
            laws,
            values: taken.beta.clone(),
            shapes: best.shapes,
        },
    })
}

/// The ranges of the shapes of each joint, see [`ranges`].
pub(super) fn shape_ranges(data: &FrictionData, laws: &[Friction]) -> Vec<[(f64, f64); SHAPES]> {
    let velocities = data.slowest().into_iter().zip(data.fastest());
    let joints = laws.iter().zip(velocities);
    joints
        .map(|(law, (slowest, fastest))| ranges(*law, slowest, fastest))
        .collect()
}

/// The optimum of other data for the same problem, found from that of a fit.
///
/// # Errors
/// As [`fit`].
pub(super) fn moved_optimum(
    data: &FrictionData,
    combinations: &BaseMap,
    layout: &ParameterLayout,
    options: &Options,
    from: &FrictionFit,
) -> Result<Optimum, FeasibilityError> {
    let options = Options {
        rough: true,
        ..options.clone()
    };
    let mut search = Search::new(data, &data.laws, combinations, layout, &options)?;
    let point = &from.point;
    let (solution, shapes) = if point.laws == data.laws {
        let start = search.point(point.shapes.clone())?;
        let (end, _) = search.descend(start, MAX_STEPS);
        (end.solution, end.shapes)
    } else {
        (linear(&mut search, true)?.0, point.shapes.clone())
    };
    Ok(Optimum {
        laws: point.laws.clone(),
        values: solution.beta,
        shapes,
    })
}

/// Fits with linear friction at all joints, `rough` without choosing what the observations leave
/// open; also returns a seed from the parameters without constraints.
fn linear(search: &mut Search<'_>, rough: bool) -> Result<(PhysicalFit, u64), FeasibilityError> {
    let data = search.data;
    let laws = data.linear_laws();
    let factor = data.linearised(&laws, &[])?.factor()?;
    let more = data.coefficients(&laws);
    let (layout, combinations) = search.linear_friction_problem(&more)?;
    let options = Options {
        rough,
        ..search.padded(&layout)
    };
    // where the parameters are not determined, the right side serves as well
    let free = factor.solve().unwrap_or_else(|_| factor.z().to_vec());
    let fit = search.solve(&factor, &combinations, &layout, &options)?;
    Ok((fit, seed(&free)))
}
