#!/usr/bin/env python3
"""What `regen identify SPEC LOG` answers without options, beside the best of a grid of manual options.

The logs are simulated here, not by regen: the motion of the independent coordinates is known in closed
form, `robot.py` closes the loops and computes the efforts by Pinocchio, and the parameters are random and
physical. So the true base parameters are known, and so are errors on another motion.

    pip install -r tests/tools/defaults/requirements.txt
    python3 tests/tools/defaults/defaults.py run --robots puma560,3rps --rates 100,1000 \\
        --noise white:1e-5,steps:1e-4,jitter:0.3 --motions fourier,ptp --seeds 2 --out cells.jsonl
    python3 tests/tools/defaults/defaults.py summary cells.jsonl [--manual-coverage]
    python3 tests/tools/defaults/defaults.py check

`run` prints a line for each cell (a robot, motion, rate, noise and seed) and appends the figures to --out,
a JSON object on each line; `summary` reads such files. `check` compares the efforts with the vectors of
tests/fixtures/vectors, measures the error of interpolation, and expects regen to recover the truth from
logs with hardly any noise.

Robots are those of `robots/`, of `tests/fixtures/mechanisms` or of this folder, by name, or paths.
`NAME+friction` gives each actuated joint viscous and Coulomb friction, `NAME+rotor` the inertia of its
rotor, `NAME+friction+rotor` both. `NAME+stribeck` has viscous and Coulomb friction in the spec and half as
much again of the Coulomb friction at low velocities in the log, which no parameter describes: its cells
count for errors, not for intervals and wrong values.

Motions: `fourier` (two periods of five harmonics), `start` (the same, blended in from rest), `ptp` (eight
moves with rests between them), `sweep` (sines of rising frequency).

Noise is that of the positions, several kinds joined by `+`: `white:1e-5` (standard deviation, rad or m),
`steps:1e-4` (an encoder's steps), `jitter:0.3` (each row is measured at an instant off its time by this
standard deviation, in samples), `cjitter:0.3` (the same, correlated over about 15 rows), `none`. `vel:1e-3` logs
velocities too, with white noise of this deviation, and `vlag:2` lets them lag by so many samples; `late:0.4`
logs the efforts so many samples late, `spikes:0.01` gives this part of the efforts errors as large as efforts
are. The
efforts have white noise of --effort times their rms.

A cell's figures: `error`, the rms of W (b - truth) over that of the efforts on another motion of the same
kind, percent; `best`, the least such error of fourth-order Butterworth filters of 2 to 60 Hz, and `ratio`,
the first over the second; `inside` of `intervals`, how many 95 % intervals hold the truth; `wrong`, the
values called well determined that are more than four of their standard deviations off; `biased`, the
values of that status; `warnings`; `seconds` of the run without options.

Motions and efforts depend on neither rate nor noise, so they are computed once and kept in --cache.
The command is copied before a run, so that a build beside it does not change it.
"""

import argparse
import collections
import concurrent.futures
import hashlib
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import zlib

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np  # noqa: E402

import motions  # noqa: E402
import robot as robots  # noqa: E402

CUTOFFS = (2, 4, 8, 15, 30, 60)  # Hz
ROBOTS = "puma560,scara+friction,tree_branch,fork+friction+rotor,fivebar,3rps,3rrr+friction,delta," \
    "fourbar+friction"
NOISE = "white:1e-7,white:1e-6,white:1e-5,white:1e-4,white:1e-3,steps:1e-6,steps:1e-5,steps:1e-4,steps:1e-3," \
    "jitter:0.1,jitter:0.3,jitter:1,cjitter:0.1,cjitter:0.3,cjitter:1"
SLOPE = 1e-4  # s on either side of an instant at which its velocity is computed
MEMORY = 15  # rows over which the jitter of `cjitter` is correlated
WRONG = 4  # standard deviations
LOGS = 8  # of each robot in `check`
AIM = 1.25  # of the ratio


# logs ------------------------------------------------------------------------------------------


