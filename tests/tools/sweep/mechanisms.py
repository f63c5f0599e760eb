"""Draws mechanisms at random, and evaluates what `regen base` prints of them at other geometries.

    python -m venv venv && venv/bin/pip install pin numpy pyyaml
    venv/bin/python tests/tools/sweep/mechanisms.py --regen target/release/regen --count 500 --seed 1
    venv/bin/python tests/tools/sweep/mechanisms.py --regen target/release/regen robots/*.yaml

Arms, trees, planar and spherical loops, spatial loops and platforms on legs have random lengths and
angles, each with a name in `geometry:`. The expressions that `regen base` prints are evaluated at
other values of these names. There, loops are closed by Newton's method, states are drawn and the regressor
W is computed, all by Pinocchio and the description alone (`vectors/forces.py`, `defaults/robot.py`). The
printed combinations hold if W = W_kept K, where K has the evaluated factors, and the printed rank is the
rank of W. One line is printed for each mechanism that fails or has rows that are neither derived nor proven,
and the counts at the end.
"""

import argparse
import collections
import concurrent.futures
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile

import numpy as np
import yaml

TOOLS = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TOOLS / "defaults"), str(TOOLS / "vectors")]
from forces import FUNCTIONS  # noqa: E402
from robot import Plain, Robot, Unreachable  # noqa: E402

GEOMETRIES = 10
LEAST_GEOMETRIES = 3
CHANGE = 0.15  # of each name, of its value
SPARE = 1.3  # equations over the rank
SPAN = 1e-9  # of W - W_kept K over W
GAP = 1e-4  # of singular values: the last of the rank over the first behind it is above the inverse of it
WORST = 1e-3  # of the dependent columns' singular values at a drawn mechanism
TRIES = 60
REACH, STEPS = 0.3, 3  # of the independent coordinates around home


class Draft:
    """A description that is drawn: its names, limbs and cuts."""

    def __init__(self, random):
        self.random = random
        self.geometry, self.limbs, self.cuts = {}, [], []
        self.joints = self.bodies = 0

    def length(self, low=0.2, high=0.6):
        name = f"l{len(self.geometry) + 1}"
        self.geometry[name] = f"{self.random.uniform(low, high):.3f}"
        return name

    def signed(self, size=0.4):
        return ("-" if self.random.random() < 0.5 else "") + self.length(0.1, size)

    def angle(self):
        """A named angle, or a right one."""
        kind = self.random.integers(6)
        if kind < 3:
            return ["0", "pi/2", "-pi/2"][kind]
        name = f"al{len(self.geometry) + 1}"
        self.geometry[name] = f"{self.random.uniform(0.3, 1.2):.3f}"
        return name

    def tilt(self, low=0.3, high=0.9):
        name = f"al{len(self.geometry) + 1}"
        self.geometry[name] = f"{self.random.uniform(low, high):.3f}"
        return name

    def maybe(self, chance, make, other="0"):
        return make() if self.random.random() < chance else other

    def row(self, dense=0.5):
        return {"alpha": self.angle(), "a": self.maybe(dense, self.signed), "d": self.maybe(dense, self.signed)}

    def joint(self, kind, body=True, **more):
        self.joints += 1
        out = {"name": f"q{self.joints}", "type": kind, **more}
        if body:
            self.bodies += 1
            out["body"] = f"b{self.bodies}"
        return out

    def limb(self, joints, **more):
        self.limbs.append({"name": f"limb{len(self.limbs) + 1}", **more, "joints": joints})
        return joints

    def cut(self, kind, first, second):
        self.cuts.append({"name": f"c{len(self.cuts) + 1}", "joint": kind, "between": [first, second]})

    def spec(self, home=None, actuated=()):
        limbs = [{**limb, "joints": [
            {**joint, **({"actuated": "true"} if joint["name"] in actuated else {})} for joint in limb["joints"]
        ]} for limb in self.limbs]
        out = {"name": "drawn", "geometry": self.geometry, "limbs": limbs}
        if self.cuts:
            out["cuts"] = self.cuts
            out["home"] = home
        return out


