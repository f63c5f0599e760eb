//! Generation of the robot's module and conversion of its text to tokens.

use std::fs;
use std::path::Path;
use std::str::FromStr;

use proc_macro_crate::{FoundCrate, crate_name};
use proc_macro2::{Ident, Span, TokenStream};
use quote::quote;
use regen_codegen::diag::{Report, Source};
use regen_codegen::emit;
use regen_codegen::pipeline::DeriveError;

use crate::input::Input;
use crate::locate::locate;
use crate::module;

/// The robot's module, or an error at the literal.
pub(crate) fn expand(input: &Input) -> syn::Result<TokenStream> {
    let span = input.file.span();
    let error = |message: String| syn::Error::new(span, message);

    let written_in = span.unwrap().local_file();
    let file = locate(&input.file.value(), written_in.as_deref()).map_err(error)?;
    let path = file
        .absolute
        .to_str()
        .ok_or_else(|| error(format!("the path of `{}` is not UTF-8", file.shown)))?;
    let text = fs::read_to_string(path)
        .map_err(|e| error(format!("cannot read `{}`: {e}", file.shown)))?;
    let source = Source {
        name: file.shown.clone(),
        text,
    };
    let store = file.absolute.with_extension("base");
    let stored = fs::read_to_string(&store).ok();
    let command = format!("run: regen base {} --store", file.shown);
    let options = emit::Options {
        runtime: runtime().map_err(error)?,
    };
    let module =
        module::module(&source, stored.as_deref(), &options).map_err(|problem| match problem {
            DeriveError::Spec(report) => error(report_message(&report)),
            DeriveError::Store(problem) => {
                let name = Path::new(&file.shown)
                    .with_extension("base")
                    .display()
                    .to_string();
                error(format!("`{name}` {problem}; {command}"))
            }
            DeriveError::NotStored => error(format!(
                "the base parameters of this robot take long to derive in a macro; {command}"
            )),
            problem => error(format!("{problem}; {command}")),
        })?;
    let inside = TokenStream::from_str(&module.source)
        .map_err(|e| error(format!("the generated source is no Rust: {e}")))?;
    let name = match &input.module {
        Some(name) => name.clone(),
        None => module_name(&module.robot).map_err(error)?,
    };
    let inputs = match store.to_str().filter(|_| stored.is_some()) {
        Some(store) => quote! { const _: &[u8] = ::core::include_bytes!(#store); },
        None => TokenStream::new(),
    };
    Ok(quote! {
        #[allow(non_snake_case)]
        pub mod #name { #inside }
        #inputs
        // Makes the spec an input of the crate, so that an edit rebuilds it.
        const _: &[u8] = ::core::include_bytes!(#path);
    })
}

/// The report, starting on a new line, as the compiler puts "error: " before the first one.
fn report_message(report: &Report) -> String {
    let mut shown = report.shown();
    let place = shown.next().map_or_else(String::new, |first| {
        let (line, column) = (first.line(), first.column());
        format!("{}:{line}:{column}", report.source.name)
    });
    let head = match shown.count() {
        0 => format!("the robot's spec has an error at {place}"),
        more => format!(
            "the robot's spec has {} errors, the first at {place}",
            more + 1
        ),
    };
    format!("{head}\n{}", report.render(false))
}

fn module_name(name: &str) -> Result<Ident, String> {
    syn::parse_str::<Ident>(name)
        .map(|_| Ident::new(name, Span::call_site()))
        .map_err(|_| {
            format!("`name: {name}` cannot name a module; say robot_model!(\"...\", mod name)")
        })
}

/// The path of the runtime in the crate that calls the macro, which may have renamed it, or may have
/// it from `regen-robotics` only.
fn runtime() -> Result<String, String> {
    match (crate_name("regen-runtime"), crate_name("regen-robotics")) {
        (Ok(FoundCrate::Name(name)), _) => Ok(format!("::{name}")),
        // The runtime's tests, examples and documentation.
        (Ok(FoundCrate::Itself), _) => Ok("::regen_runtime".to_owned()),
        (_, Ok(FoundCrate::Name(name))) => Ok(format!("::{name}::runtime")),
        (_, Ok(FoundCrate::Itself)) => Ok("::regen_robotics::runtime".to_owned()),
        _ => Err(
            "robot_model! needs `regen-robotics` or `regen-runtime` as a dependency of this crate"
                .to_owned(),
        ),
    }
}
