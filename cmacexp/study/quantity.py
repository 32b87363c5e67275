"""Quantities of runs: how far they came, how they compare, and texts as ``transfer_rmse_x[5] / transfer_rmse_x[1]``.

In a text a name is a metric or a measure of the study: ``force_rmse[5]`` its value in cycle 5, ``force_rmse[-3:]``
the median of the last 3 cycles, ``force_rmse`` its final value (:func:`cmacexp.metrics.registry.compute_final`).
``completed`` says whether a run reached its end, ``done`` and ``lasted`` are the shares of its cycles and of its time
that it did. The text is Python's notation of arithmetic and comparisons, with ``abs``, ``hypot``, ``max``, ``min``;
``setting("cmac.layers")`` is a number of the config. It is read by this file, never executed.
"""

import ast
import operator
import re
from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any

import numpy as np

from cmacexp.errors import BadInput, suggest
from cmacexp.metrics.registry import ALL_METRICS
from cmacexp.study.interval import UNPAIRED
from cmacexp.study.results import Results
from cmacexp.typing import Array

Sample = Callable[[Results], Array]


def quotients(values: Array, references: Array | float) -> Array:
    """Values over references, pair by pair: infinite where the run failed, ``UNPAIRED`` where its reference did."""
    values, references = np.broadcast_arrays(values, references)
    found = np.where(np.isfinite(references), np.inf, UNPAIRED)
    both = np.isfinite(values) & np.isfinite(references)
    return np.divide(values, references, out=found, where=both)


def growth(late: Array, early: Array) -> Array:
    """(runs,): a value late in each run over one early in the same run; infinite of a run that ended before."""
    return np.divide(late, early, out=np.full(np.shape(late), np.inf), where=np.isfinite(late))


def ended_in(results: Results) -> Array:
    """(runs,): cycle in which each ended before its time; infinite if it completed."""
    return np.where(results.completed, np.inf, np.array(results.cycles) + 1.0)


def relative(results: Results, other: Results, measure: Callable[[Results], Sequence[float] | Array]) -> Array:
    """(runs,): :func:`quotients` of a measure and that of ``other``: by seed, of the only run, or in order."""
    references = np.asarray(measure(other))
    by_seed = dict(zip(_seeds(other), references, strict=True))
    if len(by_seed) == len(other) > 1:
        references = np.array([by_seed[seed] for seed in _seeds(results)])
    return quotients(np.asarray(measure(results)), references)


def per_seed(results: Results, values: Array, choose: Callable[[Array], float]) -> Array:
    """(seeds,): e.g. the least of the values of all runs of one seed."""
    seeds = np.array(_seeds(results))
    return np.array([choose(values[seeds == seed]) for seed in results.values("seed")])


def _seeds(results: Results) -> list[int]:
    return [int(row.settings["seed"]) for row in results.rows]


OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: growth, ast.Pow: operator.pow,
    ast.USub: operator.neg, ast.LtE: operator.le, ast.GtE: operator.ge, ast.Lt: operator.lt, ast.Gt: operator.gt,
}  # fmt: skip
"""What is computed for each sign; a ratio is infinite of a run that ended before its numerator."""
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": np.abs, "hypot": np.hypot, "max": lambda *values: reduce(np.maximum, values),
    "min": lambda *values: reduce(np.minimum, values),
}  # fmt: skip
CALLED = (*FUNCTIONS, "setting")
"""Functions, and that of a dotted key that is a number of the config."""
CYCLES = re.compile(r"[1-9]\d*|-[1-9]\d*:")
"""A cycle, or the last cycles."""
OF_RUNS: dict[str, Callable[[Results], Array]] = {
    "completed": lambda results: np.array(results.completed),
    "done": lambda results: np.array([row.run.cycles_done / row.settings["cycles"] for row in results.rows]),
    "lasted": lambda results: np.array(
        [run.manifest["steps"] / (run.steps_per_cycle * run.config["cycles"]) for run in results.runs]
    ),
}
"""What every run has besides metrics and measures."""


