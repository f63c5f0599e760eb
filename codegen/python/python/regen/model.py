"""Robots as their descriptions state them: names and sizes."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any, Union

import numpy as np
from numpy.typing import NDArray

from . import _call, _native
from ._call import Progress
from .base import Base
from .errors import FileError, InputError, translated

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .options import ImportOptions

Array = NDArray[np.float64]
Path = Union[str, "os.PathLike[str]"]


class Model:
    """The description of a robot, its names and its sizes; see :class:`Robot`."""

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
        #: The robot file that was read, with its text where that was given.
        self._robot_file: tuple[str, str | None] | None = None
        #: Notes on what the import changed or left out.
        self.notes: list[str] = []
        if is_xml:
            texts = {self._path: self._text} if self._text else {}
            self._robot_file = (self._path, self._text or None)
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


def _read(path: str) -> str:
    try:
        with open(path, encoding="utf-8") as file:
            return file.read()
    except OSError as error:
        raise FileError(f"cannot read {path}: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise FileError(f"{path} is not UTF-8 text") from None
