"""Functions over arrays of states, against each other and against formulas."""

import numpy as np
import pytest

import regen

PENDULUM = """\
name: pendulum
limbs:
  - name: arm
    base: {rpy: [-pi/2, 0, 0]}
    joints:
      - {name: q1, type: revolute, body: 1, actuated: true}
"""


def test_a_pendulum_has_the_efforts_of_the_textbook():
    robot = regen.Robot(PENDULUM)
    mass, arm, inertia = 2.0, 0.5, 0.6
    phi = np.zeros(10)
    phi[robot.parameters.index("m(1)")] = mass
    phi[robot.parameters.index("mx(1)")] = mass * arm
    phi[robot.parameters.index("Izz(1)")] = inertia
    rng = np.random.default_rng(1)
    q, qd, qdd = rng.uniform(-3, 3, (3, 200, 1))
    tau = robot.inverse_dynamics(q, qd, qdd, phi)
    weight = robot.gravity([[0.0]], phi)[0, 0]
    assert abs(weight) == pytest.approx(mass * 9.81 * arm, rel=1e-14)
    np.testing.assert_allclose(tau, inertia * qdd + weight * np.cos(q), rtol=0, atol=1e-12)
    np.testing.assert_allclose(robot.mass_matrix(q, phi), np.full((200, 1, 1), inertia), rtol=1e-14)


@pytest.mark.parametrize("count", [1, 2, 63, 64, 65, 700])
def test_regressor_times_parameters_is_the_inverse_dynamics(fivebar, count):
    rng = np.random.default_rng(count)
    t = np.linspace(0, 1, count)[:, None]
    q_i = [[2.0, 1.1]] + 0.2 * np.sin(t * [[3.0, 5.0]])
    qd_i, qdd_i = rng.normal(size=(2, count, 2))
    closed = fivebar.close(q_i, qd_i, qdd_i)
    assert closed.ok.all()
    phi = rng.normal(size=len(fivebar.parameters))
    w = fivebar.regressor(*closed[:3])
    assert w.shape == (count, 2, len(phi)) and w.flags.c_contiguous
    tau = fivebar.inverse_dynamics(*closed[:3], phi)
    np.testing.assert_allclose(w @ phi, tau, rtol=0, atol=1e-11 * abs(tau).max())
    base = fivebar.base_regressor(*closed[:3])
    np.testing.assert_allclose(base @ fivebar.to_base(phi), tau, rtol=0, atol=1e-10 * abs(tau).max())
    # the mass matrix is the change of the efforts with the accelerations
    m = fivebar.mass_matrix(closed.q, phi)
    bias = fivebar.bias_forces(closed.q, closed.qd, phi) + fivebar.gravity(closed.q, phi)
    again = np.einsum("nij,nj->ni", m, qdd_i) + bias
    np.testing.assert_allclose(again, tau, rtol=0, atol=1e-10 * abs(tau).max())


def test_functions_of_controllers_agree_with_the_others(fivebar):
    rng = np.random.default_rng(5)
    t = np.linspace(0, 1, 70)[:, None]
    qd_i, qdd_i = rng.normal(size=(2, 70, 2))
    closed = fivebar.close([[2.0, 1.1]] + 0.2 * np.sin(t * [[3.0, 5.0]]), qd_i, qdd_i)
    bodies = len(fivebar.bodies)
    phi = np.full(len(fivebar.parameters), 0.05)
    phi[: 10 * bodies] = np.tile([0.02, 0, 0, 0.03, 0, 0.03, 0.1, 0, 0, 1.0], bodies)
    m = fivebar.mass_matrix(closed.q, phi)
    p = fivebar.momentum(closed.q, closed.qd, phi)
    np.testing.assert_allclose(p, np.einsum("nij,nj->ni", m, qd_i), rtol=0, atol=1e-12)
    tau = fivebar.inverse_dynamics(*closed[:3], phi)
    again = fivebar.forward_dynamics(closed.q, closed.qd, tau, phi)
    np.testing.assert_allclose(again, qdd_i, rtol=0, atol=1e-9)
    forward = fivebar.forward_dynamics_derivatives(closed.q, closed.qd, tau, phi)
    inverse = fivebar.inverse_dynamics_derivatives(*closed[:3], phi)
    assert forward.shape == (70, 2, 6) and inverse.shape == (70, 2, 4)
    unit = np.broadcast_to(np.eye(2), (70, 2, 2))
    expected = np.concatenate([-inverse, unit], axis=-1)
    np.testing.assert_allclose(m @ forward, expected, rtol=0, atol=1e-9 * abs(inverse).max())


