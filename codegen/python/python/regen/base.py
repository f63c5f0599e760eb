"""The table of base parameters."""

from __future__ import annotations

import html
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from . import _call
from .errors import CheckError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ._call import Progress


class Term(NamedTuple):
    """A multiple of a parameter in a base parameter."""

    #: The label of the parameter.
    parameter: str
    #: The coefficient as an expression in the names of the description's geometry, such as ``-2*l^2``.
    coefficient: str
    #: Its value, SI.
    value: float


class Row(NamedTuple):
    """A base parameter."""

    #: Its label: that of the parameter that is kept.
    label: str
    #: The combination of parameters that it stands for.
    terms: list[Term]
    #: How it was found: ``derived`` from spanning trees, ``proven`` by exact points, or ``completed`` from samples.
    layer: str

    @property
    def combination(self) -> str:
        """The combination in one line."""
        parts = [f"({t.coefficient})*{t.parameter}" for t in self.terms]
        return " + ".join(p.replace("(1)*", "", 1) if p.startswith("(1)*") else p for p in parts)


class Base:
    """The base parameters of a robot, a sequence of :class:`Row`.

    In a notebook it is shown as a table. ``to_pandas()``, ``to_latex()``, ``to_markdown()`` and
    ``to_sympy()`` give it in other forms, ``matrix`` as numbers.
    """

    def __init__(self, path: str, text: str, progress: Progress | bool | None) -> None:
        self._path, self._text, self._progress = path, text, progress
        #: The JSON that ``regen base --format json`` prints.
        self.data: dict[str, Any] = _call.parsed(self._printed("json"))
        self._rows = [
            Row(
                row["label"],
                [Term(t["parameter"], t["coefficient"], t["value"]) for t in row["terms"]],
                row["layer"],
            )
            for row in self.data["base"]
        ]

    def _printed(self, form: str, *more: str) -> str:
        words = ["base", f"--format={form}", *more, "--", self._path]
        try:
            return _call.run(words, {self._path: self._text}, self._progress)[0]
        except CheckError as error:
            # an incomplete table is no error here: the table and `complete` show it
            return error.printed

    @property
    def complete(self) -> bool:
        """Whether the certificate confirms that these are all base parameters."""
        return bool(self.data["complete"])

    @property
    def certificate(self) -> dict[str, Any] | None:
        """Columns, rank, number of states and digits, and singular values of the certificate."""
        found: dict[str, Any] | None = self.data["certificate"]
        return found

    @property
    def labels(self) -> list[str]:
        """The labels."""
        return [row.label for row in self._rows]

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, k: int) -> Row:
        return self._rows[k]

    def __iter__(self) -> Iterator[Row]:
        return iter(self._rows)

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The combinations as a matrix, which maps parameters to base parameters; (rank, p), SI."""
        columns = {label: k for k, label in enumerate(self.data["parameters"])}
        out = np.zeros((len(self), len(columns)))
        for k, row in enumerate(self._rows):
            for term in row.terms:
                out[k, columns[term.parameter]] = term.value
        return out

    def __repr__(self) -> str:
        return f"<Base of {self.data['robot']}: {len(self)} base parameters>"

    def __str__(self) -> str:
        return self._printed("human")

    def _repr_html_(self) -> str:
        cells = "".join(
            f"<tr><td>{k}</td><td>{html.escape(row.label)}</td>"
            f"<td style='text-align:left'>{html.escape(row.combination)}</td>"
            f"<td>{html.escape(row.layer)}</td></tr>"
            for k, row in enumerate(self._rows, 1)
        )
        doubt = "" if self.complete else f"<p>INCOMPLETE: {html.escape(self.data['reason'] or '')}</p>"
        return (
            "<table><thead><tr><th></th><th>base parameter</th><th>combination</th>"
            f"<th>layer</th></tr></thead><tbody>{cells}</tbody></table>{doubt}"
        )

    def to_pandas(self) -> Any:
        """A DataFrame with the combination and the layer of each base parameter."""
        import pandas as pd

        return pd.DataFrame(
            {
                "combination": [row.combination for row in self._rows],
                "terms": [len(row.terms) for row in self._rows],
                "layer": [row.layer for row in self._rows],
            },
            index=pd.Index(self.labels, name="base parameter"),
        )

    def to_latex(self, *, numbers: bool = False, expressions: bool = False) -> str:
        """A table in LaTeX, for the packages array, booktabs and xtab; coefficients as numbers or expressions."""
        more = [f"--{word}" for word, on in (("numbers", numbers), ("expressions", expressions)) if on]
        return self._printed("latex", *more)

    def to_markdown(self) -> str:
        """A table in Markdown."""
        return self._printed("markdown")

    def to_sympy(self) -> dict[str, Any]:
        """The combinations as expressions of SymPy, by label; names are symbols.

        The symbol of a parameter has its label as its name: ``sympy.Symbol("m(2)")``.
        """
        import sympy

        return {
            row.label: sympy.Add(
                *(_expression(t.coefficient) * sympy.Symbol(t.parameter, real=True) for t in row.terms)
            )
            for row in self._rows
        }


def _expression(text: str) -> Any:
    """A coefficient as an expression of SymPy."""
    import ast

    import sympy

    known = {"sqrt": sympy.sqrt, "sin": sympy.sin, "cos": sympy.cos, "tan": sympy.tan}

    def of(node: ast.expr) -> Any:
        if isinstance(node, ast.Constant):
            # the exact decimal as it is written
            return sympy.Rational(ast.get_source_segment(source, node))
        if isinstance(node, ast.Name):
            return sympy.pi if node.id == "pi" else sympy.Symbol(node.id, real=True)
        if isinstance(node, ast.UnaryOp):
            return -of(node.operand) if isinstance(node.op, ast.USub) else of(node.operand)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            return known[node.func.id](*(of(a) for a in node.args))
        if isinstance(node, ast.BinOp):
            left, right = of(node.left), of(node.right)
            if isinstance(node.op, ast.Add):
                return left + right
            if isinstance(node.op, ast.Sub):
                return left - right
            if isinstance(node.op, ast.Mult):
                return left * right
            if isinstance(node.op, ast.Div):
                return left / right
            if isinstance(node.op, ast.Pow):
                return left**right
        raise ValueError(f"'{text}' is not an expression")

    source = text.replace("^", "**")
    return of(ast.parse(source, mode="eval").body)
