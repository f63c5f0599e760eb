//! Errors of `robot_model!`, in folders by cause: each points at the literal, and those of a spec
//! show the spec's own line.

#[test]
fn specs_that_are_wrong_are_shown_with_their_place() {
    trybuild::TestCases::new().compile_fail("ui/spec/*.rs");
}

#[test]
fn specs_that_are_not_found_are_reported_with_the_folders_searched() {
    trybuild::TestCases::new().compile_fail("ui/path/*.rs");
}

#[test]
fn base_parameters_that_must_be_stored_anew_name_the_command() {
    trybuild::TestCases::new().compile_fail("ui/base/*.rs");
}

#[test]
fn other_uses_of_the_macro_are_explained() {
    trybuild::TestCases::new().compile_fail("ui/usage/*.rs");
}

#[test]
fn specs_beside_the_source_become_modules() {
    trybuild::TestCases::new().pass("ui/pass/*.rs");
}
