"""Robots: their description, their functions over arrays of states, and identification from logs."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _call, _native
from ._call import Progress
from .base import Base
from .errors import InputError, NumericError, translated
from .fleet import Factors
from .logs import Log, Logs, as_files, numbers
from .results import (
    Excitation,
    Explanation,
    Identified,
    Inspection,
    Report,
    Validation,
)

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .options import (
        ExciteOptions,
        IdentifyOptions,
        ImportOptions,
        InspectOptions,
        ObserveOptions,
        ReportOptions,
        SimulateOptions,
        ValidateOptions,
    )

Array = NDArray[np.float64]
Path = Union[str, "os.PathLike[str]"]


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


class Robot:
    """A robot, from its description.

    ``source`` is the path of a description (YAML) or of a URDF, SDF or MJCF file, or the text of
    one. For robot files, ``options`` are those of ``regen import``: ``name``, ``exact``,
    ``geared``, ``base`` ('fixed' or 'floating'), ``cut``, ``actuated``, ``home``, ``ignore``.

    ``payload`` says whether the payloads of the description are carried, ``"none"`` or
    ``"carried"``; a description without payloads needs nothing.

    Coordinates are in rad or m, in the order of :attr:`coordinates`; efforts in N m or N. Where a
    method takes ``q`` (and ``qd``, ``qdd``) of shape (..., n), it also takes the independent
    coordinates alone, shape (..., dof), and closes the loops first.

    >>> robot = Robot("name: arm\\nlimbs:\\n  - name: arm\\n    joints:\\n"
    ...               "      - {name: q1, type: revolute, body: 1, actuated: true}\\n")
    >>> robot.coordinates
    ['q1']
    >>> robot.regressor([[0.1], [0.2]], [[0.0], [0.0]], [[1.0], [2.0]]).shape
    (2, 1, 10)
    """

    def __init__(
        self,
        source: Path,
        *,
        payload: str | None = None,
        progress: Progress | bool | None = None,
        **options: Unpack[ImportOptions],
    ) -> None:
        if payload not in (None, "none", "carried"):
            raise InputError(f"payload={payload!r}: 'none' or 'carried' is needed")
        self._payload = payload
        self._progress = progress
        text = os.fspath(source)
        self._path: str = text
        if "\n" in text or text.lstrip().startswith("<"):
            is_xml = text.lstrip().startswith("<")
            self._path = "robot.urdf" if is_xml else "robot.yaml"
            self._text = text
        else:
            is_xml = not text.endswith((".yaml", ".yml"))
            self._text = "" if is_xml else _read(text)
        #: Notes on what the import changed or left out.
        self.notes: list[str] = []
        if is_xml:
            texts = {self._path: self._text} if self._text else {}
            found = _call.parsed(_call.call("import", [self._path], options, texts, progress))
            self._text = found["spec"]
            self._path = found["robot"] + ".yaml"
            self.notes = [f"{n['file']}:{n['line']}: {n['text']}" for n in found["notes"]]
        elif any(value is not None for value in options.values()):
            raise InputError("a description in YAML takes no options of the import")
        # raise errors about the description now rather than at the first use
        carried = {None: None, "none": False, "carried": True}[payload]
        with translated(), _call._shown(progress) as shown:
            self._native = _native.Derived(self._text, self._path, carried, shown)
        self._info: dict[str, Any] = json.loads(self._native.info())
        self._functions: dict[str, Any] = {f["name"]: f for f in self._info["functions"]}
        self._base: Base | None = None

    def __repr__(self) -> str:
        info = self._info
        return (
            f"<Robot {self.name}: {len(self.coordinates)} coordinates, {self.dof} independent, "
            f"{len(info['parameters'])} parameters, {len(info['base'])} base parameters>"
        )

    def __reduce__(self) -> tuple[object, ...]:
        return _again, (self._text, self._path, self._payload, self.notes)

    # -- names and sizes

    @property
    def name(self) -> str:
        """The robot's name."""
        return str(self._info["robot"])

    @property
    def description(self) -> str:
        """The text of the description; for URDF, SDF and MJCF, the description that the import wrote."""
        return self._text

    @property
    def coordinates(self) -> list[str]:
        """The names of all n coordinates."""
        return list(self._info["coordinates"])

    @property
    def independent(self) -> list[str]:
        """The names of the independent coordinates."""
        return [self.coordinates[k] for k in self._info["independent"]]

    @property
    def actuated(self) -> list[str]:
        """The names of the actuated coordinates."""
        return [self.coordinates[k] for k in self._info["actuated"]]

    @property
    def dof(self) -> int:
        """The number of independent coordinates."""
        return len(self._info["independent"])

    @property
    def parameters(self) -> list[str]:
        """The labels of the dynamic parameters, the columns of the regressor."""
        return [p["label"] for p in self._info["parameters"]]

    @property
    def units(self) -> list[str]:
        """The SI units of the dynamic parameters."""
        return [p["unit"] for p in self._info["parameters"]]

    @property
    def nominal(self) -> Array:
        """The nominal values of the parameters, NaN if the description has none; shape (p,)."""
        values = self._info["nominal"]
        return np.array([np.nan if v is None else v for v in values], dtype=float)

    @property
    def bodies(self) -> list[str]:
        """The labels of the bodies."""
        return list(self._info["bodies"])

    @property
    def home(self) -> Array:
        """A closed state, rad or m; shape (n,)."""
        return np.array(self._info["home"], dtype=float)

    @property
    def digest(self) -> str:
        """The digest that identifies this model in files of factors and parameters."""
        return str(self._info["digest"])

    @property
    def base(self) -> Base:
        """The base parameters: a table with their combinations and the certificate."""
        if self._base is None:
            self._base = Base(self._path, self._text, self._progress)
        return self._base

    # -- functions of states

    def close(self, q: ArrayLike, qd: ArrayLike | None = None, qdd: ArrayLike | None = None) -> Closed:
        """Closes the loops along a trajectory of the independent coordinates.

        ``q``, ``qd``, ``qdd``: shape (dof,) or (N, dof), rad or m and s; velocities and
        accelerations are zero where they are not given. The first state is reached from
        :attr:`home` on a straight line, each other one from the state before it, so that the
        assembly branch stays the same.
        """
        q = _array("q", q, self.dof)
        shape = q.shape[:-1]
        rest = [np.zeros_like(q) if x is None else _array(n, x, self.dof) for n, x in
                (("qd", qd), ("qdd", qdd))]
        rows = [_rows(x, shape, n) for x, n in zip((q, *rest), ("q", "qd", "qdd"))]
        try:
            *found, reasons = self._native.close(*rows)
        except ValueError as error:
            raise InputError(str(error)) from None
        n = len(self.coordinates)
        ok = np.array([not reason for reason in reasons]).reshape(shape)
        all_q, all_qd, all_qdd = (x.reshape(*shape, n) for x in found)
        return Closed(all_q, all_qd, all_qdd, ok, reasons)

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

    def to_base(self, phi: ArrayLike | None = None) -> Array:
        """The base parameters of parameters ``phi`` (p,), by default nominal ones; shape (rank,)."""
        return self.evaluate("to_base", phi=self.nominal if phi is None else phi)

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
        if phi is None:
            phi = self.nominal
            missing = [p for p, v in zip(self.parameters, phi) if np.isnan(v)]
            if missing:
                raise InputError(
                    f"the description has no nominal value of {', '.join(missing[:5])}"
                    f"{' and others' if len(missing) > 5 else ''}: give phi or beta"
                )
        return self.evaluate(name, phi=phi, **states)

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

    # -- the commands

    def check(self) -> Explanation:
        """Explains the mechanism in words: mobility, loops, what cannot be identified and why."""
        return Explanation(self._path, self._text, self._progress)

    def excite(
        self, *, progress: Progress | bool | None = None, **options: Unpack[ExciteOptions]
    ) -> Excitation:
        """Searches for a trajectory from which the base parameters can be identified accurately."""
        return Excitation(self._run("excite", [], options, {}, progress))

    def simulate(
        self,
        trajectory: Excitation | Mapping[str, Any] | Path | None = None,
        *,
        parameters: Identified | Mapping[str, Any] | Path | None = None,
        progress: Progress | bool | None = None,
        **options: Unpack[SimulateOptions],
    ) -> Log:
        """Simulates the controlled robot along a trajectory and returns what it would log.

        With ``runs`` there are several logs, which differ in their noise: use
        :meth:`simulate_runs`.
        """
        return self.simulate_runs(trajectory, parameters=parameters, progress=progress, **options)[0]

    def simulate_runs(
        self,
        trajectory: Excitation | Mapping[str, Any] | Path | None = None,
        *,
        parameters: Identified | Mapping[str, Any] | Path | None = None,
        progress: Progress | bool | None = None,
        **options: Unpack[SimulateOptions],
    ) -> list[Log]:
        """As :meth:`simulate`, for all ``runs``."""
        texts: dict[str, str] = {}
        given: dict[str, Any] = dict(options)
        given["trajectory"] = _file("trajectory.json", trajectory, texts)
        given["parameters"] = _file("parameters.json", parameters, texts)
        with as_files([]) as folder:
            given["out"] = folder.path / "log.csv"
            found = self._run("simulate", [], given, texts, progress)
            return [Log.read(run["file"], run) for run in found["runs"]]

    def inspect(
        self, logs: Logs, /, *, progress: Progress | bool | None = None, **options: Unpack[InspectOptions]
    ) -> Inspection:
        """Recognises the columns of logs, and predicts which parameters the logs can identify."""
        return inspect(logs, robot=self, progress=progress, **options)

    def identify(
        self,
        logs: Logs | Factors,
        /,
        *,
        progress: Progress | bool | None = None,
        **options: Unpack[IdentifyOptions],
    ) -> Identified:
        """Identifies the parameters from logs, an experiment file, or merged factors.

        ``logs``: an experiment file or the dict of one; paths of logs; columns as a dict of arrays,
        a DataFrame or a :class:`Log`; a list of these; or :class:`Factors`.
        """
        texts: dict[str, str] = {}
        given: dict[str, Any] = dict(options)
        _parameter_files(given, texts)
        if isinstance(logs, Factors):
            texts["factors.json"] = logs.text()
            given["from"] = ["factors.json"]
            found = self._run("identify", [], given, texts, progress)
        else:
            with as_files(logs, texts) as files:
                _against(files, given, texts)
                found = self._run("identify", files.paths, given, texts, progress)
        return Identified(found)

    def validate(
        self,
        parameters: Identified | Mapping[str, Any] | Path,
        logs: Logs,
        /,
        *,
        progress: Progress | bool | None = None,
        **options: Unpack[ValidateOptions],
    ) -> Validation:
        """Predicts the efforts of logs from identified parameters, and returns the errors."""
        texts: dict[str, str] = {}
        given: dict[str, Any] = dict(options)
        path = _file("parameters.json", parameters, texts)
        assert path is not None
        with as_files(logs, texts) as files:
            found = self._run("validate", [path, *files.paths], given, texts, progress)
        return Validation(found)

    def report(
        self,
        parameters: Identified | Mapping[str, Any] | Path,
        logs: Logs,
        /,
        *,
        progress: Progress | bool | None = None,
        **options: Unpack[ReportOptions],
    ) -> Report:
        """Writes the result of an identification as one HTML page, with tables and figures."""
        texts: dict[str, str] = {}
        given: dict[str, Any] = dict(options)
        path = _file("parameters.json", parameters, texts)
        assert path is not None
        with as_files(logs, texts) as files:
            _against(files, given, texts)
            out = files.path / "report.html"
            given["out"] = out
            self._text_of("report", [path, *files.paths], given, texts, progress)
            return Report(out.read_text(encoding="utf-8"))

    def observe(
        self,
        logs: Logs,
        /,
        *,
        progress: Progress | bool | None = None,
        **options: Unpack[ObserveOptions],
    ) -> Factors:
        """Reduces logs to factors, which suffice for least squares; see :class:`Factors`."""
        texts: dict[str, str] = {}
        given: dict[str, Any] = dict(options)
        with as_files(logs, texts) as files:
            out = files.path / "factors.json"
            given["out"] = out
            self._run("observe", files.paths, given, texts, progress)
            return Factors([out.read_text(encoding="utf-8")])

    def _text_of(
        self,
        command: str,
        rest: Sequence[str],
        given: Mapping[str, Any],
        texts: Mapping[str, str],
        progress: Progress | bool | None,
    ) -> str:
        options = dict(given)
        if self._payload is not None:
            options.setdefault("payload", self._payload)
        progress = self._progress if progress is None else progress
        all_texts = {**texts, self._path: self._text}
        return _call.call(command, [self._path, *rest], options, all_texts, progress)

    def _run(
        self,
        command: str,
        rest: Sequence[str],
        given: Mapping[str, Any],
        texts: Mapping[str, str],
        progress: Progress | bool | None,
    ) -> Any:
        return _call.parsed(self._text_of(command, rest, given, texts, progress))


