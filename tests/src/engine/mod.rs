//! What an engine must be able to do to be judged, and the judgement.
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

pub use check::check_engine;
pub use compare::{Figure, Figures, row_error, vector_error};
pub use naive::Naive;
pub use oracle::{ORACLES, check_oracle};
pub use pairs::{Side, check_pair};

/// What a method answers; the error says which status or misuse the engine reported.
pub type Answer<T> = Result<T, String>;

/// The names that an engine gives to its parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Names {
    /// All coordinates, in the order of `q`.
    pub coordinates: Vec<String>,
    /// The independent ones, in the order of the regressor's rows.
    pub independent: Vec<String>,
    /// The actuated ones, in the order that `efforts` takes.
    pub actuated: Vec<String>,
    /// The labels of the regressor's columns.
    pub parameters: Vec<String>,
    /// The labels of the bodies, in the order of `poses`.
    pub bodies: Vec<String>,
    /// The cuts with their numbers of rows.
    pub cuts: Vec<(String, usize)>,
    /// The cones with their greatest angles.
    pub cones: Vec<(String, f64)>,
    /// Nominal parameters.
    pub nominal: Vec<Option<f64>>,
}

/// An engine over plain vectors. `q`, `qd`, `qdd` are over all coordinates; a suffix `_i` means
/// over the independent ones; `phi` holds the parameters.
pub trait Engine {
    /// The names of its parts.
    fn names(&self) -> Names;
    /// The closed state that everything starts from.
    fn home(&self) -> Vec<f64>;
    /// f(q), cuts in file order, then couplings.
    ///
    /// # Errors
    /// What the engine reports.
    fn constraints(&self, q: &[f64]) -> Answer<Vec<f64>>;
    /// A = df/dq, every row.
    ///
    /// # Errors
    /// What the engine reports.
    fn jacobian(&self, q: &[f64]) -> Answer<DMatrix<f64>>;
    /// b of A qdd = b.
    ///
    /// # Errors
    /// What the engine reports.
    fn bias(&self, q: &[f64], qd: &[f64]) -> Answer<Vec<f64>>;
    /// What one Newton step adds to the dependent coordinates, in coordinate order.
    ///
    /// # Errors
    /// What the engine reports.
    fn newton_step(&self, q: &[f64]) -> Answer<Vec<f64>>;
    /// All velocities.
    ///
    /// # Errors
    /// What the engine reports.
    fn velocities(&self, q: &[f64], qd_i: &[f64]) -> Answer<Vec<f64>>;
    /// All accelerations.
    ///
    /// # Errors
    /// What the engine reports.
    fn accelerations(&self, q: &[f64], qd: &[f64], qdd_i: &[f64]) -> Answer<Vec<f64>>;
    /// K_i - X^T K_e: dof rows, one column per parameter.
    ///
    /// # Errors
    /// What the engine reports.
    fn regressor(&self, q: &[f64], qd: &[f64], qdd: &[f64]) -> Answer<DMatrix<f64>>;
    /// The regressor times phi.
    ///
    /// # Errors
    /// What the engine reports.
    fn inverse_dynamics(&self, q: &[f64], qd: &[f64], qdd: &[f64], phi: &[f64])
    -> Answer<Vec<f64>>;
    /// The efforts at rest.
    ///
    /// # Errors
    /// What the engine reports.
    fn gravity(&self, q: &[f64], phi: &[f64]) -> Answer<Vec<f64>>;
    /// The efforts at zero independent accelerations less gravity: Coriolis, centrifugal, friction.
    ///
    /// # Errors
    /// What the engine reports.
    fn bias_forces(&self, q: &[f64], qd: &[f64], phi: &[f64]) -> Answer<Vec<f64>>;
    /// The mass matrix of the independent coordinates.
    ///
    /// # Errors
    /// What the engine reports.
    fn mass_matrix(&self, q: &[f64], phi: &[f64]) -> Answer<DMatrix<f64>>;
    /// Y(q, qd, `qd_r`, `qdd_r`), references over the independent coordinates.
    ///
    /// # Errors
    /// What the engine reports.
    fn slotine_li(
        &self,
        q: &[f64],
        qd: &[f64],
        qd_r_i: &[f64],
        qdd_r_i: &[f64],
    ) -> Answer<DMatrix<f64>>;
    /// `tau_i` - X^T `tau_e` from the efforts of the actuated coordinates.
    ///
    /// # Errors
    /// What the engine reports.
    fn efforts(&self, q: &[f64], tau_actuated: &[f64]) -> Answer<Vec<f64>>;
    /// The bodies' frames: rotation row by row, then the origin.
    ///
    /// # Errors
    /// What the engine reports.
    fn poses(&self, q: &[f64]) -> Answer<Vec<[f64; 12]>>;
    /// The cosines of the angles between the z axes that cones limit.
    ///
    /// # Errors
    /// What the engine reports.
    fn cones(&self, q: &[f64]) -> Answer<Vec<f64>>;
}
