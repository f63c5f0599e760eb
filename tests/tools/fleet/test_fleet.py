"""Compares the fleet's result with that of one run over all logs, while a worker is killed.

    python tests/tools/fleet/test_fleet.py target/debug/regen

Needs the package distributed. Logs of a five-bar are made from `regen eval`: positions along
Fourier series, forces from the base regressor with fixed parameters and seeded noise.
"""

import json
import math
import os
import pathlib
import random
import signal
import subprocess
import sys
import tempfile

from distributed import Client, LocalCluster

import fleet

HERE = pathlib.Path(__file__).resolve().parent
SPEC = str(HERE.parents[2] / "robots" / "fivebar.yaml")
FREQUENCY, HARMONICS, SAMPLES, STEP, LOGS = 0.2, 5, 400, 0.0125, 8


def states(rng):
    """q, qd, qdd of both cranks along a random series around home."""
    w = 2 * math.pi * FREQUENCY
    coefficients = [
        [(rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1)) for _ in range(HARMONICS)]
        for _ in range(2)
    ]
    out = []
    for k in range(SAMPLES):
        t = k * STEP
        motion = [[2.0, 1.1], [0.0, 0.0], [0.0, 0.0]]
        for i, pairs in enumerate(coefficients):
            for j, (a, b) in enumerate(pairs, 1):
                c, s = math.cos(w * j * t), math.sin(w * j * t)
                motion[0][i] += a * c + b * s
                motion[1][i] += w * j * (b * c - a * s)
                motion[2][i] -= (w * j) ** 2 * (a * c + b * s)
        out.append({"independent": dict(zip(("q", "qd", "qdd"), motion))})
    return out


def make_log(regen, rng, path):
    """A CSV file of one run."""
    given = states(rng)
    done = subprocess.run(
        [regen, "eval", SPEC, "--states", "-", "--format", "json"],
        input=json.dumps(given),
        capture_output=True,
        text=True,
        check=True,
    )
    lines = ["t,q1,q3,tau_q1,tau_q3"]
    for k, (state, found) in enumerate(zip(given, json.loads(done.stdout))):
        rows = found["base_regressor"]
        beta = [0.05 + 0.1 * j for j in range(len(rows[0]))]
        forces = [
            sum(w * b for w, b in zip(row, beta)) + rng.gauss(0, 0.02) for row in rows
        ]
        q = state["independent"]["q"]
        lines.append(",".join(repr(x) for x in [k * STEP, *q, *forces]))
    path.write_text("\n".join(lines) + "\n")


def main():
    """Runs the comparison."""
    regen = str(pathlib.Path(sys.argv[1]).resolve())
    reading = ["--fourier", f"{FREQUENCY},{HARMONICS}"]
    rng = random.Random(11)
    with tempfile.TemporaryDirectory() as folder:
        logs = []
        for k in range(LOGS):
            logs.append(pathlib.Path(folder) / f"run{k}.csv")
            make_log(regen, rng, logs[-1])
        logs = [str(log) for log in logs]
        command = [regen, "identify", SPEC, *logs, *reading, "--format", "json"]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        single = json.loads(done.stdout)

        killed = []
        with (
            LocalCluster(
                n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None
            ) as cluster,
            Client(cluster) as client,
        ):
            workers = client.run(os.getpid)

            def kill_one(count):
                if count == 1:
                    # a busy worker, not an idle one
                    busy = [w for w, tasks in client.processing().items() if tasks]
                    victim = workers[busy[0] if busy else next(iter(workers))]
                    os.kill(victim, signal.SIGKILL)
                    killed.append(victim)

            merged = fleet.identify(client, regen, SPEC, logs, reading, kill_one)
    assert len(killed) == 1, "no worker was killed"
    assert merged["equations"] == single["equations"] == 2 * SAMPLES * LOGS
    worst = 0.0
    for a, b in zip(merged["parameters"], single["parameters"]):
        assert a["label"] == b["label"]
        worst = max(worst, abs(a["value"] / b["value"] - 1))
        worst = max(worst, abs(a["sigma"] / b["sigma_white"] - 1))
    print(f"{LOGS} logs, 3 workers, 1 killed: largest relative difference {worst:.1e}")
    assert worst <= 1e-12, worst


if __name__ == "__main__":
    main()