def inspect(
    logs: Logs,
    /,
    *,
    robot: Robot | None = None,
    progress: Progress | bool | None = None,
    **options: Unpack[InspectOptions],
) -> Inspection:
    """Recognises the columns of logs; with a robot, also predicts what the logs can identify."""
    texts: dict[str, str] = {}
    given: dict[str, Any] = dict(options)
    if robot is not None:
        texts[robot._path] = robot._text
        given["spec"] = robot._path
        given.setdefault("payload", robot._payload)
    with as_files(logs, texts) as files:
        printed = _call.call("inspect", files.paths, given, texts, progress)
    return Inspection(_call.parsed(printed))


def observe(robot: Robot | Path, logs: Logs, /, **options: Unpack[ObserveOptions]) -> Factors:
    """Reduces one log, or several, to factors that can be merged; see :class:`Factors`."""
    own = robot if isinstance(robot, Robot) else Robot(robot)
    return own.observe(logs, **options)


def _again(text: str, path: str, payload: str | None, notes: list[str]) -> Robot:
    """Restores a pickled robot."""
    robot = Robot.__new__(Robot)
    text = text if "\n" in text else text + "\n"
    Robot.__init__(robot, text, payload=payload)
    robot._path = path
    robot.notes = notes
    return robot


def _read(path: str) -> str:
    from .errors import FileError

    try:
        with open(path, encoding="utf-8") as file:
            return file.read()
    except OSError as error:
        raise FileError(f"cannot read {path}: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise FileError(f"{path} is not UTF-8 text") from None


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


def _file(name: str, value: Any, texts: dict[str, str]) -> str | None:
    """The path of a file, or a name under which its text is given."""
    if value is None or isinstance(value, (str, os.PathLike)):
        return None if value is None else os.fspath(value)
    data = value.data if hasattr(value, "data") else value
    texts[name] = json.dumps(data)
    return name


def _parameter_files(given: dict[str, Any], texts: dict[str, str]) -> None:
    for key in ("parameters", "start"):
        if key in given and not isinstance(given[key], (str, os.PathLike)):
            given[key] = _file(f"{key}.json", given[key], texts)
    if "reference" in given:
        given["reference"] = _file("reference.json", given["reference"], texts)
    if "controller" in given:
        given["controller"] = _file("controller.json", given["controller"], texts)


def _against(files: Any, given: dict[str, Any], texts: dict[str, str]) -> None:
    if given.get("against") is not None:
        given["against"] = files.more(given["against"], texts)
