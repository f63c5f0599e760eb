#!/usr/bin/env python3
"""Compares the times of our C with those of our Rust and of CasADi's C, in one run.

    python3 tests/tools/peers/c.py [ROBOT ...]

Robots are those of peers.py. Our C and CasADi's are compiled by `gcc -O3 -march=native`, our Rust for the
same processor. Each function is called through one that is not inlined, on the same state. The programs
run in turns, twelve times each, and the least time of many rounds counts. Rounds take some 10 us: on a busy
machine that changes its clock, few longer ones are at one speed throughout. Outputs are compared first.
"""
import math
import os
import random
import re
import subprocess
import sys

import peers
from peers import ROOT, SERIAL, WORK, run

peers.NEEDS = ["casadi==3.8.2", "pyyaml==6.0.3", "numpy"]
TURNS, ROUNDS, CALLS = 12, 1500, 48


def generate(robots):
    for robot in robots:
        file = {"rps3": "3rps"}.get(robot, robot)
        for more, folder in ([], "modules"), (["--target", "c"], "c"):
            run([peers.regen(), "generate", f"robots/{file}.yaml", *more, "--out", str(WORK / folder)], cwd=ROOT)


def sizes(robot):
    """Coordinates, independent ones, base parameters and parameters."""
    text = (WORK / "c" / f"{robot}.h").read_text()
    names = ["COORDINATE", "INDEPENDENT", "BASE", "PARAMETER"]
    return [int(re.search(rf"_{name}_COUNT (\d+)", text)[1]) for name in names]


def lengths(robot):
    """Length of the output, and of the parameters that a function takes."""
    n, dof, base, p = sizes(robot)
    return {"base_regressor": (dof * base, 0), "base_inverse_dynamics": (dof, base), "regressor": (dof * p, 0)}


def state(robot):
    n = sizes(robot)[0]
    text = (WORK / "c" / f"{robot}.c").read_text()
    home = re.search(r"_home\[\d+\] = \{([^}]*)\}", text)[1]
    home = [float(x) for x in home.replace("\n", " ").split(",") if x.strip()]
    noise = random.Random(3)
    return [[h + 0.1 * noise.uniform(-1, 1) for h in home]] + [[noise.uniform(-1, 1) for _ in range(n)] for _ in range(2)]


def rust(robots):
    folder = WORK / "c_rust"
    (folder / "src").mkdir(parents=True, exist_ok=True)
    (folder / "Cargo.toml").write_text(
        '[package]\nname = "c-rust"\nversion = "0.0.0"\nedition = "2024"\n[workspace]\n[dependencies]\n'
        f'regen-runtime = {{ path = "{ROOT / "runtime"}", default-features = false, features = ["std"] }}\n'
        "[profile.release]\ncodegen-units = 1\n")
    code = "#![allow(dead_code)]\nuse std::hint::black_box;\nuse std::time::Instant;\n"
    body = ""
    for robot in robots:
        n, dof, base, p = sizes(robot)
        q, qd, qdd = state(robot)
        code += f'#[path = "{WORK / "modules" / robot}.rs"]\nmod {robot};\n'
        state_type = f"q: &[f64; {n}], qd: &[f64; {n}], qdd: &[f64; {n}]"
        body += f"    let (q, qd, qdd) = ({q!r}, {qd!r}, {qdd!r});\n"
        for function, (length, given) in lengths(robot).items():
            name = f"{robot}_{function}"
            if given:
                code += (f"#[inline(never)]\nfn {name}({state_type}, beta: &[f64; {given}], out: &mut [f64; {length}]) -> f64 {{\n"
                         f"    let (tau, condition) = {robot}::{function}(q, qd, qdd, beta);\n    *out = tau;\n    condition.pivot\n}}\n")
                body += f"    let beta: [f64; {given}] = std::array::from_fn(|i| 0.1 + i as f64);\n    let mut out = [0.0; {length}];\n"
                call = f"{name}(black_box(&q), black_box(&qd), black_box(&qdd), black_box(&beta), &mut out)"
                show = "out.iter()"
            else:
                code += (f"#[inline(never)]\nfn {name}({state_type}, out: &mut [[f64; {dof}]; {length // dof}]) -> f64 {{\n"
                         f"    {robot}::{function}(q, qd, qdd, out).pivot\n}}\n")
                body += f"    let mut out = [[0.0; {dof}]; {length // dof}];\n"
                call = f"{name}(black_box(&q), black_box(&qd), black_box(&qdd), &mut out)"
                show = "out.iter().flatten()"
            body += (f"    if show {{\n        {call};\n        let all: Vec<String> = {show}.map(|x| format!(\"{{x:e}}\")).collect();\n"
                     f"        println!(\"{name}\\t{{}}\", all.join(\" \"));\n    }} else {{\n        let mut best = f64::MAX;\n"
                     f"        for _ in 0..{ROUNDS} {{\n            let start = Instant::now();\n            for _ in 0..{CALLS} {{\n"
                     f"                black_box({call});\n                black_box(&out);\n            }}\n"
                     f"            best = best.min(start.elapsed().as_secs_f64() / {CALLS}e-9);\n        }}\n"
                     f"        println!(\"{name}\\t{{best:.2}}\");\n    }}\n")
    code += f"fn main() {{\n    let show = std::env::args().len() > 1;\n{body}}}\n"
    (folder / "src" / "main.rs").write_text(code)
    target = WORK / "c_rust_target"
    environment = {**os.environ, "RUSTFLAGS": "-C target-cpu=native", "CARGO_TARGET_DIR": str(target)}
    subprocess.run(["cargo", "build", "--release", "--quiet"], cwd=folder, env=environment, check=True)
    return target / "release" / "c-rust"


