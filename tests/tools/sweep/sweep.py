"""Imports every robot file of some packages, and compares forces and ranks with other programs.

    python -m venv venv && venv/bin/pip install pin mujoco numpy pyyaml
    venv/bin/pip install --no-deps example-robot-data dm_control gymnasium-robotics robosuite
    venv/bin/python tests/tools/sweep/sweep.py --regen target/release/regen [FOLDER ...]

Without folders, the packages installed in this environment are searched for URDF and MJCF files.
Each file is imported. Where the robot is on the world and has hinges and slides alone, the forces
W phi of `regen eval` at random states are compared with Pinocchio's recursive Newton-Euler
algorithm (URDF) or MuJoCo's inverse dynamics without contacts, limits and dry friction (MJCF), each
with the file's damping and armature; with couplings, these are reduced to the independent coordinates. The rank that
`regen base` certifies is compared with singular values of Pinocchio's regressor. One line is printed
per file, a table at the end; with --json, everything is written there.
"""

import argparse
import collections
import json
import pathlib
import re
import site
import subprocess
import sys
import tempfile

import numpy as np
import yaml

STATES = 6


def robot_files(folders):
    for folder in folders:
        for path in sorted(pathlib.Path(folder).rglob("*")):
            if path.suffix == ".urdf":
                yield path
            elif path.suffix == ".xml" and path.is_file():
                text = path.read_text(errors="replace")
                if "<mujoco" in text and "<worldbody" in text:
                    yield path


def run(command, seconds, text=None):
    try:
        done = subprocess.run(command, input=text, capture_output=True, text=True, timeout=seconds)
    except subprocess.TimeoutExpired:
        return None, "", "no end"
    return done.returncode, done.stdout, done.stderr


def value(text):
    """A number of the spec, which may be an expression with pi."""
    if isinstance(text, (int, float)):
        return float(text)
    if not re.fullmatch(r"[-+*/0-9.e ]*(pi)?[-+*/0-9.e ]*", text):
        raise ValueError(text)
    return float(eval(text, {"pi": np.pi}))


def parameters(spec, labels):
    """The values of the dynamic parameters that a spec states, 0 where it states none."""
    found = collections.defaultdict(float)
    for label, body in (spec.get("bodies") or {}).items():
        mass = value(body["mass"])
        com = np.array([value(x) for x in body.get("com", [0, 0, 0])])
        xx, xy, xz, yy, yz, zz = (value(x) for x in body.get("inertia", [0] * 6))
        about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        about += mass * (com @ com * np.eye(3) - np.outer(com, com))
        for name, i, j in [("xx", 0, 0), ("xy", 0, 1), ("xz", 0, 2), ("yy", 1, 1), ("yz", 1, 2), ("zz", 2, 2)]:
            found[f"I{name}({label})"] = about[i, j]
        for axis, x in zip("xyz", mass * com):
            found[f"m{axis}({label})"] = x
        found[f"m({label})"] = mass
    joints = [joint for limb in spec["limbs"] for joint in limb["joints"]]
    for joint in joints:
        for symbol, x in (joint.get("nominal") or {}).items():
            if symbol != "Fc":
                found[f"{symbol}({joint['name']})"] = value(x)
    return np.array([found[label] for label in labels])


class Pinocchio:
    """Forces and ranks of a URDF file."""

    def __init__(self, path):
        import pinocchio as pin

        self.pin = pin
        self.model = pin.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        self.names = list(self.model.names)[1:]
        if any(j.nq not in (1, 2) or j.nv != 1 for j in self.model.joints[1:]):
            raise ValueError("joints of several coordinates")

    def state(self, values):
        q = np.zeros(self.model.nq)
        for k, name in enumerate(self.names, 1):
            joint = self.model.joints[k]
            x = values.get(name, 0.0)
            if joint.nq == 2:
                q[joint.idx_q : joint.idx_q + 2] = np.cos(x), np.sin(x)
            else:
                q[joint.idx_q] = x
        return q

    def rates(self, values):
        v = np.zeros(self.model.nv)
        for k, name in enumerate(self.names, 1):
            v[self.model.joints[k].idx_v] = values.get(name, 0.0)
        return v

    def forces(self, q, qd, qdd):
        q, v, a = self.state(q), self.rates(qd), self.rates(qdd)
        tau = self.pin.rnea(self.model, self.data, q, v, a) + self.model.damping * v
        return {name: tau[self.model.joints[k].idx_v] for k, name in enumerate(self.names, 1)}

    def regressor(self, q, qd, qdd):
        rows = self.pin.computeJointTorqueRegressor(
            self.model, self.data, self.state(q), self.rates(qd), self.rates(qdd)
        )
        return {name: rows[self.model.joints[k].idx_v] for k, name in enumerate(self.names, 1)}


