"""Motions and efforts of closed robots by Pinocchio, independent of regen.

A description is read, and its tree built, by `tests/tools/vectors/forces.py`. Here its loops are closed
along a motion of the independent coordinates, step by step, and the efforts are kept on grids of instants
from which those at any instant follow.
"""

import hashlib
import pathlib
import sys

import numpy as np
import pinocchio as pin
import yaml

from motions import Motion

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "vectors"))
from forces import FRICTION, INERTIAL, Description  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[3]
FOLDERS = [
    pathlib.Path(__file__).resolve().parent,
    ROOT / "robots",
    ROOT / "tests/fixtures/mechanisms",
]

ADDED = {"friction": ("friction", "linear"), "stribeck": ("friction", "linear"), "rotor": ("rotor_inertia", "true")}
EXCESS, SLOW = 0.5, 0.1  # of Stribeck friction: over Coulomb friction, and its velocity over the rms one
VERSION = 1  # of the files in the cache
TURN, SLIDE = 0.6, 0.15  # the reach of a coordinate without limits, rad and m
NODES = 8  # of the polynomial through the nearest points of a grid
COARSE, FINE = 100, 6400  # Hz, of grids
ACCURACY = 1e-8  # of what is interpolated between the points of a grid
FLOOR_ROWS = 1000  # at which a motion is taken for the error that noise of efforts alone leaves
TEST_STATES = 200  # of the motion on which parameters are judged
SKEW = np.array([[[0, 0, 0], [0, 0, -1], [0, 1, 0]],
                 [[0, 0, 1], [0, 0, 0], [-1, 0, 0]],
                 [[0, -1, 0], [1, 0, 0], [0, 0, 0]]], float)


class Unreachable(Exception):
    """A motion at which the loops do not close, or nearly lose their rank."""


def find(name):
    """The text of the spec called so, `+friction` and `+rotor` adding these to its actuated joints.

    Nominal values and limits of efforts are left out, since the true parameters are others.
    """
    name, *more = name.split("+")
    paths = [folder / f"{name}.yaml" for folder in FOLDERS] + [pathlib.Path(name)]
    path = next((p for p in paths if p.is_file()), None)
    if path is None:
        raise SystemExit(f"no spec is called {name}")
    spec = yaml.load(path.read_text(), Loader=yaml.BaseLoader)
    spec.pop("bodies", None)
    for limb in spec["limbs"]:
        for joint in limb["joints"]:
            joint.pop("nominal", None)
            if "limits" in joint:
                joint["limits"].pop("effort", None)
            if joint.get("actuated") == "true":
                for word in more:
                    if word not in ADDED:
                        raise SystemExit(f"`+{word}` adds nothing; there are {', '.join(ADDED)}")
                    key, value = ADDED[word]
                    joint[key] = value
    return Plain.write(spec)


class Plain(yaml.SafeDumper):
    """Writes all scalars as they were read, without quotes where YAML allows."""

    @classmethod
    def write(cls, spec):
        return yaml.dump(spec, Dumper=cls, sort_keys=False, width=1000)


def plain(dumper, text):
    tag = dumper.resolve(yaml.ScalarNode, text, (True, False))
    return dumper.represent_scalar(tag, text)


Plain.add_representer(str, plain)