# families --------------------------------------------------------------------------------------

def chain(draft, count, dense=0.5):
    kinds = ["revolute"] * 4 + ["prismatic"]
    return [draft.joint(str(draft.random.choice(kinds)), dh=draft.row(dense)) for _ in range(count)]


def arm(draft):
    draft.limb(chain(draft, int(draft.random.integers(2, 7))))


def tree(draft):
    trunk = draft.limb(chain(draft, int(draft.random.integers(1, 4))))
    for _ in range(int(draft.random.integers(1, 4))):
        draft.limb(chain(draft, int(draft.random.integers(1, 4))),
                   **{"from": str(draft.random.choice([j["body"] for j in trunk]))},
                   base={"xyz": [draft.signed(), "0", draft.maybe(0.5, draft.signed)], "rpy": [draft.angle(), "0", "0"]})


def planar_leg(draft, kinds, reach):
    """Joints of a leg in its plane: turns about z, shifts along x."""
    out = []
    for k, kind in enumerate(kinds):
        before = out[-1]["type"] if out else None
        if kind == "revolute":
            row = {} if before is None else {"origin": {"xyz": [draft.length(*reach), "0", "0"]}}
            out.append(draft.joint("revolute", **row))
        else:
            origin = {"xyz": [draft.maybe(0.5, draft.signed), "0", "0"]}
            out.append(draft.joint("prismatic", axis="x", origin=origin))
    return out


def planar_base(draft, k, legs):
    turn = 2 * math.pi * k / legs
    size = 0.5
    names = []
    for value in (size * math.cos(turn), size * math.sin(turn)):
        name = f"l{len(draft.geometry) + 1}"
        draft.geometry[name] = f"{value + draft.random.uniform(-0.1, 0.1):.3f}"
        names.append(name)
    return {"xyz": [*names, "0"]}


PLANAR = [["revolute", "revolute"], ["revolute", "prismatic"], ["prismatic", "revolute"]]


def planar_loop(draft):
    """A four-bar or five-bar, with shifts in places, and possibly an arm on one of its bodies."""
    first = draft.limb(planar_leg(draft, PLANAR[draft.random.integers(3)], (0.3, 0.6)), base=planar_base(draft, 0, 2))
    count = 1 if draft.random.random() < 0.5 else 2
    kinds = PLANAR[draft.random.integers(3)][:count] if count == 2 else [["revolute", "prismatic"][draft.random.integers(2)]]
    second = draft.limb(planar_leg(draft, kinds, (0.3, 0.6)), base=planar_base(draft, 1, 2))
    draft.cut("revolute", end(draft, first[-1], plane=True), end(draft, second[-1], plane=True))
    if draft.random.random() < 0.4:
        body = str(draft.random.choice([j["body"] for j in first + second]))
        draft.limb(chain(draft, int(draft.random.integers(1, 4))), **{"from": body},
                   base={"xyz": [draft.signed(), "0", "0"], "rpy": [draft.angle(), "0", "0"]})


def end(draft, joint, plane=False, tall=0.3):
    """A point of a joint's body."""
    z = "0" if plane else draft.maybe(tall, draft.signed)
    return {"body": joint["body"], "xyz": [draft.length(), draft.maybe(0.4, draft.signed), z]}


def planar_platform(draft):
    kinds = PLANAR[draft.random.integers(3)]
    first = draft.limb(planar_leg(draft, kinds, (0.3, 0.5)) + planar_leg(draft, ["revolute"], (0.3, 0.5)), base=planar_base(draft, 0, 3))
    first[-1]["origin"] = {"xyz": [draft.length(0.3, 0.5), "0", "0"]}
    for k in (1, 2):
        leg = draft.limb(planar_leg(draft, PLANAR[draft.random.integers(3)], (0.3, 0.5)), base=planar_base(draft, k, 3))
        draft.cut("revolute", {"body": first[-1]["body"], "xyz": [draft.signed(0.25), draft.signed(0.25), "0"]},
                  {"body": leg[-1]["body"], "xyz": [draft.length(0.3, 0.5), "0", "0"]})


