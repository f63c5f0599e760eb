"""The functions of a robot over arrays of states."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import InputError, NumericError, translated
from .logs import numbers
from .model import Array, Model


#: What the names of columns begin with in logs, by argument.
_PREFIXES = {"q": "", "qd": "qd_", "qdd": "qdd_", "tau": "tau_"}


class Closed(NamedTuple):
    """States of a mechanism whose loops are closed."""

    #: All coordinates, rad or m; shape (..., n); NaN at states whose loops were not closed.
    q: Array
    #: All velocities, rad/s or m/s; shape (..., n).
    qd: Array
    #: All accelerations, rad/s^2 or m/s^2; shape (..., n).
    qdd: Array
    #: Whether the loops are closed; shape (...).
    ok: NDArray[np.bool_]
    #: For each state, the reason why its loops are not closed; empty if they are.
    reasons: list[str]


class Derivatives(NamedTuple):
    """Inverse or forward dynamics at many states, with exact derivatives along the closure."""

    #: The efforts of the independent coordinates, N m or N, or their accelerations, rad/s^2 or
    #: m/s^2; shape (..., dof).
    value: Array
    #: By the independent coordinates, SI; shape (..., dof, dof).
    q: Array
    #: By the independent velocities, SI; shape (..., dof, dof).
    qd: Array
    #: By the independent accelerations, for efforts: the mass matrix; by the efforts ``tau_i``, for
    #: accelerations: its inverse; SI; shape (..., dof, dof).
    input: Array
    #: By the parameters, SI, shape (..., dof, p); None where they were not asked for.
    phi: Array | None


class Functions(Model):
    """The functions of a robot over arrays of states; see :class:`Robot`."""

    def close(self, q: ArrayLike, qd: ArrayLike | None = None, qdd: ArrayLike | None = None) -> Closed:
        """Closes the loops along a trajectory of the independent coordinates.

        ``q``, ``qd``, ``qdd``: shape (dof,) or (N, dof), rad or m and s; velocities and
        accelerations are zero where they are not given. The first state is reached from
        :attr:`home` on a straight line, each other one from the state before it, so that the
        assembly branch stays the same.
        """
        q = _array("q", self._named("q_i", q), self.dof)
        shape = q.shape[:-1]
        rest = [
            np.zeros_like(q) if x is None else _array(n, self._named(n + "_i", x), self.dof)
            for n, x in (("qd", qd), ("qdd", qdd))
        ]
        rows = [_rows(x, shape, n) for x, n in zip((q, *rest), ("q", "qd", "qdd"))]
        try:
            *found, reasons = self._native.close(*rows)
        except ValueError as error:
            raise InputError(str(error)) from None
        n = len(self.coordinates)
        ok = np.array([not reason for reason in reasons]).reshape(shape)
        all_q, all_qd, all_qdd = (x.reshape(*shape, n) for x in found)
        return Closed(all_q, all_qd, all_qdd, ok, reasons)

    # -- loops

    def constraints(self, q: ArrayLike) -> Array:
        """The residuals of the closure equations, rad and m, zero at closed states; shape (..., rows)."""
        return self.evaluate("constraints", q=q)

    def jacobian(self, q: ArrayLike) -> Array:
        """The Jacobian A of :meth:`constraints` by all coordinates; shape (..., rows, n), SI."""
        return self.evaluate("jacobian", q=q)

    def bias(self, q: ArrayLike, qd: ArrayLike) -> Array:
        """The vector b of ``A @ qdd = b`` on closed states, SI per s^2; shape (..., rows)."""
        return self.evaluate("bias", q=q, qd=qd)

    def dependent_jacobian(self, q: ArrayLike) -> Array:
        """The square part of the Jacobian that is solved; shape (..., n - dof, n - dof), SI."""
        return self.evaluate("dependent_jacobian", q=q)

    def newton_step(self, q: ArrayLike) -> Array:
        """The step of the dependent coordinates towards a closed state, rad or m; shape (..., n - dof).

        ``q``: all coordinates, shape (..., n), which need not be closed.
        """
        return self.evaluate("newton_step", q=q)

    def velocities(self, q: ArrayLike, qd_i: ArrayLike) -> Array:
        """All velocities from the independent ones, rad/s or m/s; shape (..., n).

        ``qd_i``: shape (..., dof).
        """
        return self.evaluate("velocities", q=q, qd_i=qd_i)

    def accelerations(self, q: ArrayLike, qd: ArrayLike, qdd_i: ArrayLike) -> Array:
        """All accelerations from the independent ones, rad/s^2 or m/s^2; shape (..., n).

        ``qdd_i``: shape (..., dof).
        """
        return self.evaluate("accelerations", q=q, qd=qd, qdd_i=qdd_i)

    def poses(self, q: ArrayLike) -> Array:
        """The poses of the bodies in the world, in the order of :attr:`bodies`; shape (..., bodies, 12).

        The rotation matrix row by row, its columns the body's axes, then the origin in m.
        """
        return self.evaluate("poses", q=q)

    def cones(self, q: ArrayLike) -> Array:
        """The cosines of the angles that the description limits by cones; shape (..., cones)."""
        return self.evaluate("cones", q=q)

    # -- dynamics

    def regressor(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
        """The regressor, which maps the parameters to the efforts of the independent coordinates.

        ``q``, ``qd``, ``qdd``: shape (..., n). Returns shape (..., dof, p), SI.
        """
        return self.evaluate("regressor", q=q, qd=qd, qdd=qdd)

    def base_regressor(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
        """The regressor of the base parameters; shape (..., dof, rank), SI."""
        return self.evaluate("base_regressor", q=q, qd=qd, qdd=qdd)

    def inverse_dynamics(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        qdd: ArrayLike,
        phi: ArrayLike | None = None,
        *,
        beta: ArrayLike | None = None,
    ) -> Array:
        """The efforts of the independent coordinates, N m or N; shape (..., dof).

        ``phi``: the parameters, shape (p,), nominal values where it is not given; or ``beta``: the
        base parameters, shape (rank,).
        """
        return self._with_parameters("inverse_dynamics", phi, beta, q=q, qd=qd, qdd=qdd)

    def gravity(
        self, q: ArrayLike, phi: ArrayLike | None = None, *, beta: ArrayLike | None = None
    ) -> Array:
        """The efforts that hold the robot at rest, N m or N; shape (..., dof)."""
        return self._with_parameters("gravity", phi, beta, q=q)

    def bias_forces(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        phi: ArrayLike | None = None,
        *,
        beta: ArrayLike | None = None,
    ) -> Array:
        """Coriolis, centrifugal and friction efforts, N m or N; shape (..., dof).

        The efforts are ``mass_matrix @ qdd_i + bias_forces + gravity``.
        """
        return self._with_parameters("bias_forces", phi, beta, q=q, qd=qd)

    def mass_matrix(
        self, q: ArrayLike, phi: ArrayLike | None = None, *, beta: ArrayLike | None = None
    ) -> Array:
        """The mass matrix of the independent coordinates; shape (..., dof, dof), SI."""
        return self._with_parameters("mass_matrix", phi, beta, q=q)

    def adaptive_regressor(
        self, q: ArrayLike, qd: ArrayLike, qd_r_i: ArrayLike, qdd_r_i: ArrayLike
    ) -> Array:
        """The regressor Y of Slotine and Li's adaptive control; shape (..., dof, p), SI.

        ``Y @ phi`` is ``mass_matrix @ qdd_r_i + coriolis_matrix @ qd_r_i`` and gravity, of the
        reference velocities and accelerations of the independent coordinates, shape (..., dof).
        """
        arguments = {"q": q, "qd": qd, "qd_r_i": qd_r_i, "qdd_r_i": qdd_r_i}
        return self.evaluate("adaptive_regressor", **arguments)

    def generalized_forces(self, q: ArrayLike, tau_actuated: ArrayLike) -> Array:
        """What ``regressor @ phi`` must equal, from the efforts of motors, N m or N; shape (..., dof).

        ``tau_actuated``: the efforts in the order of :attr:`actuated`, N m or N, shape (..., actuated).
        """
        return self.evaluate("generalized_forces", q=q, tau_actuated=tau_actuated)

    # -- functions of controllers

    def momentum(self, q: ArrayLike, qd: ArrayLike, phi: ArrayLike | None = None) -> Array:
        """The generalised momentum ``mass_matrix @ qd_i``, kg m^2/s or kg m/s; shape (..., dof).

        This and the methods up to :meth:`forward_dynamics_derivatives` take states that close the
        loops, all coordinates and velocities of shape (..., n), and the parameters ``phi`` of
        shape (p,), nominal values where they are not given.
        """
        return self._with_parameters("momentum", phi, None, q=q, qd=qd)

    def momentum_rate(self, q: ArrayLike, qd: ArrayLike, phi: ArrayLike | None = None) -> Array:
        """The momentum's rate less the efforts, N m or N; shape (..., dof).

        It needs no acceleration: ``coriolis_matrix.T @ qd_i`` less gravity, friction and others.
        """
        return self._with_parameters("momentum_rate", phi, None, q=q, qd=qd)

    def momentum_regressor(self, q: ArrayLike, qd: ArrayLike) -> Array:
        """The regressor of :meth:`momentum`, whose product with ``phi`` it is; shape (..., dof, p), SI."""
        return self.evaluate("momentum_regressor", q=q, qd=qd)

    def momentum_rate_regressor(self, q: ArrayLike, qd: ArrayLike) -> Array:
        """The regressor of :meth:`momentum_rate`; shape (..., dof, p), SI.

        With it the equations of motion need no acceleration: the rate of
        ``momentum_regressor @ phi`` less ``momentum_rate_regressor @ phi`` is the effort.
        """
        return self.evaluate("momentum_rate_regressor", q=q, qd=qd)

    def coriolis_matrix(self, q: ArrayLike, qd: ArrayLike, phi: ArrayLike | None = None) -> Array:
        """The Coriolis matrix of the Christoffel symbols; shape (..., dof, dof), SI.

        The rate of the mass matrix less twice this matrix is skew-symmetric.
        """
        return self._with_parameters("coriolis_matrix", phi, None, q=q, qd=qd)

    def forward_dynamics(
        self, q: ArrayLike, qd: ArrayLike, tau_i: ArrayLike, phi: ArrayLike | None = None
    ) -> Array:
        """The accelerations of the independent coordinates, rad/s^2 or m/s^2; shape (..., dof).

        ``tau_i``: their efforts, N m or N, shape (..., dof).
        """
        return self._with_parameters("forward_dynamics", phi, None, q=q, qd=qd, tau_i=tau_i)

    def inverse_dynamics_derivatives(
        self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, phi: ArrayLike | None = None
    ) -> Array:
        """The derivatives of the inverse dynamics; shape (..., dof, 2 dof), SI.

        By the independent coordinates, then by their velocities, the others following along the
        closure. Those by their accelerations are the mass matrix.
        """
        arguments = {"q": q, "qd": qd, "qdd": qdd}
        return self._with_parameters("inverse_dynamics_derivatives", phi, None, **arguments)

    def forward_dynamics_derivatives(
        self, q: ArrayLike, qd: ArrayLike, tau_i: ArrayLike, phi: ArrayLike | None = None
    ) -> Array:
        """The derivatives of the forward dynamics; shape (..., dof, 3 dof), SI.

        By the independent coordinates, by their velocities and by their efforts ``tau_i``, the
        others following along the closure.
        """
        arguments = {"q": q, "qd": qd, "tau_i": tau_i}
        return self._with_parameters("forward_dynamics_derivatives", phi, None, **arguments)

    def derivatives(
        self,
        q: ArrayLike,
        qd: ArrayLike,
        qdd: ArrayLike | None = None,
        *,
        tau_i: ArrayLike | None = None,
        phi: ArrayLike | None = None,
        by_phi: bool = False,
    ) -> Derivatives:
        """The inverse dynamics with its derivatives, or with ``tau_i`` the forward dynamics.

        ``q``, ``qd``: shape (..., n); either ``qdd`` of shape (..., n), for the efforts, or
        ``tau_i`` of shape (..., dof), N m or N, for the accelerations. ``phi``: the parameters, SI,
        shape (p,), nominal values where it is not given; ``by_phi`` also asks for the derivatives by
        them. All are exact, along the closure: see :class:`Derivatives`.
        """
        if (qdd is None) == (tau_i is None):
            raise InputError("derivatives() needs either qdd, for efforts, or tau_i, for accelerations")
        dof = self.dof
        arguments: dict[str, ArrayLike] = {"q": q, "qd": qd}
        if qdd is not None:
            arguments["qdd"] = qdd
        arguments = {name: self._named(name, values) for name, values in arguments.items()}
        self._complete(arguments)
        if tau_i is not None:
            arguments["tau_i"] = tau_i
        name = "inverse_dynamics" if tau_i is None else "forward_dynamics"
        value = self._with_parameters(name, phi, None, **arguments)
        slopes = self._with_parameters(name + "_derivatives", phi, None, **arguments)
        states = {"q": arguments["q"], "qd": arguments["qd"]}
        by_parameters = None
        if tau_i is None:
            by_input = self._with_parameters("mass_matrix", phi, None, q=arguments["q"])
            if by_phi:
                by_parameters = self.evaluate("regressor", **arguments)
        else:
            by_input = slopes[..., 2 * dof :]
            if by_phi:
                # M qdd_i + h = tau_i, so that the efforts change with phi as if qdd_i were given
                moving = self.evaluate("accelerations", **states, qdd_i=value)
                by_parameters = -by_input @ self.evaluate("regressor", **states, qdd=moving)
        by_q, by_qd = slopes[..., :dof], slopes[..., dof : 2 * dof]
        return Derivatives(value, by_q, by_qd, by_input, by_parameters)

    # -- frames

    def frame_pose(self, q: ArrayLike) -> Array:
        """The poses of the named frames in the world; shape (..., frames, 12).

        The rotation matrix row by row, its columns the frame's axes, then the origin in m.
        """
        return self.evaluate("frame_pose", q=q)

    def frame_jacobian(self, q: ArrayLike) -> Array:
        """The Jacobians of the named frames by the independent velocities; shape (..., 6 frames, dof).

        For each frame the velocity of its origin, m/s, then its angular velocity, rad/s, in the
        axes of the world, the dependent coordinates following along the closure.
        """
        return self.evaluate("frame_jacobian", q=q)

    def frame_jacobian_rate(self, q: ArrayLike, qd: ArrayLike) -> Array:
        """The accelerations of the named frames at ``qdd_i = 0``; shape (..., 6 frames).

        The rate of :meth:`frame_jacobian` times the independent velocities, m/s^2 and rad/s^2.
        """
        return self.evaluate("frame_jacobian_rate", q=q, qd=qd)

    # -- parameters

    def to_base(self, phi: ArrayLike | None = None) -> Array:
        """The base parameters of parameters ``phi`` (p,), by default nominal ones; shape (rank,)."""
        return self.evaluate("to_base", phi=self.nominal if phi is None else phi)

    def parameters_from_base(self, beta: ArrayLike, free: ArrayLike | None = None) -> Array:
        """Parameters with the base parameters ``beta`` (rank,), SI; shape (p,).

        ``free``: the values of the parameters that are not kept, shape (p - rank,), by default
        nominal ones, or zero without these.
        """
        if free is None:
            nominal = dict(zip(self.parameters, np.nan_to_num(self.nominal)))
            free = np.array([nominal[label] for label in self._info["free"]])
        return self.evaluate("parameters_from_base", beta=beta, free=free)

    # -- any function

    def evaluate(self, function: str, **arguments: ArrayLike) -> Array:
        """Any function of the generated modules at many states: see :attr:`functions`.

        States have shape (..., length), parameters (length,). At a singularity of the loops the
        values are NaN or large; :meth:`evaluate_with_pivots` tells how near one is.
        """
        return self.evaluate_with_pivots(function, **arguments)[0]

    def evaluate_with_pivots(self, function: str, **arguments: ArrayLike) -> tuple[Array, Array]:
        """As :meth:`evaluate`, with the pivot of each state: about 1, and 0 at a singularity."""
        if function not in self._functions:
            raise InputError(f"there is no function '{function}'; there are {self.functions}")
        signature = self._functions[function]
        needed = [a["name"] for a in signature["arguments"]]
        if set(arguments) != set(needed):
            raise InputError(f"{function} needs {', '.join(needed)}")
        arguments = {name: self._named(name, values) for name, values in arguments.items()}
        self._complete(arguments)
        states: list[Array] = []
        parameters: list[Array] = []
        shape: tuple[int, ...] | None = None
        for argument in signature["arguments"]:
            name, length = argument["name"], argument["length"]
            values = _array(name, arguments[name], length)
            if argument["parameter"]:
                parameters.append(np.ascontiguousarray(_whole(name, values)))
                continue
            shape = values.shape[:-1] if shape is None else shape
            states.append(_rows(values, shape, name))
        with translated():
            try:
                values, pivots = self._native.evaluate(function, states, parameters)
            except ValueError as error:
                raise InputError(str(error)) from None
        shape = () if shape is None else shape
        return values.reshape(*shape, *signature["shape"]), pivots.reshape(shape)

    @property
    def functions(self) -> list[str]:
        """The names of the functions for :meth:`evaluate`."""
        return list(self._functions)

    def _with_parameters(
        self, name: str, phi: ArrayLike | None, beta: ArrayLike | None, **states: ArrayLike
    ) -> Array:
        if beta is not None:
            if phi is not None:
                raise InputError("phi or beta, not both")
            return self.evaluate("base_" + name, beta=beta, **states)
        return self.evaluate(name, phi=self._known(phi), **states)

    def _known(self, phi: ArrayLike | None) -> ArrayLike:
        """The parameters that were given, else the nominal ones."""
        if phi is not None:
            return phi
        missing = [p for p, v in zip(self.parameters, self.nominal) if np.isnan(v)]
        if missing:
            raise InputError(
                f"the description has no nominal value of {', '.join(missing[:5])}"
                f"{' and others' if len(missing) > 5 else ''}: give phi or beta"
            )
        return self.nominal

    def frame(self, t: ArrayLike | None = None, /, **states: ArrayLike) -> Any:
        """A DataFrame of states, whose columns have their names in logs.

        ``t``: times, s, shape (N,), which become the column ``t``. ``q``, ``qd``, ``qdd``, ``tau``:
        shape (N, n) for all coordinates, (N, dof) for the independent ones, or (N, actuated) for
        efforts of actuators; SI. It is what functions and commands take, and needs pandas.
        """
        import pandas as pd

        columns: dict[str, Array] = {} if t is None else {"t": numbers("t", t)}
        for name, values in states.items():
            if name not in _PREFIXES:
                raise InputError(f"`{name}` is none of {', '.join(_PREFIXES)}")
            table = numbers(name, values)
            sets = [self.independent, self.coordinates] + [self.actuated] * (name == "tau")
            fitting = [names for names in sets if table.ndim == 2 and table.shape[1] == len(names)]
            if not fitting:
                sizes = ", ".join(str(size) for size in sorted({len(names) for names in sets}))
                raise InputError(f"`{name}` has shape {table.shape}, not (N, k) with k of {sizes}")
            columns.update((_PREFIXES[name] + j, table[:, k]) for k, j in enumerate(fitting[0]))
        lengths = {name: len(column) for name, column in columns.items()}
        if len(set(lengths.values())) > 1:
            raise InputError(f"the columns are not equally long: {lengths}")
        return pd.DataFrame(columns)

    def _named(self, name: str, values: Any) -> Any:
        """The columns of a DataFrame by their names in logs; other values as they are."""
        kind, _, which = name.partition("_")
        if not hasattr(values, "columns") or kind not in _PREFIXES:
            return values
        prefix = _PREFIXES[kind]
        sets = [self.actuated] if which == "actuated" else [self.coordinates, self.independent]
        if which in ("i", "r_i"):
            sets = [self.independent]
        for names in sets:
            wanted = [prefix + name for name in names]
            if all(column in values.columns for column in wanted):
                return values[wanted].to_numpy()
        raise InputError(f"`{name}` is a table without columns {', '.join(wanted)}")

    def _complete(self, arguments: dict[str, ArrayLike]) -> None:
        """Closes the loops if only the independent coordinates are given."""
        n, dof = len(self.coordinates), self.dof
        if n == dof or "q" not in arguments:
            return
        q = numbers("q", arguments["q"])
        if q.ndim == 0 or q.shape[-1] != dof:
            return
        shape = q.shape[:-1]
        flat = [
            _rows(_array(name, arguments[name], dof), shape, name).reshape(-1, dof)
            if name in arguments
            else None
            for name in ("q", "qd", "qdd")
        ]
        assert flat[0] is not None
        closed = self.close(flat[0], flat[1], flat[2])
        if not closed.ok.all():
            k = int(np.argmin(closed.ok))
            raise NumericError(f"state {k}: {closed.reasons[k]}; close() skips such states")
        for name, values in zip(("q", "qd", "qdd"), closed[:3]):
            if name in arguments:
                arguments[name] = values.reshape(*shape, n)


def _array(name: str, values: ArrayLike, length: int) -> Array:
    array = numbers(name, values)
    if array.ndim == 0 or array.shape[-1] != length:
        raise InputError(f"`{name}` has shape {array.shape}, the last must be {length}")
    return array


def _whole(name: str, values: Array) -> Array:
    if values.ndim != 1:
        raise InputError(f"`{name}` has shape {values.shape}, one row is needed")
    return values


def _rows(values: Array, shape: tuple[int, ...], name: str) -> Array:
    if values.shape[:-1] != shape:
        raise InputError(f"`{name}` has {values.shape[:-1]} states, `q` has {shape}")
    return np.ascontiguousarray(values.reshape(-1, values.shape[-1]))
