"""A study declared: runs, claims, findings, figures and tables, in YAML, or in Python where a part needs code.

``docs/add-a-study.md`` shows one of each. In Python, :func:`declare` takes the same declaration; there a value, a
cell of a table, a figure or all runs may be functions too.
"""

import importlib
import itertools
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import NoneType
from typing import Any

import yaml

from cmacexp.errors import BadInput, require, require_name
from cmacexp.metrics.registry import ALL_METRICS, TRANSFER, format_number
from cmacexp.report.figures import Panel, draw
from cmacexp.study.interval import estimate
from cmacexp.study.quantity import compute_quantity, find_unit, parse_quantity
from cmacexp.study.results import Measure, NoSuchRuns, Results
from cmacexp.study.statements import ANY, Claim, Criterion, Finding, Limit, fill
from cmacexp.study.study import DataFrame, Figure, Request, Study, grid, starting_from
from cmacexp.study.views import completed, cross_tabulate, over_cycles, over_setting, tabulate

Declared = dict[str, Any]
"""A part of a declaration, or values of a page, by name."""
UNITS = {
    **dict.fromkeys(("", "cycles", "samples"), ("", 1.0)),
    **{metric.unit: (metric.unit, 1.0) for metric in ALL_METRICS.values()},
    **{unit: (unit, 1.0) for unit in ("m/s", "m/s^2", "rad/s", "Hz", "kg", "N/m", "W")},
    "%": ("", 100.0), "mm": ("m", 1e3), "mrad": ("rad", 1e3), "ms": ("s", 1e3),
}  # fmt: skip
"""Units of a limit: the SI unit of each, and the factor from that to it."""
NUMBER = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
LIMIT = re.compile(rf"(?:(at most|at least) )?{NUMBER}(?: to {NUMBER})? ?(%|[a-zA-Zµ]+(?:[ /][a-zA-Z]+(?:\^2)?)?)?")
ANYTHING: tuple[Any, str] = (object, "")
MAPPING, LISTS = ((Mapping, NoneType), "a mapping"), ((Mapping, NoneType), "a mapping to lists of values")
LIST, FUNCTION = ((list, tuple), "a list"), (Callable, "a function of Python")
SETTING, TITLES = ((str, NoneType), "a setting"), ((str, list, Mapping), "a setting, or a mapping of it to a title")
ACROSS = ((str, Mapping), TITLES[1])
SWITCH = (bool, "true or false; --seeds N gives the number of seeds")
"""Kinds of values: their types, and how a message names them."""
CRITERION: dict[str, tuple[Any, str]] = {
    "quantity": ANYTHING, "value": ANYTHING, "of": MAPPING, "over": MAPPING, "each": MAPPING, "limit": ANYTHING,
    "opposite": ANYTHING, "case": ANYTHING, "infinite": ANYTHING, "beside": ANYTHING,
}  # fmt: skip
FORMS: dict[str, dict[str, tuple[Any, str]]] = {
    "study": {
        "title": ANYTHING, "question": ANYTHING, "common": MAPPING, "runs": ((list, tuple, Callable), "a list"),
        "measures": MAPPING, "computed": MAPPING, "claims": MAPPING, "findings": MAPPING, "figures": MAPPING,
        "tables": MAPPING, "values": FUNCTION,
    },
    "runs": {
        "set": ANYTHING, "quick": ANYTHING, "over": LISTS, "seeds": SWITCH, "labels": MAPPING, "after": MAPPING,
    },
    "claims": {"for": LISTS, "words": ANYTHING, "where": ANYTHING, "criteria": LIST, **CRITERION},
    "findings": {"for": LISTS, "says": ANYTHING, "criteria": LIST, **CRITERION},
    "criteria": CRITERION,
    "figures": {
        "metric": ANYTHING, "value": ANYTHING, "over": SETTING, "by": SETTING, "of": MAPPING, "log": ANYTHING,
        "title": ANYTHING, "y": ANYTHING, "kind": ANYTHING,
    },
    "tables": {"rows": TITLES, "columns": MAPPING, "across": ACROSS, "value": ANYTHING, "of": MAPPING},
}  # fmt: skip
"""What each part of a declaration may hold."""


