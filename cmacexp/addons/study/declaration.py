"""A study declared as one mapping: runs, claims, findings, figures and tables, by the names of their parts.

``docs/add-a-study.md`` shows it. A value is a function of the results; so may be a cell of a table, a figure, or all
runs.
"""

import itertools
import math
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import yaml

from cmacexp.addons.study.results import NoSuchRuns, Results
from cmacexp.addons.study.samples import require_sample
from cmacexp.addons.study.statements import Claim, Criterion, Finding, Limit, fill
from cmacexp.addons.study.study import DataFrame, Figure, Request, Study, grid, starting_from
from cmacexp.addons.study.views import cross_tabulate, over_cycles, over_setting, tabulate
from cmacexp.errors import require, require_name
from cmacexp.metrics.registry import ALL_METRICS
from cmacexp.report.figures import Panel, draw

Declared = dict[str, Any]
"""A part of a declaration, or values of a page, by name."""
UNITS = {
    **dict.fromkeys(("", "cycles", "samples", "m/s", "m/s^2", "rad/s", "Hz", "kg", "N/m", "W"), 1.0),
    **{metric.unit: 1.0 for metric in ALL_METRICS.values()},
    "%": 100.0, "mm": 1e3, "mrad": 1e3, "ms": 1e3,
}  # fmt: skip
"""Units of a limit: the factor from the SI unit to each."""
NUMBER = r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
LIMIT = re.compile(
    rf"(any|at most|at least|) ?(?:{NUMBER}(?: to {NUMBER})?)? ?(%|[a-zA-Zµ]+(?:[ /][a-zA-Z]+(?:\^2)?)?)?"
)
CRITERION = ("quantity", "value", "of", "over", "each", "limit", "opposite", "case", "infinite", "beside")
FORMS: dict[str, tuple[str, ...]] = {
    "study": (
        "title", "question", "common", "runs", "measures", "computed", "claims", "findings", "figures", "tables",
        "values",
    ),
    "runs": ("set", "quick", "over", "seeds", "labels", "after"),
    "claims": ("for", "words", "where", "criteria", *CRITERION),
    "findings": ("for", "says", "criteria", *CRITERION),
    "criteria": CRITERION,
    "figures": ("metric", "value", "over", "by", "of", "log", "title", "y", "kind"),
    "tables": ("rows", "columns", "across", "value", "of"),
}  # fmt: skip
"""What each part of a declaration may hold."""


def _check(part: str, given: Any, *needs: str) -> dict[str, Any]:
    """A part that is a mapping with names of its form, and with all that it needs; raises BadInput."""
    require(isinstance(given, Mapping), part, given, f"must be a mapping with {', '.join(FORMS[part])}")
    for name in given:
        require_name(part, name, FORMS[part])
    for name in needs:
        require(given.get(name) not in (None, {}), part, dict(given), f"needs {name}")
    return dict(given)


def _list(value: Any) -> list[Any]:
    return list(value) if isinstance(value, list) else [] if value is None else [value]


def format_overrides(values: Any) -> list[str]:
    """Overrides as on the command line, of a mapping or of a list of texts."""
    if not isinstance(values, Mapping):
        return [str(text) for text in _list(values)]
    return [
        f"{key}={yaml.safe_dump(value, default_flow_style=True).split(chr(10))[0]}" for key, value in values.items()
    ]


def read_limit(text: str) -> tuple[Limit, str, float]:
    """A limit, the unit that it is given in, and the factor to it: ``at most 10 %``, ``at least 2``, ``1 to 3 mm``.

    ``any mm`` is of a value that stands beside others and decides nothing.

    Raises:
        BadInput: it is none, its unit is unknown, or its lower end is above its upper end.
    """
    found = LIMIT.fullmatch(str(text))
    side, first, last, unit = found.groups("") if found else ("", "", "", "")
    low = float(first or "nan")
    ends = {"any": (-math.inf, math.inf), "at most": (-math.inf, low), "at least": (low, math.inf)}
    low, high = ends.get(side, (low, float(last or low)))
    require(low <= high, "limit", text, "must be as “at most 10 %”, “at least 2” or “1 to 3 mm”, low to high")
    require(unit in UNITS, "limit", text, f"its unit must be none, or one of {', '.join(filter(None, UNITS))}")
    return Limit(low / UNITS[unit], high / UNITS[unit]), unit, UNITS[unit]