def test_every_function_is_a_method_with_shapes_and_units(fivebar):
    # functions of base parameters are those with `beta`
    names = {name.removeprefix("base_") for name in fivebar.functions}
    for name in names | {"derivatives"}:
        text = getattr(regen.Robot, name).__doc__
        assert "shape" in text or ":class:" in text, name


def test_every_function_takes_arrays_of_states(fivebar):
    rng = np.random.default_rng(7)
    q_i = [2.0, 1.1] + 0.1 * rng.normal(size=(4, 5, 2))
    closed = fivebar.close(q_i.reshape(-1, 2), *rng.normal(size=(2, 20, 2)))
    n, dof, p = 4, fivebar.dof, len(fivebar.parameters)
    widths = {"tau_actuated": 2, "free": p - len(fivebar.base), "beta": len(fivebar.base), "phi": p}
    given = dict(zip(("q", "qd", "qdd"), (x.reshape(4, 5, n) for x in closed[:3])))
    for name in fivebar.functions:
        arguments = {}
        for argument in fivebar._functions[name]["arguments"]:
            own = argument["name"]
            lead = () if argument["parameter"] else (4, 5)
            arguments[own] = given.get(own, np.full((*lead, widths.get(own, dof)), 0.5))
        whole = fivebar.evaluate(name, **arguments)
        alone = {k: v if v.ndim == 1 else v[2, 3] for k, v in arguments.items()}
        np.testing.assert_array_equal(fivebar.evaluate(name, **alone), whole[2, 3] if "q" in arguments else whole)
        if not name.startswith("base_"):
            np.testing.assert_array_equal(getattr(fivebar, name)(**arguments), whole)


def test_derivatives_are_those_of_differences_along_the_closure(picker):
    rng = np.random.default_rng(11)
    q = [2.2, 0.94] + 0.2 * rng.uniform(-1, 1, (30, 2))
    qd, qdd = rng.normal(size=(2, 30, 2))
    phi = picker.nominal
    inverse = picker.derivatives(q, qd, qdd, by_phi=True)
    forward = picker.derivatives(q, qd, tau_i=inverse.value, phi=phi, by_phi=True)
    np.testing.assert_allclose(forward.value, qdd, rtol=0, atol=1e-9)
    assert picker.derivatives(q, qd, qdd).phi is None and forward.phi.shape == (30, 2, len(phi))
    step = 1e-6
    for found, function, last in (
        (inverse, picker.inverse_dynamics, qdd),
        (forward, picker.forward_dynamics, inverse.value),
    ):
        given = [q, qd, last, phi]
        for k, (values, slopes) in enumerate(zip(given, found[1:])):
            for c in range(values.shape[-1]):
                sides = []
                for sign in (1, -1):
                    moved = list(given)
                    moved[k] = values + sign * step * np.eye(values.shape[-1])[c]
                    sides.append(function(*moved))
                differences = (sides[0] - sides[1]) / (2 * step)
                # rounding of values of order 10 over the step, and the third derivative
                np.testing.assert_allclose(slopes[..., c], differences, rtol=1e-6, atol=1e-6 * abs(slopes).max())
    with pytest.raises(regen.InputError, match="either qdd"):
        picker.derivatives(q, qd)


def test_parameters_from_base_have_these_base_parameters(picker):
    beta = picker.to_base() + 0.1
    np.testing.assert_allclose(picker.to_base(picker.parameters_from_base(beta)), beta, atol=1e-12)


