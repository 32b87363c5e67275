"""A study declared in YAML: runs, claims, findings, figures and tables, without Python.

``docs/add-a-study.md`` shows one. The same declarations make parts of studies in Python: see ``read_criteria``.
"""

import itertools
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from cmacexp.errors import BadInput, suggest
from cmacexp.report.figures import draw
from cmacexp.study.curves import over_cycles, over_setting
from cmacexp.study.quantity import check_quantity, compute_quantity
from cmacexp.study.results import Results
from cmacexp.study.statements import Claim, Criterion, Finding, Limit
from cmacexp.study.study import Request, Study, grid
from cmacexp.study.tables import cross_tabulate, tabulate

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

SCALES = {"%": 100.0, "mm": 1e3, "mrad": 1e3, "ms": 1e3}
"""Factor from the unit of a metric to that of a limit, where it is not 1."""
LIMIT = re.compile(r"(?:(at most|at least) )?(\S+?)(?: to (\S+?))? ?(%|[a-zA-Zµ]+(?:[ /][a-zA-Z]+)?)?")
CRITERION = ("quantity", "value", "of", "over", "each", "limit", "opposite", "case")
FORMS: dict[str, Sequence[str]] = {
    "study": ("title", "question", "runs", "claims", "findings", "figures", "tables"),
    "runs": ("set", "quick", "over", "seeds", "labels"),
    "claims": ("words", "where", "criteria", *CRITERION),
    "findings": ("says", "criteria", *CRITERION),
    "criteria": CRITERION,
    "figures": ("metric", "value", "over", "by", "of", "log", "title"),
    "tables": ("rows", "columns", "across", "value", "of"),
}
"""What each part of a declaration may hold."""