def turned(draft, kind="revolute"):
    return draft.joint(kind, origin={"rpy": [draft.tilt(), "0", "0"]})


def spherical(draft):
    """All axes of a loop of four or five turns through one point, possibly with an arm on it."""
    first = draft.limb([draft.joint("revolute"), turned(draft)])
    joints = [draft.joint("revolute")]
    if draft.random.random() < 0.5:
        joints.append(turned(draft))
    second = draft.limb(joints, base={"rpy": [draft.tilt(0.6, 1.3), draft.maybe(0.5, draft.tilt), "0"]})
    draft.cut("revolute", {"body": first[-1]["body"], "rpy": [draft.tilt(), "0", "0"]},
              {"body": second[-1]["body"], "rpy": [draft.tilt(), "0", "0"]})


def spatial_loop(draft):
    """One loop of turns, shifts and a universal joint, closed by a spherical joint."""
    one = ["revolute", "prismatic"]
    first = [draft.joint(str(draft.random.choice(one)), dh=draft.row()),
             draft.joint("universal", origin={"xyz": [draft.length(), "0", draft.maybe(0.3, draft.signed)]})]
    draft.limb(first)
    second = [draft.joint(str(draft.random.choice(one)), dh=draft.row())]
    if draft.random.random() < 0.4:
        second.append(draft.joint("revolute", dh=draft.row(0.8)))
    draft.limb(second, base={"xyz": [draft.signed(0.6), draft.signed(0.6), draft.maybe(0.5, draft.signed)], "rpy": [draft.angle(), "0", "0"]})
    draft.cut("spherical", end(draft, first[-1]), end(draft, second[-1]))


LEGS = {
    "RPS": lambda d: [d.joint("revolute"), d.joint("prismatic", axis="x")],
    "PRS": lambda d: [d.joint("prismatic"), d.joint("revolute", origin={"rpy": ["pi/2", "0", "0"]})],
    "RRS": lambda d: [d.joint("revolute"), d.joint("revolute", origin={"xyz": [d.length(0.3, 0.5), "0", "0"]})],
    "RUS": lambda d: [d.joint("revolute"), d.joint("universal", origin={"xyz": [d.length(0.2, 0.4), "0", "0"]})],
    "UPS": lambda d: [d.joint("universal"), d.joint("prismatic", body=True)],
    "URS": lambda d: [d.joint("universal"), d.joint("revolute", origin={"xyz": [d.length(0.3, 0.5), "0", "0"]})],
}


def platform(draft):
    """A platform on three legs of one kind, or of mixed ones, which it meets at spherical joints."""
    kinds = list(LEGS)
    one = str(draft.random.choice(kinds))
    mixed = draft.random.random() < 0.4
    if one == "UPS" and not mixed and draft.random.random() < 0.5:
        legs = int(draft.random.integers(4, 7))
    else:
        legs = 3
    body = None
    for k in range(legs):
        kind = str(draft.random.choice(kinds)) if mixed else one
        joints = LEGS[kind](draft)
        base = planar_base(draft, k, legs)
        turn = f"al{len(draft.geometry) + 1}"
        draft.geometry[turn] = f"{2 * math.pi * k / legs + math.pi + draft.random.uniform(-0.3, 0.3):.3f}"
        base["rpy"] = ["pi/2" if kind[0] == "R" else "0", "0", turn]
        tip = ["0", "0", draft.length(0.2, 0.4)] if kind == "UPS" else [draft.length(0.3, 0.5), "0", "0"]
        if k == 0:
            joints.append(draft.joint("spherical", origin={"xyz": tip}))
            body = joints[-1]["body"]
        draft.limb(joints, base=base)
        if k:
            draft.cut("spherical", {"body": body, "xyz": [draft.signed(0.3), draft.signed(0.3), draft.maybe(0.3, draft.signed)]},
                      {"body": joints[-1]["body"], "xyz": tip})


