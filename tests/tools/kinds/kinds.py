#!/usr/bin/env python3
"""What `regen identify SPEC LOG` says of logs with planted mistakes, and whether its advice mends them.

The logs are those of `tests/tools/defaults`, simulated without regen, so that the true parameters are known. Into
each one to three mistakes of `mistakes.py` are planted at random; others are left as they are.

    pip install -r tests/tools/defaults/requirements.txt
    python3 tests/tools/kinds/kinds.py run --logs 200 --clean 100 --seed 1 --out found.jsonl
    python3 tests/tools/kinds/kinds.py show found.jsonl

A log is `told` if the first answer, which may be an error, has a warning or an error that names a column or the
kind of one of its mistakes; `harmless` if it was not told, the error of the efforts on another motion is at most 1.25
times that of the log without mistakes, and as many values are within their intervals (but for one in ten);
`traceless` if it is neither, but the residuals are at most 1.1 times those without mistakes and no value is
implausible: such a log is that of another robot, and no one can tell. All else is `silent`.

The remedy is what the messages print: assignments of columns, other options, keys of the spec, numbers to subtract.
All that is printed is applied, and the command asked again, up to `ROUNDS` times. The remedy `works` if then the log
is as harmless as above; `nearly` if the error is larger than that but below the noise of the efforts (`--effort`), as
no log tells a number that is missing exactly, not even to an `offset: true` in its spec; `none` if no message had any
to apply. Logs of which something is lost (columns that are constant, doubled, of another run, noise or velocities, and the
unit of all efforts) are not counted there.
"""

import argparse
import collections
import concurrent.futures
import json
import os
import pathlib
import re
import resource
import shlex
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "defaults"))
import defaults  # noqa: E402
import numpy as np  # noqa: E402
import robot as robots  # noqa: E402
import yaml  # noqa: E402

import mistakes  # noqa: E402

ROBOTS = "puma560,scara+friction,fork+friction+rotor,fivebar,3rps"
MOTIONS = ("fourier", "start", "ptp", "sweep")
NOISE = ("white:1e-5", "white:1e-4", "steps:1e-4")
ROUNDS = 4
LOST = {
    "constant_column", "doubled_column", "other_run", "noise_alone", "swapped_position_and_velocity", "unit_of_efforts"
}
TIMED = 7  # one of so many logs is fitted without the checks, too; no multiple of the number of robots
# the options of advice that are applied as they are printed
OPTION = re.compile(
    r"--column (?:'[^']+'|[\w.]+=[\w.:*/^-]*\w)|--delay \w+=[\d.]*\d|--(?:problems|outliers|saturated|stuck|gaps|standstill|delay|huber"
    r"|velocities)[ =][\w.,:-]*\w|--(?:rate|fourier|butterworth)[ =][\d.]+"
)


