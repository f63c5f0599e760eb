"""How often instrumental variables find the true parameters where noisy positions bias least squares.

    python tests/tools/estimation/instruments.py [--seeds 200] [--regen target/release/regen]

Simulates an arm with two joints and the closed five-bar with noise of positions, and identifies each
log by `regen identify --iv`. For each case it prints the largest error of least squares in standard
deviations, minimised over the seeds, and the number of seeds for which every value by instrumental
variables is within 3 of its standard deviations. The true values are those of least squares in an
exact log.
"""

import argparse
import json
import pathlib
import subprocess
import tempfile

ARM = """\
name: arm
gravity: [0, 0, -9.81]
limbs:
  - name: arm
    base: {rpy: [pi/2, 0, 0]}
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true,
         friction: viscous, nominal: {Fv: 0.4}, limits: {position: [-2, 2]}}
      - {name: q2, type: revolute, dh: {a: 0.4}, body: 2, actuated: true,
         friction: viscous, nominal: {Fv: 0.2}, limits: {position: [-2, 2]}}
home: {q1: 0.3, q2: 0.5}
bodies:
  1: {mass: 3.0, com: [0.2, 0, 0], inertia: [0.01, 0, 0, 0.05, 0, 0.05]}
  2: {mass: 1.5, com: [0.15, 0, 0], inertia: [0.005, 0, 0, 0.02, 0, 0.02]}
"""


MOTION = {
    "format": "regen-trajectory",
    "base_frequency": 0.5,
    "harmonics": 2,
    "cosine": [[0.1, 0.05], [0.05, -0.08]],
    "sine": [[0.15, 0.05], [-0.12, 0.06]],
}


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--seeds", type=int, default=200)
    options.add_argument("--regen", default="target/release/regen")
    args = options.parse_args()
    regen = pathlib.Path(args.regen).resolve()
    root = pathlib.Path(__file__).resolve().parents[3]

    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "arm.yaml").write_text(ARM)

        def run(*words):
            done = subprocess.run(
                [regen, *map(str, words)], cwd=folder, capture_output=True, text=True
            )
            if done.returncode != 0:
                raise SystemExit(f"{words}: {done.stderr}")
            return done.stdout

        def identified(spec, log, *more):
            return json.loads(run("identify", spec, log, "--format", "json", *more))

        five = root / "robots" / "fivebar.yaml"
        for spec, robot, names, home in [
            ("arm.yaml", "arm", ["q1", "q2"], [0.3, 0.5]),
            (five, "fivebar", ["q1", "q3"], [2.0, 1.1]),
        ]:
            motion = {**MOTION, "robot": robot, "coordinates": names, "offset": home}
            (folder / "t.json").write_text(json.dumps(motion))
            along = ("--trajectory", "t.json")
            run("simulate", spec, *along, "--out", "exact.csv", "--exact")
            exact = identified(spec, "exact.csv")["parameters"]
            truth = {p["label"]: p["value"] for p in exact}
            run("simulate", spec, *along, "--out", "log.csv", "--step", 0.005, "--duration", 6,
                "--noise", "1e-4,0.02", "--runs", args.seeds)
            for filters in [(), ("--butterworth", "4,40"), ("--reference", "t.json")]:
                biased, within, told, sigmas = [], 0, 0, []
                for seed in range(1, args.seeds + 1):
                    found = identified(spec, f"log-{seed}.csv", "--iv", *filters)

                    def ratios(rows):
                        return [abs(p["value"] - truth[p["label"]]) / p["sigma"] for p in rows]

                    biased.append(max(ratios(found["least_squares"])))
                    ours = ratios(found["parameters"])
                    within += max(ours) <= 3
                    sigmas += ours
                    told += found["instruments"]["probability"] < 0.01
                rms = (sum(x * x for x in sigmas) / len(sigmas)) ** 0.5
                name = pathlib.Path(spec).stem
                print(f"{name}, --iv {' '.join(filters)}: "
                      f"least squares off by at least {min(biased):.1f} sigma in every seed; "
                      f"instrumental variables within 3 sigma in {within} of {args.seeds} "
                      f"(rms {rms:.2f} sigma); bias told in {told}", flush=True)


if __name__ == "__main__":
    main()