def parts(noise):
    """The kinds of noise with their sizes."""
    out = {}
    for word in noise.split("+"):
        kind, _, size = word.partition(":")
        if kind not in ("white", "steps", "jitter", "cjitter", "vel", "vlag", "late", "spikes", "none"):
            raise SystemExit(f"no noise is called {kind}")
        out[kind] = float(size or 0)
    return out


def rows(run, rate, noise, effort, random):
    """Times, measured positions, measured velocities (none unless noise names them) and efforts."""
    sizes = parts(noise)
    t = np.arange(int(round(run.motion.time * rate))) / rate
    off = sizes.get("jitter", 0) * random.normal(size=len(t))
    if "cjitter" in sizes:
        keep = np.exp(-1 / MEMORY)
        steps = random.normal(size=len(t)) * np.sqrt(1 - keep**2)
        steps[0] = random.normal()
        for k in range(1, len(t)):
            steps[k] += keep * steps[k - 1]
        off = off + sizes["cjitter"] * steps
    instants = t + np.clip(off / rate, -motions.MARGIN, motions.MARGIN)
    q, z = run.at(instants)
    if sizes.get("late"):
        z = run.at(np.clip(instants - sizes["late"] / rate, -motions.MARGIN, None))[1]
    q = q + sizes.get("white", 0) * random.normal(size=q.shape)
    step = sizes.get("steps", 0)
    if step:
        zero = random.uniform(0, step, q.shape[1])
        q = np.round((q - zero) / step) * step + zero
    size = np.sqrt(np.mean(z**2, axis=0))
    z = z + effort * size * random.normal(size=z.shape)
    if "spikes" in sizes:
        # few errors of efforts that are as large as these
        z = z + (random.uniform(size=z.shape) < sizes["spikes"]) * size * random.normal(size=z.shape)
    if "vel" not in sizes:
        return t, q, np.empty((len(t), 0)), z
    late = instants - sizes.get("vlag", 0) / rate
    late = np.clip(late, SLOPE - motions.MARGIN, run.motion.time + motions.MARGIN - SLOPE)
    slope = (run.at(late + SLOPE)[0] - run.at(late - SLOPE)[0]) / (2 * SLOPE)
    return t, q, slope + sizes["vel"] * random.normal(size=q.shape), z


def write(path, run, t, q, v, z):
    names = run.robot.names_independent
    rates = [f"qd_{c}" for c in names] if v.shape[1] else []
    head = ",".join(["t", *names, *rates, *(f"tau_{c}" for c in names)])
    np.savetxt(path, np.column_stack([t, q, v, z]), delimiter=",", comments="", fmt="%.12g", header=head)


# regen -----------------------------------------------------------------------------------------


class Regen:
    """The command, with the base parameters of specs."""

    def __init__(self, path):
        self.path = str(path)
        self.bases = {}

    def call(self, *words):
        return subprocess.run([self.path, *map(str, words)], capture_output=True, text=True, check=False)

    def base(self, spec):
        if spec not in self.bases:
            ran = self.call("base", spec, "--format", "json")
            if ran.returncode:
                raise SystemExit(f"regen base {spec}: {ran.stderr}")
            self.bases[spec] = json.loads(ran.stdout)["base"]
        return self.bases[spec]

    def identify(self, spec, log, options):
        """The rows of the base parameters, the messages and the seconds; no rows if it has no answer."""
        begin = time.monotonic()
        ran = self.call("identify", spec, log, "--format", "json", *options)
        seconds = time.monotonic() - begin
        found = json.loads(ran.stdout) if ran.stdout.startswith("{") else {}
        return found, ran.stderr, seconds


