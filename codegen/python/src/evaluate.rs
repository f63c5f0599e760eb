//! Evaluates functions at many states, with arrays that are stored state by state. The batch
//! evaluator needs them entry by entry, so that states are transposed in blocks that fit the cache.

use regen_batch::{eval_base_many, eval_control_many, eval_many};
use regen_interpreted::Interpreted;
use regen_runtime::function::{Argument, Layout, Shape, Signature, Sizes};
use regen_runtime::{Arguments, BaseFunction, ControlFunction, Function, SizeError};

/// The number of states in a block.
const BLOCK: usize = 64;
/// The number of states whose entries are transposed together: one cache line of doubles.
const TILE: usize = 8;
/// The number of states after which control returns to the caller, which handles signals.
const PART: usize = 1 << 14;

/// A function, of all parameters, of base parameters or for controllers.
#[derive(Clone, Copy)]
pub(crate) enum Which {
    Whole(Function),
    Base(BaseFunction),
    Control(ControlFunction),
}

impl Which {
    /// The function with a name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        let whole = Function::ALL.into_iter().map(Self::Whole);
        let base = BaseFunction::ALL.into_iter().map(Self::Base);
        let control = ControlFunction::ALL.into_iter().map(Self::Control);
        let mut all = whole.chain(base).chain(control);
        all.find(|f| f.signature().name == name)
    }

    pub(crate) fn signature(self) -> &'static Signature {
        match self {
            Self::Whole(function) => function.signature(),
            Self::Base(function) => function.signature(),
            Self::Control(function) => function.signature(),
        }
    }
}

/// One function at many states.
pub(crate) struct Batch<'a> {
    model: &'a Interpreted<'a>,
    which: Which,
    sizes: Sizes,
    count: usize,
    /// The arguments as they were given: one row per state, or parameters.
    given: Vec<(Argument, &'a [f64])>,
    /// The result, state by state, each matrix by rows.
    values: &'a mut [f64],
    pivots: &'a mut [f64],
    /// The block's arguments and its output, entry by entry.
    inputs: [Vec<f64>; Argument::ALL.len()],
    out: Vec<f64>,
}

impl<'a> Batch<'a> {
    /// The function at as many states as there are `pivots`; `values` receives the results, state by
    /// state, each matrix by rows.
    pub(crate) fn new(
        model: &'a Interpreted<'a>,
        which: Which,
        sizes: Sizes,
        values: &'a mut [f64],
        pivots: &'a mut [f64],
    ) -> Self {
        Self {
            model,
            which,
            sizes,
            count: pivots.len(),
            given: Vec::new(),
            values,
            pivots,
            inputs: core::array::from_fn(|_| Vec::new()),
            out: Vec::new(),
        }
    }

    /// The number of states.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Sets an argument.
    ///
    /// # Errors
    /// In words, if its length is wrong.
    pub(crate) fn give(&mut self, argument: Argument, entries: &'a [f64]) -> Result<(), String> {
        let states = if argument.is_parameter() {
            1
        } else {
            self.count
        };
        let length = self.sizes.length(argument.size());
        if entries.len() != length * states {
            return Err(format!(
                "`{}` has {} entries, the model needs {length} for each of {states} states",
                argument.name(),
                entries.len()
            ));
        }
        self.given.push((argument, entries));
        Ok(())
    }

    /// Computes up to [`PART`] states from the index `from` on; returns the index of the next one.
    pub(crate) fn go_on(&mut self, from: usize) -> Result<usize, SizeError> {
        let end = (from + PART).min(self.count);
        let mut first = from;
        while first < end {
            let next = (first + BLOCK).min(end);
            self.block(first, next - first)?;
            first = next;
        }
        Ok(end)
    }

    fn block(&mut self, first: usize, count: usize) -> Result<(), SizeError> {
        let signature = self.which.signature();
        for (argument, entries) in &self.given {
            if argument.is_parameter() {
                continue;
            }
            let width = self.sizes.length(argument.size());
            let rows = &entries[first * width..(first + count) * width];
            let input = &mut self.inputs[*argument as usize];
            input.resize(width * count, 0.0);
            for (k, row) in rows.chunks_exact(width.max(1)).enumerate() {
                for (entry, value) in row.iter().enumerate() {
                    input[entry * count + k] = *value;
                }
            }
        }
        let mut arguments = Arguments::EMPTY;
        for (argument, entries) in &self.given {
            arguments = if argument.is_parameter() {
                arguments.with(*argument, entries)
            } else {
                arguments.with(*argument, &self.inputs[*argument as usize])
            };
        }
        let length = self.sizes.output(signature);
        self.out.resize(length * count, 0.0);
        let out = &mut self.out[..];
        let pivots = &mut self.pivots[first..first + count];
        match self.which {
            Which::Whole(function) => {
                eval_many(self.model, function, count, arguments, out, pivots)?;
            }
            Which::Base(function) => {
                eval_base_many(self.model, function, count, arguments, out, pivots)?;
            }
            Which::Control(function) => {
                eval_control_many(self.model, function, count, arguments, out, pivots)?;
            }
        }
        let (rows, columns, layout) = match signature.shape {
            Shape::Vector(size) => (self.sizes.length(size), 1, Layout::RowMajor),
            Shape::Matrix {
                rows,
                columns,
                layout,
            } => (self.sizes.length(rows), self.sizes.length(columns), layout),
        };
        let out = &self.out;
        let values = &mut self.values[first * length..(first + count) * length];
        for (part, tile) in values.chunks_mut(TILE * length.max(1)).enumerate() {
            let states = part * TILE..(part * TILE + TILE).min(count);
            for row in 0..rows {
                for column in 0..columns {
                    let entry = match layout {
                        Layout::RowMajor => row * columns + column,
                        Layout::ColumnMajor => column * rows + row,
                    };
                    let line = &out[entry * count + states.start..entry * count + states.end];
                    let places = tile[row * columns + column..].iter_mut().step_by(length);
                    for (place, value) in places.zip(line) {
                        *place = *value;
                    }
                }
            }
        }
        Ok(())
    }
}
