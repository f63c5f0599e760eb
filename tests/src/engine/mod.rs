//! The interface of an engine under test, and the functions that check it.
//!
//! ```
//! use regen_tests::engine::{Naive, check_engine};
//! use regen_tests::files;
//!
//! let mechanism = files::mechanism(&files::robots().join("fourbar.yaml"))?;
//! let figures = check_engine(&Naive::new(&mechanism)?, &mechanism, 1, 2)?;
//! assert!(figures.worst("regressor") <= 1e-10);
//! # Ok::<(), String>(())
//! ```

mod check;
mod compare;
mod dynamics;
mod naive;
mod oracle;
mod pairs;

use nalgebra::DMatrix;
use regen_codegen::signature::{FunctionKind, Layout, Shape, Size};

pub use check::check_engine;
pub use compare::{Figure, Figures, row_error, vector_error};
pub use naive::Naive;
pub use oracle::{ORACLES, check_oracle};
pub use pairs::{Side, check_pair};

/// The result of a method; the error is the status or misuse that the engine reported.
pub type Answer<T> = Result<T, String>;

/// The names that an engine gives to its parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Names {
    /// All coordinates, in the order of `q`.
    pub coordinates: Vec<String>,
    /// The independent coordinates, in the order of the regressor's rows.
    pub independent: Vec<String>,
    /// The actuated coordinates, in the order of the actuators' efforts.
    pub actuated: Vec<String>,
    /// The labels of the regressor's columns.
    pub parameters: Vec<String>,
    /// The labels of the bodies, in the order of `poses`.
    pub bodies: Vec<String>,
    /// The cut joints with their numbers of closure rows.
    pub cuts: Vec<(String, usize)>,
    /// The cones with their largest angles, rad.
    pub cones: Vec<(String, f64)>,
    /// The nominal parameters, SI; `None` where the spec has none.
    pub nominal: Vec<Option<f64>>,
}

/// An engine over plain vectors, which computes functions by their kind. `q`, `qd`, `qdd` contain
/// all coordinates; with the suffix `_i` only the independent ones; `phi` contains the parameters.
pub trait Engine {
    /// The names of its parts.
    fn names(&self) -> Names;
    /// The home configuration, which is closed.
    fn home(&self) -> Vec<f64>;
    /// A function's output, stored as its signature specifies; empty for a function of the model
    /// that this robot does not have.
    ///
    /// # Errors
    /// When the engine reports that the state is singular, that sizes are wrong, or that it has no
    /// such function.
    fn call(&self, kind: FunctionKind, inputs: &[&[f64]]) -> Answer<Vec<f64>>;

    /// A function's output as a matrix; a vector becomes a column.
    ///
    /// # Errors
    /// When the engine reports an error.
    fn matrix(&self, kind: FunctionKind, inputs: &[&[f64]]) -> Answer<DMatrix<f64>> {
        let values = self.call(kind, inputs)?;
        let names = self.names();
        Ok(match kind.signature().shape {
            Shape::Vector(_) => DMatrix::from_column_slice(values.len(), 1, &values),
            Shape::Matrix {
                columns,
                layout: Layout::RowMajor,
                ..
            } => {
                let columns = names.length(columns);
                DMatrix::from_row_slice(values.len() / columns, columns, &values)
            }
            Shape::Matrix {
                rows,
                layout: Layout::ColumnMajor,
                ..
            } => {
                let rows = names.length(rows);
                DMatrix::from_column_slice(rows, values.len() / rows, &values)
            }
        })
    }

    /// The bodies' frames: rotation row by row, then the origin.
    ///
    /// # Errors
    /// When the engine reports an error.
    fn poses(&self, q: &[f64]) -> Answer<Vec<[f64; 12]>> {
        let values = self.call(FunctionKind::Poses, &[q])?;
        let (poses, _) = values.as_chunks::<12>();
        Ok(poses.to_vec())
    }
}

impl Names {
    /// The number of names that a size counts.
    fn length(&self, size: Size) -> usize {
        match size {
            Size::Coordinates => self.coordinates.len(),
            Size::Independent => self.independent.len(),
            Size::Dependent => self.coordinates.len() - self.independent.len(),
            Size::Actuated => self.actuated.len(),
            // no engine has names for these
            Size::Rows | Size::Base | Size::Free | Size::Frames | Size::FrameRates => 0,
            Size::Parameters => self.parameters.len(),
            Size::Bodies => self.bodies.len(),
            Size::Cones => self.cones.len(),
            Size::Pose => 12,
            Size::State => 2 * self.independent.len(),
            Size::StateEfforts => 3 * self.independent.len(),
        }
    }
}