def judged(found, base, truth, w, efforts):
    """The figures of an answer, or None if a value is missing."""
    by_label = {row["label"]: row for row in found.get("parameters") or []}
    answers = [by_label.get(row["label"]) for row in base]
    if any(a is None or a["value"] is None for a in answers):
        return None
    off = np.array([a["value"] for a in answers]) - truth
    errors = w @ off
    intervals = [(a["low"], a["high"], y) for a, y in zip(answers, truth.tolist()) if a["low"] is not None]
    sigmas = np.array([a["sigma"] if a["sigma"] else np.nan for a in answers])
    ratios = np.abs(off) / sigmas
    wrong = [k for k, a in enumerate(answers) if a["status"] == "well" and ratios[k] > WRONG]
    out = {
        "error": float(100 * np.sqrt(np.mean(errors**2) / np.mean(efforts**2))),
        # each effort by its own size
        "error_each": float(100 * np.sqrt(np.mean(np.mean(errors**2, axis=0) / np.mean(efforts**2, axis=0)))),
        "intervals": len(intervals),
        "inside": sum(low <= y <= high for low, high, y in intervals),
        "wrong": len(wrong),
        "well": sum(a["status"] == "well" for a in answers),
        "biased": sum(a["status"] == "biased" for a in answers),
        "most_sigmas": float(np.nanmax(ratios)) if np.isfinite(ratios).any() else None,
    }
    if wrong:
        out["wrong_labels"] = [f"{answers[k]['label']} {ratios[k]:.1f}" for k in wrong]
    return out


def messages(text):
    """The messages that begin with `warning`, shortened."""
    out = []
    for line in text.splitlines():
        if "warning" in line.lower():
            out.append(line.strip()[:160])
    return out


def asked_cells(doc):
    """The command line of a script that reads intervals: REGEN CELLS and options; `cells` are names, motions and seeds."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("regen")
    parser.add_argument("cells")
    parser.add_argument("--noise", default="white:1e-5")
    parser.add_argument("--rate", type=float, default=200.0)
    parser.add_argument("--seeds", default="2,3")
    parser.add_argument("--cache", default=tempfile.gettempdir())
    parser.add_argument("--options", default="", help="more options of the command, between blanks")
    o = parser.parse_args()
    pairs = [cell.split(":") for cell in o.cells.split(",")]
    o.cells = [(name, motion, seed) for name, motion in pairs for seed in map(int, o.seeds.split(","))]
    o.options = o.options.split()
    return o


# cells -----------------------------------------------------------------------------------------


def spec_file(name, cache):
    """A file with the robot's spec."""
    text = robots.find(name)
    path = pathlib.Path(cache) / "specs" / f"{pathlib.Path(name).stem if '/' in name else name}.yaml"
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file() or path.read_text() != text:
        path.write_text(text)
    return path


def group(o, name, motion, seed):
    """Yields the figures of all cells of a robot's motion."""
    regen = Regen(o.command)
    spec = spec_file(name, o.cache)
    run = robots.Run(spec, motion, seed, o.time, o.cache, "+stribeck" in name)
    base = regen.base(spec)
    truth, w = run.combinations(base)
    floor = run.floor(base, o.effort)
    with tempfile.TemporaryDirectory() as folder:
        log = pathlib.Path(folder) / "log.csv"
        for rate in o.rates:
            for noise in o.noise:
                cell = {"robot": name, "motion": motion, "rate": rate, "noise": noise, "seed": seed,
                        "floor": floor / np.sqrt(rate)}
                random = np.random.default_rng([seed, zlib.crc32(f"{name} {motion} {rate} {noise}".encode())])
                write(log, run, *rows(run, rate, noise, o.effort, random))
                yield measured(o, cell, regen, spec, log, base, truth, w, run.test_efforts)


