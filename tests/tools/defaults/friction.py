"""Intervals of Stribeck friction, `regen identify SPEC LOG --friction`, on logs with known truths.

    friction.py REGEN CELLS [--noise white:1e-5] [--rate 200] [--seeds 2,3] [--cache DIR]

CELLS are robots and motions of `defaults.py`, as `puma560:fourier,fivebar:ptp`: each actuated joint has viscous and
Stribeck friction, half as much again as Coulomb's at rest, with the exponent 2. Prints, for each log, how many
intervals of friction and of base parameters hold the truth.
"""

import json
import pathlib
import subprocess
import tempfile
import zlib

import numpy as np

import defaults
import robot as robots


def truth_of(run):
    """The true values of all symbols of friction."""
    truth = dict(run.truth)
    for k, size, slow in run.excess:
        c = run.robot.coordinates[run.robot.independent[k]]
        truth |= {f"Fs({c})": truth[f"Fc({c})"] + size, f"vs({c})": slow, f"delta({c})": 2.0}
    return truth


def held(rows, truth):
    """How many of these labels and intervals hold the truth, of how many, and those that do not."""
    missed = [label for label, own in rows if not own["low"] <= truth[label] <= own["high"]]
    return len(rows) - len(missed), len(rows), missed


def main():
    o = defaults.asked_cells(__doc__)
    regen, folder = defaults.Regen(o.regen), pathlib.Path(tempfile.mkdtemp())
    sums = np.zeros(4, int)
    for name, motion, seed in o.cells:
        plain = defaults.spec_file(name + "+stribeck", o.cache)
        run = robots.Run(plain, motion, seed, 10.0, o.cache, True)
        spec, log = folder / f"{name}.yaml", folder / "log.csv"
        spec.write_text(pathlib.Path(plain).read_text().replace("friction: linear", "friction: stribeck"))
        random = np.random.default_rng([seed, zlib.crc32(f"{name} {motion} stb".encode())])
        defaults.write(log, run, *defaults.rows(run, o.rate, o.noise, 0.02, random))
        words = [o.regen, "identify", spec, log, "--friction", "--format", "json", *o.options]
        answer = subprocess.run(words, capture_output=True, text=True, check=False)
        if answer.returncode:
            print(name, motion, seed, answer.stderr.strip()[:300])
            continue
        found = json.loads(answer.stdout)
        truth = truth_of(run)
        laws = [(f"{s}({joint['joint']})", own) for joint in found["friction"]
                for s, own in joint["intervals"].items() if own]
        friction = held(laws, truth)
        base = regen.base(str(spec))
        values = dict(zip([row["label"] for row in base], run.combinations(base)[0]))
        rows = [(row["label"], row) for row in found["parameters"]
                if row["label"] in values and row["low"] is not None]
        others = held(rows, values)
        sums += [*friction[:2], *others[:2]]
        print(f"{name} {motion} {seed}: friction {friction[0]} of {friction[1]} {friction[2]}, base {others[0]} of {others[1]}",
              flush=True)
    print(f"friction {sums[0]} of {sums[1]}, base parameters {sums[2]} of {sums[3]}")


if __name__ == "__main__":
    main()