class Mujoco:
    """Forces of an MJCF file."""

    def __init__(self, path):
        import mujoco

        self.mj = mujoco
        self.model = mujoco.MjModel.from_xml_path(str(path))
        off = mujoco.mjtDisableBit
        self.model.opt.disableflags |= int(off.mjDSBL_CONSTRAINT) | int(off.mjDSBL_ACTUATION)
        self.model.body_gravcomp[:] = 0.0
        self.data = mujoco.MjData(self.model)
        kinds = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}
        if any(int(kind) not in kinds for kind in self.model.jnt_type):
            raise ValueError("joints of several coordinates")
        self.names = [self.model.joint(k).name for k in range(self.model.njnt)]

    def forces(self, q, qd, qdd):
        for k, name in enumerate(self.names):
            self.data.qpos[k] = q.get(name, self.model.qpos0[k])
            self.data.qvel[k] = qd.get(name, 0.0)
            self.data.qacc[k] = qdd.get(name, 0.0)
        self.mj.mj_inverse(self.model, self.data)
        return dict(zip(self.names, self.data.qfrc_inverse.copy()))


def couplings(spec):
    """For each joint that follows others, their factors."""
    found = {}
    for key, form in (spec.get("couplings") or {}).items():
        terms = {}
        for sign, factor, name in re.findall(r"([+-]?)\s*(?:([0-9.e-]+)\*)?([A-Za-z_]\w*)", str(form)):
            if name != "pi":
                terms[name] = (-1.0 if sign == "-" else 1.0) * float(factor or 1)
        found[key] = terms
    # those that follow joints which follow others themselves
    for _ in found:
        for key, terms in found.items():
            direct = {}
            for name, factor in terms.items():
                for of, more in found.get(name, {name: 1.0}).items():
                    direct[of] = direct.get(of, 0.0) + factor * more
            found[key] = direct
    return found


def reduced(rows, followers, independent):
    """Rows of all joints, reduced to the independent ones by the power of those that follow."""
    total = {name: np.array(rows[name], dtype=float) for name in independent}
    for key, terms in followers.items():
        for name, factor in terms.items():
            if key in rows and name in total:
                total[name] = total[name] + factor * rows[key]
    return [total[name] for name in independent]


def compare(regen, path, spec_path, folder):
    spec = yaml.safe_load(spec_path.read_text())
    if spec.get("cuts"):
        return {"forces": "not compared: loops"}
    code, out, err = run([regen, "info", spec_path, "--format", "json"], 600)
    if code != 0:
        return {"forces": f"info: {err.strip()[:200]}"}
    info = json.loads(out)
    names, independent = info["coordinates"], info["independent"]
    try:
        other = Pinocchio(path) if path.suffix == ".urdf" else Mujoco(path)
    except Exception as why:
        return {"forces": f"not compared: {str(why)[:120]}"}
    if any("." in name for name in names) or not set(names) <= set(other.names):
        return {"forces": "not compared: joints of several coordinates, or renamed"}
    random = np.random.default_rng(1)
    n = len(independent)
    states = [
        {"independent": {k: (s * random.uniform(-1, 1, n)).tolist() for k, s in [("q", 1), ("qd", 2), ("qdd", 3)]}}
        for _ in range(STATES)
    ]
    file = folder / "states.json"
    file.write_text(json.dumps(states))
    code, out, err = run([regen, "eval", spec_path, "--states", file, "--format", "json"], 900)
    if code != 0:
        return {"forces": f"eval: {err.strip()[:200]}"}
    phi = parameters(spec, info["parameters"])
    followers, worst, largest, rows = couplings(spec), 0.0, 0.0, []
    for state in json.loads(out):
        of = lambda key: dict(zip(names, state[key]))
        forces = other.forces(of("q"), of("qd"), of("qdd"))
        theirs = np.array(reduced(forces, followers, independent), dtype=float)
        ours = np.array(state["regressor"]) @ phi
        worst = max(worst, np.abs(theirs - ours).max())
        largest = max(largest, np.abs(theirs).max())
        if isinstance(other, Pinocchio):
            rows += reduced(other.regressor(of("q"), of("qd"), of("qdd")), followers, independent)
    result = {"forces": worst / max(largest, 1e-9)}
    if rows:
        result["their_rank"] = rank(other, followers, independent, random, names, spec)
    return result