def measured(o, cell, regen, spec, log, base, truth, w, efforts):
    """The figures of one cell."""
    found, text, seconds = regen.identify(spec, log, o.options)
    figures = judged(found, base, truth, w, efforts)
    cell |= {"options": o.options, "answered": figures is not None, "seconds": round(seconds, 3)}
    cell |= figures or {}
    if found.get("filter"):
        cell["choice"] = {key: value for key, value in found["filter"].items() if key != "candidates"}
    if figures and "+stribeck" in cell["robot"]:
        # the intervals are those of a model that does not hold
        cell |= {"intervals": 0, "inside": 0, "wrong": 0}
        cell.pop("wrong_labels", None)
    cell["warnings"] = messages(text)
    if figures is None:
        cell["says"] = text.strip()[:400] or "values are missing"
    if o.manual:
        cell["manual"] = {}
        for cutoff in CUTOFFS:
            if cutoff < cell["rate"] / 2.5:
                option = ["--butterworth", f"4,{cutoff}", "--no-suspicion"]
                answer = judged(regen.identify(spec, log, option)[0], base, truth, w, efforts)
                if answer:
                    if "+stribeck" in cell["robot"]:
                        answer |= {"intervals": 0, "inside": 0, "wrong": 0}
                    cell["manual"][str(cutoff)] = {
                        k: answer[k] for k in ("error", "error_each", "intervals", "inside", "wrong", "well")
                    }
        if cell["manual"]:
            cutoff = min(cell["manual"], key=lambda c: cell["manual"][c]["error"])
            cell["best"], cell["best_cutoff"] = cell["manual"][cutoff]["error"], float(cutoff)
            if figures:
                cell["ratio"] = figures["error"] / cell["best"]
    return cell


def title(cell):
    return f"{cell['robot']} {cell['motion']} {cell['rate']:g} Hz {cell['noise']} seed {cell['seed']}"


def line(cell):
    out = f"{title(cell)}: "
    if cell["answered"]:
        out += f"{cell['error']:.3g} %"
    else:
        out += "NO ANSWER"
    if "best" in cell:
        out += f", best {cell['best']:.3g} % at {cell['best_cutoff']:g} Hz"
    if "ratio" in cell:
        out += f", ratio {cell['ratio']:.3g}"
    if cell["answered"]:
        out += f", inside {cell['inside']}/{cell['intervals']}, wrong {cell['wrong']}"
        if cell["biased"]:
            out += f", biased {cell['biased']}"
    return f"{out}, warnings {len(cell['warnings'])}, {cell['seconds']:.2f} s"


def work(job):
    o, name, motion, seed = job
    return list(group(o, name, motion, seed))


def copied(path, cache):
    """A copy of the command, which a build does not change."""
    path = pathlib.Path(path)
    if not path.is_file():
        raise SystemExit(f"no command {path}: build it, or state it by --regen")
    name = hashlib.sha256(path.read_bytes()).hexdigest()[:12]
    copy = pathlib.Path(cache) / f"regen-{name}"
    if not copy.is_file():
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(path, copy)
    return copy


def run_cells(o):
    o.command = copied(o.regen, o.cache)
    jobs = [(o, n, m, s) for n in o.robots for m in o.motions for s in range(o.seeds)]
    out = open(o.out, "a", encoding="utf-8") if o.out else None
    cells = []

    def tell(cell):
        cell["command"] = o.command.name
        cells.append(cell)
        print(line(cell), flush=True)
        if out:
            out.write(json.dumps(cell) + "\n")
            out.flush()

    if o.jobs > 1:
        with concurrent.futures.ProcessPoolExecutor(o.jobs) as pool:
            for found in pool.map(work, jobs):
                for cell in found:
                    tell(cell)
    else:
        for job in jobs:
            for cell in group(*job):
                tell(cell)
    summarise(cells, False)


# summary ---------------------------------------------------------------------------------------


def share(part, whole):
    return f"{100 * part / whole:.1f} % ({part}/{whole})" if whole else "-"


def covered(cells):
    return share(sum(c["inside"] for c in cells), sum(c["intervals"] for c in cells))


