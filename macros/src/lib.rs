//! [`robot_model!`]: a robot's dynamics, derived from its YAML spec at compile time.
//!
//! Use it through `regen-robotics`, or through `regen-runtime` with the feature `macros`.

mod input;
mod locate;
mod model;
mod module;

use proc_macro::TokenStream;

/// Derives a robot from its spec and puts its dynamics into a module of the robot's name.
///
/// ```text
/// regen_runtime::robot_model!("3rps.yaml");                   // pub mod rps3, by the spec's `name`
/// regen_runtime::robot_model!("3rps.yaml", mod manipulator);  // pub mod manipulator
/// ```
///
/// The file is looked up beside the source file, then in the directory of the crate's
/// `Cargo.toml`, then in `robots/` there. An edit of it rebuilds the crate. Errors in it appear
/// at the literal, with the spec's own line and column.
///
/// The module is what `regen generate` writes. It works in `no_std` crates and wherever the
/// runtime is a dependency, also under another name. Its model is a type named like the robot:
/// `rps3::Rps3`. Where that is a name of Rust's prelude or one that the module imports or
/// defines, `Robot` is put behind it: a robot named `joint` is `joint::JointRobot`.
///
/// The result is cached in the user's cache folder (`REGEN_CACHE` names another one, or is
/// `off`), so that an edit of Rust beside the macro derives nothing; see `regen_cache`.
///
/// Macros are built without optimisation by default. Where a large robot makes that felt:
///
/// ```toml
/// [profile.dev.build-override]
/// opt-level = 3
/// ```
#[proc_macro]
pub fn robot_model(input: TokenStream) -> TokenStream {
    let input = syn::parse_macro_input!(input as input::Input);
    model::expand(&input)
        .unwrap_or_else(|error| error.to_compile_error())
        .into()
}