def _check(part: str, given: Any, needs: Collection[str] = ()) -> dict[str, Any]:
    """A part that is a mapping of its own keys to values of their kinds, with all that it needs; raises BadInput."""
    require(isinstance(given, Mapping), part, given, f"must be a mapping with {', '.join(FORMS[part])}")
    for key, value in given.items():
        require_name(part, key, FORMS[part])
        kind, words = FORMS[part][key]
        require(isinstance(value, kind), f"{part}.{key}", value, f"must be {words}")
        _require_texts(f"{part}.{key}", value if isinstance(value, Mapping) else ())
        for name, each in value.items() if FORMS[part][key] is LISTS and value else ():
            is_list = isinstance(each, Collection) and not isinstance(each, str) and len(each)
            require(is_list, f"{part}.{key}.{name}", each, "must be a list of values, such as [0.1, 0.2]")
    for key in needs:
        require(given.get(key) not in (None, {}), part, dict(given), f"needs {key}")
    return dict(given)


def _require_texts(key: str, names: Collection[Any]) -> None:
    """Require of names that they are texts, which a number in YAML is not; raises BadInput."""
    require(all(isinstance(name, str) for name in names), key, names, "must have texts for names, such as '3'")


def _list(value: Any) -> list[Any]:
    return list(value) if isinstance(value, list) else [] if value is None else [value]


def format_overrides(values: Any) -> list[str]:
    """Overrides as on the command line, of a mapping or of a list of texts."""
    if not isinstance(values, Mapping):
        return [str(text) for text in _list(values)]
    return [
        f"{key}={yaml.safe_dump(value, default_flow_style=True).split(chr(10))[0]}" for key, value in values.items()
    ]


def _find_scale(text: str, unit: str, quantity: str | None) -> float:
    """The factor from the SI unit of a ``quantity``, None if unknown, to the unit of its limit; raises BadInput."""
    allowed = [name for name, (own, _) in UNITS.items() if quantity in (None, own)]
    use = ", ".join(name or "no unit" for name in allowed)
    require(unit in allowed, "limit", text, f"its unit must be one of {use}, not {unit or 'none'}")
    return UNITS[unit][1]


def read_limit(text: str, quantity: str | None = None) -> tuple[Limit, str, float]:
    """A limit, the unit that it is given in, and the factor to it: ``at most 10 %``, ``at least 2``, ``1 to 3 mm``.

    ``any mm`` is of a value that stands beside others and decides nothing. ``quantity`` is the SI unit of what is
    limited; None: any is allowed.

    Raises:
        BadInput: it is none, its unit is unknown or not of the ``quantity``, or its lower end is above its upper end.
    """
    if (found := re.fullmatch(r"any ?(.*)", str(text))) is not None:
        return ANY, found[1], _find_scale(text, found[1], quantity)
    found = LIMIT.fullmatch(str(text))
    side, low, high, unit = found.groups("") if found else ("", "nan", "", "")
    ends = float(low), float(high or low)
    require(ends[0] <= ends[1], "limit", text, "must be as “at most 10 %”, “at least 2” or “1 to 3 mm”, low to high")
    scale = _find_scale(text, unit, quantity)
    bounds = {"at most": (float("-inf"), ends[0]), "at least": (ends[0], float("inf"))}.get(side, ends)
    return Limit(*(bound / scale for bound in bounds)), unit, scale


def read_criteria(given: Mapping[str, Any], measures: Collection[str] = ()) -> list[Criterion]:
    """The criteria of a statement: those under ``criteria``, or the one that it is itself, for ``each`` setting.

    After them come the values of ratios that are to stand ``beside`` them.

    Raises:
        BadInput: a key is unknown or missing, or the quantity or the limit is none.
    """
    parts = given.get("criteria", [{key: each for key, each in given.items() if key in CRITERION}])
    parts = [_check("criteria", each, ["value", "limit"]) for each in parts]
    shown = [_list_values(each) for each in parts if each.get("beside")]
    return [criterion for each in (*parts, *shown) for criterion in _read_criterion(each, measures)]


def _list_values(given: Mapping[str, Any]) -> dict[str, Any]:
    """What shows the values of the runs that a criterion divides, those of ``over`` first; it decides nothing."""
    own = _check("criteria", given, ("of", "over"))
    missing = own["over"].keys() - own["of"].keys()
    require(not missing, "beside", own["beside"], f"needs a value under of for what over names: {', '.join(missing)}")
    quantity, _, unit = str(own["beside"]).rpartition(", ")
    pairs = {key: [value, own["of"][key]] for key, value in own["over"].items()}
    case = {"case": ", ".join([str(own["case"]), *map("{{{}}}".format, pairs)])} if "case" in own else {}
    more = {"quantity": quantity, "each": {**(own.get("each") or {}), **pairs}, "limit": f"any {unit}"}
    return {"value": own["value"], "of": own["of"], **more, **case}


