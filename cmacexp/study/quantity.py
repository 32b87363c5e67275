"""Quantities of runs: how far they came, how they compare, and texts as ``transfer_rmse_x[5] / transfer_rmse_x[1]``.

In a text a name is a metric or a measure of the study: ``force_rmse[5]`` its value in cycle 5, ``force_rmse[-3:]``
the median of the last 3 cycles, ``force_rmse`` its final value (:func:`cmacexp.metrics.registry.compute_final`).
``completed`` says whether a run reached its end, ``done`` and ``lasted`` are the shares of its cycles and of its time
that it did. The text is Python's notation of arithmetic and comparisons, with ``abs``, ``hypot``, ``max``, ``min``;
``setting("cmac.layers")`` is a number of the config. It is read by this file, never executed.
"""

import ast
import operator
from collections.abc import Callable, Collection, Sequence
from functools import reduce
from typing import Any

import numpy as np

from cmacexp.errors import BadInput, require_name
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
    ast.LtE: operator.le, ast.GtE: operator.ge, ast.Lt: operator.lt, ast.Gt: operator.gt,
}  # fmt: skip
"""What is computed for each sign; a ratio is infinite of a run that ended before its numerator."""
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": np.abs, "hypot": np.hypot, "max": lambda *values: reduce(np.maximum, values),
    "min": lambda *values: reduce(np.minimum, values),
}  # fmt: skip
OF_RUNS: dict[str, Callable[[Results], Array]] = {
    "completed": lambda results: np.array(results.completed),
    "done": lambda results: np.array([row.run.cycles_done / row.settings["cycles"] for row in results.rows]),
    "lasted": lambda results: np.array(
        [run.manifest["steps"] / (run.steps_per_cycle * run.config["cycles"]) for run in results.runs]
    ),
}
"""What every run has besides metrics and measures."""


def parse_quantity(text: str, measures: Collection[str] | None = None) -> ast.expr:
    """The expression of a text, checked before anything is run.

    Raises:
        BadInput: it is none, it uses what this file does not know, or, if ``measures`` are given, a name is neither a
            metric nor one of them.
    """
    allowed = [*FUNCTIONS, "setting", *OF_RUNS, *(measures or ()), *ALL_METRICS]
    try:
        tree = ast.parse(str(text), mode="eval").body
        for name in (node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and measures is not None):
            require_name("quantity", name, allowed)
        _compute(tree, Results([]))
    except (SyntaxError, TypeError, ArithmeticError) as error:
        raise BadInput("quantity", text, f"is no expression: {error}") from error
    return tree


def find_unit(quantity: ast.expr) -> str | None:
    """The SI unit of a metric, of a ratio of two that have the same, or of truth values; None: it is not known."""
    match quantity:
        case ast.Name(name) | ast.Subscript(ast.Name(name)):
            return "" if name in OF_RUNS else ALL_METRICS[name].unit if name in ALL_METRICS else None
        case ast.BinOp(left, ast.Div(), right):
            return "" if find_unit(left) == find_unit(right) is not None else None
    return "" if isinstance(quantity, ast.Compare) else None


def compute_quantity(text: str, results: Results) -> Array:
    """(runs,): the value of a quantity in each run; raises as :func:`parse_quantity` and ``Results.at``."""
    return np.array(np.broadcast_to(_compute(parse_quantity(text), results), len(results)))


def _compute(node: ast.expr, results: Results) -> Any:
    """The value of an expression in each run; raises BadInput for what is no part of a quantity."""
    match node:
        case ast.Constant(int() | float() as value):
            return value
        case ast.Name(name) if name in OF_RUNS:
            return OF_RUNS[name](results)
        case ast.Name(name):
            return results.end(name) if name in ALL_METRICS else results.measure(name)
        case ast.Subscript(ast.Name(name), ast.Slice(ast.UnaryOp(ast.USub(), ast.Constant(int(last))), None)) if last:
            return results.end(name, last)
        case ast.Subscript(ast.Name(name), ast.Constant(int(cycle))) if cycle:
            return results.at(cycle, name)
        case ast.BinOp(left, sign, right) | ast.Compare(left, [sign], [right]) if type(sign) in OPERATORS:
            return OPERATORS[type(sign)](_compute(left, results), _compute(right, results))
        case ast.UnaryOp(ast.USub(), value):
            return -_compute(value, results)
        case ast.Call(ast.Name("setting"), [ast.Constant(str(key))]):
            return _read_setting(key, results)
        case ast.Call(ast.Name(name), values, []) if name in FUNCTIONS:
            return FUNCTIONS[name](*(_compute(value, results) for value in values))
    raise BadInput(
        "quantity",
        ast.unparse(node),
        f"a quantity may use + - * / ** < <= > >=, {', '.join(FUNCTIONS)}, a cycle as [5], the last ones as [-3:]",
    )


def _read_setting(key: str, results: Results) -> Array:
    """(runs,): a number of the config."""
    try:
        return np.array([float(row.settings[key]) for row in results.rows])
    except (LookupError, TypeError, ValueError) as error:
        values = results.values(key)
        raise BadInput("setting", key, f"must be a number in all of these runs; they have {values}") from error