def translating(draft):
    """Two planar legs in planes across each other: what they carry only moves along a line."""
    first = draft.limb(planar_leg(draft, ["revolute"] * 3, (0.3, 0.5)), base={"rpy": ["pi/2", "0", "0"]})
    second = draft.limb(planar_leg(draft, ["revolute"] * 2, (0.3, 0.5)),
                        base={"xyz": [draft.length(0.1, 0.3), draft.length(0.1, 0.3), "0"], "rpy": ["pi/2", "0", "pi/2"]})
    draft.cut("revolute", {"body": first[-1]["body"], "xyz": [draft.length(0.1, 0.3), "0", draft.length(0.1, 0.3)], "rpy": ["0", "pi/2", "0"]},
              {"body": second[-1]["body"], "xyz": [draft.length(0.3, 0.5), "0", "0"]})


def parallelogram(draft):
    """A bar on two equal cranks, in the plane, possibly with an arm on it."""
    crank, bar = draft.length(), draft.length()
    first = draft.limb([draft.joint("revolute"), draft.joint("revolute", origin={"xyz": [crank, "0", "0"]})])
    second = draft.limb([draft.joint("revolute")], base={"xyz": [bar, "0", "0"]})
    draft.cut("revolute", {"body": first[-1]["body"], "xyz": [bar, "0", "0"]}, {"body": second[-1]["body"], "xyz": [crank, "0", "0"]})
    draft.start = {first[0]["name"]: 1.0, first[1]["name"]: -1.0, second[0]["name"]: 1.0}
    if draft.random.random() < 0.6:
        draft.limb(chain(draft, int(draft.random.integers(1, 4))), **{"from": first[-1]["body"]},
                   base={"xyz": [draft.signed(), "0", "0"], "rpy": [draft.angle(), "0", "0"]})


FAMILIES = [arm, tree, planar_loop, planar_platform, spherical, spatial_loop, platform, translating, parallelogram]
WEIGHTS = [2, 2, 4, 3, 2, 3, 5, 1, 2]


def drawn(seed, path):
    """Writes a mechanism that closes with the mobility of its closed state; returns its family."""
    random = np.random.default_rng([seed, 11])
    for _ in range(TRIES):
        family = FAMILIES[random.choice(len(FAMILIES), p=np.array(WEIGHTS) / sum(WEIGHTS))]
        draft = Draft(random)
        family(draft)
        if not draft.cuts:
            names = [j["name"] for limb in draft.limbs for j in limb["joints"]]
            write(path, draft.spec(actuated=names))
            return family.__name__
        found = closed_draft(draft, path)
        if found is not None:
            write(path, found)
            return family.__name__
    raise SystemExit(f"seed {seed}: no mechanism closes")


def write(path, spec):
    path.write_text(Plain.write(spec))


def closed_draft(draft, path):
    """The spec with a closed home and actuated joints on which all others depend."""
    random = draft.random
    singles = [j["name"] for limb in draft.limbs for j in limb["joints"] if j["type"] in ("revolute", "prismatic")]
    write(path, draft.spec({}, singles))
    robot = Loose(path)
    start = getattr(draft, "start", None)
    for _ in range(6):
        guess = random.uniform(-1, 1, len(robot.coordinates))
        if start:
            guess = np.array([start.get(c, 0.0) for c in robot.coordinates])
        try:
            q = robot.closed_freely(guess)
        except SystemExit:
            continue
        q = (q + np.pi) % (2 * np.pi) - np.pi if np.abs(q).max() > 4 else q
        if np.abs(robot.constraint(q)[0]).max() > 1e-10 or robot.is_opposite(q):
            continue
        s = np.linalg.svd(robot.constraint(q)[1], compute_uv=False)
        rank = int((s > 1e-8 * s[0]).sum())
        mobility = len(q) - rank
        if not 0 < mobility <= len(singles) or rank == 0 or s[rank - 1] < WORST * s[0]:
            continue
        best = None
        for _ in range(40):
            chosen = sorted(random.choice(len(singles), mobility, replace=False))
            names = [singles[k] for k in chosen]
            rest = [k for k, c in enumerate(robot.coordinates) if c not in names]
            s = np.linalg.svd(robot.constraint(q)[1][:, rest], compute_uv=False)
            worst = s[rank - 1] / s[0] if len(s) >= rank and s[0] > 0 else 0
            if best is None or worst > best[0]:
                best = (worst, names)
        if best[0] < 10 * WORST:
            continue
        home = {c: f"{x:.9f}" for c, x in zip(robot.coordinates, q)}
        return draft.spec(home, best[1])
    return None


