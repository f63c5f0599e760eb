fn main() {
    let path = std::env::args().nth(1).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    let t = std::time::Instant::now();
    let robot = regen_codegen::pipeline::derive(&regen_codegen::diag::Source::new(path, text))
        .unwrap_or_else(|e| panic!("{e}"));
    let out = regen_codegen::emit::module(&robot, &regen_codegen::emit::Options::default());
    eprintln!("{:?} {:?}", t.elapsed(), robot.operations());
    println!("{out}");
}