def rank(other, followers, independent, random, names, spec):
    """The rank of Pinocchio's regressor at many states, by singular values."""
    rows = []
    states = max(20, int(3 * 10 * other.model.njoints / max(1, len(independent))))
    form = spec.get("couplings") or {}
    for _ in range(states):
        sets = []
        for scale in (3.0, 2.0, 3.0):
            values = dict(zip(independent, scale * random.uniform(-1, 1, len(independent))))
            for key in form:
                values[key] = sum(f * values.get(name, 0.0) for name, f in followers[key].items())
            sets.append(values)
        rows += reduced(other.regressor(*sets), followers, independent)
    rows = np.array(rows)
    # a link without mass and inertia has no parameters in the spec
    massive = [i.mass > 0 or np.abs(i.inertia).max() > 0 for i in other.model.inertias[1:]]
    rows = rows[:, np.repeat(massive, 10)]
    size = np.linalg.norm(rows, axis=0)
    rows = rows[:, size > 1e-9 * size.max()]
    s = np.linalg.svd(rows / np.linalg.norm(rows, axis=0), compute_uv=False)
    return int((s > 1e-9 * s[0]).sum())


def inertial_rank(base):
    """The number of base parameters that are no friction and no rotor."""
    return sum(not re.match(r"(F[vc]|J|K|Fo)[+-]?\(", row["label"]) for row in base["base"])


def one(regen, path, folder, exact):
    spec_path = folder / "robot.yaml"
    options = ["--exact"] if exact else []
    code, out, err = run([regen, "import", path, *options], 120)
    if code != 0:
        return {"import": "refused", "why": err.strip().splitlines()[0][:200] if err.strip() else f"exit {code}"}
    spec_path.write_text(out)
    result = {"import": "read", "notes": err.count("note: ")}
    result.update(compare(regen, path, spec_path, folder))
    code, out, err = run([regen, "base", spec_path, "--format", "json"], 1800)
    try:
        base = json.loads(out)
    except ValueError:
        result["base"] = f"exit {code}: {err.strip()[:200]}"
        return result
    result.update(
        rank=base["rank"],
        inertial_rank=inertial_rank(base),
        complete=base["complete"],
        largest=max((abs(t["value"]) for row in base["base"] for t in row["terms"]), default=0),
    )
    result["condition"] = base["condition"]
    return result


def main():
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--regen", required=True)
    options.add_argument("--exact", action="store_true")
    options.add_argument("--json")
    options.add_argument("folders", nargs="*", default=site.getsitepackages())
    chosen = options.parse_args()
    results = {}
    for path in robot_files(chosen.folders):
        with tempfile.TemporaryDirectory() as folder:
            results[str(path)] = result = one(chosen.regen, path, pathlib.Path(folder), chosen.exact)
        print(path.name, json.dumps(result), flush=True)
    read = [r for r in results.values() if r["import"] == "read"]
    compared = [r["forces"] for r in read if isinstance(r.get("forces"), float)]
    ranks = [(r["inertial_rank"], r["their_rank"]) for r in read if "their_rank" in r and "rank" in r]
    conditions = sorted(r["condition"] for r in read if r.get("condition"))
    print(f"files {len(results)}, read {len(read)}, refused {len(results) - len(read)}")
    print(f"forces compared {len(compared)}, above 1e-9: {sum(x > 1e-9 for x in compared)}")
    print(f"ranks compared {len(ranks)}, different: {sum(a != b for a, b in ranks)}")
    print(f"incomplete {sum(r.get('complete') is False for r in read)}")
    if conditions:
        print(f"condition: median {conditions[len(conditions) // 2]:.3g}, largest {conditions[-1]:.3g}")
    if chosen.json:
        pathlib.Path(chosen.json).write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    sys.exit(main())
