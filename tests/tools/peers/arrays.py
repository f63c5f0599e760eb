#!/usr/bin/env python3
"""The PUMA's base regressor at 75,000 states, from numpy to numpy: the package `regen`, the bare batch
without Python, Pinocchio's regressor in a loop, and CasADi's compiled function mapped.

    pip install ./codegen/python pin casadi numpy pandas
    python tests/tools/peers/arrays.py

Values are compared first. Then all of it runs in turns, and the least CPU time of each counts; the bare
batch is a program that writes entry by entry into memory that it has already used.
"""

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"
sys.dont_write_bytecode = True  # nothing is left beside the sources

import casadi
import end_to_end
import numpy as np
import peers
import pinocchio_rows

import regen

ROBOT, COUNT = "puma560", 75_000


def kept(robot):
    """The labels of the base parameters."""
    return robot.base.labels


def batch(profile):
    """The program that times the bare batch; with the package's features little is left to build."""
    command = ["cargo", "build", "--quiet", "--profile", profile, "-p", "regen-python", "-p", "regen-interpreted",
               "--lib", "--example", "batch"]
    subprocess.run(command, cwd=peers.ROOT, check=True)
    target = Path(os.environ.get("CARGO_TARGET_DIR", peers.ROOT / "target"))
    return target / {"dev": "debug"}.get(profile, profile) / "examples" / "batch"


def bare(program):
    """The CPU time of the bare batch."""
    command = [program, f"robots/{ROBOT}.yaml", str(COUNT)]
    done = subprocess.run(command, cwd=peers.ROOT, capture_output=True, text=True, check=True)
    return float(done.stdout)


def compile_casadi():
    """CasADi's compiled base regressor in the library that `by_casadi` opens."""
    peers.write_casadi(casadi, [end_to_end.casadi_function(casadi, ROBOT)], "arrays.c", {})
    library = peers.WORK / "arrays.so"
    peers.run(["gcc", "-O3", "-march=native", "-shared", "-fPIC", "arrays.c", "-o", library, "-lm"], cwd=peers.WORK)
    end_to_end.casadi_library = lambda: library


def main():
    """Compares and times."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--profile", default="release", help="of the bare batch; that of the installed package")
    arguments = parser.parse_args()
    rounds = arguments.rounds
    peers.WORK.mkdir(parents=True, exist_ok=True)
    robot = regen.Robot(peers.ROOT / "robots" / f"{ROBOT}.yaml")
    peers.kept = lambda _: kept(robot)
    rng = np.random.default_rng(1)
    motion = [np.ascontiguousarray(x) for x in rng.uniform(-1, 1, (3, COUNT, len(robot.coordinates)))]
    program = batch(arguments.profile)
    compile_casadi()
    evaluate, rows = pinocchio_rows.arm(ROBOT)

    def by_pinocchio():
        out = np.empty((COUNT, rows, len(robot.base)))
        for k, (q, qd, qdd) in enumerate(zip(*motion)):
            out[k] = evaluate(q, qd, qdd)
        return out

    ways = {
        "regen": lambda: robot.base_regressor(*motion),
        "CasADi mapped": lambda: end_to_end.by_casadi(ROBOT, motion),
        "Pinocchio's loop": by_pinocchio,
    }
    found = {name: way().reshape(COUNT, -1) for name, way in ways.items()}
    for name, values in found.items():
        off = abs(values - found["regen"]).max()
        print(f"{name} differs by at most {off:.1e}")
        assert off < 1e-10, name
    del found
    best = dict.fromkeys(["bare batch", *ways], float("inf"))
    for turn in range(rounds):
        best["bare batch"] = min(best["bare batch"], bare(program))
        for name, way in ways.items():
            # a loop over states takes so long that it runs in the first two turns only
            if name.startswith("Pinocchio") and turn > 1:
                continue
            begin = time.process_time()
            way()
            best[name] = min(best[name], time.process_time() - begin)
    load = " ".join(f"{x:.1f}" for x in os.getloadavg())
    print(f"\n{COUNT} states, load {load}\n\n| way | CPU, ms | ns per state | of the bare batch |\n|---|---|---|---|")
    for name, seconds in best.items():
        part = seconds / best["bare batch"]
        print(f"| {name} | {1e3 * seconds:.1f} | {1e9 * seconds / COUNT:.0f} | {part:.2f} |")


if __name__ == "__main__":
    main()
