//! A straight-line program: the form of a function that is emitted as Rust or C, or interpreted.

/// A temporary: the number of a value that a step computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Temp(pub u32);

/// An operand of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Operand {
    /// An element of an argument.
    Input {
        /// Index of the argument.
        argument: usize,
        /// Index in the argument.
        element: usize,
    },
    /// A constant, rounded once from its exact value.
    Constant(f64),
    /// The result of an earlier step.
    Temp(Temp),
}

/// The operation of a step; its operands are named a, b, c in order.
#[derive(Clone, Debug, PartialEq)]
pub enum Op {
    /// `-a`
    Neg(Operand),
    /// `a + b`
    Add(Operand, Operand),
    /// `a - b`
    Sub(Operand, Operand),
    /// `a * b`
    Mul(Operand, Operand),
    /// `a * b + c`
    MulAdd(Operand, Operand, Operand),
    /// `c - a * b`
    NegMulAdd(Operand, Operand, Operand),
    /// `a * b - c`
    MulSub(Operand, Operand, Operand),
    /// `a / b`
    Div(Operand, Operand),
    /// Sine and cosine: two results.
    SinCos(Operand),
    /// The square root.
    Sqrt(Operand),
    /// The sign: -1, 0 or 1.
    Sign(Operand),
    /// 1 for a positive operand, else 0.
    Positive(Operand),
    /// 1 for a negative operand, else 0.
    Negative(Operand),
    /// The solution of a linear system: unknowns by right-hand sides, row by row.
    Solve(Box<SolveStep>),
}

/// A linear system that is solved in a fixed order of pivots, with all that is needed to solve it
/// with pivoting where a pivot of that order is too small.
#[derive(Clone, Debug, PartialEq)]
pub struct SolveStep {
    /// All rows of A.
    pub matrix: Vec<Vec<Operand>>,
    /// All rows of B.
    pub rhs: Vec<Vec<Operand>>,
    /// The solution in the fixed order of pivots: unknowns by right-hand sides.
    pub fixed: Vec<Vec<Operand>>,
    /// The pivots of the fixed order, each with the absolute value that it usually has.
    pub pivots: Vec<(Operand, f64)>,
}

/// One step with its results.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// The operation.
    pub op: Op,
    /// The temporaries of its results: one, two for [`Op::SinCos`], all unknowns for [`Op::Solve`].
    pub results: Vec<Temp>,
}

/// An argument of the function.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Argument {
    /// The argument's name in code.
    pub name: String,
    /// The number of its elements.
    pub len: usize,
    /// What it contains: the text of its documentation.
    pub doc: String,
}

impl Argument {
    /// Whether it contains coordinates or their derivatives, whose names begin with q: where these are not
    /// finite, no result is worth anything. Parameters and efforts are not.
    pub fn is_motion(&self) -> bool {
        self.name.starts_with('q')
    }
}

/// A group of steps and the outputs that they complete.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// A title for the outputs.
    pub title: String,
    /// The range of the steps.
    pub steps: std::ops::Range<usize>,
    /// The range of the outputs, which are complete after the steps.
    pub outputs: std::ops::Range<usize>,
}

/// The name and shape of the result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Output {
    /// The result's name in code.
    pub name: String,
    /// One length for a vector; two for an array of arrays, the outer length first.
    pub shape: Vec<usize>,
    /// What it contains: the text of its documentation.
    pub doc: String,
}

/// Number of operations of a program; a multiply-add counts as a product and a sum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Operations {
    /// Sums and differences.
    pub add: usize,
    /// Products.
    pub mul: usize,
    /// Quotients.
    pub div: usize,
    /// Pairs of sine and cosine.
    pub sincos: usize,
    /// Square roots.
    pub sqrt: usize,
}

/// A straight-line program.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// The arguments.
    pub arguments: Vec<Argument>,
    /// The steps in order.
    pub steps: Vec<Step>,
    /// The groups, in order; they cover all steps.
    pub groups: Vec<Group>,
    /// The name and shape of the result.
    pub output: Output,
    /// The elements of the result, outer index first.
    pub outputs: Vec<Operand>,
    /// For each temporary, a suggested name.
    pub names: Vec<Option<String>>,
}

impl Op {
    /// The operands, in order.
    pub fn operands(&self) -> Vec<Operand> {
        match self {
            Op::Neg(a)
            | Op::SinCos(a)
            | Op::Sqrt(a)
            | Op::Sign(a)
            | Op::Positive(a)
            | Op::Negative(a) => vec![*a],
            Op::Add(a, b) | Op::Sub(a, b) | Op::Mul(a, b) | Op::Div(a, b) => vec![*a, *b],
            Op::MulAdd(a, b, c) | Op::NegMulAdd(a, b, c) | Op::MulSub(a, b, c) => vec![*a, *b, *c],
            Op::Solve(s) => {
                let rows = s.matrix.iter().chain(&s.rhs).chain(&s.fixed);
                let pivots = s.pivots.iter().map(|p| p.0);
                rows.flatten().copied().chain(pivots).collect()
            }
        }
    }
}