def _read_criterion(own: Mapping[str, Any], measures: Collection[str]) -> list[Criterion]:
    sample = own["value"] if callable(own["value"]) else str(own["value"])
    case = own.get("case")  # with the values of settings in braces; without one, the values
    more = {key: own[key] for key in ("over", "infinite") if key in own}
    measured = None if callable(sample) else find_unit(parse_quantity(sample, measures))
    holds, unit, scale = read_limit(own["limit"], measured if own.get("over") is None else "")
    fails = read_limit(own["opposite"], UNITS[unit][0])[0] if "opposite" in own else None
    values = [[(key, value) for value in _list(each)] for key, each in (own.get("each") or {}).items()]
    return [
        Criterion(
            str(own.get("quantity", sample)), sample, holds, fails, unit, scale,
            {**(own.get("of") or {}), **dict(chosen)},
            ", ".join(str(value) for _, value in chosen) if case is None else _fill("case", str(case), dict(chosen)),
            **more,
        )
        for chosen in itertools.product(*values)
    ]  # fmt: skip


def _take_ends(values: Sequence[Any]) -> list[Any]:
    """The first and the last value; the only one once."""
    return [*values[:1], *values[1:][-1:]]


def read_requests(parts: Sequence[Any], quick: bool, common: Mapping[str, Any] | None = None) -> list[Request]:
    """The runs of all parts; a quick form takes what ``quick`` sets, and the first and last value of each setting.

    A part whose ``quick`` is null is left out of it. What a part does not say is ``common`` to all that do not.
    """
    found: list[Request] = []
    for own in ({**(common or {}), **_check("runs", given)} for given in parts):
        if quick and own.get("quick", {}) is None:
            continue
        over = {
            key: {name: format_overrides(v) for name, v in values.items()} if isinstance(values, Mapping) else values
            for key, values in (own.get("over") or {}).items()
        }
        if quick:
            over = {
                k: dict(_take_ends([*v.items()])) if isinstance(v, dict) else _take_ends(v) for k, v in over.items()
            }
        more = own.get("quick") if quick else None
        requests = grid(
            *format_overrides(own.get("set")), over=over, seeded=own.get("seeds", False), **(own.get("labels") or {})
        )
        requests = [replace(each, overrides=(*each.overrides, *format_overrides(more))) for each in requests]
        if own.get("after") is not None:
            first = [
                replace(each, labels={key: each.labels[key] for key in over if key not in own["after"]})
                for each in found
                if own["after"].items() <= each.labels.items()
            ]
            requests = starting_from(first, requests)
        found += requests
    return found


def _cell(value: Any, measures: Collection[str]) -> Callable[[Results], Any]:
    """What a cell of a table shows of its runs: a quantity of those that completed, several, or how many did.

    A cycle that runs were not to reach, as those of a quick form, is shown as undefined. A function shows what it
    gives.
    """
    if callable(value):
        return value  # type: ignore[no-any-return]
    for text in _list(value) or [""]:
        parse_quantity(text, measures)

    def show(results: Results) -> Any:
        done = [row for row in results.rows if row.run.completed] or results.rows
        try:
            if not isinstance(value, list):
                return compute_quantity(value, Results(done, results.computed))
            found = [estimate(compute_quantity(text, results)) for text in value]
        except BadInput as error:
            if error.key not in ("cycle", "metric"):
                raise
            return None
        errors = " / ".join(format_number(each.value) for each in found)
        return f"{errors} ({found[-1].size})" if found[-1].failed else errors

    return completed if value == "completed" else show


def read_figure(given: Any, measures: Collection[str] = ()) -> Callable[[Results], Figure]:
    """A figure of panels: a ``metric`` over cycles, or a ``value`` over a setting, with a line for each of ``by``.

    Panels of runs that a quick form leaves out are left out.
    """
    panels = [
        _check("figures", each, ["by"] if "metric" in _check("figures", each) else ["value", "over"])
        for each in _list(given)
    ]
    for own in panels:
        parse_quantity(str(own.get("metric", own.get("value"))), measures)
        is_metric = own.get("metric", TRANSFER) in list(ALL_METRICS)
        require(is_metric, "figures.metric", own.get("metric"), "must be a metric; other quantities are a value")

    def build(own: Mapping[str, Any], results: Results) -> list[Panel]:
        try:
            chosen = results.select(own.get("of"))
        except NoSuchRuns:
            return []
        log, title = own.get("log", ""), own.get("title", "")
        if "metric" in own:
            panel = over_cycles(chosen, own["metric"], own["by"], log)
            return [replace(panel, title=title or panel.title)]
        y, kind = str(own.get("y", title or own["value"])), own.get("kind", "lines")
        sample = partial(compute_quantity, own["value"])
        return [over_setting(chosen, own["over"], y, sample, own.get("by"), title=title, log=log, kind=kind)]

    return lambda results: draw([p for own in panels for p in build(own, results)], columns=min(2, len(panels)))