def summarise(cells, manual_coverage, hardest=10, by=("robot", "motion", "rate", "noise")):
    """Prints the figures of many cells."""
    answered = [c for c in cells if c["answered"]]
    rated = [c for c in answered if "ratio" in c]
    print(f"\n{len(cells)} cells, {len(cells) - len(answered)} without an answer")
    if rated:
        good = sum(c["ratio"] <= AIM for c in rated)
        ratios = [c["ratio"] for c in rated]
        worst = max(rated, key=lambda c: c["ratio"])
        print(f"error at most {AIM} times that of the best manual filter: {share(good, len(rated))}; "
              f"median {np.median(ratios):.3g}, 90 % {np.quantile(ratios, 0.9):.3g}, "
              f"worst {worst['ratio']:.3g} ({title(worst)})")
    floored = [c for c in answered if "floor" in c]
    if floored:
        ratios = np.array([c["error"] / c["floor"] for c in floored])
        print(f"error over that expected of noise of efforts alone: geometric mean {np.exp(np.log(ratios).mean()):.3g}")
        both = [c for c in floored if "best" in c]
        if both:
            good = sum(c["error"] <= AIM * max(c["best"], c["floor"]) for c in both)
            print(f"error at most {AIM} times the larger of this and the best manual filter's: {share(good, len(both))}")
    wrong = [c for c in answered if c["wrong"]]
    print(f"95 % intervals that hold the truth: {covered(answered)}")
    print(f"logs with values well but wrong: {len(wrong)} of {len(answered)}, "
          f"{sum(c['wrong'] for c in wrong)} values; values called biased: {sum(c['biased'] for c in answered)}")
    if answered:
        seconds = [c["seconds"] for c in answered]
        print(f"seconds: median {np.median(seconds):.2f}, most {max(seconds):.2f}")
    for key in by:
        values = sorted({c[key] for c in cells}, key=lambda x: (isinstance(x, str), x))
        if len(values) < 2:
            continue
        print(f"\n{key:24} cells  no answer  ratio <= {AIM}   median    worst  coverage  wrong logs")
        for value in values:
            some = [c for c in cells if c[key] == value]
            told = [c for c in some if c["answered"]]
            ratios = np.array([c["ratio"] for c in told if "ratio" in c])
            part = f"{100 * np.mean(ratios <= AIM):12.1f} % {np.median(ratios):8.3g} {ratios.max():8.3g}" \
                if len(ratios) else f"{'-':>14} {'-':>8} {'-':>8}"
            whole = sum(c["intervals"] for c in told)
            inside = f"{100 * sum(c['inside'] for c in told) / whole:7.1f} %" if whole else "        -"
            print(f"{shown(value):24} {len(some):5}  {len(some) - len(told):9}  {part} {inside} "
                  f"{sum(c['wrong'] > 0 for c in told):11}")
    if rated and hardest:
        print("\nhardest cells")
        for cell in sorted(rated, key=lambda c: -c["ratio"])[:hardest]:
            print(f"  {line(cell)}")
        low = [c for c in answered if c["intervals"] and c["inside"] < 0.8 * c["intervals"]]
        if low:
            print("\nfewest intervals that hold the truth")
            for cell in sorted(low, key=lambda c: c["inside"] / c["intervals"])[:hardest]:
                print(f"  {line(cell)}")
    silent = collections.Counter(c.get("says", "")[:120] for c in cells if not c["answered"])
    if silent:
        print("\nno answer")
        for text, count in silent.most_common(hardest):
            print(f"  {count} times: {text}")
    if manual_coverage:
        print(f"\nmanual cutoff   cells  coverage                 wrong logs  best of all  ratio <= {AIM}   median")
        for cutoff in map(str, CUTOFFS):
            some = [c for c in cells if cutoff in c.get("manual", {})]
            if some:
                each = [c["manual"][cutoff] for c in some]
                best = sum(c["best_cutoff"] == float(cutoff) for c in some)
                ratios = np.array([m["error"] / c["best"] for m, c in zip(each, some)])
                print(f"{cutoff + ' Hz':15} {len(some):5}  {covered(each):24} "
                      f"{sum(m['wrong'] > 0 for m in each):10}  {best:11}  "
                      f"{100 * np.mean(ratios <= AIM):11.1f} %  {np.median(ratios):7.3g}")


def shown(x):
    return x if isinstance(x, str) else f"{x:g}"


