//! The arguments of the macro.

use syn::ext::IdentExt;
use syn::parse::{Parse, ParseStream};
use syn::{Ident, LitStr, Token};

/// `"file.yaml"` or `"file.yaml", mod name`.
pub(crate) struct Input {
    /// The spec's path.
    pub(crate) file: LitStr,
    /// The module's name; default: the robot's name.
    pub(crate) module: Option<Ident>,
}

impl Parse for Input {
    fn parse(input: ParseStream<'_>) -> syn::Result<Self> {
        if !input.peek(LitStr) {
            return Err(input.error(
                "expected the path of a robot's spec: robot_model!(\"robot.yaml\") or \
                 robot_model!(\"robot.yaml\", mod name)",
            ));
        }
        let file = input.parse()?;
        let mut module = None;
        if input.parse::<Option<Token![,]>>()?.is_some() && !input.is_empty() {
            if !input.peek(Token![mod]) {
                return Err(input.error("expected `mod name`, the name of the module to make"));
            }
            input.parse::<Token![mod]>()?;
            if input.peek(Ident::peek_any) && !input.peek(Ident) {
                return Err(input.error("a keyword cannot name a module"));
            }
            module = Some(input.parse()?);
            input.parse::<Option<Token![,]>>()?;
        }
        if input.is_empty() {
            Ok(Self { file, module })
        } else {
            Err(input.error("robot_model! takes a path and at most `mod name`"))
        }
    }
}