def asked(command, spec, log, options):
    """The JSON, the messages and the processor time of an answer, s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    words = [str(command), "identify", str(spec), str(log), "--format", "json", *options]
    try:
        ran = subprocess.run(words, capture_output=True, text=True, check=False, timeout=120)
    except subprocess.TimeoutExpired:
        return {}, "HANGS", 120, -1
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    found = json.loads(ran.stdout) if ran.stdout.startswith("{") else {}
    return found, ran.stderr, seconds, ran.returncode


def warned(text):
    """The warnings and errors, each with the lines that belong to it, without the notes."""
    out, keep = [], False
    for line in text.splitlines():
        if re.match(r"(warning|error)", line):
            keep = True
            out.append(line)
        elif re.match(r"[a-z]+:", line) and not line.startswith(" "):
            keep = False
        elif keep and out:
            out[-1] += "\n" + line
    return out


def tells(text, columns, words):
    """Whether a message names one of the columns, or the kind."""
    said = [t for t in warned(text) if "too few to know how uncertain" not in t]

    def named(names, text):
        return any(re.search(rf"(?<!\w){re.escape(c)}(?!\w)", text) for c in names)

    # what is left of efforts is told by their joints
    left = next((t for t in said if "does not explain these efforts" in t), None)
    joints = [re.sub("^(tau|qd)_", "", c) for c in columns]
    if left and (not columns or named(joints, left)):
        return True
    said = "\n".join(said)
    return named(columns, said) or re.search(words, said) is not None


def good(figures, clean, most=0):
    """Whether an answer is as good as that of the log without mistakes, or its error at most `most` %."""
    if figures is None or clean is None:
        return False
    share = figures["inside"] / max(1, figures["intervals"])
    before = clean["inside"] / max(1, clean["intervals"])
    return figures["error"] <= max(most, defaults.AIM * clean["error"]) and share >= before - 0.1


class Trial:
    """One log with its mistakes."""

    def __init__(self, o, seed):
        random = np.random.default_rng([o.seed, seed])
        self.name = o.robots[seed % len(o.robots)]
        motion = str(random.choice(MOTIONS))
        self.rate = float(random.choice(o.rates))
        noise = str(random.choice(o.noise)) + ("+vel:1e-3" if random.uniform() < 0.3 else "")
        self.title = f"{self.name} {motion} {self.rate:g} Hz {noise} seed {o.seed}/{seed}"
        self.spec = defaults.spec_file(self.name, o.cache)
        self.run = robots.Run(self.spec, motion, int(random.integers(o.motions)), o.time, o.cache)
        self.base = defaults.Regen(o.command).base(self.spec)
        self.truth, self.w = self.run.combinations(self.base)
        t, q, v, z = defaults.rows(self.run, self.rate, noise, o.effort, random)
        c = self.run.robot.names_independent
        names = ["t", *c, *(["qd_" + x for x in c] if v.shape[1] else []), *("tau_" + x for x in c)]
        joints = {x: self.run.robot.joint[x]["type"] for x in c}
        self.log = mistakes.Log(names, np.column_stack([t, q, v, z]), self.spec.read_text(), joints)
        self.random = random

    def judged(self, found):
        return defaults.judged(found, self.base, self.truth, self.w, self.run.test_efforts)

    def plant(self, wanted):
        """Plants mistakes; returns the names, the columns and the words of each."""
        count = int(self.random.choice([1, 2, 3], p=[0.5, 0.3, 0.2]))
        kinds = [k for k in mistakes.KINDS if not wanted or k.__name__ in wanted]
        kinds = [k for k in kinds if k.fits(self.log)]
        chosen = self.random.permutation(len(kinds))[: count if not wanted else 1]
        return [(kinds[k].__name__, *kinds[k](self.log, self.random)) for k in sorted(chosen)]


def advised(text, options, log):
    """Applies what the messages advise: the new options, and whether anything was to be applied."""
    said = "\n".join(warned(text))
    more, changed, seen = dict(options), False, set()
    columns = [x for x in OPTION.findall(said) if x.startswith("--column")]
    # what is read wrongly is corrected before rows are left out
    for found in columns or OPTION.findall(said):
        is_named = found.startswith(("--column", "--delay "))
        words = shlex.split(found if is_named else found.replace("=", " ", 1))
        if len(words) != 2:
            continue
        key = (words[0], words[1].split("=")[0]) if is_named else words[0]
        # of alternatives the first one
        if key not in seen and more.get(key) != words:
            more[key], changed = words, True
        seen.add(key)
    new = re.search(r"`(gravity: \[[^`]*\])`", said)
    if new:
        log.spec = re.sub(r"(?m)^gravity:(.*\n)(- .*\n)*", new[1] + "\n", log.spec)
        changed = True
    for joints in re.findall(r"[Gg]ive ((?:`\w+`(?:, | and )?)+) `offset: true`", said):
        spec = yaml.load(log.spec, Loader=yaml.BaseLoader)
        for limb in spec["limbs"]:
            for joint in limb["joints"]:
                if f"`{joint.get('name')}`" in joints:
                    joint["offset"], changed = "true", True
        log.spec = robots.Plain.write(spec)
    for value, column in re.findall(r"(-?[\d.]+) from column `(\w+)`", said):
        if column in log.names:
            log.table[:, log.names.index(column)] -= float(value)
            changed = True
    return more, changed


def tried(job):
    """The figures of one log."""
    o, seed, clean = job
    trial = Trial(o, seed)
    out = {"log": trial.title, "robot": trial.name, "kinds": [], "command": o.command.name}
    with tempfile.TemporaryDirectory() as folder:
        path, spec = pathlib.Path(folder) / "log.csv", pathlib.Path(folder) / "robot.yaml"

        def ask(options=(), log=trial.log):
            log.write(path)
            spec.write_text(log.spec)
            return asked(o.command, spec, path, options)

        found, text, seconds, code = ask()
        before = trial.judged(found)
        out |= {"clean": before, "seconds": round(seconds, 3)}
        if clean:
            out |= {"code": code, "says": warned(text)}
            if seed % TIMED == 0:
                out["fit_seconds"] = round(ask(["--no-suspicion"])[2], 3)
            return out
        planted = trial.plant(o.kinds)
        if o.keep:
            kept = pathlib.Path(o.keep) / f"{o.seed}-{seed}"
            kept.mkdir(parents=True, exist_ok=True)
            trial.log.write(kept / "log.csv")
            (kept / "robot.yaml").write_text(trial.log.spec)
        out["kinds"] = [name for name, _, _ in planted]
        out["columns"] = [columns for _, columns, _ in planted]
        residual = found.get("relative_absolute")
        found, text, seconds, code = ask()
        after = trial.judged(found)
        told = [tells(text, columns, words) for _, columns, words in planted]
        out |= {"after": after, "code": code, "told": told, "says": warned(text), "seconds": round(seconds, 3)}
        out["residual"] = [residual, found.get("relative_absolute")]
        if code not in (0, 2, 3, 4, 5, 6):
            out["verdict"] = "crash" if text != "HANGS" else "hang"
        elif any(told):
            out["verdict"] = "told"
        elif good(after, before):
            out["verdict"] = "harmless"
        elif (code == 0 and residual and found.get("relative_absolute")
              and found["relative_absolute"] <= 1.1 * residual and not out["says"]):
            out["verdict"] = "traceless"
        else:
            out["verdict"] = "silent"
        if seed % TIMED == 0 and code == 0:
            out["fit_seconds"] = round(ask(["--no-suspicion"])[2], 3)
        options, rounds, changed = {}, 0, True
        while changed and rounds < ROUNDS and not good(after, before):
            options, changed = advised(text, options, trial.log)
            if changed:
                rounds += 1
                found, text, _, code = ask([w for words in options.values() for w in words])
                after = trial.judged(found)
        nearly = rounds and good(after, before, 100 * o.effort)
        out["remedy"] = "works" if good(after, before) else "nearly" if nearly else "fails" if rounds else "none"
        out |= {"rounds": rounds, "options": [w for words in options.values() for w in words], "mended": after}
        if rounds and out["remedy"] == "fails":
            out["says_last"] = warned(text)
    return out


def share(part, whole):
    return f"{100 * part / whole:5.1f} % ({part}/{whole})" if whole else "-"


def shown(rows):
    """Prints the table of many logs."""
    clean = [r for r in rows if not r["kinds"]]
    rows = [r for r in rows if r["kinds"]]
    false = [r for r in clean if [s for s in r["says"] if "too few to know" not in s]]
    print(f"{len(clean)} clean logs, {len(false)} with a warning or an error")
    for r in false:
        print(f"  {r['log']}: {r['says'][0].splitlines()[0][:200]}")
    print(f"{len(rows)} logs with mistakes")

    def line(name, some):
        count = collections.Counter(r["verdict"] for r in some)
        # what is not in the log is mended by no remedy
        whole = [r for r in some if not set(r["kinds"]) & LOST]
        remedy = collections.Counter(r["remedy"] for r in whole if r["verdict"] == "told")
        tried = remedy["works"] + remedy["nearly"] + remedy["fails"]
        heard = count["told"] + count["harmless"]
        print(f"{name:26} {len(some):5} {count['told']:6} {count['harmless']:9} {count['traceless']:10} "
              f"{count['silent']:7} {count['hang'] + count['crash']:6}  {share(heard, len(some)):20} "
              f"{share(remedy['works'], tried):20} {share(remedy['works'] + remedy['nearly'], tried):20} {remedy['none']:6}")

    print(f"{'':26} {'logs':>5} {'told':>6} {'harmless':>9} {'traceless':>10} {'silent':>7} {'crash':>6}  "
          f"{'told or harmless':20} {'remedy works':20} {'or nearly':20} {'no remedy':>6}")
    for kind in mistakes.KINDS:
        some = [r for r in rows if r["kinds"] == [kind.__name__]]
        if some:
            line(kind.__name__, some)
    for count in (2, 3):
        some = [r for r in rows if len(r["kinds"]) == count]
        if some:
            line(f"{count} at once", some)
    line("all", rows)
    for name, some in (("with mistakes", rows), ("clean", clean)):
        ratios = [r["seconds"] / r["fit_seconds"] for r in some if r.get("fit_seconds")]
        if ratios:
            print(f"processor time over that of the fit, {name}: median {np.median(ratios):.2f}, most {max(ratios):.2f}, "
                  f"above 2: {share(sum(x > 2 for x in ratios), len(ratios))}")


def main():
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = p.add_subparsers(dest="command_name", required=True)
    r = commands.add_parser("run", help="try logs")
    r.add_argument("--regen", default=os.environ.get("REGEN", str(robots.ROOT / "target/release/regen")))
    r.add_argument("--robots", default=ROBOTS)
    r.add_argument("--logs", type=int, default=100, help="logs with mistakes")
    r.add_argument("--clean", type=int, default=0, help="logs without")
    r.add_argument("--kinds", default="", help="only these, one in each log")
    r.add_argument("--only", default="", help="only the logs of these numbers")
    r.add_argument("--seed", type=int, default=1)
    r.add_argument("--motions", type=int, default=3, help="motions of each kind and robot")
    r.add_argument("--rates", default="100,200", help="rates of the rows, Hz")
    r.add_argument("--noise", default=",".join(NOISE), help="noise of the positions, as of defaults.py")
    r.add_argument("--time", type=float, default=10)
    r.add_argument("--effort", type=float, default=0.02, help="noise of the efforts over their rms")
    r.add_argument("--cache", default=str(pathlib.Path(tempfile.gettempdir()) / "regen-defaults"))
    r.add_argument("--keep", help="write the logs and specs to this folder")
    r.add_argument("--jobs", type=int, default=1)
    r.add_argument("--out", help="append the figures to this file")
    s = commands.add_parser("show", help="the table of files of --out")
    s.add_argument("files", nargs="+")
    s.add_argument("--verdict", default="silent,crash,hang", help="list the logs of these verdicts")
    s.add_argument("--remedy", default="", help="list the logs whose remedy is so")
    o = p.parse_args()
    if o.command_name == "show":
        rows = [json.loads(text) for path in o.files for text in pathlib.Path(path).read_text().splitlines()]
        shown(rows)
        for row in rows:
            listed = row.get("verdict") in o.verdict.split(",")
            if row["kinds"] and (listed or (row["verdict"] == "told" and row["remedy"] in o.remedy.split(","))):
                print(json.dumps(row))
        return 0
    o.robots, o.kinds = o.robots.split(","), [k for k in o.kinds.split(",") if k]
    o.rates, o.noise = [float(rate) for rate in o.rates.split(",")], o.noise.split(",")
    o.command = defaults.copied(o.regen, o.cache)
    jobs = [(o, k, False) for k in range(o.logs)] + [(o, 10**6 + k, True) for k in range(o.clean)]
    if o.only:
        jobs = [(o, int(k), False) for k in o.only.split(",")]
    rows, out = [], open(o.out, "a", encoding="utf-8") if o.out else None

    def keep(row):
        rows.append(row)
        print(f"{row['log']}: {', '.join(row['kinds']) or 'clean'}: {row.get('verdict', len(row['says']))}, "
              f"{row.get('remedy', '')}", flush=True)
        if out:
            out.write(json.dumps(row) + "\n")
            out.flush()

    if o.jobs > 1:
        with concurrent.futures.ProcessPoolExecutor(o.jobs) as pool:
            for row in pool.map(tried, jobs):
                keep(row)
    else:
        for job in jobs:
            keep(tried(job))
    shown(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