class Robot(Description):
    """A description with its closed motions and its efforts."""

    def __init__(self, path):
        super().__init__(path)
        if self.couplings or self.spec.get("drives") or self.spec.get("motors"):
            raise SystemExit(f"{path}: couplings and motors are not supported here")
        self.names_independent = [self.coordinates[k] for k in self.independent]
        joints = {}
        for limb in self.spec["limbs"]:
            for joint in limb["joints"]:
                if "name" in joint:
                    joints[joint["name"]] = joint
        self.joint = {c: joints[c if c in joints else c.rsplit(".", 1)[0]] for c in self.coordinates}
        actuated = [c for c in self.coordinates if self.joint[c].get("actuated") == "true"]
        if sorted(actuated) != sorted(self.names_independent):
            raise SystemExit(f"{path}: the actuated coordinates must be the independent ones")
        for k in self.dependent:
            if self.joint[self.coordinates[k]].get("rotor_inertia") == "true":
                raise SystemExit(f"{path}: rotors of dependent coordinates are not supported here")
        self.ends = [
            [(self.model.frames[f].parentJoint, self.model.frames[f].placement) for f in frames]
            for _, frames in self.cuts
        ]
        self.start = self.closed(self.home)
        if self.start is None:
            self.start = self.closed_freely(self.home)
        if self.dependent:
            self.least = 0.15 * self.smallest(self.constraint(self.start)[1])

    # closure -------------------------------------------------------------------------------------

    def closed_freely(self, q):
        """The closed state near q, of which all coordinates may change."""
        q = q.copy()
        for _ in range(100):
            f, a = self.constraint(q)
            if np.abs(f).max() < 1e-13:
                return q
            step = np.linalg.lstsq(a, -f, rcond=1e-10)[0]
            q += step * min(1, 0.3 / max(1e-30, np.abs(step).max()))
        raise SystemExit(f"{self.spec['name']}: home does not close")

    def constraint(self, q):
        """The equations of all cuts, which are 0 where the loops close, and their Jacobian."""
        model, data, n = self.model, self.data, len(q)
        x = np.empty(n)
        x[self.place] = q
        pin.computeJointJacobians(model, data, x)
        values, rows = [], []
        for (kind, _), sides in zip(self.cuts, self.ends):
            at = []
            for joint, frame in sides:
                place = data.oMi[joint] * frame if joint else frame
                if joint:
                    j = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)[:, self.place]
                    arm = place.translation - data.oMi[joint].translation
                    at.append((place.rotation, place.translation, j[:3] - SKEW.dot(arm) @ j[3:], j[3:]))
                else:
                    at.append((place.rotation, place.translation, np.zeros((3, n)), np.zeros((3, n))))
            (ra, pa, va, wa), (rb, pb, vb, wb) = at
            gap, speed = pb - pa, vb - va
            if kind in ("spherical", "universal", "revolute", "fixed"):
                values += list(gap)
                rows += list(speed)
            right = {
                "spherical": (),
                "universal": ((0, 1),),
                "revolute": ((0, 2), (1, 2)),
                "cylindrical": ((0, 2), (1, 2)),
                "prismatic": ((0, 1), (0, 2), (1, 2)),
                "fixed": ((0, 1), (0, 2), (1, 2)),
            }[kind]
            for i, k in right:
                a, b = ra[:, i], rb[:, k]
                values.append(a @ b)
                rows.append(np.cross(a, b) @ (wa - wb))
            if kind in ("cylindrical", "prismatic"):
                for i in (0, 1):
                    a = ra[:, i]
                    values.append(a @ gap)
                    rows.append(np.cross(a, gap) @ wa + a @ speed)
        return np.array(values), np.array(rows)

    def smallest(self, a):
        """The smallest singular value of the dependent columns but for those that are always 0, relative."""
        s = np.linalg.svd(a[:, self.dependent], compute_uv=False)
        s = s[: len(self.dependent)]
        return s[s > 1e-9 * s[0]].min() / s[0]

    def inverse(self, a):
        """The pseudo-inverse of the dependent columns."""
        u, s, vt = np.linalg.svd(a[:, self.dependent], full_matrices=False)
        kept = s > 1e-9 * s[0]
        if kept.sum() < len(self.dependent) or s[kept][-1] < self.least * s[0]:
            raise Unreachable
        return (vt[kept].T / s[kept]) @ u[:, kept].T

    def newton(self, q):
        """Closes the loops by the dependent coordinates; returns the state, the Jacobian and its inverse."""
        for _ in range(12):
            f, a = self.constraint(q)
            p = self.inverse(a)
            if np.abs(f).max() < 3e-14:
                break
            step = -p @ f
            if np.abs(step).max() > 0.5:
                raise Unreachable
            q = q.copy()
            q[self.dependent] += step
            if np.abs(step).max() < 1e-11:  # the next step would be of roundings
                f, a = self.constraint(q)
                p = self.inverse(a)
                break
        else:
            raise Unreachable
        return q, a, p

    def states(self, t, qi, vi, ai, near):
        """Closed states along the independent coordinates, the first one continued from `near`.

        Returns q, qd, qdd of all coordinates and dq_dependent/dq_independent at each instant.
        """
        n, ind, dep = len(self.coordinates), self.independent, self.dependent
        q, v, a = (np.zeros((len(t), n)) for _ in range(3))
        slopes = np.zeros((len(t), len(dep), len(ind)))
        q[:, ind], v[:, ind], a[:, ind] = qi, vi, ai
        if not dep:
            return q, v, a, slopes
        guess = near.copy()
        way = qi[0] - near[ind]
        steps = int(np.ceil(np.abs(way).max() / 0.02))
        for k in range(1, steps):
            guess[ind] = near[ind] + way * k / steps
            guess = self.newton(guess)[0]
        for k in range(len(t)):
            if k:
                h = t[k] - t[k - 1]
                guess = q[k - 1] + h * v[k - 1] + h * h / 2 * a[k - 1]
            guess[ind] = qi[k]
            x, jacobian, p = self.newton(guess)
            slope = -p @ jacobian[:, ind]
            v[k, dep] = slope @ vi[k]
            size = max(1e-12, np.abs(v[k]).max())
            h = 1e-5 / size
            ahead = self.constraint(x + h * v[k])[1] @ v[k]
            behind = self.constraint(x - h * v[k])[1] @ v[k]
            a[k, dep] = slope @ ai[k] - p @ ((ahead - behind) / (2 * h))
            q[k], slopes[k] = x, slope
        return q, v, a, slopes

    # efforts -------------------------------------------------------------------------------------

    def carry(self, phi):
        """Gives the bodies these parameters, ten each in the order of INERTIAL."""
        for k in range(self.model.njoints):
            self.model.inertias[k] = pin.Inertia.Zero()
        for body, (xx, xy, xz, yy, yz, zz, mx, my, mz, m) in zip(self.bodies, phi.reshape(-1, 10)):
            c = np.array([mx, my, mz]) / m
            about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            joint, at = self.at[str(body)]
            self.model.inertias[joint] += at.act(pin.Inertia(m, c, about + m * pin.skew(c) @ pin.skew(c)))
        self.data = self.model.createData()

    def efforts(self, q, v, a, slopes):
        """The efforts of the rigid bodies at closed states."""
        out = np.empty((len(q), len(self.independent)))
        x = [np.empty(len(self.coordinates)) for _ in range(3)]
        for k in range(len(q)):
            for y, z in zip(x, (q[k], v[k], a[k])):
                y[self.place] = z
            tau = pin.rnea(self.model, self.data, *x)[self.place]
            out[k] = tau[self.independent] + tau[self.dependent] @ slopes[k]
        return out

    def regressor(self, q, v, a, slopes):
        """The efforts of the rigid bodies, linear in their parameters: states x efforts x parameters."""
        n = len(self.coordinates)
        x = [np.empty(n) for _ in range(3)]
        moves = [(joint, inertial(at)) for joint, at in (self.at[str(b)] for b in self.bodies)]
        out = np.empty((len(q), len(self.independent), 10 * len(self.bodies)))
        for k in range(len(q)):
            for y, z in zip(x, (q[k], v[k], a[k])):
                y[self.place] = z
            w = pin.computeJointTorqueRegressor(self.model, self.data, *x)[self.place]
            w = np.hstack([w[:, 10 * (j - 1):10 * j] @ m if j else np.zeros((n, 10)) for j, m in moves])
            out[k] = w[self.independent] + slopes[k].T @ w[self.dependent]
        return out

    def friction_of(self, c):
        """The symbols of the friction and the rotor of a coordinate."""
        joint = self.joint[c]
        out = list(FRICTION.get(joint.get("friction", "none"), []))
        return out + ["J"] * (joint.get("rotor_inertia") == "true")

    def columns(self, v, a, slopes, sign):
        """Efforts linear in the parameters of friction and rotors: states x efforts x parameters.

        `sign` has the sign of each velocity, and at rest the part of the Coulomb friction that acts.
        """
        labels, out = [], []
        for k, c in enumerate(self.coordinates):
            for symbol in self.friction_of(c):
                s = sign[:, k]
                value = {
                    "Fv": v[:, k], "Fc": s, "J": a[:, k],
                    "Fv+": np.maximum(v[:, k], 0), "Fv-": np.minimum(v[:, k], 0),
                    "Fc+": np.maximum(s, 0), "Fc-": np.minimum(s, 0),
                }[symbol]
                if k in self.independent:
                    lever = np.zeros(len(self.independent))
                    lever[self.independent.index(k)] = 1
                    lever = np.broadcast_to(lever, (len(v), len(lever)))
                else:
                    lever = slopes[:, self.dependent.index(k)]
                labels.append(f"{symbol}({c})")
                out.append(value[:, None] * lever)
        if not out:
            return labels, np.zeros((len(v), len(self.independent), 0))
        return labels, np.stack(out, axis=2)

    # limits --------------------------------------------------------------------------------------

    def room(self):
        """Centres and reaches of the independent coordinates, and limits of their velocities."""
        centre, reach, speed = [], [], []
        for k in self.independent:
            joint = self.joint[self.coordinates[k]]
            limits = joint.get("limits") or {}
            home, size = self.start[k], SLIDE if joint["type"] == "prismatic" else TURN
            if "position" in limits:
                low, high = self.vector(limits["position"])
                size = min(size, 0.45 * (high - low))
                home = min(max(home, low + 1.05 * size), high - 1.05 * size)
            centre.append(home)
            reach.append(size)
            limit = np.inf
            if "velocity" in limits:
                limit = 0.9 * np.abs(self.vector(limits["velocity"])).min()
            speed.append(limit)
        return np.array(centre), np.array(reach), np.array(speed)


