"""Intervals of unknown gains beside those of base parameters, on two runs of which one carries a load of known mass.

    gains.py REGEN CELLS [--noise white:1e-5] [--rate 200] [--seeds 2,3] [--cache DIR] [--options "--iv ..."]

CELLS are robots and motions of `defaults.py`, as `puma560:fourier,fivebar:ptp`. The last body carries the load, the logs
have the currents of all efforts, and the command is told the mass of the load alone. Prints, for each pair of logs, how
many intervals of gains and of base parameters hold the truth, and the values called well determined that are
more than four deviations off.
"""

import json
import pathlib
import subprocess
import tempfile
import zlib

import numpy as np
import yaml

import defaults
import robot as robots

MASS, PLACE = 2.5, np.array([0.02, -0.03, 0.05])  # of the load, in the frame of the last body
MOMENTS = np.array([0.012, 0.015, 0.01])


def loaded(spec, folder):
    """The spec with a body `load` on the last body, and the load's ten parameters."""
    doc = yaml.safe_load(pathlib.Path(spec).read_text())
    body = robots.Robot(pathlib.Path(spec)).bodies[-1]
    joint = {"type": "fixed", "body": "load", "payload": True}
    doc["limbs"].append({"name": "load", "from": body, "joints": [joint]})
    path = folder / f"loaded-{pathlib.Path(spec).name}"
    path.write_text(yaml.safe_dump(doc, sort_keys=False))
    about = np.diag(MOMENTS) - MASS * robots.pin.skew(PLACE) @ robots.pin.skew(PLACE)
    return path, np.array([*about[np.triu_indices(3)], *(MASS * PLACE), MASS])


def main():
    o = defaults.asked_cells(__doc__)
    regen, folder = defaults.Regen(o.regen), pathlib.Path(tempfile.mkdtemp())
    sums = np.zeros(6, int)
    for name, motion, seed in o.cells:
        plain = defaults.spec_file(name, o.cache)
        spec, load = loaded(plain, folder)
        random = np.random.default_rng([seed, zlib.crc32(f"{name} {motion} gains".encode())])
        free = robots.Run(plain, motion, seed, 10.0, o.cache)
        runs = {"free": free, "loaded": robots.Run(plain, motion, seed, 10.0, o.cache, load=load)}
        names = free.robot.names_independent
        gains = random.uniform(2, 20, len(names)) * random.choice([-1, 1], len(names))
        for key, run in runs.items():
            t, q, v, z = defaults.rows(run, o.rate, o.noise, 0.02, random)
            defaults.write(folder / f"{key}.csv", run, t, q, v, z / gains)
        columns = {f"tau_{c}": {"column": f"tau_{c}", "unit": "A", "gain": "unknown"} for c in names}
        carried = {"files": ["loaded.csv"], "payload": {"m": MASS}}
        runs_file = folder / "runs.yaml"
        runs_file.write_text(yaml.safe_dump({"columns": columns, "runs": [{"files": ["free.csv"]}, carried]}))
        words = [o.regen, "identify", spec, runs_file, "--logs", folder, "--format", "json", *o.options]
        answer = subprocess.run(words, capture_output=True, text=True, check=False)
        if answer.returncode:
            print(name, motion, seed, answer.stderr.strip()[:300])
            continue
        found = json.loads(answer.stdout)
        base = regen.base(str(plain))
        truth = dict(zip([row["label"] for row in base], free.combinations(base)[0]))
        judged = [
            [(own["low"], own["high"], own["value"], own.get("status"), gain)
             for own, gain in zip(found["gains"], gains) if own.get("low") is not None],
            [(row["low"], row["high"], row["value"], row["status"], truth[row["label"]])
             for row in found["parameters"] if row["label"] in truth and row["low"] is not None],
        ]
        counts, wrong = [], []
        for rows in judged:
            counts += [sum(low <= y <= high for low, high, *_, y in rows), len(rows)]
            # the half of an interval of 95 % is about two deviations
            wrong += [f"{x:.4g} for {y:.4g}" for low, high, x, status, y in rows
                      if status in (None, "well") and abs(x - y) > 4 * (high - low) / 2 / 1.96]
        sums += [*counts, len(wrong), 1]
        print(f"{name} {motion} {seed}: gains {counts[0]} of {counts[1]}, base {counts[2]} of {counts[3]}, wrong {wrong}",
              flush=True)
    print(f"gains {sums[0]} of {sums[1]}, base parameters {sums[2]} of {sums[3]}, wrong {sums[4]} in {sums[5]} fits")


if __name__ == "__main__":
    main()