impl Op {
    /// Replaces every operand by the one that `to` gives for it.
    pub(super) fn change_operands(&mut self, to: impl Fn(&Operand) -> Operand) {
        let change = |o: &mut Operand| *o = to(o);
        match self {
            Op::Neg(a)
            | Op::SinCos(a)
            | Op::Sqrt(a)
            | Op::Sign(a)
            | Op::Positive(a)
            | Op::Negative(a) => change(a),
            Op::Add(a, b) | Op::Sub(a, b) | Op::Mul(a, b) | Op::Div(a, b) => {
                change(a);
                change(b);
            }
            Op::MulAdd(a, b, c) | Op::NegMulAdd(a, b, c) | Op::MulSub(a, b, c) => {
                change(a);
                change(b);
                change(c);
            }
            Op::Solve(s) => {
                let rows = s.matrix.iter_mut().chain(&mut s.rhs).chain(&mut s.fixed);
                rows.flatten().for_each(&change);
                s.pivots.iter_mut().for_each(|p| change(&mut p.0));
            }
        }
    }
}

impl Program {
    /// Counts the operations. Not counted are sign changes, comparisons, and the solution of a
    /// system by other pivots, which is rarely needed.
    pub fn operations(&self) -> Operations {
        let mut count = Operations::default();
        for step in &self.steps {
            match step.op {
                Op::Add(..) | Op::Sub(..) => count.add += 1,
                Op::Mul(..) => count.mul += 1,
                Op::MulAdd(..) | Op::NegMulAdd(..) | Op::MulSub(..) => {
                    count.add += 1;
                    count.mul += 1;
                }
                Op::Div(..) => count.div += 1,
                Op::SinCos(_) => count.sincos += 1,
                Op::Sqrt(_) => count.sqrt += 1,
                Op::Neg(_) | Op::Sign(_) | Op::Positive(_) | Op::Negative(_) | Op::Solve(_) => {}
            }
        }
        count
    }

    /// Drops steps whose results are not used: sines and cosines are lowered in pairs, and
    /// sometimes one of the two is enough.
    pub(super) fn drop_unused(&mut self) {
        let mut used = vec![false; self.names.len()];
        let mark = |operand: &Operand, used: &mut Vec<bool>| {
            if let Operand::Temp(t) = operand {
                used[t.0 as usize] = true;
            }
        };
        self.outputs.iter().for_each(|o| mark(o, &mut used));
        let mut keep = vec![false; self.steps.len()];
        for (index, step) in self.steps.iter().enumerate().rev() {
            if step.results.iter().any(|t| used[t.0 as usize]) {
                keep[index] = true;
                step.op.operands().iter().for_each(|o| mark(o, &mut used));
            }
        }
        // the new index of a step is the number of kept steps before it
        let mut new_index = Vec::with_capacity(keep.len() + 1);
        let mut count = 0;
        for kept in &keep {
            new_index.push(count);
            count += usize::from(*kept);
        }
        new_index.push(count);
        for group in &mut self.groups {
            group.steps = new_index[group.steps.start]..new_index[group.steps.end];
        }
        let mut kept = keep.iter();
        self.steps.retain(|_| kept.next().copied().unwrap_or(false));
    }

    /// Moves sines and cosines, with the steps that compute their angles, to the front, where they
    /// can be computed together. Their angles are linear forms in the arguments, so no other steps
    /// have to move; sines and cosines of angles that depend on other ones stay in place.
    pub(super) fn angles_first(&mut self) {
        let first = self.first_angles();
        if first.iter().filter(|f| **f).count() < 2 {
            return;
        }
        let mut needed = vec![false; self.names.len()];
        let mut early = vec![0_u8; self.steps.len()];
        for (index, step) in self.steps.iter().enumerate().rev() {
            if first[index] {
                early[index] = 2;
            } else if step.results.iter().any(|t| needed[t.0 as usize]) {
                early[index] = 1;
            }
            if early[index] > 0 {
                for operand in step.op.operands() {
                    if let Operand::Temp(t) = operand {
                        needed[t.0 as usize] = true;
                    }
                }
            }
        }
        let mut moved: [Vec<Step>; 3] = Default::default();
        // the new index of a step that stays is the number of staying steps before it
        let mut new_index = Vec::with_capacity(self.steps.len() + 1);
        for (step, kind) in self.steps.drain(..).zip(&early) {
            new_index.push(moved[0].len());
            moved[usize::from(*kind)].push(step);
        }
        new_index.push(moved[0].len());
        let [rest, arguments, angles] = moved;
        let first = arguments.len() + angles.len();
        self.steps = arguments.into_iter().chain(angles).chain(rest).collect();
        for group in &mut self.groups {
            group.steps = first + new_index[group.steps.start]..first + new_index[group.steps.end];
        }
        let start = self.groups.first().map_or(0, |g| g.outputs.start);
        let all = Group {
            title: "sines and cosines".to_owned(),
            steps: 0..first,
            outputs: start..start,
        };
        self.groups.insert(0, all);
    }

    /// For each step, whether it computes the sine and cosine of an angle that depends on no other
    /// sine, cosine or solution.
    fn first_angles(&self) -> Vec<bool> {
        let mut late = vec![false; self.names.len()];
        let angles = self.steps.iter().map(|step| {
            let of_late = step.op.operands().iter().any(|operand| match operand {
                Operand::Temp(t) => late[t.0 as usize],
                Operand::Input { .. } | Operand::Constant(_) => false,
            });
            let is_angle = matches!(step.op, Op::SinCos(_));
            if of_late || is_angle || matches!(step.op, Op::Solve(_)) {
                step.results.iter().for_each(|t| late[t.0 as usize] = true);
            }
            is_angle && !of_late
        });
        angles.collect()
    }

    /// Whether the program solves linear systems, and so also returns a condition.
    pub fn solves(&self) -> bool {
        self.steps.iter().any(|s| matches!(s.op, Op::Solve(_)))
    }
}