def inertial(at):
    """The matrix from a body's parameters, in the order of INERTIAL, to Pinocchio's in the joint's frame."""
    sk = pin.skew
    out = np.zeros((10, 10))
    for k, name in enumerate(INERTIAL):
        m, mc = float(name == "m"), np.array([name == s for s in ("mx", "my", "mz")], float)
        about = np.zeros((3, 3))
        if name[0] == "I":
            i, j = "xyz".index(name[1]), "xyz".index(name[2])
            about[i, j] = about[j, i] = 1
        r, p = at.rotation, at.translation
        mc, about = r @ mc, r @ about @ r.T
        about = about - sk(p) @ sk(mc) - sk(mc) @ sk(p) - m * sk(p) @ sk(p)
        mc = mc + m * p
        out[:, k] = [m, *mc, about[0, 0], about[0, 1], about[1, 1], about[0, 2], about[1, 2], about[2, 2]]
    return out


def draw(random, bodies):
    """Parameters of bodies that could exist: mass, centre of mass and principal moments at random."""
    out = []
    for _ in range(bodies):
        m, c = random.uniform(1, 6), random.uniform(-0.1, 0.1, 3)
        # any two of these moments are at least the third
        moments = np.diag(random.uniform(0.03, 0.06, 3))
        turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
        about = turn @ moments @ turn.T - m * pin.skew(c) @ pin.skew(c)
        out += [*about[np.triu_indices(3)], *(m * c), m]
    return np.array(out)