def test_closed_states_satisfy_the_loops_and_their_derivatives(fivebar):
    t = np.linspace(0, 2, 401)[:, None]
    q_i = [[2.0, 1.1]] + 0.2 * np.sin(t * [[3.0, 5.0]])
    qd_i = 0.2 * np.cos(t * [[3.0, 5.0]]) * [[3.0, 5.0]]
    closed = fivebar.close(q_i, qd_i)
    assert abs(fivebar.evaluate("constraints", q=closed.q)).max() < 1e-12
    jacobian = fivebar.evaluate("jacobian", q=closed.q)
    assert abs(np.einsum("nij,nj->ni", jacobian, closed.qd)).max() < 1e-12
    k = [fivebar.coordinates.index(name) for name in fivebar.independent]
    np.testing.assert_array_equal(closed.q[:, k], q_i)
    # the velocities are those of the positions
    slope = np.gradient(closed.q, t[:, 0], axis=0)[1:-1]
    np.testing.assert_allclose(slope, closed.qd[1:-1], atol=2e-3)


def test_the_shape_of_one_state_of_many_and_of_grids(fivebar):
    n, dof = len(fivebar.coordinates), fivebar.dof
    q = fivebar.home
    zero = np.zeros(n)
    one = fivebar.regressor(q, zero, zero)
    assert one.shape == (dof, len(fivebar.parameters))
    grid = np.broadcast_to(q, (3, 4, n))
    many = fivebar.regressor(grid, np.zeros((3, 4, n)), np.zeros((3, 4, n)))
    assert many.shape == (3, 4, *one.shape)
    np.testing.assert_array_equal(many[2, 3], one)
    # not contiguous, and of integers
    striped = np.repeat(grid, 2, axis=2)[:, :, ::2]
    np.testing.assert_array_equal(fivebar.gravity(striped, np.arange(len(fivebar.parameters))),
                                  fivebar.gravity(grid, np.arange(len(fivebar.parameters))))
    assert fivebar.regressor(np.empty((0, n)), np.empty((0, n)), np.empty((0, n))).shape[0] == 0


def test_independent_coordinates_are_closed_first(fivebar):
    q_i = np.array([[2.0, 1.1], [2.1, 1.0]])
    closed = fivebar.close(q_i, q_i, q_i)
    np.testing.assert_array_equal(fivebar.regressor(q_i, q_i, q_i), fivebar.regressor(*closed[:3]))


def test_states_that_cannot_be_closed_are_told(picker):
    # cranks that point away from each other: 0.65 m between the ends of rods of 0.3 m
    far = np.array([[2.2, 0.94], [np.pi, 0.0], [2.2, 0.94]])
    closed = picker.close(far)
    assert list(closed.ok) == [True, False, True]
    assert np.isnan(closed.q[1]).any() and closed.reasons[1]
    np.testing.assert_allclose(closed.q[2], closed.q[0], atol=1e-9)
    with pytest.raises(regen.NumericError, match="state 1"):
        picker.gravity(far, np.zeros(len(picker.parameters)))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"q": [[0.0] * 3]}, "q"),
        ({"q": 0.0}, "last must be"),
    ],
)
def test_wrong_shapes_are_told(scara, arguments, words):
    with pytest.raises(regen.InputError, match=words):
        scara.gravity(**arguments, phi=np.zeros(len(scara.parameters)))


def test_wrong_names_and_missing_values_are_told(scara):
    n = len(scara.coordinates)
    with pytest.raises(regen.InputError, match="needs q, qd, qdd"):
        scara.evaluate("regressor", q=np.zeros(n))
    with pytest.raises(regen.InputError, match="no function"):
        scara.evaluate("regresor", q=np.zeros(n))
    with pytest.raises(regen.InputError, match="states"):
        scara.regressor(np.zeros((2, n)), np.zeros((3, n)), np.zeros((2, n)))
    with pytest.raises(regen.InputError, match="nominal"):
        regen.Robot(PENDULUM).gravity([0.0])
    with pytest.raises(regen.InputError, match="not both"):
        scara.gravity(np.zeros(n), phi=[0.0], beta=[0.0])


def test_other_threads_run_while_states_are_computed(fivebar):
    import threading
    import time

    n = len(fivebar.coordinates)
    q = np.broadcast_to(fivebar.home, (400_000, n))
    zero = np.zeros_like(q)
    ticks = []
    stop = threading.Event()

    def count():
        while not stop.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    begin = time.perf_counter()
    fivebar.regressor(q, zero, zero)
    end = time.perf_counter()
    stop.set()
    thread.join()
    during = [t for t in ticks if begin < t < end]
    gaps = np.diff([begin, *during, end])
    # with the lock held throughout, one gap would be nearly the whole time
    assert gaps.max() < 0.9 * (end - begin)
