"""A study declared as one mapping: runs, claims, findings, figures and tables by name.

``docs/add-a-study.md`` describes the form. A value is a function of the results. Cells of tables, and whole figures,
tables or lists of runs, may be functions, too.
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
from cmacexp.addons.study.statements import Claim, Criterion, Finding, Limit, fill_names
from cmacexp.addons.study.study import DataFrame, Figure, Request, Study, grid, starting_from
from cmacexp.addons.study.views import cross_tabulate, over_cycles, over_setting, tabulate
from cmacexp.errors import require, require_name
from cmacexp.metrics.registry import ALL_METRICS
from cmacexp.report.figures import Panel, draw

Declared = dict[str, Any]
"""Section of a declaration, or values of a page, by name."""
UNITS = {
    **dict.fromkeys(("", "cycles", "samples", "m/s", "m/s^2", "rad/s", "Hz", "kg", "N/m", "W"), 1.0),
    **{metric.unit: 1.0 for metric in ALL_METRICS.values()},
    "%": 100.0, "mm": 1e3, "mrad": 1e3, "ms": 1e3,
}  # fmt: skip
"""Units of limits: factor from the SI unit by unit."""
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
"""Allowed names in each section of a declaration."""


def _check(section: str, entries: Any, *needs: str) -> dict[str, Any]:
    """Return the entries of a section as a dictionary after checking their names.

    Raises:
        BadInput: ``entries`` is no mapping, contains a name that is not in ``FORMS``, or lacks one of ``needs``.
    """
    require(isinstance(entries, Mapping), section, entries, f"must be a mapping with {', '.join(FORMS[section])}")
    for name in entries:
        require_name(section, name, FORMS[section])
    for name in needs:
        require(entries.get(name) not in (None, {}), section, dict(entries), f"needs {name}")
    return dict(entries)


def _list(value: Any) -> list[Any]:
    return list(value) if isinstance(value, list) else [] if value is None else [value]


def format_overrides(values: Any) -> list[str]:
    """Format a mapping of values by config key as command-line overrides; return a list of texts unchanged."""
    if not isinstance(values, Mapping):
        return [str(text) for text in _list(values)]
    return [
        f"{key}={yaml.safe_dump(value, default_flow_style=True).split(chr(10))[0]}" for key, value in values.items()
    ]


def read_limit(text: str) -> tuple[Limit, str, float]:
    """Read a limit such as ``at most 10 %``, ``at least 2`` or ``1 to 3 mm``.

    Returns the limit in SI units, its unit as written, and the factor from the SI unit to that unit. ``any mm`` is
    the limit of a value that is only shown and decides nothing.

    Raises:
        BadInput: the text is no limit, its unit is unknown, or its lower end is above its upper end.
    """
    match = LIMIT.fullmatch(str(text))
    side, first, last, unit = match.groups("") if match else ("", "", "", "")
    low = float(first or "nan")
    ends = {"any": (-math.inf, math.inf), "at most": (-math.inf, low), "at least": (low, math.inf)}
    low, high = ends.get(side, (low, float(last or low)))
    require(low <= high, "limit", text, "must be as “at most 10 %”, “at least 2” or “1 to 3 mm”, low to high")
    require(unit in UNITS, "limit", text, f"its unit must be none, or one of {', '.join(filter(None, UNITS))}")
    return Limit(low / UNITS[unit], high / UNITS[unit]), unit, UNITS[unit]


def read_criteria(statement: Mapping[str, Any]) -> list[Criterion]:
    """Read the criteria of a statement, one for each combination of the settings under ``each``.

    They are declared under ``criteria``; a statement with only one criterion may hold its entries itself. After them
    come criteria without a limit that show, for each ratio with ``beside``, its numerator and denominator.

    Raises:
        BadInput: a name is unknown or missing, the value is no function, or the limit is malformed.
    """
    entries = statement.get("criteria", [{key: value for key, value in statement.items() if key in CRITERION}])
    criteria = [_check("criteria", entry, "value", "limit") for entry in entries]
    operands = [_show_operands(criterion) for criterion in criteria if criterion.get("beside")]
    return [criterion for entry in (*criteria, *operands) for criterion in _read_criterion(entry)]


def _show_operands(ratio: Mapping[str, Any]) -> dict[str, Any]:
    """Return a criterion without a limit that shows both operands of a ratio, that of the ``over`` runs first."""
    entries = _check("criteria", ratio, "of", "over")
    missing = entries["over"].keys() - entries["of"].keys()
    require(
        not missing, "beside", entries["beside"], f"needs a value under of for what over names: {', '.join(missing)}"
    )
    quantity, _, unit = str(entries["beside"]).rpartition(", ")
    pairs = {key: [value, entries["of"][key]] for key, value in entries["over"].items()}
    case = {"case": ", ".join([str(entries["case"]), *map("{{{}}}".format, pairs)])} if "case" in entries else {}
    more = {"quantity": quantity, "each": {**(entries.get("each") or {}), **pairs}, "limit": f"any {unit}"}
    return {"value": entries["value"], "of": entries["of"], **more, **case}


def _read_criterion(entries: Mapping[str, Any]) -> list[Criterion]:
    """Read a criterion for each combination of its settings under ``each``.

    ``case`` may contain names of these settings in braces; without it the case lists their values.
    """
    case = entries.get("case")
    more = {key: entries[key] for key in ("over", "infinite") if key in entries}
    holds, unit, scale = read_limit(entries["limit"])
    fails = read_limit(entries["opposite"])[0] if "opposite" in entries else None
    values = [[(key, value) for value in _list(chosen)] for key, chosen in (entries.get("each") or {}).items()]
    return [
        Criterion(
            str(entries.get("quantity", entries["value"])), entries["value"], holds, fails, unit, scale,
            {**(entries.get("of") or {}), **dict(chosen)},
            ", ".join(str(value) for _, value in chosen) if case is None
            else fill_names("case", str(case), dict(chosen)),
            **more,
        )
        for chosen in itertools.product(*values)
    ]  # fmt: skip


def _read_over(values: Mapping[str, Any], quick: bool) -> dict[str, Any]:
    """Read values by setting, or overrides by label; a quick study uses only the first and the last of each."""
    varied: dict[str, Any] = {}
    for key, options in values.items():
        is_list = isinstance(options, Collection) and not isinstance(options, str) and len(options)
        require(is_list, f"runs.over.{key}", options, "must be a list of values, such as [0.1, 0.2]")
        labelled = isinstance(options, Mapping)
        items = [(label, format_overrides(texts)) for label, texts in options.items()] if labelled else [*options]
        items = [*items[:1], *items[1:][-1:]] if quick else items
        varied[key] = dict(items) if labelled else items
    return varied


def read_requests(groups: Sequence[Any], quick: bool, common: Mapping[str, Any] | None = None) -> list[Request]:
    """Read the runs of all groups; ``common`` holds the default entries of a group.

    A quick study adds the overrides of ``quick``, uses only the first and last value of each setting, and leaves out
    groups whose ``quick`` is None. The runs of a group with ``after`` start from the final weights of earlier runs:
    of those that have the labels ``after`` and the same value of every other setting of the group.
    """
    all_requests: list[Request] = []
    for group in ({**(common or {}), **_check("runs", entries)} for entries in groups):
        if quick and group.get("quick", {}) is None:
            continue
        over = _read_over(group.get("over") or {}, quick)
        fixed = format_overrides(group.get("set"))
        requests = grid(*fixed, over=over, seeded=group.get("seeds", False), **(group.get("labels") or {}))
        more = format_overrides(group.get("quick")) if quick else []
        requests = [replace(request, overrides=(*request.overrides, *more)) for request in requests]
        after = group.get("after")
        if after is not None:
            first = [
                replace(request, labels={key: request.labels[key] for key in over if key not in after})
                for request in all_requests
                if after.items() <= request.labels.items()
            ]
            requests = starting_from(first, requests)
        all_requests += requests
    return all_requests


def _draw_panel(entries: Mapping[str, Any], results: Results) -> list[Panel]:
    """Make the panel of the selected runs; an empty list if a quick study left these runs out."""
    try:
        chosen = results.select(entries.get("of"))
    except NoSuchRuns:
        return []
    title = entries.get("title", "")
    if "metric" in entries:
        panel = over_cycles(chosen, entries["metric"], entries["by"], entries.get("log", ""))
        return [replace(panel, title=title or panel.title)]  # the label of the y axis keeps the name of the metric
    style = {name: entries[name] for name in ("log", "kind") if name in entries}
    y = str(entries.get("y", title))
    return [over_setting(chosen, entries["over"], y, entries["value"], entries.get("by"), title=title, **style)]


def read_figure(declared: Any) -> Callable[[Results], Figure]:
    """Return a function that draws a declared figure of one or several panels from the results.

    A panel shows a ``metric`` over cycles or a ``value`` over a setting, with one line per value of the setting
    ``by``. Panels whose runs a quick study leaves out are left out.

    Raises:
        BadInput: a name is unknown or missing, or the value is no function.
    """
    panels = [
        _check("figures", panel, *(["by"] if "metric" in _check("figures", panel) else ["value", "over"]))
        for panel in _list(declared)
    ]
    for panel in panels:
        if "metric" in panel:
            require_name("figures.metric", panel["metric"], ALL_METRICS)
        else:
            require_sample("figures.value", panel["value"])
    return lambda results: draw(
        [drawn for panel in panels for drawn in _draw_panel(panel, results)], columns=min(2, len(panels))
    )


def read_table(declared: Any) -> Callable[[Results], DataFrame]:
    """Return a function that makes a declared table from the results.

    The table has a row for each combination of the settings ``rows``. Its columns are the functions ``columns``, or
    the function ``value`` for each value of ``across``: a setting, or a mapping of a setting to the prefix of the
    titles.

    Raises:
        BadInput: a name is unknown or missing, or a value is no function.
    """
    needs = ["value"] if "across" in _check("tables", declared) else ["columns"]
    table = _check("tables", declared, "rows", *needs)
    rows = table["rows"] if isinstance(table["rows"], Mapping) else {key: key for key in _list(table["rows"])}
    columns = table.get("columns") or {"value": table["value"]}
    for title, value in columns.items():
        require_sample(f"tables.{title}", value)
    if "across" in table:
        across = table["across"] if isinstance(table["across"], Mapping) else {table["across"]: ""}
        row, column = (next(iter(settings.items())) for settings in (rows, across))
        return lambda results: cross_tabulate(results.select(table.get("of")), row, column, table["value"])
    return lambda results: tabulate(results.select(table.get("of")), rows, columns)


def _fill_texts(section: str, value: Any, words: Mapping[str, Any]) -> Any:
    """Replace the names in braces in all texts of a nested value by ``words``; raises BadInput for other names."""
    if isinstance(value, Mapping):
        return {key: _fill_texts(section, item, words) for key, item in value.items()}
    if isinstance(value, list):
        return [_fill_texts(section, item, words) for item in value]
    return fill_names(section, value, words) if isinstance(value, str) else value


def _expand(section: str, statements: Mapping[str, Any], *needs: str) -> dict[str, dict[str, Any]]:
    """Replace each statement by one statement for each combination of the values under ``for``.

    ``for`` holds the values by the name that stands in braces in the texts and in the name of the statement.
    """
    expanded = {}
    for name, statement in statements.items():
        values = _check(section, statement, *needs).get("for") or {}
        for chosen in itertools.product(*values.values()):
            words = dict(zip(values, chosen, strict=True))
            expanded[_fill_texts(section, name, words)] = (
                _fill_texts(section, statement, words) if words else statement
            )
    return expanded


def _read(section: str, declaration: Mapping[str, Any], read: Callable[[Any], Any]) -> dict[str, Any]:
    """Read every entry of a section with ``read``, by name; keep entries that are functions."""
    entries = declaration.get(section) or {}
    return {name: entry if callable(entry) else read(entry) for name, entry in entries.items()}


def declare(**declaration: Any) -> Study:
    """Make a study from its declaration: ``title``, ``question``, ``runs`` and the other names in :data:`FORMS`.

    Raises:
        BadInput: a section is malformed.
    """
    study = _check("study", declaration, "title", "question", "runs")
    for name, measure in (study.get("measures") or {}).items():
        require(callable(measure), "measures", f"{name}: {measure}", "must be a function of a run")
    common = _check("runs", study.get("common") or {})
    return Study(
        title=str(study["title"]),
        question=str(study["question"]),
        runs=study["runs"] if callable(study["runs"]) else partial(read_requests, study["runs"], common=common),
        measures=study.get("measures") or {},
        claims={
            name: Claim(claim["words"], claim["where"], read_criteria(claim))
            for name, claim in _expand("claims", study.get("claims") or {}, "words", "where").items()
        },
        findings={
            name: Finding(read_criteria(finding), says=str(finding.get("says", "")))
            for name, finding in _expand("findings", study.get("findings") or {}).items()
        },
        figures=_read("figures", study, read_figure),
        tables=_read("tables", study, read_table),
        **{name: study[name] for name in ("computed", "values") if name in study},
    )
