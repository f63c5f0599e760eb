//! Lowers expressions to the steps of a program: output by output and group by group, operands
//! first, so that the steps of one group stay together.

use rustc_hash::FxHashMap;

use crate::sym::{Ex, Graph, Node, SymbolId, SystemId};

use super::angles::Angles;
use super::factor::factor;
use super::order::order;
use super::program::{Argument, Group, Op, Operand, Output, Program, SolveStep, Step, Temp};
use super::relations::relate;

/// A request for a program.
#[derive(Clone, Debug)]
pub struct Request {
    /// The arguments, each with the symbols of its elements.
    pub arguments: Vec<(Argument, Vec<SymbolId>)>,
    /// The name and shape of the result.
    pub output: Output,
    /// The outputs in groups: titles with their expressions, in order.
    pub groups: Vec<(String, Vec<Ex>)>,
}

/// Builds and optimises the program for a request.
pub fn lower(g: &Graph, request: Request) -> Program {
    let mut inputs = FxHashMap::default();
    let mut arguments = Vec::new();
    for (index, (argument, symbols)) in request.arguments.into_iter().enumerate() {
        for (element, symbol) in symbols.into_iter().enumerate() {
            inputs.entry(symbol).or_insert(Operand::Input {
                argument: index,
                element,
            });
        }
        arguments.push(argument);
    }
    let roots = request.groups.iter().flat_map(|(_, o)| o).copied();
    let uses = Uses::count(g, roots);
    let mut lowering = Lowering {
        g,
        inputs,
        angles: Angles::new(g, &uses.angles),
        uses,
        values: FxHashMap::default(),
        sines_and_cosines: FxHashMap::default(),
        solutions: FxHashMap::default(),
        steps: Vec::new(),
        names: Vec::new(),
    };
    let mut groups = Vec::new();
    let mut outputs = Vec::new();
    for (title, exs) in request.groups {
        let (first_step, first_output) = (lowering.steps.len(), outputs.len());
        for ex in exs {
            let operand = lowering.value(ex);
            outputs.push(operand);
        }
        groups.push(Group {
            title,
            steps: first_step..lowering.steps.len(),
            outputs: first_output..outputs.len(),
        });
    }
    let mut program = Program {
        arguments,
        steps: lowering.steps,
        groups,
        output: request.output,
        outputs,
        names: lowering.names,
    };
    program.drop_unused();
    factor(&mut program);
    relate(&mut program);
    program.angles_first();
    order(&mut program);
    program
}

/// The uses of nodes and angles by the nodes that are computed.
struct Uses {
    /// For each node, how often it is an operand or an output.
    count: Vec<u32>,
    /// The angles whose sine or cosine is used, each once.
    angles: Vec<crate::sym::AngleId>,
}

impl Uses {
    fn count(g: &Graph, roots: impl Iterator<Item = Ex>) -> Self {
        let mut uses = Uses {
            count: vec![0; g.len()],
            angles: Vec::new(),
        };
        let mut seen_systems = Vec::new();
        let mut stack = Vec::new();
        for root in roots {
            uses.count[root.index()] += 1;
            stack.push(root);
        }
        let mut expanded = vec![false; g.len()];
        while let Some(ex) = stack.pop() {
            if std::mem::replace(&mut expanded[ex.index()], true) {
                continue;
            }
            match g.node(ex) {
                Node::Sin(angle) | Node::Cos(angle) => {
                    uses.angles.push(angle);
                    continue;
                }
                Node::Solved(system, ..) => {
                    if seen_systems.contains(&system) {
                        continue;
                    }
                    seen_systems.push(system);
                }
                _ => {}
            }
            for child in g.children(ex) {
                uses.count[child.index()] += 1;
                stack.push(child);
            }
        }
        uses.angles.sort_unstable();
        uses.angles.dedup();
        uses
    }
}