class Loose(Robot):
    """A mechanism that is not closed yet."""

    def __init__(self, path):
        super(Robot, self).__init__(path)
        self.ends = [
            [(self.model.frames[f].parentJoint, self.model.frames[f].placement) for f in frames]
            for _, frames in self.cuts
        ]

    def is_opposite(self, q):
        """Whether the axes of a revolute cut point in opposite directions, which descriptions do not allow."""
        self.rows(q, 0 * q, 0 * q)
        turns = [[self.data.oMf[f].rotation[:, 2] for f in frames] for kind, frames in self.cuts if kind == "revolute"]
        return any(a @ b < 0 for a, b in turns)


# the check -------------------------------------------------------------------------------------

def scalar(text, names):
    return float(eval(text.replace("^", "**"), {**FUNCTIONS, **names}))  # noqa: S307 printed by the command


def changed(spec, random, found):
    """The spec with other values of its names that are numbers; those whose equality is said to be used stay equal."""
    geometry = {}
    changes = {name: 0.0 for name in found["held"]}
    for names in found["equal_by_value"]:
        change = random.uniform(-CHANGE, CHANGE)
        for name in re.findall(r"[A-Za-z_]\w*", names):
            changes.setdefault(name, change)
    for name, text in spec["geometry"].items():
        try:
            value = float(text)
        except ValueError:
            geometry[name] = text
            continue
        change = changes.get(name)
        geometry[name] = repr(value * (1 + (random.uniform(-CHANGE, CHANGE) if change is None else change)))
    return {**spec, "geometry": geometry}


def sampled(robot, random, equations):
    """W at closed states."""
    rows = []
    n, ind, dep = len(robot.coordinates), robot.independent, robot.dependent
    while len(rows) * len(ind) < equations:
        q, v, a = np.zeros((3, n))
        slopes = np.zeros((len(dep), len(ind)))
        v[ind], a[ind] = random.normal(size=(2, len(ind)))
        if not dep:
            q = random.normal(size=n)
        else:
            q = reached(robot, random)
            jacobian = robot.constraint(q)[1]
            inverse = np.linalg.pinv(jacobian[:, dep], rcond=1e-9)
            slopes = -inverse @ jacobian[:, ind]
            v[dep] = slopes @ v[ind]
            a[dep] = slopes @ a[ind] - inverse @ robot.rows(q, v, np.zeros(n))[2]
        rows.append(robot.regressor([q], [v], [a], [slopes])[0])
    return np.concatenate(rows)


def reached(robot, random):
    """A closed state on the branch of home."""
    size = REACH
    for _ in range(TRIES):
        goal = robot.start[robot.independent] + size * random.uniform(-1, 1, len(robot.independent))
        q = robot.start.copy()
        try:
            for k in range(1, STEPS + 1):
                q[robot.independent] = robot.start[robot.independent] + (goal - robot.start[robot.independent]) * k / STEPS
                q = robot.newton(q)[0]
            return q
        except Unreachable:
            size *= 0.8
    raise SystemExit("no state is reached")


