"""How often 95 % intervals hold the truth, in logs of two robots under control that regen did not simulate.

    python tests/tools/estimation/coverage.py [--seeds 200] [--robots arm,fivebar] [--regen target/release/regen]
        [--estimators "none;--huber 1.345"] [--case late]

An arm with two links and a five-bar, both upright, their equations written here in closed form and integrated by
Runge and Kutta. A controller at half the rate of the log reads encoders with steps and holds its efforts, which
a current loop follows with a lag of 2 ms; joints have viscous and Coulomb friction. The log has the encoders'
positions at 250 Hz for 8 s, and the efforts of the drives 0.4 samples late with noise that is an autoregression
(0.9 from row to row). Each seed has other noise, other zeros of the encoders and another motion.
`--case held` logs the positions that the controller has read, each twice; `--case prompt` has no delay.

For each estimator: the part of all intervals that hold the truth, for each parameter that whose part is below
the limit (88 %), and its mean error in deviations. Needs numpy.
"""

import argparse
import collections
import json
import pathlib
import subprocess
import tempfile

import numpy as np

RATE, TIME, SUBSTEPS = 250, 8, 10
BEFORE = 2  # s, until the motion has settled
STEP, KEEP = 1e-4, 0.9  # of encoders, rad; of the noise from row to row
LAG, GRAVITY, WIDTH = 2e-3, 9.81, 5e-3
LEAST = 88  # percent
ESTIMATORS = "none;--delay auto;--huber 1.345;--iv;--feasible;--reduce;--weighting equal;--cross;--bandwidth 60"

FRICTION = "friction: linear, nominal: {Fv: 0.1, Fc: 0.1}, limits: {effort: [-60, 60], velocity: [-20, 20]}"
ARM = f"""\
name: arm
gravity: [0, 0, -9.81]
limbs:
  - name: arm
    base: {{rpy: [pi/2, 0, 0]}}
    joints:
      - {{name: q1, type: revolute, body: 1, actuated: true, {FRICTION}}}
      - {{name: q2, type: revolute, dh: {{a: 0.4}}, body: 2, actuated: true, {FRICTION}}}
home: {{q1: -1.2, q2: 0.6}}
"""
FIVEBAR = f"""\
name: fivebar
gravity: [0, 0, -9.81]
limbs:
  - name: left
    base: {{rpy: [pi/2, 0, 0]}}
    joints:
      - {{name: q1, type: revolute, body: 1, actuated: true, {FRICTION}}}
      - {{name: q2, type: revolute, dh: {{a: 0.3}}, body: 2}}
  - name: right
    base: {{xyz: [0.2, 0, 0], rpy: [pi/2, 0, 0]}}
    joints:
      - {{name: q3, type: revolute, body: 3, actuated: true, {FRICTION}}}
      - {{name: q4, type: revolute, dh: {{a: 0.3}}, body: 4}}
cuts:
  - {{name: tip, joint: revolute, between: [{{body: 2, xyz: [0.4, 0, 0]}}, {{body: 4, xyz: [0.4, 0, 0]}}]}}
home: {{q1: 2.0, q2: -1.0, q3: 1.1, q4: 1.0}}
"""


class Body:
    """A planar body: mass, first moments and moment of inertia in its frame."""

    def __init__(self, mass, x, y, about_centre):
        self.m, self.x, self.y = mass, mass * x, mass * y
        self.i = about_centre + mass * (x * x + y * y)

    def values(self, name):
        return {f"m({name})": self.m, f"mx({name})": self.x, f"my({name})": self.y, f"Izz({name})": self.i}


