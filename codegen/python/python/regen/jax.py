"""Dynamics of a robot as functions of JAX, with exact derivatives; ``import regen.jax`` asks for JAX.

>>> import jax.numpy as jnp
>>> import regen, regen.jax
>>> robot = regen.Robot("name: arm\\nlimbs:\\n  - name: arm\\n    joints:\\n"
...                     "      - {name: q1, type: revolute, body: 1, actuated: true}\\n")
>>> inverse = regen.jax.inverse_dynamics(robot)
>>> unit = jnp.eye(10)[robot.parameters.index("Izz(1)")]
>>> slope = jax.jacobian(inverse, argnums=2)(jnp.zeros(1), jnp.zeros(1), jnp.ones(1), unit)
>>> float(slope[0, 0])
1.0
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from numpy.typing import NDArray

from .errors import InputError
from .functions import Derivatives
from .model import Array

if TYPE_CHECKING:
    from .robot import Robot

__all__ = ["forward_dynamics", "inverse_dynamics"]


def inverse_dynamics(robot: Robot) -> Callable[..., jax.Array]:
    """The inverse dynamics of a robot as a function of JAX.

    The result is a function of (q_i, qd_i, qdd_i, phi) of the independent coordinates, rad or m and
    s, each of shape (..., dof), and of the parameters, SI, of shape (p,), or (..., p) where they
    differ from state to state; without ``phi`` the nominal ones. It returns their efforts, N m or
    N, shape (..., dof), and works under ``jit``, ``vmap``, ``jvp``, ``vjp`` and ``grad``, once
    differentiated: the derivatives are exact, along the closure, and have none themselves.

    Loops are closed on the straight line from ``robot.home``, for each state by itself; where there
    is no closed state on it, and where an argument is not finite, the result is NaN. It is computed
    in double precision on the host and rounded to the type of the arguments: turn on
    ``jax_enable_x64`` for all of it.
    """
    return _dynamics(robot, False)


def forward_dynamics(robot: Robot) -> Callable[..., jax.Array]:
    """The forward dynamics of a robot as a function of JAX.

    As :func:`inverse_dynamics`, a function of (q_i, qd_i, tau_i, phi), with the efforts ``tau_i`` of
    the independent coordinates, N m or N. It returns their accelerations, rad/s^2 or m/s^2.
    """
    return _dynamics(robot, True)


def _dynamics(robot: Robot, forward: bool) -> Callable[..., jax.Array]:
    dof, p = robot.dof, len(robot.parameters)
    columns = (dof, dof, dof, p)

    def called(wanted: tuple[bool, ...], arrays: tuple[Any, ...]) -> list[jax.Array]:
        """The value and the wanted derivatives, by one call on the host."""
        lead = jnp.broadcast_shapes(*(x.shape[:-1] for x in arrays))
        kind = jnp.result_type(float, *arrays)
        widths = [c for c, is_wanted in zip(columns, wanted) if is_wanted]
        shapes = [(*lead, dof), *((*lead, dof, c) for c in widths)]

        def host(*given: Any) -> list[Any]:
            found = _evaluated(robot, forward, wanted, [np.asarray(x, float) for x in given])
            return [x.astype(kind) for x in found]

        struct: Any = jax.ShapeDtypeStruct
        results = [struct(shape, kind) for shape in shapes]
        out: list[jax.Array] = jax.pure_callback(host, results, *arrays, vmap_method="expand_dims")
        return out

    @jax.custom_jvp
    def dynamics(*arrays: Any) -> jax.Array:
        return called((False,) * 4, arrays)[0]

    def pushed(arrays: tuple[Any, ...], tangents: tuple[Any, ...]) -> tuple[jax.Array, jax.Array]:
        # constants have no tangents: their derivatives, such as the regressor, are not computed
        moving = [t for t in tangents if not isinstance(t, SymbolicZero)]
        wanted = tuple(not isinstance(t, SymbolicZero) for t in tangents)
        value, *slopes = called(wanted, arrays)
        out = jnp.zeros_like(value)
        for slope, tangent in zip(slopes, moving):
            out = out + jnp.einsum("...ij,...j->...i", slope, tangent)
        return value, out

    dynamics.defjvp(pushed, symbolic_zeros=True)

    def checked(q_i: Any, qd_i: Any, last: Any, phi: Any = None) -> jax.Array:
        arrays = [jnp.asarray(x, jnp.result_type(float, x)) for x in (q_i, qd_i, last)]
        arrays.append(jnp.asarray(robot._known(phi)))
        names = ("q_i", "qd_i", "tau_i" if forward else "qdd_i", "phi")
        for name, array, length in zip(names, arrays, columns):
            if array.shape[-1:] != (length,):
                raise InputError(f"`{name}` has shape {array.shape}, the last must be {length}")
        out: jax.Array = dynamics(*arrays)
        return out

    checked.__doc__ = (forward_dynamics if forward else inverse_dynamics).__doc__
    checked.__name__ = checked.__qualname__ = "forward_dynamics" if forward else "inverse_dynamics"
    return checked


def _evaluated(
    robot: Robot, forward: bool, wanted: tuple[bool, ...], given: list[Array]
) -> list[Array]:
    """The value and the wanted derivatives at many states, NaN where there are none."""
    lead = np.broadcast_shapes(*(x.shape[:-1] for x in given))
    count = int(np.prod(lead))
    *states, phis = (np.broadcast_to(x, (*lead, x.shape[-1])).reshape(count, -1) for x in given)
    dof, p = robot.dof, phis.shape[1]
    parts: list[Array] = [np.full((count, dof), np.nan)]
    parts += [np.full((count, dof, c), np.nan) for c, w in zip((dof, dof, dof, p), wanted) if w]
    finite = np.all([np.isfinite(x).all(axis=1) for x in (*states, phis)], axis=0)
    # states with the same parameters are evaluated together
    groups = [(phis[0], finite)] if given[3].size == p and count else [
        (phi, finite & (phis == phi).all(axis=1)) for phi in np.unique(phis[finite], axis=0)
    ]
    for phi, chosen in groups:
        rows = np.flatnonzero(chosen)
        closed, full = _closed(robot, [x[rows] for x in states[: 2 if forward else 3]])
        rows = rows[closed]
        if not rows.size:
            continue
        last = {"tau_i": states[2][rows]} if forward else {"qdd": full[2]}
        found: Derivatives | None = None
        if any(wanted):
            found = robot.derivatives(full[0], full[1], **last, phi=phi, by_phi=wanted[3])
            value = found.value
        elif forward:
            value = robot.forward_dynamics(full[0], full[1], states[2][rows], phi)
        else:
            value = robot.inverse_dynamics(full[0], full[1], full[2], phi)
        slopes = [] if found is None else [s for s, w in zip(found[1:], wanted) if w]
        for part, values in zip(parts, (value, *slopes)):
            part[rows] = values
    return [part.reshape(*lead, *part.shape[1:]) for part in parts]


def _closed(robot: Robot, states: list[Array]) -> tuple[NDArray[np.bool_], list[Array]]:
    """Which states can be closed, and those in all coordinates."""
    if len(robot.coordinates) == robot.dof:
        return np.ones(len(states[0]), bool), states
    # home between them, so that no result depends on the other states of a batch
    home = robot.home[[robot.coordinates.index(name) for name in robot.independent]]
    all_states = []
    for k, values in enumerate(states):
        spread = np.zeros((2 * len(values), robot.dof))
        spread[::2] = home if k == 0 else 0.0
        spread[1::2] = values
        all_states.append(spread)
    found = robot.close(*all_states)
    ok = found.ok[1::2]
    return ok, [x[1::2][ok] for x in (found.q, found.qd, found.qdd)]