def read_criteria(given: Mapping[str, Any]) -> list[Criterion]:
    """The criteria of a statement: those under ``criteria``, or the one that it is itself, for ``each`` setting.

    After them come the values of ratios that are to stand ``beside`` them.

    Raises:
        BadInput: a name is unknown or missing, the value is no function, or the limit is none.
    """
    parts = given.get("criteria", [{key: value for key, value in given.items() if key in CRITERION}])
    parts = [_check("criteria", part, "value", "limit") for part in parts]
    beside = [_list_values(part) for part in parts if part.get("beside")]
    return [criterion for part in (*parts, *beside) for criterion in _read_criterion(part)]


def _list_values(given: Mapping[str, Any]) -> dict[str, Any]:
    """What shows the values of the runs that a criterion divides, those of ``over`` first; it decides nothing."""
    own = _check("criteria", given, "of", "over")
    missing = own["over"].keys() - own["of"].keys()
    require(not missing, "beside", own["beside"], f"needs a value under of for what over names: {', '.join(missing)}")
    quantity, _, unit = str(own["beside"]).rpartition(", ")
    pairs = {key: [value, own["of"][key]] for key, value in own["over"].items()}
    case = {"case": ", ".join([str(own["case"]), *map("{{{}}}".format, pairs)])} if "case" in own else {}
    more = {"quantity": quantity, "each": {**(own.get("each") or {}), **pairs}, "limit": f"any {unit}"}
    return {"value": own["value"], "of": own["of"], **more, **case}


def _read_criterion(own: Mapping[str, Any]) -> list[Criterion]:
    case = own.get("case")  # with the values of settings in braces; without one, the values
    more = {key: own[key] for key in ("over", "infinite") if key in own}
    holds, unit, scale = read_limit(own["limit"])
    fails = read_limit(own["opposite"])[0] if "opposite" in own else None
    values = [[(key, value) for value in _list(chosen)] for key, chosen in (own.get("each") or {}).items()]
    return [
        Criterion(
            str(own.get("quantity", own["value"])), own["value"], holds, fails, unit, scale,
            {**(own.get("of") or {}), **dict(chosen)},
            ", ".join(str(value) for _, value in chosen) if case is None else _fill("case", str(case), dict(chosen)),
            **more,
        )
        for chosen in itertools.product(*values)
    ]  # fmt: skip


def _read_over(values: Mapping[str, Any], quick: bool) -> dict[str, Any]:
    """Values by setting, or overrides by label; a quick form takes the first and the last of each."""
    found: dict[str, Any] = {}
    for key, given in values.items():
        is_list = isinstance(given, Collection) and not isinstance(given, str) and len(given)
        require(is_list, f"runs.over.{key}", given, "must be a list of values, such as [0.1, 0.2]")
        labelled = isinstance(given, Mapping)
        items = [(name, format_overrides(own)) for name, own in given.items()] if labelled else [*given]
        items = [*items[:1], *items[1:][-1:]] if quick else items
        found[key] = dict(items) if labelled else items
    return found


def read_requests(parts: Sequence[Any], quick: bool, common: Mapping[str, Any] | None = None) -> list[Request]:
    """The runs of all parts; a quick form takes what ``quick`` sets, and the first and last value of each setting.

    A part whose ``quick`` is null is left out of it. What a part does not say is ``common`` to all that do not.
    """
    found: list[Request] = []
    for own in ({**(common or {}), **_check("runs", given)} for given in parts):
        if quick and own.get("quick", {}) is None:
            continue
        over, more = _read_over(own.get("over") or {}, quick), own.get("quick") if quick else None
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