class Pair:
    """Two links in a row; angles of the second are relative."""

    def __init__(self, length, first, second):
        self.length, self.first, self.second = length, first, second

    def equations(self, q, v):
        """The inertia matrix and the other terms, of many states."""
        a, b, n = self.first, self.second, self.length
        c, s = np.cos(q[..., 1]), np.sin(q[..., 1])
        lever, slope = n * (b.x * c - b.y * s), -n * (b.x * s + b.y * c)
        inertia = np.empty((*q.shape, 2))
        inertia[..., 0, 0] = a.i + b.m * n * n + b.i + 2 * lever
        inertia[..., 0, 1] = inertia[..., 1, 0] = b.i + lever
        inertia[..., 1, 1] = b.i
        both = q[..., 0] + q[..., 1]
        second = GRAVITY * (b.x * np.cos(both) - b.y * np.sin(both))
        first = GRAVITY * (a.x * np.cos(q[..., 0]) - a.y * np.sin(q[..., 0]) + b.m * n * np.cos(q[..., 0]))
        rest = np.empty(q.shape)
        rest[..., 0] = slope * v[..., 1] * (2 * v[..., 0] + v[..., 1]) + first + second
        rest[..., 1] = -slope * v[..., 0] ** 2 + second
        return inertia, rest


class Arm:
    spec, joints, centre, swing = ARM, ["q1", "q2"], [-1.2, 0.6], [0.9, 0.9]
    gains = [60.0, 5.0], [15.0, 1.0]
    noise = [0.15, 0.05]
    friction = {"Fv": [0.4, 0.15], "Fc": [0.25, 0.1]}

    def __init__(self):
        self.pair = Pair(0.4, Body(3.0, 0.2, 0.01, 0.04), Body(1.5, 0.17, -0.02, 0.02))
        self.truth = self.pair.first.values("1") | self.pair.second.values("2")

    def equations(self, q, v):
        return self.pair.equations(q, v)


class Fivebar:
    spec, joints, centre, swing = FIVEBAR, ["q1", "q3"], [2.0, 1.1], [0.35, 0.35]
    gains = [20.0, 1.5], [20.0, 1.5]
    noise = [0.03, 0.03]
    friction = {"Fv": [0.1, 0.12], "Fc": [0.1, 0.08]}

    def __init__(self):
        self.left = Pair(0.3, Body(0.5, 0.14, 0.01, 5e-3), Body(0.35, 0.2, -0.01, 6e-3))
        self.right = Pair(0.3, Body(0.45, 0.15, -0.01, 4e-3), Body(0.4, 0.22, 0.01, 7e-3))
        self.truth = {}
        for pair, names in [(self.left, "12"), (self.right, "34")]:
            self.truth |= pair.first.values(names[0]) | pair.second.values(names[1])

    def equations(self, q, v):
        # absolute angles of the rods from the triangle of both elbows and the tip
        short, rod = 0.3, 0.4

        def along(angle):
            return np.stack([np.cos(angle), np.sin(angle)], -1)

        def across(angle):
            return np.stack([-np.sin(angle), np.cos(angle)], -1)

        left, right = short * along(q[..., 0]), short * along(q[..., 1]) + np.array([0.2, 0])
        apart = right - left
        half = (apart**2).sum(-1, keepdims=True) / 4
        up = np.stack([-apart[..., 1], apart[..., 0]], -1) / np.sqrt(4 * half)
        tip = (left + right) / 2 + np.sqrt(rod**2 - half) * up
        angles = [np.arctan2(*(tip - e)[..., ::-1].T).T for e in (left, right)]
        # rod * across(a) * a' - rod * across(b) * b' = the elbows' difference of velocities
        matrix = rod * np.stack([across(angles[0]), -across(angles[1])], -1)
        cranks = short * np.stack([-across(q[..., 0]), across(q[..., 1])], -1)
        rates = np.linalg.solve(matrix, cranks)
        turning = np.einsum("...ij,...j->...i", rates, v)
        pull = (short * along(q[..., 0]) * v[..., :1] ** 2 - short * along(q[..., 1]) * v[..., 1:] ** 2
                + rod * along(angles[0]) * turning[..., :1] ** 2 - rod * along(angles[1]) * turning[..., 1:] ** 2)
        bias = np.linalg.solve(matrix, pull[..., None])[..., 0]
        inertia, rest = 0, 0
        for k, pair in enumerate([self.left, self.right]):
            slope = np.zeros((*q.shape[:-1], 2, 2))
            slope[..., 0, k] = 1
            slope[..., 1, :] = rates[..., k, :]
            slope[..., 1, k] -= 1
            own_q = np.stack([q[..., k], angles[k] - q[..., k]], -1)
            own_v = np.einsum("...ij,...j->...i", slope, v)
            m, h = pair.equations(own_q, own_v)
            h = h + m[..., 1] * bias[..., k, None]
            inertia = inertia + np.einsum("...ki,...kl,...lj->...ij", slope, m, slope)
            rest = rest + np.einsum("...ki,...k->...i", slope, h)
        return inertia, rest