def judged(path, regen, seed):
    """What is wrong with the base parameters of a description, and the counts of its rows."""
    done = subprocess.run([regen, "base", path, "--format", "json", "--no-cache"], capture_output=True, text=True, timeout=600)
    if not done.stdout:
        return [f"no answer: {done.stderr.strip()[:300]}"], {}
    found = json.loads(done.stdout)
    said = [] if found["complete"] else [f"incomplete: {found['reason']}"]
    kinds = collections.Counter(f"{row['layer']} {row['factors']}" for row in found["base"])
    spec = yaml.load(path.read_text(), Loader=yaml.BaseLoader)
    random = np.random.default_rng([seed, 12])
    labels = found["parameters"]
    kept = [labels.index(row["label"]) for row in found["base"]]
    # with rows that hold at the spec's values only, all are compared there alone
    everywhere = all(row["factors"] == "everywhere" for row in found["base"])
    tried = 0
    for _ in range(6 * GEOMETRIES):
        if tried == GEOMETRIES:
            break
        with tempfile.TemporaryDirectory() as folder:
            other = pathlib.Path(folder) / "other.yaml"
            # the first one is the mechanism itself
            write(other, changed(spec, random, found) if tried and everywhere else spec)
            try:
                robot = Robot(other)
                w = sampled(robot, random, SPARE * len(labels) + 20)
            except (SystemExit, AssertionError, np.linalg.LinAlgError) as error:
                if not tried:
                    said.append(f"the check failed at the mechanism itself: {error}")
                    break
                continue
        tried += 1
        names = robot.names
        factors = np.zeros((len(kept), len(labels)))
        for k, row in enumerate(found["base"]):
            for term in row["terms"]:
                factors[k, labels.index(term["parameter"])] = scalar(term["coefficient"], names)
        if robot.parameters != labels:
            said.append(f"other parameters: {set(robot.parameters) ^ set(labels)}")
            break
        size = np.abs(w).max(axis=0)
        rest = np.abs(w - w[:, kept] @ factors).max() / np.abs(w).max()
        scaled = w / np.where(size > 1e-12 * size.max(), size, 1)
        s = np.linalg.svd(scaled, compute_uv=False)
        s = np.append(s, np.full(max(0, len(kept) + 1 - len(s)), 0.0))
        rank = found["rank"]
        gap = max(s[rank], 1e-16) / s[rank - 1] if rank else 0
        if rest > SPAN:
            said.append(f"geometry {tried}: W - W_kept K is {rest:.2g} of W")
        if gap > GAP:
            said.append(f"geometry {tried}: singular values {s[rank - 1]:.2g} and {s[rank]:.2g} of rank {rank}")
        if rest > SPAN or gap > GAP:
            break
        if not everywhere:
            break
    if tried < LEAST_GEOMETRIES and everywhere and not said:
        said.append(f"closes at {tried} geometries only")
    return said, kinds


def work(job):
    regen, seed, path, keep = job
    if path is not None:
        return path.stem, *judged(path, regen, 1)
    keep.mkdir(parents=True, exist_ok=True)
    path = keep / f"{seed}.yaml"
    family = drawn(seed, path)
    said, kinds = judged(path, regen, seed)
    return f"{seed} {family}", said, kinds


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--regen", default="target/release/regen")
    parser.add_argument("--count", type=int, default=0, help="how many mechanisms are drawn")
    parser.add_argument("--seed", type=int, default=1, help="of the first one")
    parser.add_argument("--keep", default=None, help="a folder for the drawn descriptions")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("files", nargs="*")
    o = parser.parse_args()
    keep = pathlib.Path(o.keep or tempfile.mkdtemp())
    jobs = [(o.regen, None, pathlib.Path(f), keep) for f in o.files]
    jobs += [(o.regen, o.seed + k, None, keep) for k in range(o.count)]
    total, failed, families = collections.Counter(), 0, collections.Counter()
    with concurrent.futures.ProcessPoolExecutor(o.jobs) as pool:
        for name, said, kinds in pool.map(work, jobs):
            families[name.split()[-1] if o.count else "file"] += 1
            total.update(kinds)
            failed += bool(said)
            weak = {k: n for k, n in kinds.items() if k not in ("derived everywhere", "proven everywhere")}
            if said or weak:
                print(f"{name}: {'; '.join(said) or 'holds'}{f' {weak}' if weak else ''}", flush=True)
    print(f"{len(jobs)} mechanisms, {failed} with something wrong")
    print(", ".join(f"{n} {k}" for k, n in families.most_common()))
    print("rows: " + ", ".join(f"{n} {k}" for k, n in total.most_common()))


if __name__ == "__main__":
    main()