def read_figure(given: Any) -> Callable[[Results], Figure]:
    """A figure of panels: a ``metric`` over cycles, or a ``value`` over a setting, with a line for each of ``by``.

    Panels of runs that a quick form leaves out are left out.
    """
    panels = [
        _check("figures", panel, *(["by"] if "metric" in _check("figures", panel) else ["value", "over"]))
        for panel in _list(given)
    ]
    for own in panels:
        if "metric" in own:
            require_name("figures.metric", own["metric"], ALL_METRICS)
        else:
            require_sample("figures.value", own["value"])

    def build(own: Mapping[str, Any], results: Results) -> list[Panel]:
        try:
            chosen = results.select(own.get("of"))
        except NoSuchRuns:
            return []
        log, title = own.get("log", ""), own.get("title", "")
        if "metric" in own:
            panel = over_cycles(chosen, own["metric"], own["by"], log)
            return [replace(panel, title=title or panel.title)]
        y, kind = str(own.get("y", title)), own.get("kind", "lines")
        return [over_setting(chosen, own["over"], y, own["value"], own.get("by"), title=title, log=log, kind=kind)]

    return lambda results: draw([p for own in panels for p in build(own, results)], columns=min(2, len(panels)))


def read_table(given: Any) -> Callable[[Results], DataFrame]:
    """A row for each of ``rows``; a column for each function of ``columns``, or a ``value`` for each of ``across``.

    ``across`` is a setting, or a mapping of one to what its titles begin with.
    """
    own = _check("tables", given, "rows", *(["value"] if "across" in _check("tables", given) else ["columns"]))
    rows = own["rows"] if isinstance(own["rows"], Mapping) else {key: key for key in _list(own["rows"])}
    columns = own.get("columns") or {"value": own["value"]}
    for title, value in columns.items():
        require_sample(f"tables.{title}", value)
    if "across" in own:
        across = own["across"] if isinstance(own["across"], Mapping) else {own["across"]: ""}
        row, column = (next(iter(settings.items())) for settings in (rows, across))
        return lambda results: cross_tabulate(results.select(own.get("of")), row, column, own["value"])
    return lambda results: tabulate(results.select(own.get("of")), rows, columns)


def _fill(part: str, value: Any, words: Mapping[str, Any]) -> Any:
    """A value in a part of a declaration whose texts have names in braces replaced; raises BadInput."""
    if isinstance(value, Mapping):
        return {key: _fill(part, each, words) for key, each in value.items()}
    if isinstance(value, list):
        return [_fill(part, each, words) for each in value]
    return fill(part, value, words) if isinstance(value, str) else value


def _expand(part: str, given: Mapping[str, Any], *needs: str) -> dict[str, dict[str, Any]]:
    """Statements by name, one for each value that ``for`` gives for a name in braces; raises BadInput."""
    found = {}
    for name, own in given.items():
        values = _check(part, own, *needs).get("for") or {}
        for chosen in itertools.product(*values.values()):
            words = dict(zip(values, chosen, strict=True))
            found[_fill(part, name, words)] = _fill(part, own, words) if words else own
    return found


def _read(part: str, given: Mapping[str, Any], read: Callable[[Any], Any]) -> dict[str, Any]:
    """A part of a declaration by name; a function stands for itself."""
    return {name: own if callable(own) else read(own) for name, own in (given.get(part) or {}).items()}


def declare(**given: Any) -> Study:
    """The study of a declaration: ``title``, ``question``, ``runs`` and what else :data:`FORMS` has of a study.

    Raises:
        BadInput: some part of it is not as it must be.
    """
    own = _check("study", given, "title", "question", "runs")
    for name, measure in (own.get("measures") or {}).items():
        require(callable(measure), "measures", f"{name}: {measure}", "must be a function of a run")
    common = _check("runs", own.get("common") or {})
    return Study(
        title=str(own["title"]),
        question=str(own["question"]),
        runs=own["runs"] if callable(own["runs"]) else partial(read_requests, own["runs"], common=common),
        measures=own.get("measures") or {},
        claims={
            name: Claim(claim["words"], claim["where"], read_criteria(claim))
            for name, claim in _expand("claims", own.get("claims") or {}, "words", "where").items()
        },
        findings={
            name: Finding(read_criteria(finding), says=str(finding.get("says", "")))
            for name, finding in _expand("findings", own.get("findings") or {}).items()
        },
        figures=_read("figures", own, read_figure),
        tables=_read("tables", own, read_table),
        **{name: own[name] for name in ("computed", "values") if name in own},
    )