def read_table(given: Any, measures: Collection[str] = ()) -> Callable[[Results], DataFrame]:
    """A row for each of ``rows``; a column for each quantity of ``columns``, or for each value of ``across``.

    ``across`` is a setting, or a mapping of one to what its titles begin with.
    """
    own = _check(
        "tables", given, ["rows", *(["across", "value"] if "across" in _check("tables", given) else ["columns"])]
    )
    _require_texts("tables.rows", [*own["rows"].values()] if isinstance(own["rows"], Mapping) else own["rows"])
    rows = own["rows"] if isinstance(own["rows"], Mapping) else {key: key for key in _list(own["rows"])}
    require(rows, "tables.rows", own["rows"], "must name at least one setting")
    if "across" in own:
        across = own["across"] if isinstance(own["across"], Mapping) else {own["across"]: ""}
        (row, column), sample = (next(iter(each.items())) for each in (rows, across)), _cell(own["value"], measures)
        return lambda results: cross_tabulate(results.select(own.get("of")), row, column, sample)
    columns = {title: _cell(text, measures) for title, text in own["columns"].items()}
    return lambda results: tabulate(results.select(own.get("of")), rows, columns)


def _fill(part: str, value: Any, words: Mapping[str, Any]) -> Any:
    """A value in a part of a declaration whose texts have names in braces replaced; raises BadInput."""
    if isinstance(value, Mapping):
        return {key: _fill(part, each, words) for key, each in value.items()}
    if isinstance(value, list):
        return [_fill(part, each, words) for each in value]
    return fill(part, value, words) if isinstance(value, str) else value


def _expand(part: str, given: Mapping[str, Any], needs: Collection[str] = ()) -> dict[str, dict[str, Any]]:
    """Statements by name, one for each value that ``for`` gives for a name in braces; raises BadInput."""
    found = {}
    for name, own in given.items():
        values = _check(part, own, needs).get("for") or {}
        for chosen in itertools.product(*values.values()):
            words = dict(zip(values, chosen, strict=True))
            found[_fill(part, name, words)] = _fill(part, own, words) if words else own
    return found


def _find_measure(target: Any) -> Measure:
    """The function of a dotted name; raises BadInput."""
    module, _, name = str(target).rpartition(".")
    try:
        return getattr(importlib.import_module(module), name)  # type: ignore[no-any-return]
    except (ImportError, AttributeError, ValueError) as error:
        raise BadInput("measures", target, f"must be a function by its dotted name: {error}") from error


def _read(part: str, given: Mapping[str, Any], read: Callable[[Any], Any]) -> dict[str, Any]:
    """A part of a declaration by name; a function stands for itself."""
    return {name: own if callable(own) else read(own) for name, own in (given.get(part) or {}).items()}


def declare(**given: Any) -> Study:
    """The study of a declaration: ``title``, ``question``, ``runs`` and what else :data:`FORMS` has of a study.

    Raises:
        BadInput: some part of it is not as it must be.
    """
    own = _check("study", given, ["title", "question", "runs"])
    runs = (
        own["runs"]
        if callable(own["runs"])
        else partial(read_requests, own["runs"], common=_check("runs", own.get("common") or {}))
    )
    measures = _read("measures", own, _find_measure)
    return Study(
        title=str(own["title"]),
        question=str(own["question"]),
        runs=runs,
        measures=measures,
        claims={
            name: Claim(claim["words"], claim["where"], read_criteria(claim, measures))
            for name, claim in _expand("claims", own.get("claims") or {}, ["words", "where"]).items()
        },
        findings={
            name: Finding(read_criteria(finding, measures), says=str(finding.get("says", "")))
            for name, finding in _expand("findings", own.get("findings") or {}).items()
        },
        figures=_read("figures", own, partial(read_figure, measures=measures)),
        tables=_read("tables", own, partial(read_table, measures=measures)),
        **{name: own[name] for name in ("computed", "values") if name in own},
    )


def read_study(path: Path) -> Study:
    """The study of a file of YAML.

    Raises:
        BadInput: it is no YAML in UTF-8, or some part of it is not as it must be.
    """
    try:
        given = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise BadInput("study", path, f"is no YAML in UTF-8: {' '.join(str(error).split())}") from error
    return declare(**_check("study", given))
