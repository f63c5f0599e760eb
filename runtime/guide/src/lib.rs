#![doc = include_str!(concat!(env!("OUT_DIR"), "/index.md"))]

/// Modules of pages, as `build.rs` wrote them for rustdoc.
macro_rules! pages {
    ($($name:ident = $file:literal),* $(,)?) => {$(
        #[doc = include_str!(concat!(env!("OUT_DIR"), "/", $file))]
        pub mod $name {}
    )*};
}

pages! {
    start_control = "start_control.md",
    start_identify = "start_identify.md",
    start_research = "start_research.md",
    model = "model.md",
    recipes = "recipes.md",
    table = "table.md",
    controller = "controller.md",
    c = "c.md",
    ros2 = "ros2.md",
    simulink = "simulink.md",
    plc = "plc.md",
    optimise = "optimise.md",
    equations = "equations.md",
    paper = "paper.md",
    serve = "serve.md",
    experiment = "experiment.md",
    identify = "identify.md",
    logs = "logs.md",
    inspect = "inspect.md",
    loads = "loads.md",
    response = "response.md",
    rehearse = "rehearse.md",
    calibrate = "calibrate.md",
    estimators = "estimators.md",
    python = "python.md",
    trust = "trust.md",
    evidence = "evidence.md",
    evidence_table = "evidence-table.md",
    numbers = "numbers.md",
    commands = "commands.md",
    reference = "reference.md",
    compare = "compare.md",
}
