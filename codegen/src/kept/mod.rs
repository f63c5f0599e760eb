//! Results of derivations as bytes, and back, so that each is derived once.
//!
//! Where the bytes are kept is the caller's concern: it gives
//! [`Mechanism::with_keeper`](crate::Mechanism::with_keeper) a [`Keeper`]. A result is handed to the
//! keeper only if the bytes give the same result again.

mod analysis;
mod key;
mod program;

use std::fmt;

pub use key::Key;

use crate::base::Analysis;
use crate::bytes::{Reader, Writer};
use crate::robot::{Function, FunctionKind, Robot};

/// A place where results are kept.
///
/// ```
/// use std::collections::BTreeMap;
/// use std::sync::{Arc, Mutex};
/// use regen_codegen::{Mechanism, diag::Source, kept::{Keeper, Key}};
///
/// #[derive(Debug, Default)]
/// struct InMemory(Mutex<BTreeMap<Key, Vec<u8>>>);
///
/// impl Keeper for InMemory {
///     fn find(&self, key: &Key) -> Option<Vec<u8>> {
///         self.0.lock().ok()?.get(key).cloned()
///     }
///     fn keep(&self, key: &Key, bytes: &dyn Fn() -> Option<Vec<u8>>) {
///         if let (Ok(mut kept), Some(bytes)) = (self.0.lock(), bytes()) {
///             kept.insert(*key, bytes);
///         }
///     }
/// }
///
/// let text = "name: arm\nlimbs:\n  - name: arm\n    joints:\n      \
///             - {name: q1, type: revolute, body: link, actuated: true}\n";
/// let keeper = Arc::new(InMemory::default());
/// let open = || Mechanism::open(&Source::new("arm.yaml", text));
/// let derived = open()?.with_keeper(keeper.clone()).analysis()?.clone();
/// assert_eq!(keeper.0.lock().map_or(0, |kept| kept.len()), 1);
/// assert_eq!(*open()?.with_keeper(keeper).analysis()?, derived);
/// # Ok::<(), regen_codegen::diag::Report>(())
/// ```
pub trait Keeper: fmt::Debug + Send + Sync {
    /// The bytes that were kept for a key, unchanged.
    fn find(&self, key: &Key) -> Option<Vec<u8>>;

    /// Called after [`find`](Self::find) had nothing and the result was derived: keeps what `bytes`
    /// returns, or not, where that is not worth it. `bytes` returns `None` where the result cannot
    /// be kept.
    fn keep(&self, key: &Key, bytes: &dyn Fn() -> Option<Vec<u8>>);
}

/// Where the loops are closed, and the base parameters: what is known of a mechanism before any
/// function is derived.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Facts {
    /// The coordinates at home, rad or m.
    pub(crate) home: Vec<f64>,
    /// Indices of the redundant closure rows.
    pub(crate) redundant_rows: Vec<usize>,
    /// The base parameters, if they were derived.
    pub(crate) analysis: Option<Analysis>,
}

impl Facts {
    fn write(&self, out: &mut Writer) {
        out.list(&self.home, |out, x| out.double(*x));
        out.list(&self.redundant_rows, |out, row| out.size(*row));
        out.flag(self.analysis.is_some());
        if let Some(found) = &self.analysis {
            analysis::write(out, found);
        }
    }

    fn read(from: &mut Reader<'_>) -> Option<Self> {
        Some(Self {
            home: from.list(Reader::double)?,
            redundant_rows: from.list(Reader::size)?,
            analysis: if from.flag()? {
                Some(analysis::read(from)?)
            } else {
                None
            },
        })
    }

    /// The bytes of the facts; `None` if they would not give the same facts again.
    pub(crate) fn to_bytes(&self) -> Option<Vec<u8>> {
        let mut out = Writer::default();
        self.write(&mut out);
        let bytes = out.finish();
        (Self::from_bytes(&bytes).as_ref() == Some(self)).then_some(bytes)
    }

    /// Reads what [`Facts::to_bytes`] returned.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let mut from = Reader::new(bytes);
        let facts = Self::read(&mut from)?;
        from.is_at_end().then_some(facts)
    }
}

/// The facts of a robot with its functions; names, limits and nominal values come from the spec.
pub(crate) fn robot_to_bytes(robot: &Robot) -> Option<Vec<u8>> {
    let facts = Facts {
        home: robot.home.clone(),
        redundant_rows: robot.redundant_rows.clone(),
        analysis: robot.analysis.clone(),
    };
    let mut out = Writer::default();
    facts.write(&mut out);
    out.list(&robot.functions, |out, function| {
        out.text(function.kind.name());
        program::write(out, &function.program);
    });
    let bytes = out.finish();
    let (again, functions) = robot_from_bytes(&bytes)?;
    (again == facts && functions == robot.functions).then_some(bytes)
}

/// Reads what [`robot_to_bytes`] returned.
pub(crate) fn robot_from_bytes(bytes: &[u8]) -> Option<(Facts, Vec<Function>)> {
    let mut from = Reader::new(bytes);
    let facts = Facts::read(&mut from)?;
    let functions = from.list(|from| {
        let name = from.text()?;
        let kind = FunctionKind::ALL.into_iter().find(|k| k.name() == name)?;
        let program = program::read(from)?;
        Some(Function { kind, program })
    })?;
    from.is_at_end().then_some((facts, functions))
}
