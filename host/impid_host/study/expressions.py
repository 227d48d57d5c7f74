"""Formulas over a log's columns, such as a drive's gain: `35.15 * u_V`.

Only arithmetic, comparisons and the functions below; no attributes, no subscripts, no strings but a column's
name. Every operand becomes an array of doubles first, so no formula can build a huge integer or string.
"""

import ast
import functools
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impid_host.errors import ImpidError
from impid_host.extras import extra

MAX_CHARACTERS = 1000

FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "atan2": np.arctan2,
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "abs": np.abs,
    "sign": np.sign,
    "hypot": np.hypot,
    "minimum": lambda first, *others: functools.reduce(np.minimum, others, first),
    "maximum": lambda first, *others: functools.reduce(np.maximum, others, first),
    "unwrap": np.unwrap,
}
CONSTANTS = {"pi": np.pi, "g0": 9.80665}

_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_NODES = (ast.Expr, ast.Constant, ast.UnaryOp, ast.BinOp, ast.Name, ast.Call)


class ExpressionError(ValueError):
    """The formula cannot be evaluated; the message says why in one line."""


def evaluate(expression: str, column: Callable[[str], NDArray[np.float64]]) -> NDArray[np.float64]:
    """The value of `expression`, shape (N,) or () where it names no column.

    `column` hands out a column by name; it is asked for the names in the formula and for `col("any name")`.
    It may raise its own error for a name that does not exist.

    Raises:
        ExpressionError: the formula is too long, no formula, or uses what is not allowed.
    """
    if len(expression) > MAX_CHARACTERS:
        raise ExpressionError(f"is longer than {MAX_CHARACTERS} characters")
    functions = {name: _on_doubles(_of_operands(name, function)) for name, function in FUNCTIONS.items()}
    evaluator = extra("simpleeval", "a formula in a mapping").SimpleEval(
        operators={node: _on_doubles(function) for node, function in _OPERATORS.items()},
        functions=functions | {"col": _by_name(column)},
        names=lambda node: CONSTANTS[node.id] if node.id in CONSTANTS else column(node.id),
    )
    evaluator.nodes = {kind: handle for kind, handle in evaluator.nodes.items() if kind in _NODES}
    evaluator.nodes[ast.Compare] = lambda node: _compare(evaluator, node)
    try:
        with np.errstate(all="ignore"):
            return _doubles(evaluator.eval(expression.strip()))
    except ImpidError:
        raise
    except RecursionError:
        raise ExpressionError("is nested too deeply") from None
    except Exception as error:  # simpleeval, the parser and numpy each have errors of their own
        message = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ExpressionError(message[:200]) from None


def _compare(evaluator: Any, node: ast.Compare) -> NDArray[np.float64]:
    """One comparison, element by element: 1 where it holds, else 0."""
    if len(node.ops) != 1:
        raise ExpressionError("chains comparisons; multiply two of them instead")
    compare = evaluator.operators[type(node.ops[0])]
    return _doubles(compare(evaluator._eval(node.left), evaluator._eval(node.comparators[0])))


def _of_operands(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """The function with its operands alone: numpy takes further ones, such as where to put the result."""
    takes = function.nin if isinstance(function, np.ufunc) else 1
    if name in ("minimum", "maximum"):
        return function

    def run(*operands: NDArray[np.float64]) -> Any:
        if len(operands) != takes:
            raise ExpressionError(f"gives {name} {len(operands)} values; it takes {takes}")
        return function(*operands)

    return run


def _on_doubles(function: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *operands: _doubles(function(*(_doubles(operand) for operand in operands)))


def _by_name(column: Callable[[str], NDArray[np.float64]]) -> Callable[[object], NDArray[np.float64]]:
    return lambda name: column(str(name))


def _doubles(value: object) -> NDArray[np.float64]:
    if isinstance(value, str | bytes):
        raise ExpressionError('holds text; a column\'s name goes into col("...")')
    return np.asarray(value, dtype=np.float64)
