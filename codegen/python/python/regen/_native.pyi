"""The native part of the package."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]
_Progress = Callable[[str, int, int | None], object] | None

__version__: str

class NativeError(Exception): ...

class Derived:
    def __init__(
        self,
        text: str,
        name: str,
        payload: bool | None = None,
        progress: _Progress = None,
    ) -> None: ...
    def info(self) -> str: ...
    def evaluate(
        self, function: str, states: list[_Array], parameters: list[_Array]
    ) -> tuple[_Array, _Array]: ...
    def close(
        self, q: _Array, qd: _Array, qdd: _Array
    ) -> tuple[_Array, _Array, _Array, list[str]]: ...

def call_command(
    words: list[str], texts: dict[str, str], progress: _Progress = None
) -> tuple[str, list[str]]: ...
def options(command: str) -> list[tuple[str, bool, bool, list[str], str]]: ...
def merge_factors(texts: list[str]) -> str: ...