def _check(part: str, given: Any, needs: Collection[str] = ()) -> dict[str, Any]:
    """A part that is a mapping with no other keys than its own; raises BadInput."""
    if not isinstance(given, Mapping):
        raise BadInput(part, given, f"must be a mapping with {', '.join(FORMS[part])}")
    for key in given:
        if key not in FORMS[part]:
            raise BadInput(part, key, f"may have {', '.join(FORMS[part])}{suggest(str(key), FORMS[part])}")
    for key in needs:
        if key not in given:
            raise BadInput(part, dict(given), f"needs {key}")
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

    Raises:
        BadInput: it is none.
    """
    found = LIMIT.fullmatch(str(text))
    try:
        side, low, high, unit = found.groups() if found else (None, "", "", "")
        ends = [float(low), float(high or low)]
    except ValueError:
        raise BadInput("limit", text, "must be as “at most 10 %”, “at least 2” or “1 to 3 mm”") from None
    scale = SCALES.get(unit or "", 1.0)
    bounds = {"at most": (float("-inf"), ends[0]), "at least": (ends[0], float("inf"))}.get(side or "", tuple(ends))
    return Limit(*(bound / scale for bound in bounds)), unit or "", scale


def read_criteria(given: Mapping[str, Any], measures: Collection[str] = ()) -> list[Criterion]:
    """The criteria of a statement: those under ``criteria``, or the one that it is itself, for ``each`` setting.

    Raises:
        BadInput: a key is unknown or missing, or the quantity or the limit is none.
    """
    if "criteria" in given:
        return [criterion for each in given["criteria"] for criterion in read_criteria(each, measures)]
    own = {key: value for key, value in given.items() if key in CRITERION}
    for key in ("value", "limit"):
        if key not in own:
            raise BadInput("criteria", dict(given), f"needs {key}")
    check_quantity(own["value"], measures)
    holds, unit, scale = read_limit(own["limit"])
    fails = read_limit(own["opposite"])[0] if "opposite" in own else None
    values = [[(key, value) for value in _list(each)] for key, each in (own.get("each") or {}).items()]
    return [
        Criterion(
            str(own.get("quantity", own["value"])), str(own["value"]), holds, fails, unit, scale,
            {**(own.get("of") or {}), **dict(chosen)}, str(own.get("case", ", ".join(str(v) for _, v in chosen))),
            over=own.get("over"),
        )
        for chosen in itertools.product(*values)
    ]  # fmt: skip


def read_requests(parts: Sequence[Any], quick: bool) -> list[Request]:
    """The runs of all parts; a quick form takes what ``quick`` sets, and the first two values of each setting."""
    found = []
    for given in parts:
        own = _check("runs", given)
        over = {
            key: {name: format_overrides(v) for name, v in values.items()} if isinstance(values, Mapping) else values
            for key, values in (own.get("over") or {}).items()
        }
        if quick:
            over = {k: dict(list(v.items())[:2]) if isinstance(v, dict) else v[:2] for k, v in over.items()}
        more = own.get("quick") if quick else None
        texts = [*format_overrides(own.get("set")), *format_overrides(more)]
        found += grid(*texts, over=over, seeded=bool(own.get("seeds")), **(own.get("labels") or {}))
    return found


def _sample(text: str) -> Callable[[Results], Any]:
    return partial(compute_quantity, text)


def read_figure(given: Any) -> "Callable[[Results], Figure]":
    """A figure of panels: a ``metric`` over cycles, or a ``value`` over a setting, with a line for each of ``by``."""
    panels = [_check("figures", each, ["by"] if "metric" in each else ["value", "over"]) for each in _list(given)]

    def build(own: Mapping[str, Any], results: Results) -> Any:
        chosen, log, title = results.select(own.get("of")), own.get("log", ""), own.get("title", "")
        if "metric" in own:
            return over_cycles(chosen, own["metric"], own["by"], log, title)
        y = title or str(own["value"])
        return over_setting(chosen, own["over"], y, _sample(own["value"]), own.get("by"), title=title, log=log)

    return lambda results: draw([build(own, results) for own in panels])


def read_table(given: Any) -> "Callable[[Results], pd.DataFrame]":
    """A row for each of ``rows``; a column for each quantity of ``columns``, or for each value of ``across``."""
    own = _check("tables", given, ["rows"])
    rows = own["rows"] if isinstance(own["rows"], Mapping) else {key: key for key in _list(own["rows"])}
    if "across" in own:
        pair, sample = next(iter(rows.items())), _sample(own["value"])
        return lambda results: cross_tabulate(results.select(own.get("of")), pair, (own["across"], ""), sample)
    columns = {title: _sample(text) for title, text in own["columns"].items()}
    return lambda results: tabulate(results.select(own.get("of")), rows, columns)


def read_findings(given: Mapping[str, Any], measures: Collection[str] = ()) -> dict[str, Finding]:
    """Findings by name; raises as :func:`read_criteria`."""
    return {
        name: Finding(read_criteria(_check("findings", own), measures), says=str(own.get("says", "")))
        for name, own in given.items()
    }


def read_claims(given: Mapping[str, Any], measures: Collection[str] = ()) -> dict[str, Claim]:
    """Claims by name; raises as :func:`read_criteria`."""
    return {
        name: Claim(own["words"], own["where"], read_criteria(own, measures))
        for name, own in ((name, _check("claims", each, ["words", "where"])) for name, each in given.items())
    }


def read_study(path: Path) -> Study:
    """The study of a file of YAML.

    Raises:
        BadInput: it is no YAML, or some part of it is not as it must be.
    """
    try:
        given = yaml.safe_load(path.read_text(encoding="utf-8"))
    except yaml.YAMLError as error:
        raise BadInput("study", path, f"is no YAML: {' '.join(str(error).split())}") from error
    own = _check("study", given, ["title", "question", "runs"])
    read_requests(own["runs"], quick=False)
    return Study(
        title=str(own["title"]),
        question=str(own["question"]),
        runs=partial(read_requests, own["runs"]),
        claims=read_claims(own.get("claims") or {}),
        findings=read_findings(own.get("findings") or {}),
        figures={name: read_figure(each) for name, each in (own.get("figures") or {}).items()},
        tables={name: read_table(each) for name, each in (own.get("tables") or {}).items()},
    )