def ours(robots):
    code = '#include <string.h>\n#include <math.h>\n' + peers.TIMER
    body = ""
    for robot in robots:
        run(["gcc", "-O3", "-march=native", f"-D{robot.upper()}_NO_FLOAT", "-c", f"{robot}.c"], cwd=WORK / "c")
        code += f'#include "{robot}.h"\n'
        q, qd, qdd = ("{" + ", ".join(map(repr, v)) + "}" for v in state(robot))
        body += f" {{ static const double q[] = {q}, qd[] = {qd}, qdd[] = {qdd};\n"
        for function, (length, given) in lengths(robot).items():
            beta = ", beta" if given else ""
            if given:
                body += f"  static double beta[{given}]; for (int i = 0; i < {given}; i++) beta[i] = 0.1 + i;\n"
            call = f"{robot}_{function}(q, qd, qdd{beta}, out);"
            body += (f'  if (show) {{ {call} printf("{robot}_{function}\\t"); for (int i = 0; i < {length}; i++) printf("%.17g ", out[i]); printf("\\n"); }}\n'
                     f"  else {{ double best = 1e30; for (int r = 0; r < {ROUNDS}; r++) {{ double t = now(); for (int k = 0; k < {CALLS}; k++) {{ KEEP(q); {call} KEEP(out); }}"
                     f' t = (now() - t) / {CALLS}; if (t < best) best = t; }} printf("{robot}_{function}\\t%.2f\\n", best); }}\n')
        body += " }\n"
    code += f"int main(int argc, char **argv) {{ static double out[65536]; const int show = argc > 1; (void)argv;\n{body} return 0; }}\n"
    (WORK / "c" / "main.c").write_text(code)
    run(["gcc", "-O2", "main.c", *[f"{r}.o" for r in robots], "-o", "ours", "-lm"], cwd=WORK / "c")
    return WORK / "c" / "ours"


def shown(program):
    lines = (line.split("\t") for line in run([program, "show"]).splitlines())
    return {name: [float(x) for x in values.split()] for name, values in lines}


def main():
    WORK.mkdir(parents=True, exist_ok=True)
    peers.in_environment()
    import casadi as ca

    robots = sys.argv[1:] or ["puma560", "ur5e", "panda", "rps3"]
    generate(robots)
    in_rust, in_c = rust(robots), ours(robots)
    known, found = shown(in_rust), shown(in_c)
    for name, values in known.items():
        largest = max(map(abs, values))
        apart = max(abs(a - b) for a, b in zip(values, found[name])) / largest
        if not apart < 1e-13:
            sys.exit(f"{name} differs by {apart:.1e}")
    functions = [peers.casadi_rps3(ca) if r == "rps3" else peers.casadi_serial(ca, r) for r in robots]
    plain = peers.compile_casadi(ca, functions, ["-O3", "-march=native"], "plain")
    fast = peers.compile_casadi(ca, functions, ["-O3", "-march=native", "-ffast-math"], "fast")
    in_rust, in_c, plain, fast = peers.figures([in_rust, in_c, plain, fast], TURNS)
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors; {run(['gcc', '--version']).splitlines()[0]}, "
          f"{run(['rustc', '--version']).strip()}, CasADi {ca.__version__}\n")
    print("| function | Rust, ns | C, ns | C/Rust | CasADi's C, ns | C/CasADi |\n|---|---|---|---|---|---|")
    for name, time in in_rust.items():
        robot = next(r for r in robots if name.startswith(r))
        peer = math.inf
        if name == f"{robot}_base_regressor":
            peer = min(plain[f"{robot}_base"], fast[f"{robot}_base"])
        theirs = f"{peer:.0f} | {in_c[name] / peer:.2f}" if math.isfinite(peer) else "- | -"
        print(f"| {name} | {time:.0f} | {in_c[name]:.0f} | {in_c[name] / time:.2f} | {theirs} |")


if __name__ == "__main__":
    main()