def parse_quantity(text: str) -> ast.expr:
    """The expression of a text.

    Raises:
        BadInput: it is none, or uses what this file does not know.
    """
    try:
        tree = ast.parse(str(text), mode="eval").body
    except SyntaxError as error:
        raise BadInput("quantity", text, f"is no expression: {error.msg}") from error
    for node in ast.walk(tree):
        known = isinstance(node, ast.Constant | ast.Name | ast.Load | ast.Slice | ast.Subscript | ast.operator)
        known |= isinstance(node, ast.BinOp | ast.UnaryOp | ast.Compare | ast.cmpop | ast.unaryop)
        known |= isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in CALLED
        if not known or (isinstance(node, ast.operator | ast.cmpop | ast.unaryop) and type(node) not in OPERATORS):
            raise BadInput("quantity", text, f"may use + - * / ** < <= > >= and {', '.join(FUNCTIONS)}")
        if isinstance(node, ast.Subscript) and not CYCLES.fullmatch(ast.unparse(node.slice)):
            raise BadInput("quantity", text, "write a cycle, from 1, as [5], the last cycles as [-3:]")
    return tree


def find_unit(quantity: ast.expr) -> str | None:
    """The SI unit of a metric, of a ratio of two that have the same, or of truth values; None: it is not known."""
    match quantity:
        case ast.Name(name) | ast.Subscript(ast.Name(name)):
            return "" if name in OF_RUNS else ALL_METRICS[name].unit if name in ALL_METRICS else None
        case ast.BinOp(left, ast.Div(), right):
            return "" if find_unit(left) == find_unit(right) is not None else None
    return "" if isinstance(quantity, ast.Compare) else None


def check_quantity(text: str, measures: Any = ()) -> None:
    """Check the names of a quantity before anything is run.

    Raises:
        BadInput: it is no quantity, or a name is neither a metric nor one of ``measures``.
    """
    for name in (node.id for node in ast.walk(parse_quantity(text)) if isinstance(node, ast.Name)):
        if name not in {*CALLED, *OF_RUNS, *measures, *ALL_METRICS}:
            allowed = [*OF_RUNS, *measures, *ALL_METRICS]
            raise BadInput("quantity", text, f"has no metric or measure {name!r}{suggest(name, allowed)}")


def compute_quantity(text: str, results: Results) -> Array:
    """(runs,): the value of a quantity in each run; raises as :func:`parse_quantity` and ``Results.at``."""
    found = np.broadcast_to(_compute(parse_quantity(text), results), len(results))
    return np.array(found)


def _compute(node: ast.expr, results: Results) -> Any:
    match node:
        case ast.Constant(value):
            return value
        case ast.Name(name):
            if name in OF_RUNS:
                return OF_RUNS[name](results)
            return results.end(name) if name in ALL_METRICS else results.measure(name)
        case ast.Subscript(ast.Name(name), ast.Slice(ast.UnaryOp(ast.USub(), ast.Constant(int(count))), None)):
            return results.end(name, count)
        case ast.Subscript(ast.Name(name), ast.Constant(int(cycle))):
            return results.at(cycle, name)
        case ast.BinOp(left, sign, right) | ast.Compare(left, [sign], [right]):
            return OPERATORS[type(sign)](_compute(left, results), _compute(right, results))
        case ast.UnaryOp(sign, value):
            return OPERATORS[type(sign)](_compute(value, results))
        case ast.Call(ast.Name("setting"), [ast.Constant(str(key))]):
            try:
                return np.array([float(row.settings[key]) for row in results.rows])
            except (LookupError, TypeError, ValueError) as error:
                raise BadInput(
                    "setting", key, f"must be a number in all of these runs; they have {results.values(key)}"
                ) from error
        case ast.Call(ast.Name(name), values):
            return FUNCTIONS[name](*(_compute(value, results) for value in values))
    raise BadInput("quantity", ast.unparse(node), "has a part that is no number, metric or measure")
