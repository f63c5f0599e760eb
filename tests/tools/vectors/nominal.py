"""Computes joint torques of published arms from the tables of their sources, by Pinocchio.

Writes tests/fixtures/computed/nominal.json: for each robot a few states and the inverse dynamics
that Pinocchio computes from the source's own frames and inertias. `python
tests/tools/vectors/nominal.py --bodies` prints the sources' inertias in the frames of
robots/*.yaml instead.

Needs: pip install numpy pin==4.1.0
"""

import json
import pathlib
import sys

import numpy as np
import pinocchio as pin

PI = np.pi

# Universal_Robots_ROS2_Description, config/ur5e at 3426d67 and the nominal kinematics there:
# xyz and rpy of the joint, mass, centre of mass, roll of the tensor's frame, xx xy xz yy yz zz.
UR5E = [
    ((0, 0, 0.1625), (0, 0, 0), 3.761, (0, -0.00193, -0.02561), PI / 2,
     (0.00700210, 0.00000073, -0.00001053, 0.00648091, 0.00049994, 0.00657286)),
    ((0, 0, 0), (PI / 2, 0, 0), 8.058, (-0.2125, 0, 0.11336), 0,
     (0.01505885, -0.00005400, 0.00000563, 0.33388086, -0.00000181, 0.33247207)),
    ((-0.425, 0, 0), (0, 0, 0), 2.846, (-0.2422, 0, 0.0265), 0,
     (0.00399632, -0.00001365, 0.00137272, 0.07879254, -0.00000660, 0.07848510)),
    ((-0.3922, 0, 0.1333), (0, 0, 0), 1.37, (0, -0.01634, -0.0018), PI / 2,
     (0.00165491, -0.00000282, -0.00000438, 0.00135962, 0.00010157, 0.00126279)),
    ((0, -0.0997, 0), (PI / 2, 0, 0), 1.3, (0, 0.01634, -0.0018), -PI / 2,
     (0.00135617, -0.00000274, 0.00000444, 0.00127827, -0.00005048, 0.00096614)),
    ((0, 0.0996, 0), (PI / 2, PI, PI), 0.365, (0, 0, -0.001159), 0,
     (0.00018694, 0.00000006, -0.00000017, 0.00018908, -0.00000092, 0.00025756)),
]

# Gaz and others (2019), from franka_ros, franka_description/robots/common/inertial.yaml at b2a62ff,
# in the frames of franka_description, robots/fer/kinematics.yaml at 1ddff9b.
PANDA = [
    ((0, 0, 0.333), (0, 0, 0), 4.970684, (0.003875, 0.002081, -0.04762), 0,
     (0.70337, -0.000139, 0.006772, 0.70661, 0.019169, 0.009117)),
    ((0, 0, 0), (-PI / 2, 0, 0), 0.646926, (-0.003141, -0.02872, 0.003495), 0,
     (0.007962, -0.003925, 0.010254, 0.02811, 0.000704, 0.025995)),
    ((0, -0.316, 0), (PI / 2, 0, 0), 3.228604, (0.027518, 0.039252, -0.066502), 0,
     (0.037242, -0.004761, -0.011396, 0.036155, -0.012805, 0.01083)),
    ((0.0825, 0, 0), (PI / 2, 0, 0), 3.587895, (-0.05317, 0.104419, 0.027454), 0,
     (0.025853, 0.007796, -0.001332, 0.019552, 0.008641, 0.028323)),
    ((-0.0825, 0.384, 0), (-PI / 2, 0, 0), 1.225946, (-0.011953, 0.041065, -0.038437), 0,
     (0.035549, -0.002117, -0.004037, 0.029474, 0.000229, 0.008627)),
    ((0, 0, 0), (PI / 2, 0, 0), 1.666555, (0.060149, -0.014117, -0.010517), 0,
     (0.001964, 0.000109, -0.001158, 0.004354, 0.000341, 0.005433)),
    ((0.088, 0, 0), (PI / 2, 0, 0), 0.735522, (0.010517, -0.004252, 0.061597), 0,
     (0.012516, -0.000428, -0.001196, 0.010027, -0.000741, 0.004815)),
]

# Drake, manipulation/models/iiwa_description/urdf/iiwa14_no_collision.urdf at 0b6a9c3.
IIWA14 = [
    ((0, 0, 0.1575), (0, 0, 0), 5.76, (0, -0.03, 0.12), 0, (0.033, 0, 0, 0.0333, 0, 0.0123)),
    ((0, 0, 0.2025), (PI / 2, 0, PI), 6.35, (0.0003, 0.059, 0.042), 0, (0.0305, 0, 0, 0.0304, 0, 0.011)),
    ((0, 0.2045, 0), (PI / 2, 0, PI), 3.5, (0, 0.03, 0.13), 0, (0.025, 0, 0, 0.0238, 0, 0.0076)),
    ((0, 0, 0.2155), (PI / 2, 0, 0), 3.5, (0, 0.067, 0.034), 0, (0.017, 0, 0, 0.0164, 0, 0.006)),
    ((0, 0.1845, 0), (-PI / 2, PI, 0), 3.5, (0.0001, 0.021, 0.076), 0, (0.01, 0, 0, 0.0087, 0, 0.00449)),
    ((0, 0, 0.2155), (PI / 2, 0, 0), 1.8, (0, 0.0006, 0.0004), 0, (0.0049, 0, 0, 0.0047, 0, 0.0036)),
    ((0, 0.081, 0), (-PI / 2, PI, 0), 1.2, (0, 0, 0.02), 0, (0.001, 0, 0, 0.001, 0, 0.001)),
]