struct Lowering<'g> {
    g: &'g Graph,
    inputs: FxHashMap<SymbolId, Operand>,
    angles: Angles,
    uses: Uses,
    values: FxHashMap<Ex, Operand>,
    /// Sines and cosines of expressions, by the expression.
    sines_and_cosines: FxHashMap<Ex, (Operand, Operand)>,
    solutions: FxHashMap<SystemId, Vec<Vec<Operand>>>,
    steps: Vec<Step>,
    names: Vec<Option<String>>,
}

impl Lowering<'_> {
    fn temp(&mut self, name: Option<String>) -> Temp {
        let temp = Temp(self.names.len() as u32);
        self.names.push(name);
        temp
    }

    fn push(&mut self, op: Op, name: Option<String>) -> Operand {
        let temp = self.temp(name);
        self.steps.push(Step {
            op,
            results: vec![temp],
        });
        Operand::Temp(temp)
    }

    /// The factors of a product that is used only once, so that it can become a multiply-add.
    fn lone_product(&self, ex: Ex) -> Option<(Ex, Ex)> {
        match self.g.node(ex) {
            Node::Mul(a, b)
                if self.uses.count[ex.index()] == 1
                    && !self.values.contains_key(&ex)
                    && self.g.name_of(ex).is_none() =>
            {
                Some((a, b))
            }
            _ => None,
        }
    }

    /// The operand with the value of an expression; adds its steps if it is not computed yet.
    ///
    /// Uses an explicit stack instead of recursion, because expressions are deep.
    fn value(&mut self, root: Ex) -> Operand {
        let mut stack = vec![root];
        while let Some(&ex) = stack.last() {
            if self.values.contains_key(&ex) {
                stack.pop();
                continue;
            }
            let waiting: Vec<Ex> = self
                .needs(ex)
                .into_iter()
                .filter(|e| !self.values.contains_key(e))
                .collect();
            if waiting.is_empty() {
                let operand = self.compute(ex);
                self.values.insert(ex, operand);
                stack.pop();
            } else {
                stack.extend(waiting.into_iter().rev());
            }
        }
        self.values[&root]
    }

    /// The nodes that are operands of a node's step.
    fn needs(&self, ex: Ex) -> Vec<Ex> {
        match self.g.node(ex) {
            Node::Add(a, b) | Node::Sub(a, b) => match (self.lone_product(a), self.lone_product(b))
            {
                (_, Some((x, y))) => vec![a, x, y],
                (Some((x, y)), None) => vec![x, y, b],
                (None, None) => vec![a, b],
            },
            Node::Sin(_) | Node::Cos(_) => Vec::new(),
            Node::Solved(system, ..) if self.solutions.contains_key(&system) => Vec::new(),
            _ => self.g.children(ex),
        }
    }

    fn compute(&mut self, ex: Ex) -> Operand {
        let at = |e: &Ex| self.values[e];
        let name = self.g.name_of(ex).map(str::to_owned);
        let op = match self.g.node(ex) {
            Node::Constant(id) => return Operand::Constant(self.g.number(id).to_f64()),
            Node::Symbol(id) => {
                // every symbol of a request's outputs is one of its arguments
                return self
                    .inputs
                    .get(&id)
                    .copied()
                    .unwrap_or(Operand::Constant(f64::NAN));
            }
            Node::Neg(a) => match at(&a) {
                Operand::Constant(c) => return Operand::Constant(-c),
                a => Op::Neg(a),
            },
            Node::Add(a, b) => match (self.lone_product(a), self.lone_product(b)) {
                (_, Some((x, y))) => Op::MulAdd(at(&x), at(&y), at(&a)),
                (Some((x, y)), None) => Op::MulAdd(at(&x), at(&y), at(&b)),
                (None, None) => Op::Add(at(&a), at(&b)),
            },
            Node::Sub(a, b) => match (self.lone_product(a), self.lone_product(b)) {
                (_, Some((x, y))) => Op::NegMulAdd(at(&x), at(&y), at(&a)),
                (Some((x, y)), None) => Op::MulSub(at(&x), at(&y), at(&b)),
                (None, None) => Op::Sub(at(&a), at(&b)),
            },
            Node::Mul(a, b) => Op::Mul(at(&a), at(&b)),
            Node::Div(a, b) => Op::Div(at(&a), at(&b)),
            Node::Sqrt(a) => Op::Sqrt(at(&a)),
            Node::Sign(a) => Op::Sign(at(&a)),
            Node::Positive(a) => Op::Positive(at(&a)),
            Node::Negative(a) => Op::Negative(at(&a)),
            Node::Sin(angle) => return self.sin_cos(angle).0,
            Node::Cos(angle) => return self.sin_cos(angle).1,
            Node::SinOf(a) => return self.sin_cos_of(a).0,
            Node::CosOf(a) => return self.sin_cos_of(a).1,
            Node::Solved(system, row, column) => {
                return self.solution(system)[row as usize][column as usize];
            }
        };
        self.push(op, name)
    }

    fn solution(&mut self, id: SystemId) -> &Vec<Vec<Operand>> {
        if !self.solutions.contains_key(&id) {
            let system = self.g.system(id);
            let at = |rows: &[Vec<Ex>]| -> Vec<Vec<Operand>> {
                rows.iter()
                    .map(|row| row.iter().map(|e| self.values[e]).collect())
                    .collect()
            };
            let step = SolveStep {
                matrix: at(&system.matrix),
                rhs: at(&system.rhs),
                fixed: at(&system.fixed),
                pivots: system
                    .pivots
                    .iter()
                    .map(|(e, size)| (self.values[e], *size))
                    .collect(),
            };
            let (unknowns, sides) = (system.fixed.len(), step.rhs.first().map_or(0, Vec::len));
            let mut results = Vec::new();
            for row in 0..unknowns {
                for side in 0..sides {
                    let node = self.g.find_solved(id, row, side);
                    let name = node.and_then(|n| self.g.name_of(n)).map(str::to_owned);
                    results.push(self.temp(name));
                }
            }
            let operands: Vec<Operand> = results.iter().map(|t| Operand::Temp(*t)).collect();
            let rows = operands.chunks(sides.max(1)).map(<[Operand]>::to_vec);
            self.solutions.insert(id, rows.collect());
            self.steps.push(Step {
                op: Op::Solve(Box::new(step)),
                results,
            });
        }
        &self.solutions[&id]
    }

    fn sin_cos(&mut self, id: crate::sym::AngleId) -> (Operand, Operand) {
        let angle = self.g.angle(id).clone();
        super::angles::lower(self, &angle)
    }

    fn sin_cos_of(&mut self, ex: Ex) -> (Operand, Operand) {
        use super::angles::Target as _;
        if let Some(sines_and_cosines) = self.sines_and_cosines.get(&ex) {
            return *sines_and_cosines;
        }
        let label = self.sines_and_cosines.len() + 1;
        let names = (format!("sin_turn_{label}"), format!("cos_turn_{label}"));
        let sines_and_cosines = self.sin_cos_step(self.values[&ex], names);
        self.sines_and_cosines.insert(ex, sines_and_cosines);
        sines_and_cosines
    }
}

impl super::angles::Target for Lowering<'_> {
    fn angles(&mut self) -> &mut Angles {
        &mut self.angles
    }

    fn symbol(&self, id: SymbolId) -> (Operand, String) {
        let operand = self.inputs.get(&id).copied();
        (
            operand.unwrap_or(Operand::Constant(f64::NAN)),
            self.g.symbol_name(id).to_owned(),
        )
    }

    fn step(&mut self, op: Op, name: Option<String>) -> Operand {
        self.push(op, name)
    }

    fn sin_cos_step(&mut self, argument: Operand, names: (String, String)) -> (Operand, Operand) {
        let sin = self.temp(Some(names.0));
        let cos = self.temp(Some(names.1));
        self.steps.push(Step {
            op: Op::SinCos(argument),
            results: vec![sin, cos],
        });
        (Operand::Temp(sin), Operand::Temp(cos))
    }
}
