"""Computes accelerations and short runs of closed chains by another engine.

Writes tests/fixtures/computed/simulation.json: for two robots of robots/*.yaml, the accelerations that
Pinocchio's constraint dynamics (Carpentier, Budhiraja and Mansard, 2021) computes from the state
and the efforts of the actuators, and states of runs integrated with these accelerations alone.
The mechanisms are built here from their dimensions, not from the YAML files: the 3-RPS as three
trees with two cut points, the five-bar linkage as two arms with one.

Needs: pip install numpy pin==4.1.0
"""

import json
import pathlib

import numpy as np
import pinocchio as pin

G = np.array([0, 0, -9.81])


def rx(a):
    return pin.utils.rotate("x", a)


def rz(a):
    return pin.utils.rotate("z", a)


def at(x, y, z, rotation=None):
    return pin.SE3(np.eye(3) if rotation is None else rotation, np.array([x, y, z], float))


def body(mass, com, moments):
    """A body from its mass, centre of mass and moments about it along its axes."""
    return pin.Inertia(mass, np.array(com, float), np.diag(moments).astype(float))


class Mechanism:
    """A tree with points that coincide; coordinates by name."""

    def __init__(self, gravity):
        self.model = pin.Model()
        self.model.gravity.linear = gravity
        self.names, self.pairs = [], []

    def joint(self, parent, kind, placement, name, inertia=None):
        joint = self.model.addJoint(parent, kind, placement, name)
        if inertia is not None:
            self.model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
        self.names.append(name)
        return joint

    def meet(self, first, second):
        """Joins two points, each (joint, placement)."""
        (a, pa), (b, pb) = first, second
        self.pairs.append(pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D, self.model, a, pa, b, pb, pin.ReferenceFrame.LOCAL))

    def ready(self):
        self.data = self.model.createData()
        pairs, self.pairs = self.pairs, pin.StdVec_RigidConstraintModel()
        self.datas = pin.StdVec_RigidConstraintData()
        for pair in pairs:
            self.pairs.append(pair)
            self.datas.append(pair.createData())
        pin.initConstraintDynamics(self.model, self.data, self.pairs, self.datas)
        return self

    def gap(self, q):
        pin.forwardKinematics(self.model, self.data, q)
        points = []
        for pair in self.pairs:
            a = self.data.oMi[pair.joint1_id] * pair.joint1_placement
            b = self.data.oMi[pair.joint2_id] * pair.joint2_placement
            points.append(a.translation - b.translation)
        return np.concatenate(points)

    def jacobian(self, q):
        """The Jacobian of the gap."""
        pin.computeJointJacobians(self.model, self.data, q)
        pin.forwardKinematics(self.model, self.data, q)
        rows = []
        for pair in self.pairs:
            sides = []
            for joint, placement in ((pair.joint1_id, pair.joint1_placement),
                                     (pair.joint2_id, pair.joint2_placement)):
                point = self.data.oMi[joint] * placement
                j = pin.getJointJacobian(self.model, self.data, joint, pin.LOCAL_WORLD_ALIGNED)
                arm = point.translation - self.data.oMi[joint].translation
                sides.append(j[:3] - pin.skew(arm) @ j[3:])
            rows.append(sides[0] - sides[1])
        return np.vstack(rows)

    def closed(self, q, fixed):
        """The closed state near q with the coordinates `fixed` unchanged."""
        q = q.copy()
        free = [k for k in range(self.model.nv) if k not in fixed]
        for _ in range(50):
            step = np.linalg.lstsq(self.jacobian(q)[:, free], -self.gap(q), rcond=1e-12)[0]
            q[free] += step
            if np.abs(step).max() < 1e-15:
                break
        assert np.abs(self.gap(q)).max() < 1e-14, self.gap(q)
        return q

    def moving(self, q, fixed, rates):
        """All velocities, from the velocities `rates` of the fixed coordinates."""
        j = self.jacobian(q)
        free = [k for k in range(self.model.nv) if k not in fixed]
        v = np.zeros(self.model.nv)
        v[fixed] = rates
        v[free] = np.linalg.lstsq(j[:, free], -j[:, fixed] @ v[fixed], rcond=1e-12)[0]
        return v

    def accelerations(self, q, v, tau):
        settings = pin.ProximalSettings(1e-14, 1e-14, 1e-10, 100)
        a = pin.constraintDynamics(self.model, self.data, q, v, tau, self.pairs, self.datas, settings)
        a = a.copy()
        # the same by the equations of motion with Lagrange multipliers, in one solve
        mass = pin.crba(self.model, self.data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        bias = pin.nonLinearEffects(self.model, self.data, q, v)
        j = self.jacobian(q)
        h = 1e-5
        drift = (self.jacobian(pin.integrate(self.model, q, h * v)) @ v
                 - self.jacobian(pin.integrate(self.model, q, -h * v)) @ v) / (2 * h)
        m = len(drift)
        kkt = np.block([[mass, j.T], [j, np.zeros((m, m))]])
        other = np.linalg.lstsq(kkt, np.concatenate([tau - bias, -drift]), rcond=1e-12)[0][:len(a)]
        # central differences of the drift are accurate to about 1e-9
        assert np.abs(a - other).max() < 1e-6 * (1 + np.abs(a).max()), np.abs(a - other).max()
        return a

    def run(self, q, v, tau, duration, steps):
        """A run under constant efforts: the classic Runge-Kutta method of order four, all coordinates."""
        h = duration / steps
        rate = lambda q, v: (v, self.fast(q, v, tau))
        for _ in range(steps):
            k1 = rate(q, v)
            k2 = rate(q + h / 2 * k1[0], v + h / 2 * k1[1])
            k3 = rate(q + h / 2 * k2[0], v + h / 2 * k2[1])
            k4 = rate(q + h * k3[0], v + h * k3[1])
            q = q + h / 6 * (k1[0] + 2 * k2[0] + 2 * k3[0] + k4[0])
            v = v + h / 6 * (k1[1] + 2 * k2[1] + 2 * k3[1] + k4[1])
        return q, v

    def fast(self, q, v, tau):
        settings = pin.ProximalSettings(1e-14, 1e-14, 1e-10, 100)
        return pin.constraintDynamics(
            self.model, self.data, q, v, tau, self.pairs, self.datas, settings).copy()


def rps3():
    """robots/3rps.yaml; a spherical joint is three revolute joints, about z, y and x of its frame."""
    m = Mechanism(G)
    a = 0.4563
    r = a / np.sqrt(3)
    swing = lambda: body(5.0, (0, -0.08, 0), (0.0215, 0.0027, 0.0215))
    slide = lambda: body(3.4, (0, 0, -0.15), (0.0255, 0.0255, 0.0004))
    corner = lambda angle: at(r * np.cos(angle), r * np.sin(angle), 0, rz(angle) @ rx(-np.pi / 2))
    legs = []
    for turn, prism, angle in (("q1", "q2", 0), ("q6", "q7", 2 * np.pi / 3), ("q8", "q9", -2 * np.pi / 3)):
        first = m.joint(0, pin.JointModelRZ(), corner(angle), turn, swing())
        legs.append(m.joint(first, pin.JointModelPZ(), at(0, 0, 0, rx(np.pi / 2)), prism, slide()))
        if angle == 0:
            platform = body(6.048, (a / 2, a * np.sqrt(3) / 6, 0), (0.1187, 0.1187, 0.2371))
            last = legs[0]
            for k, (kind, inertia) in enumerate(SPHERICAL(platform)):
                last = m.joint(last, kind, pin.SE3.Identity(), f"s1.{k + 1}", inertia)
    m.meet((last, at(a, 0, 0)), (legs[1], pin.SE3.Identity()))
    m.meet((last, at(a / 2, a * np.sqrt(3) / 2, 0)), (legs[2], pin.SE3.Identity()))
    home = dict(q2=0.6, q7=0.6, q9=0.6)
    home["s1.1"] = 5 * np.pi / 6
    return m.ready(), home, ["q2", "q7", "q9"]


def SPHERICAL(inertia):
    return [(pin.JointModelRZ(), None), (pin.JointModelRY(), None), (pin.JointModelRX(), inertia)]


def fivebar():
    """robots/fivebar.yaml; the tip's equation normal to its plane is 0 = 0."""
    m = Mechanism(G)
    crank = lambda: body(0.24, (0.15, 0, 0), (1e-5, 1.8e-3, 1.8e-3))
    rod = lambda: body(0.32, (0.2, 0, 0), (1e-5, 4.27e-3, 4.27e-3))
    rods = []
    for names, x in ((("q1", "q2"), 0), (("q3", "q4"), 0.2)):
        first = m.joint(0, pin.JointModelRZ(), at(x, 0, 0, rx(np.pi / 2)), names[0], crank())
        rods.append(m.joint(first, pin.JointModelRZ(), at(0.3, 0, 0), names[1], rod()))
    m.meet((rods[0], at(0.4, 0, 0)), (rods[1], at(0.4, 0, 0)))
    return m.ready(), dict(q1=2.0, q2=-1.0, q3=1.1, q4=1.0), ["q1", "q3"]


def vectors(name, made, spread, speed, effort, hold, duration, steps, seed):
    mechanism, home, actuated = made
    random = np.random.default_rng(seed)
    size = mechanism.model.nv
    at_home = np.array([home.get(n, 0.0) for n in mechanism.names])
    fixed = [mechanism.names.index(n) for n in actuated]
    tau_of = lambda efforts: np.bincount(fixed, efforts, size)
    states = []
    for _ in range(12):
        q = mechanism.closed(at_home, fixed)
        # in small steps from home, to stay on its branch
        target = q[fixed] + spread * random.uniform(-1, 1, len(fixed))
        for part in np.linspace(0, 1, 21)[1:]:
            near = q.copy()
            near[fixed] += (target - q[fixed]) * 1.0 if part == 1 else (target - q[fixed]) * 0.15
            q = mechanism.closed(near, fixed)
        v = mechanism.moving(q, fixed, speed * random.uniform(-1, 1, len(fixed)))
        efforts = hold + effort * random.uniform(-1, 1, len(fixed))
        a = mechanism.accelerations(q, v, tau_of(efforts))
        states.append(dict(q=q.tolist(), qd=v.tolist(), effort=efforts.tolist(), qdd=a.tolist()))
    q = mechanism.closed(at_home, fixed)
    v = mechanism.moving(q, fixed, speed / 4 * random.uniform(-1, 1, len(fixed)))
    efforts = hold + effort / 10 * random.uniform(-1, 1, len(fixed))
    ends = [mechanism.run(q, v, tau_of(efforts), duration, n) for n in (steps, 2 * steps)]
    off = max(np.abs(a - b).max() for a, b in zip(*ends))
    print(name, "halving the step changes the end by", off,
          "gap", np.abs(mechanism.gap(ends[1][0])).max())
    return dict(
        robot=name, coordinates=mechanism.names, actuated=actuated, states=states,
        run=dict(q=q.tolist(), qd=v.tolist(), effort=efforts.tolist(), duration=duration,
                 end_q=ends[1][0].tolist(), end_qd=ends[1][1].tolist()))


def main():
    out = [
        vectors("rps3", rps3(), 0.06, 0.4, 60.0, 53.1, 0.3, 600, 1),
        vectors("fivebar", fivebar(), 0.3, 2.0, 1.0, np.array([-0.84, 0.89]), 0.5, 2000, 2),
    ]
    path = pathlib.Path(__file__).resolve().parents[2] / "fixtures/computed/simulation.json"
    path.write_text(json.dumps(dict(engine=f"pinocchio {pin.__version__}", robots=out), indent=1) + "\n")


if __name__ == "__main__":
    main()