# Armstrong, Khatib and Burdick (1986). Of link 1 only the moment about its axis is measured; its
# other parameters do not affect the torques.
PUMA560 = [
    ((0, 0, 0), (0, 0, 0), 0, (0, 0, 0), 0, (0, 0, 0, 0, 0, 0.35)),
    ((0, 0.2435, 0), (-PI / 2, 0, 0), 17.4, (0.068, 0.006, -0.016), 0, (0.13, 0, 0, 0.524, 0, 0.539)),
    ((0.4318, 0, -0.0934), (0, 0, 0), 4.8, (0, -0.07, 0.014), 0, (0.066, 0, 0, 0.0125, 0, 0.066)),
    ((-0.0203, -0.4331, 0), (PI / 2, 0, 0), 0.82, (0, 0, -0.019), 0, (1.8e-3, 0, 0, 1.8e-3, 0, 1.3e-3)),
    ((0, 0, 0), (-PI / 2, 0, 0), 0.34, (0, 0, 0), 0, (0.3e-3, 0, 0, 0.3e-3, 0, 0.4e-3)),
    ((0, 0, 0), (PI / 2, 0, 0), 0.09, (0, 0, 0.032), 0, (0.15e-3, 0, 0, 0.15e-3, 0, 0.04e-3)),
]

# The modified Denavit-Hartenberg rows of robots/*.yaml: alpha, a, d.
ROWS = {
    "puma560": [(0, 0, 0), (-PI / 2, 0, 0.2435), (0, 0.4318, -0.0934), (PI / 2, -0.0203, 0.4331),
                (-PI / 2, 0, 0), (PI / 2, 0, 0)],
    "ur5e": [(0, 0, 0.1625), (PI / 2, 0, 0), (0, -0.425, 0), (0, -0.3922, 0.1333),
             (PI / 2, 0, 0.0997), (-PI / 2, 0, 0.0996)],
    "panda": [(0, 0, 0.333), (-PI / 2, 0, 0), (PI / 2, 0, 0.316), (PI / 2, 0.0825, 0),
              (-PI / 2, -0.0825, 0.384), (PI / 2, 0, 0), (PI / 2, 0.088, 0)],
    "iiwa14": [(0, 0, 0.36), (-PI / 2, 0, 0), (PI / 2, 0, 0.42), (PI / 2, 0, 0),
               (-PI / 2, 0, 0.4), (-PI / 2, 0, 0), (PI / 2, 0, 0)],
}
SOURCES = {"puma560": PUMA560, "ur5e": UR5E, "panda": PANDA, "iiwa14": IIWA14}


def matrix(six):
    xx, xy, xz, yy, yz, zz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def inertia(mass, com, roll, six):
    turn = pin.rpy.rpyToMatrix(roll, 0, 0)
    return pin.Inertia(mass, np.array(com, float), turn @ matrix(six) @ turn.T)


def model(links):
    built = pin.Model()
    for i, (xyz, rpy, mass, com, roll, six) in enumerate(links):
        place = pin.SE3(pin.rpy.rpyToMatrix(*map(float, rpy)), np.array(xyz, float))
        joint = built.addJoint(i, pin.JointModelRZ(), place, f"q{i + 1}")
        built.appendBodyToJoint(joint, inertia(mass, com, roll, six), pin.SE3.Identity())
    return built


def bodies():
    """The sources' inertias in the frames of robots/*.yaml."""
    for name, links in SOURCES.items():
        print(name)
        source, ours = pin.SE3.Identity(), pin.SE3.Identity()
        for (xyz, rpy, mass, com, roll, six), (alpha, a, d) in zip(links, ROWS[name]):
            source = source * pin.SE3(pin.rpy.rpyToMatrix(*map(float, rpy)), np.array(xyz, float))
            turn = pin.rpy.rpyToMatrix(alpha, 0, 0)
            ours = ours * pin.SE3(turn, np.array([a, 0, 0]) + turn @ np.array([0, 0, d]))
            x = ours.inverse() * source
            # the axes are equal: the frames differ only by a translation along and a rotation about it
            assert abs(x.rotation[2, 2] - 1) < 1e-9 and np.abs(x.translation[:2]).max() < 1e-9, name
            i = x.act(inertia(mass, com, roll, six))
            numbers = [float(f"{v:.9g}") + 0.0 for v in
                       [*np.round(i.lever, 9), *np.round(np.array(i.inertia)[np.triu_indices(3)], 12)]]
            print(f"  mass {mass} com {numbers[:3]} inertia {numbers[3:]}")


def torques(links):
    built = model(links)
    data = built.createData()
    return lambda q, qd, qdd: pin.rnea(built, data, q, qd, qdd)


def vectors():
    random = np.random.default_rng(20260101)
    out = {}
    for name, links in SOURCES.items():
        n, tau = len(links), torques(links)
        # one state at rest with the arm out: gravity alone
        states = [(np.full(n, 0.3), np.zeros(n), np.zeros(n))]
        states += [tuple(random.uniform(-s, s, n) for s in (3, 2, 5)) for _ in range(5)]
        out[name] = [{"q": list(q), "qd": list(v), "qdd": list(a), "tau": list(tau(q, v, a))}
                     for q, v, a in states]
    path = pathlib.Path(__file__).resolve().parents[2] / "fixtures/computed/nominal.json"
    lines = [f' "{name}": [\n  ' + ",\n  ".join(map(json.dumps, states)) + "\n ]"
             for name, states in out.items()]
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    bodies() if "--bodies" in sys.argv else vectors()
