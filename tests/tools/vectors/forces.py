"""Computes the forces of any description by Pinocchio, for comparison by `regen verify --all`.

    python tests/tools/vectors/forces.py robots/*.yaml

reads each description independently of regen, builds its tree in Pinocchio joint by joint, closes its
loops by Newton's method on Pinocchio's frames, and writes vectors/NAME.json beside it, or in
tests/fixtures for a robot of this repository: some closed states, random parameters at each, and the
forces of the independent coordinates, tau_i - X^T tau_e with tau by the recursive Newton-Euler
algorithm and X from the frames' velocities. Rotors are Pinocchio's armature. Pinocchio's inverse
dynamics has no friction: its parameters are 0.

Needs: pip install numpy pyyaml pin==4.1.0
"""

import json
import math
import pathlib
import sys

import numpy as np
import pinocchio as pin
import yaml

STATES = 4
TREE, LOOP = 2.5, 0.25
INERTIAL = ["Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "mx", "my", "mz", "m"]
FRICTION = {"viscous": ["Fv"], "coulomb": ["Fc"], "linear": ["Fv", "Fc"],
            "coulomb_asymmetric": ["Fv", "Fc+", "Fc-"], "asymmetric": ["Fv+", "Fc+", "Fv-", "Fc-"]}
FUNCTIONS = {"pi": math.pi, "sqrt": math.sqrt, "sin": math.sin, "cos": math.cos, "tan": math.tan,
             "deg": math.radians, "__builtins__": {}}


def identity():
    return pin.SE3.Identity()


def axis_turn(axis, angle):
    return pin.SE3(pin.utils.rotate(axis, angle), np.zeros(3))


def shift(x, y, z):
    return pin.SE3(np.eye(3), np.array([x, y, z], float))


class Description:
    """A description as a Pinocchio model, with the pairs of frames that the cuts join."""

    def __init__(self, path):
        # read all scalars as text, also labels such as 1 and names such as y
        self.spec = yaml.load(path.read_text(), Loader=yaml.BaseLoader)
        self.names = {}
        for name, text in (self.spec.get("geometry") or {}).items():
            self.names[name] = self.scalar(text)
        self.model = pin.Model()
        self.model.gravity.linear = np.array(
            [self.scalar(x) for x in self.spec.get("gravity", ["0", "0", "-9.81"])])
        self.at = {"world": (0, identity())}  # where bodies are
        self.limbs = {}
        waiting = list(enumerate(self.spec["limbs"]))
        while waiting:
            ready = [x for x in waiting if str(x[1].get("from", "world")) in self.at]
            assert ready, "a limb starts nowhere"
            for index, limb in ready:
                self.limbs[index] = self.limb(limb)
            waiting = [x for x in waiting if x not in ready]
        ordered = [joint for k in sorted(self.limbs) for joint in self.limbs[k]]
        self.coordinates = [c for joint in ordered for c in joint["coordinates"]]
        self.place = [self.model.joints[self.model.getJointId(c)].idx_v for c in self.coordinates]
        self.bodies = [joint["body"] for joint in ordered if joint["body"] is not None]
        actuated = [c for joint in ordered if joint["actuated"] for c in joint["coordinates"]]
        wanted = self.spec.get("independent") or actuated
        self.independent = [self.coordinates.index(c) for c in wanted]
        self.dependent = [k for k in range(len(self.coordinates)) if k not in self.independent]
        self.parameters = [f"{s}({b})" for b in self.bodies for s in INERTIAL]
        for joint in ordered:
            for c in joint["coordinates"]:
                self.parameters += [f"{s}({c})" for s in FRICTION.get(joint["friction"], [])]
        self.rotors = [c for joint in ordered if joint["rotor"] for c in joint["coordinates"]]
        self.parameters += [f"J({c})" for c in self.rotors]
        self.cuts = []
        for cut in self.spec.get("cuts") or []:
            self.cuts.append((cut["joint"], [self.side(cut["name"], k, s)
                                             for k, s in enumerate(cut["between"])]))
        self.couplings = []
        for key, form in (self.spec.get("couplings") or {}).items():
            zero = dict.fromkeys(self.coordinates, 0.0)
            constant = self.scalar(form, zero)
            row = np.zeros(len(self.coordinates))
            for k, c in enumerate(self.coordinates):
                row[k] = constant - self.scalar(form, {**zero, c: 1.0})
            row[self.coordinates.index(key)] += 1
            self.couplings.append((row, constant))
        self.home = np.zeros(len(self.coordinates))
        for name, text in (self.spec.get("home") or {}).items():
            self.home[self.coordinates.index(name)] = self.scalar(text)
        self.data = self.model.createData()

    def scalar(self, text, more=None):
        known = {**FUNCTIONS, **self.names, **{k.replace(".", "__"): v for k, v in (more or {}).items()}}
        for name in more or {}:
            text = text.replace(name, name.replace(".", "__")) if "." in name else text
        return float(eval(str(text).replace("^", "**"), known))  # noqa: S307 one's own file

    def vector(self, texts):
        return [self.scalar(t) for t in texts]

    def placement(self, value):
        x, y, z = self.vector(value.get("xyz", ["0"] * 3))
        r, p, w = self.vector(value.get("rpy", ["0"] * 3))
        return shift(x, y, z) * axis_turn("z", w) * axis_turn("y", p) * axis_turn("x", r)

    def side(self, cut, k, value):
        label, placement = (value, identity()) if isinstance(value, str) else \
            (str(value["body"]), self.placement(value))
        joint, at = self.at[label]
        return self.model.addFrame(pin.Frame(f"{cut}.{k}", joint, 0, at * placement, pin.OP_FRAME))

    def limb(self, limb):
        joint, at = self.at[str(limb.get("from", "world"))]
        at = at * self.placement(limb.get("base", {}))
        out = []
        kinds = {"revolute": None, "prismatic": None, "cylindrical": ["RZ", "PZ"],
                 "universal": ["RX", "RY"], "spherical": ["RZ", "RY", "RX"], "fixed": []}
        for spec in limb["joints"]:
            if "dh" in spec:
                row = {k: self.scalar(v) for k, v in spec["dh"].items()}
                at = (at * axis_turn("x", row.get("alpha", 0)) * shift(row.get("a", 0), 0, 0)
                      * axis_turn("z", row.get("theta", 0)) * shift(0, 0, row.get("d", 0)))
            else:
                at = at * self.placement(spec.get("origin", {}))
            motions, name = kinds[spec["type"]], spec.get("name")
            single = motions is None
            if single:
                motions = ["RP"[spec["type"] == "prismatic"] + spec.get("axis", "z").upper()]
            coordinates = [name if single else f"{name}.{k + 1}" for k in range(len(motions))]
            for motion, coordinate in zip(motions, coordinates):
                joint = self.model.addJoint(joint, getattr(pin, "JointModel" + motion)(), at, coordinate)
                at = identity()
            body = spec.get("body")
            if body is not None:
                self.at[str(body)] = (joint, at)
            out.append({"coordinates": coordinates, "body": body,
                        "actuated": spec.get("actuated") == "true",
                        "friction": spec.get("friction", "none"),
                        "rotor": spec.get("rotor_inertia") == "true"})
        return out

    def rows(self, q, qd, qdd):
        """f with its first and second time derivatives."""
        def pinned(x):
            y = np.zeros(self.model.nv)
            y[self.place] = x
            return y
        pin.forwardKinematics(self.model, self.data, pinned(q), pinned(qd), pinned(qdd))
        pin.updateFramePlacements(self.model, self.data)
        out = []
        for kind, frames in self.cuts:
            sides = []
            for frame in frames:
                world = pin.LOCAL_WORLD_ALIGNED
                at = self.data.oMf[frame]
                if self.model.frames[frame].parentJoint == 0:
                    zero = np.zeros(3)
                    sides.append((at, zero, zero, zero, zero))
                    continue
                v = pin.getFrameVelocity(self.model, self.data, frame, world)
                a = pin.getFrameClassicalAcceleration(self.model, self.data, frame, world)
                sides.append((at, v.linear, v.angular, a.linear, a.angular))
            (a, va, wa, aa, ra), (b, vb, wb, ab, rb) = sides

            def axis(at, w, r, k):
                u = at.rotation[:, k]
                d = np.cross(w, u)
                return u, d, np.cross(r, u) + np.cross(w, d)

            def product(x, y):
                return x[0] @ y[0], x[1] @ y[0] + x[0] @ y[1], x[2] @ y[0] + 2 * x[1] @ y[1] + x[0] @ y[2]

            gap = (b.translation - a.translation, vb - va, ab - aa)
            points = [tuple(d[k] for d in gap) for k in range(3)]

            def angle(i, j):
                return product(axis(a, wa, ra, i), axis(b, wb, rb, j))

            def along(i):
                return product(axis(a, wa, ra, i), gap)

            out += {"spherical": lambda: points,
                    "universal": lambda: points + [angle(0, 1)],
                    "revolute": lambda: points + [angle(0, 2), angle(1, 2)],
                    "cylindrical": lambda: [angle(0, 2), angle(1, 2), along(0), along(1)],
                    "prismatic": lambda: [along(0), along(1), angle(0, 1), angle(0, 2), angle(1, 2)],
                    "fixed": lambda: points + [angle(0, 1), angle(0, 2), angle(1, 2)]}[kind]()
        out += [(row @ q - constant, row @ qd, row @ qdd) for row, constant in self.couplings]
        return np.array(out).reshape(-1, 3).T

    def jacobian(self, q):
        n, zero = len(q), np.zeros(len(q))
        columns = [self.rows(q, e, zero)[1] for e in np.eye(n)]
        return np.array(columns).T.reshape(-1, n)

    def dependents(self, q, rhs):
        """Solves A_e x = rhs over all rows, with two steps of iterative refinement."""
        a = self.jacobian(q)[:, self.dependent]
        x = np.linalg.lstsq(a, rhs, rcond=1e-12)[0]
        for _ in range(2):
            x = x + np.linalg.lstsq(a, rhs - a @ x, rcond=1e-12)[0]
        return x

    def conditioning(self, q):
        values = np.linalg.svd(self.jacobian(q)[:, self.dependent], compute_uv=False)
        return values.min(initial=1) / values.max(initial=1) if len(values) else 1

    def closed(self, q):
        q, zero, best = q.copy(), np.zeros(len(q)), None
        for _ in range(60):
            f = self.rows(q, zero, zero)[0]
            size = np.abs(f).max(initial=0.0)
            if best is None or size < best[0]:
                best = (size, q.copy())
            elif size < 1e-12:
                break
            if not self.dependent:
                break
            step = self.dependents(q, -f)
            if not np.isfinite(step).all() or np.abs(step).max() > 3:
                return None
            q[self.dependent] += step
        # the bound is a few roundings of lengths of metres
        return best[1] if best[0] < 1e-13 else None

    def reach(self, start, goal):
        q = start.copy()
        steps = 1 if not len(self.rows(start, start * 0, start * 0)[0]) else 10
        for k in range(1, steps + 1):
            q[self.independent] = start[self.independent] + k / steps * (goal - start[self.independent])
            q = self.closed(q)
            if q is None:
                return None
        return q

    def state(self, random, home):
        size = LOOP if len(self.rows(home, home * 0, home * 0)[0]) else TREE
        dof, n = len(self.independent), len(home)
        for _ in range(20):
            q = self.reach(home, home[self.independent] + random.uniform(-size, size, dof))
            if q is not None and self.conditioning(q) > 0.2 * self.conditioning(home):
                break
            size *= 0.7
        assert q is not None, "no closed state"
        qd, qdd = np.zeros(n), np.zeros(n)
        a = self.jacobian(q)
        qd[self.independent] = random.uniform(-1.5, 1.5, dof)
        qdd[self.independent] = random.uniform(-3, 3, dof)
        if self.dependent:
            qd[self.dependent] = self.dependents(q, -a[:, self.independent] @ qd[self.independent])
            rest = -self.rows(q, qd, np.zeros(n))[2] - a[:, self.independent] @ qdd[self.independent]
            qdd[self.dependent] = self.dependents(q, rest)
        return q, qd, qdd

    def forces(self, q, qd, qdd, phi):
        model = self.model
        for k in range(model.njoints):
            model.inertias[k] = pin.Inertia.Zero()
        for b, label in enumerate(self.bodies):
            xx, xy, xz, yy, yz, zz, mx, my, mz, m = phi[10 * b:10 * b + 10]
            c = np.array([mx, my, mz]) / m
            about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            central = about + m * pin.skew(c) @ pin.skew(c)
            joint, at = self.at[str(label)]
            model.inertias[joint] += at.act(pin.Inertia(m, c, central))
        value = dict(zip(self.parameters, phi))
        armature = np.zeros(model.nv)
        for c in self.rotors:
            armature[self.place[self.coordinates.index(c)]] = value[f"J({c})"]
        model.armature = armature
        def pinned(x):
            y = np.zeros(model.nv)
            y[self.place] = x
            return y
        tau = pin.rnea(model, model.createData(), pinned(q), pinned(qd), pinned(qdd))[self.place]
        out = tau[self.independent]
        if self.dependent:
            x = self.dependents(q, self.jacobian(q)[:, self.independent])
            out = out - x.T @ tau[self.dependent]
        return out

    def draw(self, random):
        """Draws parameters: random physical bodies, and friction 0."""
        phi = np.zeros(len(self.parameters))
        for b in range(len(self.bodies)):
            spread = random.uniform(-0.3, 0.3, (3, 3))
            m, c = random.uniform(0.5, 2), random.uniform(-0.4, 0.4, 3)
            moments = m * (spread @ spread.T + np.outer(c, c))
            about = np.trace(moments) * np.eye(3) - moments
            phi[10 * b:10 * b + 10] = [*about[np.triu_indices(3)], *(m * c), m]
        for k, label in enumerate(self.parameters):
            if label.startswith("J("):
                phi[k] = random.uniform(0.1, 1)
        return phi


def main(paths):
    for path in map(pathlib.Path, paths):
        d = Description(path)
        random = np.random.default_rng(20261121)
        home = d.closed(d.home)
        assert home is not None, f"{path}: home does not close"
        states = []
        for _ in range(STATES):
            q, qd, qdd = d.state(random, home)
            phi = d.draw(random)
            tau = d.forces(q, qd, qdd, phi)
            states.append({"q": list(q), "qd": list(qd), "qdd": list(qdd), "phi": list(phi),
                           "tau": list(tau)})
        folder = path.resolve().parent / "../tests/fixtures/vectors"
        if not folder.is_dir():
            folder = path.parent / "vectors"
            folder.mkdir(exist_ok=True)
        head = {"by": f"Pinocchio {pin.__version__}", "coordinates": d.coordinates,
                "independent": [d.coordinates[k] for k in d.independent], "parameters": d.parameters}
        lines = [f' "{k}": {json.dumps(v)},' for k, v in head.items()]
        body = ",\n  ".join(json.dumps(s) for s in states)
        (folder / f"{path.stem}.json").write_text(
            "{\n" + "\n".join(lines) + f'\n "states": [\n  {body}\n ]\n}}\n')
        print(f"{path}: {len(states)} states, {len(d.coordinates)} coordinates")


if __name__ == "__main__":
    main(sys.argv[1:])
