"""Dynamics in JAX: values, derivatives, transformations."""

import numpy as np
import pytest

import regen

jax = pytest.importorskip("jax")
jax.config.update("jax_enable_x64", True)
jnp = pytest.importorskip("jax.numpy")


@pytest.fixture(scope="module")
def both(picker):
    import regen.jax

    return regen.jax.inverse_dynamics(picker), regen.jax.forward_dynamics(picker)


@pytest.fixture(scope="module")
def states():
    rng = np.random.default_rng(2)
    return [2.2, 0.94] + 0.2 * rng.uniform(-1, 1, (12, 2)), *rng.normal(size=(2, 12, 2))


def test_values_are_those_of_the_robot_alone_in_batches_and_compiled(picker, both, states):
    inverse, forward = both
    tau = picker.inverse_dynamics(*states)
    np.testing.assert_allclose(inverse(*states), tau, rtol=1e-9, atol=1e-11)
    np.testing.assert_array_equal(jax.jit(inverse)(*states), inverse(*states))
    np.testing.assert_array_equal(jax.vmap(inverse)(*states), inverse(*states))
    # a state's result does not depend on the others of a batch
    alone = [inverse(*(x[k] for x in states)) for k in range(12)]
    np.testing.assert_allclose(np.array(alone), inverse(*states), rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(forward(*states[:2], tau), states[2], rtol=0, atol=1e-9)
    # other parameters for each state
    phi = picker.nominal * np.linspace(0.5, 1.5, 12)[:, None]
    many = jax.vmap(inverse)(*states, phi)
    np.testing.assert_allclose(many[3], picker.inverse_dynamics(*(x[3] for x in states), phi[3]), rtol=1e-9)
    np.testing.assert_array_equal(many, inverse(*states, phi))


def test_derivatives_by_all_arguments_are_exact_forwards_and_backwards(picker, both, states):
    q, qd, qdd = (x[4] for x in states)
    exact = (
        picker.derivatives(q, qd, qdd, by_phi=True),
        picker.derivatives(q, qd, tau_i=qdd, by_phi=True),
    )
    for function, own in zip(both, exact):
        given = (q, qd, qdd, jnp.asarray(picker.nominal))
        for mode in (jax.jacfwd, jax.jacrev):
            found = jax.jit(mode(function, argnums=(0, 1, 2, 3)))(*given)
            for slope, expected in zip(found, own[1:]):
                scale = abs(expected).max()
                np.testing.assert_allclose(slope, expected, rtol=0, atol=1e-9 * scale)
        # those of a batch
        many = jax.vmap(jax.jacfwd(function, argnums=1))(*states)
        np.testing.assert_allclose(many[4], own.qd, rtol=0, atol=1e-9 * abs(own.qd).max())
        with pytest.raises(ValueError, match="JVP"):
            jax.hessian(function)(*given)


def test_gradients_of_a_motion_by_its_parameters(picker, both):
    _, forward = both

    def end(phi):
        def step(x, _):
            q, qd = x
            qd = qd + 0.01 * forward(q, qd, jnp.array([0.3, -0.2]), phi)
            return (q + 0.01 * qd, qd), None

        (q, _), _ = jax.lax.scan(step, (jnp.array([2.2, 0.94]), jnp.zeros(2)), None, length=10)
        return q.sum()

    phi = jnp.asarray(picker.nominal)
    slope = jax.jit(jax.grad(end))(phi)
    k = picker.parameters.index("Izz(1)")
    moved = 1e-6 * jnp.eye(len(phi))[k]
    assert slope[k] == pytest.approx(float(end(phi + moved) - end(phi - moved)) / 2e-6, rel=1e-5)


def test_what_has_no_result_is_nan_and_wrong_shapes_are_told(both):
    inverse, forward = both
    # cranks that point away from each other, and a value that is not finite
    q = np.array([[np.pi, 0.0], [2.2, 0.94], [np.nan, 0.94]])
    assert np.isnan(inverse(q, 0 * q[1:2], q[1:2])).all(axis=1).tolist() == [True, False, True]
    assert np.isfinite(jax.jacobian(forward)(q[1], q[1], q[1])).all()
    with pytest.raises(regen.InputError, match="qd_i"):
        inverse(q, np.zeros(3), q)


def test_an_arm_without_loops_and_single_precision(scara):
    import regen.jax

    q = np.linspace(-0.3, 0.4, len(scara.coordinates))
    phi = np.linspace(0.1, 0.3, len(scara.parameters))
    found = regen.jax.inverse_dynamics(scara)(q, q, q, phi)
    np.testing.assert_allclose(found, scara.inverse_dynamics(q, q, q, phi), rtol=1e-12)
    small = [np.asarray(x, np.float32) for x in (q, q, q, phi)]
    found = regen.jax.inverse_dynamics(scara)(*small)
    assert found.dtype == jnp.float32


def test_the_example_in_the_documentation():
    import doctest

    import regen.jax

    assert doctest.testmod(regen.jax).failed == 0