def interpolate(grid, values, t):
    """Values between those on an even grid, by the polynomial through the nearest NODES of them."""
    h = grid[1] - grid[0]
    place = (t - grid[0]) / h
    first = np.clip(np.floor(place).astype(int) - NODES // 2 + 1, 0, len(grid) - NODES)
    x = place - first
    weights = np.ones((len(t), NODES))
    for i in range(NODES):
        for j in range(NODES):
            if i != j:
                weights[:, i] *= (x - j) / (i - j)
    out = np.zeros((len(t), *values.shape[1:]))
    for i in range(NODES):
        out += weights[:, i].reshape(-1, *[1] * (values.ndim - 1)) * values[first + i]
    return out


class Run:
    """One robot with its parameters along one motion, and a second motion to judge parameters on."""

    def __init__(self, path, kind, seed, time, cache, stribeck=False, load=None):
        """`load` adds ten parameters to those of the last body; friction stays that of the robot without it."""
        self.robot = Robot(path)
        random = np.random.default_rng([seed, 1])
        self.phi = draw(random, len(self.robot.bodies))
        self.bare = self.phi.copy()
        text = f"{VERSION} {path.read_text()} {kind} {seed} {time}"
        if load is not None:
            self.phi[-len(INERTIAL):] += load
            text += f" {list(load)}"
        name = hashlib.sha256(text.encode()).hexdigest()[:24]
        kept = pathlib.Path(cache) / f"{name}.npz"
        if kept.is_file():
            data = dict(np.load(kept))
            self.motion, other = self.motions(kind, seed, time, float(data["size"]))
        else:
            data = None
            size = 1.0
            while data is None:
                self.motion, other = self.motions(kind, seed, time, size)
                try:
                    data = self.computed(other)
                except Unreachable:
                    size *= 0.75
                    if size < 0.02:
                        raise SystemExit(f"{path}: no motion is reachable") from None
            data["size"] = np.array(size)
            kept.parent.mkdir(parents=True, exist_ok=True)
            part = kept.with_suffix(".part.npz")
            np.savez(part, **data)
            part.replace(kept)
        self.size = float(data["size"])
        self.grids = [
            (data[f"t{k}"], data[f"efforts{k}"], data[f"slopes{k}"])
            for k in range(len(self.motion.pieces))
        ]
        self.judge(data, random, stribeck)

    def motions(self, kind, seed, time, size):
        centre, reach, speeds = self.robot.room()
        return [
            Motion(kind, np.random.default_rng([seed, k]), time, centre, size * reach, speeds)
            for k in (2, 3)
        ]

    def computed(self, other):
        """What takes long: closed states and efforts on grids of the pieces of the motion."""
        robot, data = self.robot, {}
        near = robot.start
        t = np.linspace(0, other.time, TEST_STATES)
        q, v, a, slopes = robot.states(t, *other.at(t), near)
        data["test"] = robot.regressor(q, v, a, slopes)
        data["test_v"], data["test_a"], data["test_slopes"] = v, a, slopes
        robot.carry(self.phi)
        for k, (begin, end, rests) in enumerate(self.motion.pieces):
            if rests:
                t = np.linspace(begin, end, NODES)
                q, v, a, slopes = self.along(t, near)
                z = robot.efforts(q, v, a, slopes)
            else:
                rate = COARSE
                while True:
                    t = np.linspace(begin, end, 2 * max(NODES, int(np.ceil((end - begin) * rate / 2))) + 1)
                    q, v, a, slopes = self.along(t, near)
                    z = robot.efforts(q, v, a, slopes)
                    # twice the step gives about 2^NODES times the error
                    errors = [
                        np.abs(interpolate(t[::2], x[::2], t[1::2]) - x[1::2]).max() / np.abs(x).max()
                        for x in (z, slopes) if np.abs(x).max(initial=0) > 0
                    ]
                    if max(errors) < ACCURACY * 2**NODES / 4 or rate >= FINE:
                        break
                    rate *= 2
            near = q[-1]
            data[f"t{k}"], data[f"efforts{k}"], data[f"slopes{k}"] = t, z, slopes
        return data

    def along(self, t, near):
        # instants at the end of a piece belong to it, not to the next one
        inside = np.clip(t, t[0] + 1e-9, t[-1] - 1e-9)
        return self.robot.states(t, *self.motion.at(inside), near)

    def judge(self, data, random, stribeck):
        """Draws friction and rotors in proportion to the efforts, and computes the test's regressor."""
        robot = self.robot
        v, a, slopes = data["test_v"], data["test_a"], data["test_slopes"]
        labels, more = robot.columns(v, a, slopes, np.sign(v))
        self.test = np.concatenate([data["test"], more], axis=2)
        rigid = data["test"] @ self.bare
        typical = np.sqrt(np.mean(rigid**2, axis=0))
        values = []
        for label in labels:
            symbol, c = label[:-1].split("(")
            k = robot.coordinates.index(c)
            if k in robot.independent:
                size = typical[robot.independent.index(k)]
            else:
                size = typical.mean()
            share = random.uniform(0.1, 0.3) if symbol == "J" else random.uniform(0.05, 0.15)
            if symbol.startswith("Fv"):
                size /= np.sqrt(np.mean(v[:, k] ** 2))
            elif symbol == "J":
                size /= np.sqrt(np.mean(a[:, k] ** 2))
            values.append(share * size)
        self.more = np.array(values)
        self.excess = []
        if stribeck:
            for label, value in zip(labels, values):
                k = robot.coordinates.index(label[:-1].split("(")[1])
                if label.startswith("Fc("):
                    slow = SLOW * np.sqrt(np.mean(v[:, k] ** 2))
                    self.excess.append((robot.independent.index(k), EXCESS * value, slow))
        names = [f"{s}({b})" for b in robot.bodies for s in INERTIAL] + labels
        self.truth = dict(zip(names, np.concatenate([self.phi, self.more])))
        self.stick = random.uniform(-1, 1, (len(self.motion.pieces), len(robot.coordinates)))
        self.test_efforts = self.test @ np.array(list(self.truth.values()))

    def at(self, t):
        """Independent positions and all efforts at these instants."""
        robot = self.robot
        ind, dep = robot.independent, robot.dependent
        qi, vi, ai = self.motion.at(t)
        piece = self.motion.piece(t)
        efforts = np.empty((len(t), len(ind)))
        slopes = np.zeros((len(t), len(dep), len(ind)))
        for k, (grid, z, s) in enumerate(self.grids):
            rows = piece == k
            if rows.any():
                efforts[rows] = interpolate(grid, z, t[rows])
                slopes[rows] = interpolate(grid, s, t[rows])
        if len(self.more):
            v = np.zeros((len(t), len(robot.coordinates)))
            a = np.zeros_like(v)
            v[:, ind], a[:, ind] = vi, ai
            v[:, dep] = np.einsum("tde,te->td", slopes, vi)
            rests = np.array([p[2] for p in self.motion.pieces])[piece]
            sign = np.where(rests[:, None], self.stick[piece], np.sign(v))
            efforts = efforts + robot.columns(v, a, slopes, sign)[1] @ self.more
            for k, size, slow in self.excess:
                efforts[:, k] += size * sign[:, ind[k]] * np.exp(-((vi[:, k] / slow) ** 2))
        return qi, efforts

    def combinations(self, base):
        """True values of the base parameters, and their columns of the test's regressor."""
        names = list(self.truth)
        values = [sum(x["value"] * self.truth[x["parameter"]] for x in row["terms"]) for row in base]
        return np.array(values), self.test[:, :, [names.index(row["label"]) for row in base]]

    def floor(self, base, effort):
        """The expected error of least squares that knows the motion of a log of 1 Hz, % of the efforts.

        That of a log of R Hz is this over the root of R. `effort` is the noise of the efforts over their rms.
        """
        robot, motion = self.robot, self.motion
        t = np.arange(FLOOR_ROWS) * motion.time / FLOOR_ROWS
        q, v, a, slopes = robot.states(t, *motion.at(t), robot.start)
        w = np.concatenate([robot.regressor(q, v, a, slopes), robot.columns(v, a, slopes, np.sign(v))[1]], axis=2)
        names = list(self.truth)
        kept = [names.index(row["label"]) for row in base]
        moves = np.full(len(t), True)
        if len(self.more):
            # static friction is not known
            moves = ~np.array([p[2] for p in motion.pieces])[motion.piece(t)]
        size = effort * np.sqrt(np.mean(self.at(t)[1] ** 2, axis=0))
        w = w[:, :, kept] / size[:, None]
        information = np.einsum("tep,teq->pq", w[moves], w[moves]) * motion.time / FLOOR_ROWS
        test = self.test[:, :, kept]
        error = np.einsum("tep,pq,teq->te", test, np.linalg.pinv(information), test).mean()
        return float(100 * np.sqrt(error / np.mean(self.test_efforts**2)))