def summary(o):
    cells = []
    for path in o.files:
        with open(path, encoding="utf-8") as file:
            cells += [json.loads(text) for text in file]
    for key in ("robot", "motion", "rate", "noise"):
        wanted = getattr(o, key)
        if wanted:
            cells = [c for c in cells if shown(c[key]) in wanted.split(",")]
    if o.seeds:
        return over_seeds(cells)
    summarise(cells, o.manual_coverage, o.hardest)
    return 0


# check -----------------------------------------------------------------------------------------


def check(o):
    """Compares the efforts with vectors, measures the interpolation, and recovers known parameters."""
    o.command = copied(o.regen, o.cache)
    regen, failed = Regen(o.command), 0

    def aim(what, value, most):
        nonlocal failed
        failed += not value <= most
        print(f"{'ok' if value <= most else 'MISSED':7} {what}: {value:.2g} (at most {most:g})", flush=True)

    for name in o.robots:
        path = spec_file(name, o.cache)
        kept = robots.ROOT / "tests/fixtures/vectors" / f"{name.split('+')[0]}.json"
        if "+" not in name and kept.is_file():
            aim(f"{name}, efforts of the vectors", vectors(robots.Robot(path), json.loads(kept.read_text())), 1e-10)
        run = robots.Run(path, "start", 0, o.time, o.cache)
        aim(f"{name}, interpolated efforts", interpolation(run), 1e-7)
        base = regen.base(path)
        truth, w = run.combinations(base)
        inside = intervals = error = 0
        with tempfile.TemporaryDirectory() as folder:
            log = pathlib.Path(folder) / "log.csv"
            # errors of one log are correlated, so several are needed for the intervals
            for draw in range(LOGS):
                write(log, run, *rows(run, 1000, "white:1e-9", 1e-3, np.random.default_rng(draw)))
                found, text, _ = regen.identify(path, log, ["--butterworth", "4,30", "--no-suspicion"])
                figures = judged(found, base, truth, w, run.test_efforts)
                if figures is None:
                    aim(f"{name}, no answer ({text.strip()[:100]})", np.inf, 0)
                    break
                error = max(error, figures["error"])
                inside, intervals = inside + figures["inside"], intervals + figures["intervals"]
            else:
                aim(f"{name}, error of recovered parameters in percent", error, 0.1)
                aim(f"{name}, part of the intervals without the truth", 1 - inside / intervals, 0.12)
    return failed > 0


def vectors(robot, kept):
    """The largest error of efforts at states computed by Newton's method on frames, relative."""
    worst = 0
    for state in kept["states"]:
        q, v, a = (np.array(state[k]) for k in ("q", "qd", "qdd"))
        phi = np.array(state["phi"])[: 10 * len(robot.bodies)]
        ind = robot.independent
        x, v2, a2, slopes = robot.states(np.zeros(1), q[None, ind], v[None, ind], a[None, ind], q)
        tau = np.array(state["tau"])
        by_regressor = (robot.regressor(x, v2, a2, slopes) @ phi)[0]
        robot.carry(phi)
        by_recursion = robot.efforts(x, v2, a2, slopes)[0]
        for label, value in zip(kept["parameters"], state["phi"]):
            if label.startswith("J("):
                k = ind.index(robot.coordinates.index(label[2:-1]))
                by_regressor[k] += value * a[ind][k]
                by_recursion[k] += value * a[ind][k]
        for mine in (by_regressor, by_recursion):
            worst = max(worst, np.abs(mine - tau).max() / np.abs(tau).max())
    return worst


def interpolation(run):
    """The largest error of interpolated efforts of rigid bodies, relative to the largest effort."""
    t = np.sort(np.random.default_rng(3).uniform(2, run.motion.time, 200))
    robot = run.robot
    near = robot.states(np.zeros(1), *run.motion.at(np.zeros(1)), robot.start)[0][0]
    q, v, a, slopes = robot.states(t, *run.motion.at(t), near)
    robot.carry(run.phi)
    exact = robot.efforts(q, v, a, slopes)
    more, run.more = run.more, np.zeros(0)
    found = run.at(t)[1]
    run.more = more
    return np.abs(found - exact).max() / np.abs(exact).max()