def simulated(robot, seeds, late):
    """Times, encoders and efforts of a log for each seed: seeds x rows x joints."""
    step = 1 / (RATE * SUBSTEPS)
    random = [np.random.default_rng([seed, 7]) for seed in seeds]
    zero = np.array([r.uniform(0, STEP, 2) for r in random])
    phases = np.array([r.uniform(0, 2 * np.pi, (4, 2)) for r in random])
    sizes = np.array([0.6, 0.5, 0.35, 0.25])
    frequencies = np.array([0.25, 0.5, 1.0, 1.5])

    def wanted(t):
        w = 2 * np.pi * frequencies[:, None]
        parts = sizes[:, None] * np.array(robot.swing) / sizes.sum()
        return (np.array(robot.centre) + (parts * np.sin(w * t + phases)).sum(1),
                (parts * w * np.cos(w * t + phases)).sum(1))

    viscous, coulomb = np.array(robot.friction["Fv"]), np.array(robot.friction["Fc"])

    def slope(state, command):
        q, v, u = state
        inertia, rest = robot.equations(q, v)
        force = u - rest - viscous * v - coulomb * np.tanh(v / WIDTH)
        return np.stack([v, np.linalg.solve(inertia, force[..., None])[..., 0], (command - u) / LAG])

    def read(q):
        return np.round((q - zero) / STEP) * STEP + zero

    q, v = wanted(0)
    state = np.stack([q, v, robot.equations(q, v)[1]])
    kp, kd = np.array(robot.gains).T
    last, command = read(q), state[2]
    rows = RATE * (TIME + BEFORE)
    logs = collections.defaultdict(list)
    delay = int(round(late * SUBSTEPS))
    efforts = [state[2]] * (delay + 1)
    for row in range(rows):
        t = row / RATE
        now = read(state[0])
        if row % 2 == 0:
            goal, rate = wanted(t)
            # the load at the goal is fed forward, as drives do
            command = kp * (goal - now) + kd * (rate - (now - last) * RATE / 2) + robot.equations(goal, rate)[1]
            last = now
        logs["q"].append(now)
        logs["held"].append(last)
        logs["u"].append(efforts[-1 - delay])
        for _ in range(SUBSTEPS):
            k1 = slope(state, command)
            k2 = slope(state + step / 2 * k1, command)
            k3 = slope(state + step / 2 * k2, command)
            k4 = slope(state + step * k3, command)
            state = state + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            efforts.append(state[2])
        del efforts[: -delay - 1]
    logs = {key: np.stack(x, 1)[:, RATE * BEFORE :] for key, x in logs.items()}
    noise = np.stack([r.normal(size=logs["u"].shape[1:]) for r in random])
    noise[:, 1:] *= np.sqrt(1 - KEEP**2)
    for row in range(1, noise.shape[1]):
        noise[:, row] += KEEP * noise[:, row - 1]
    logs["u"] = logs["u"] + np.array(robot.noise) * noise
    return logs


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--seeds", type=int, default=200)
    options.add_argument("--first", type=int, default=1, help="the first seed")
    options.add_argument("--robots", default="arm,fivebar")
    options.add_argument("--estimators", default=ESTIMATORS, help="options of each, separated by ;")
    options.add_argument("--case", default="late", choices=["late", "prompt", "held"])
    options.add_argument("--regen", default="target/release/regen")
    options.add_argument("--out", help="append each answer to this file, a JSON object on each line")
    args = options.parse_args()
    regen = pathlib.Path(args.regen).resolve()
    out = open(args.out, "a", encoding="utf-8") if args.out else None
    for robot in [{"arm": Arm, "fivebar": Fivebar}[name]() for name in args.robots.split(",")]:
        seeds = range(args.first, args.first + args.seeds)
        logs = simulated(robot, seeds, 0.4 if args.case == "late" else 0)
        with tempfile.TemporaryDirectory() as folder:
            spec = pathlib.Path(folder) / "robot.yaml"
            spec.write_text(robot.spec)

            def run(*words):
                done = subprocess.run([regen, *map(str, words)], capture_output=True, text=True, check=False)
                return done.stdout, done.stderr

            base = json.loads(run("base", spec, "--format", "json")[0])["base"]
            truth = {row["label"]: sum(x["value"] * robot.truth.get(x["parameter"], 0) for x in row["terms"])
                     for row in base}
            for kind, values in robot.friction.items():
                truth |= {f"{kind}({joint})": x for joint, x in zip(robot.joints, values)}
            head = ",".join(["t", *robot.joints, *(f"tau_{joint}" for joint in robot.joints)])
            t = np.arange(RATE * TIME) / RATE
            files = []
            for k, seed in enumerate(seeds):
                files.append(pathlib.Path(folder) / f"{seed}.csv")
                positions = logs["held" if args.case == "held" else "q"][k]
                np.savetxt(files[-1], np.column_stack([t, positions, logs["u"][k]]), delimiter=",", fmt="%.10g",
                           comments="", header=head)
            for words in args.estimators.split(";"):
                counts, failed, shown = collections.defaultdict(list), collections.Counter(), collections.Counter()
                given = [] if words == "none" else words.split()
                for k, path in enumerate(files):
                    # the others are those that are left out in turn
                    more = [files[k - 1], files[k - 2]] if "--cross" in given else []
                    text, says = run("identify", spec, path, *more, *given, "--no-suspicion", "--format", "json")
                    found = json.loads(text) if text.startswith("{") else {}
                    if not found:
                        failed[says.strip()[:120]] += 1
                        continue
                    for row in found["parameters"]:
                        if row["low"] is not None:
                            counts[row["label"]].append((row["low"], row["high"], row["value"], row["sigma"]))
                            shown[row["status"]] += 1
                    if out:
                        kept = {key: found.get(key) for key in ("filter", "parameters")}
                        kept |= {"robot": type(robot).__name__, "case": args.case, "seed": seeds[k], "options": words,
                                 "truth": truth, "says": says}
                        out.write(json.dumps(kept) + "\n")
                        out.flush()
                inside = {key: [low <= truth[key] <= high for low, high, *_ in x] for key, x in counts.items()}
                whole = [y for x in inside.values() for y in x]
                mean = 100 * np.mean(whole) if whole else np.nan
                print(f"{type(robot).__name__} {args.case} {words}: {mean:.1f} % of {len(whole)}, {dict(shown)}")
                for text, count in failed.items():
                    print(f"    no answer {count} times: {text}")
                for key, x in inside.items():
                    part = 100 * np.mean(x)
                    ratios = [(y[2] - truth[key]) / y[3] for y in counts[key] if y[3]]
                    mark = "  BELOW" if part < LEAST else ""
                    print(f"    {key:8} {part:6.1f} % of {len(x)}, error {np.mean(ratios):+.2f} +- "
                          f"{np.std(ratios):.2f} deviations, truth {truth[key]:.4g}{mark}", flush=True)


if __name__ == "__main__":
    main()