def over_seeds(cells):
    """A line for each robot, motion, rate and noise: its errors over all seeds beside those of one filter for all of them.

    Of six errors of one log the smallest is so partly by chance; over many seeds the best filter is the one that a
    person would find.
    """
    groups = collections.defaultdict(list)
    for c in cells:
        if c["answered"] and c.get("manual"):
            groups[c["robot"], c["motion"], c["rate"], c["noise"]].append(c)

    def size(errors):
        return float(np.sqrt(np.mean(np.square(errors))))

    ratios, inside, intervals, wrong, logs = [], 0, 0, 0, 0
    for key, own in groups.items():
        cutoffs = set.intersection(*(set(c["manual"]) for c in own))
        best, cutoff = min((size([c["manual"][k]["error"] for c in own]), k) for k in cutoffs)
        error, floor = size([c["error"] for c in own]), size([c["floor"] for c in own])
        held, whole = sum(c["inside"] for c in own), sum(c["intervals"] for c in own)
        off = sum(c["wrong"] for c in own)
        ratios.append(error / best)
        inside, intervals, wrong, logs = inside + held, intervals + whole, wrong + off, logs + len(own)
        print(f"{key[0]} {key[1]} {key[2]:g} Hz {key[3]}, {len(own)} seeds: {error:.3g} %, one filter {best:.3g} % ({cutoff} Hz), "
              f"ratio {error / best:.2f}, floor {floor:.3g} %, inside {100 * held / max(1, whole):.1f} %, wrong {off}")
    if ratios:
        print(f"{len(ratios)} groups of {logs} logs: ratio at most {AIM} in {sum(x <= AIM for x in ratios)}, geometric mean "
              f"{np.exp(np.mean(np.log(ratios))):.2f}, most {max(ratios):.2f}; inside {100 * inside / intervals:.1f} % "
              f"of {intervals}, wrong {wrong}")
    return 0


def main():
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = p.add_subparsers(dest="command_name", required=True)
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--regen", default=os.environ.get("REGEN", str(robots.ROOT / "target/release/regen")))
    common.add_argument("--robots", default=ROBOTS)
    common.add_argument("--time", type=float, default=10, help="length of the logs, s")
    common.add_argument("--cache", default=str(pathlib.Path(tempfile.gettempdir()) / "regen-defaults"))
    r = commands.add_parser("run", parents=[common], help="measure cells")
    r.add_argument("--rates", default="50,100,500,1000,4000")
    r.add_argument("--noise", default=NOISE)
    r.add_argument("--motions", default="fourier,start,ptp,sweep")
    r.add_argument("--seeds", type=int, default=1)
    r.add_argument("--effort", type=float, default=0.02, help="noise of the efforts over their rms")
    r.add_argument("--options", default="", help="options of the run that is measured")
    r.add_argument("--no-manual", dest="manual", action="store_false", help="without the manual filters")
    r.add_argument("--jobs", type=int, default=1)
    r.add_argument("--out", help="append the figures to this file")
    s = commands.add_parser("summary", help="summarise files of --out")
    s.add_argument("files", nargs="+")
    s.add_argument("--manual-coverage", action="store_true", help="also the coverage of each manual cutoff")
    s.add_argument("--seeds", action="store_true", help="in place of all, errors over the seeds of each robot, motion, rate and noise")
    s.add_argument("--hardest", type=int, default=10)
    for key in ("robot", "motion", "rate", "noise"):
        s.add_argument(f"--{key}", help="only these, separated by commas")
    commands.add_parser("check", parents=[common], help="check this harness")
    o = p.parse_args()
    if o.command_name == "summary":
        return summary(o)
    o.robots = o.robots.split(",")
    if o.command_name == "check":
        return check(o)
    o.rates = [float(x) for x in o.rates.split(",")]
    o.noise, o.motions, o.options = o.noise.split(","), o.motions.split(","), o.options.split()
    for noise in o.noise:
        parts(noise)
    return run_cells(o)


if __name__ == "__main__":
    sys.exit(main())
