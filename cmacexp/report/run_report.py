"""The report of one run."""

from collections.abc import Sequence
from typing import Any

import pyarrow.parquet as pq

from cmacexp.config.cmac import OUTPUTS, WORD_BYTES
from cmacexp.config.difference import flat
from cmacexp.config.machine import LEG_NAMES
from cmacexp.data.integrity import faults
from cmacexp.data.parquet import read_table
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import BODY_METRICS, METRICS, Scores, steps_by_cycle
from cmacexp.errors import BadInput, BadRun
from cmacexp.metrics.drift import Drift, in_words
from cmacexp.metrics.summary import number, table_of_cycles, unit_of
from cmacexp.report import over_cycle, per_cycle
from cmacexp.report.comparison import TABLES, steps_per_cycle
from cmacexp.report.figure_data import MOST_CYCLES, Look, look_at
from cmacexp.report.page import Report, Section, Table, Text


def require_whole(run: StoredRun) -> None:
    """Refuse a run whose tables are not those that it left.

    Raises:
        BadRun: names the first table that is missing or changed, or says that the run took no step.
    """
    for fault in faults(run.folder):
        name, _, what = fault.partition(": ")
        if name in TABLES:
            raise BadRun(f"{run.folder / name}: {what}; run it again, a report is about what a run left")
    if not run.manifest["steps"]:
        raise BadRun(f"{run.folder}: the run took no step, there is nothing to report")


def _whole_cycles(run: StoredRun) -> int:
    return int(run.manifest["steps"]) // steps_per_cycle(run.config)


def _last_cycle(run: StoredRun) -> int:
    return -(-int(run.manifest["steps"]) // steps_per_cycle(run.config))


def _kept_cycles(run: StoredRun) -> list[int]:
    kept = sorted(steps_by_cycle(run.folder))
    if not kept:
        raise BadRun(f"{run.folder}: its trace holds no step; run it again without record.cycles")
    return kept


def chosen_cycles(run: StoredRun, asked: Sequence[int]) -> list[int]:
    """The cycles to show: those asked for, else the first, the first that learned, the middle and the last whole one.

    Of a thinned run only those that its trace kept.

    Raises:
        BadInput: the run or its trace does not have one, or they are too many to tell apart.
        BadRun: the trace holds no step.
    """
    last, kept = _last_cycle(run), _kept_cycles(run)
    if len(set(asked)) > MOST_CYCLES:
        raise BadInput("--cycles", ",".join(map(str, asked)), f"at most {MOST_CYCLES} can be told apart in a figure")
    for wanted in asked:
        if not 1 <= wanted <= last:
            raise BadInput("--cycles", wanted, f"{run.folder} has cycles 1 to {last}")
        if wanted not in kept:
            raise BadInput("--cycles", wanted, "is not in the trace, of which record.cycles kept others")
    if asked:
        return sorted(set(asked))
    whole = [cycle for cycle in kept if cycle <= _whole_cycles(run)] or kept[:1]
    learned = run.config["learning"]["start_cycle"] if run.manifest["memory"] else 1
    candidates = {whole[0], whole[(len(whole) - 1) // 2], whole[-1], *[c for c in whole if c >= learned][:1]}
    return sorted(candidates)


def _how_it_ended(run: StoredRun) -> str:
    manifest = run.manifest
    cause = f" {manifest['cause']}" if manifest["cause"] else ""
    return f"{run.status}{cause}"


def _facts(run: StoredRun) -> Table:
    manifest, config = run.manifest, run.config
    per_step = 1e6 * manifest["rollout_seconds"] / manifest["steps"]
    facts = {
        "folder": str(run.folder),
        "ended": _how_it_ended(run),
        "drift": in_words(Drift(**manifest["drift"])) if manifest.get("drift") else "none seen",
        "cycles": f"{_whole_cycles(run)} of {config['cycles']} asked for, {config['gait']['cycle_time']:g} s each",
        "steps": f"{manifest['steps']} of {1e3 * config['sampling_period']:g} ms",
        "machine": str(config["machine"]["kind"]),
        "feedforward": str(config["feedforward"]["_target_"]).rpartition(".")[2],
        "force control": f"{config['force_control']['method']}, reference {config['reference']}",
        "closed loop": f"{per_step:.2f} us a step, the whole run {manifest['wall_seconds']:.2f} s",
        "seed": str(manifest["seed"]),
        "config hash": str(manifest["config_hash"])[:16],
        "commit": str(manifest["git_commit"] or "not known")[:16],
        "versions": ", ".join(f"{name} {version}" for name, version in manifest["versions"].items()),
    }
    return Table(["what", "of this run"], [[key, value] for key, value in facts.items()], text_columns=2)


def _exact(value: float) -> str:
    return "-" if value != value else f"{value:.4g}"


def _all_metrics(run: StoredRun, cycles: Sequence[int]) -> Table:
    """Every metric of the chosen cycles, in the units of the files, with what it means."""
    rows = []
    for name in (METRICS, BODY_METRICS) if run.walks else (METRICS,):
        frame = run.metrics if name == METRICS else run.body_metrics
        table = pq.read_schema(run.folder / name).empty_table()
        for column in frame.columns.drop(["cycle", "leg"], errors="ignore"):
            numbers, values = per_cycle.pooled(frame, column)
            known = dict(zip(numbers.tolist(), values.tolist(), strict=True))
            unit, meaning = unit_of(table, column)
            if any(value == value for value in values):
                rows.append([column, meaning, unit or "1", *(_exact(known[cycle]) for cycle in cycles)])
    titles = ["metric", "meaning", "unit", *(f"cycle {cycle}" for cycle in cycles)]
    return Table(titles, rows, "All metrics of the chosen cycles; what is undefined throughout is left out.", 3)


def _per_cycle(run: StoredRun, cycles: Sequence[int], look: Look) -> Section:
    body = read_table(run.folder / BODY_METRICS) if run.walks else None
    titles, rows = table_of_cycles(Scores(read_table(run.folder / METRICS), body))
    columns = [f"{title}, {unit}" if unit else title for title, unit in titles]
    parts: list[Any] = []
    if run.metrics["cycle"].max() > 1:
        parts.append(per_cycle.metrics(run, "N m" if look.has_joints else "N"))
        parts += [per_cycle.of_each_leg(run)] if run.walks else []
    caption = "Metrics per cycle" + (", pooled over the legs" if run.walks else "")
    return Section("Metrics per cycle", [*parts, Table(columns, rows, caption), _all_metrics(run, cycles)])


def _shares(run: StoredRun, cycles: Sequence[int]) -> Table:
    """The feedforward's share of the absolute torque, by leg and cycle."""
    metrics = run.metrics.set_index(["leg", "cycle"])["feedforward_share"]
    legs = sorted(run.metrics["leg"].unique())
    rows = [
        [_leg_name(leg, len(legs)), *(number(100.0 * float(metrics[(leg, cycle)])) for cycle in cycles)]
        for leg in legs
    ]
    caption = "Share of the feedforward in feedforward plus feedback, absolute torques over the cycle, %"
    return Table(["leg", *(f"cycle {cycle}" for cycle in cycles)], rows, caption)


def _leg_name(leg: int, legs: int) -> str:
    return f"{leg}, {LEG_NAMES[leg - 1]}" if legs > 1 else str(leg)


def _memory(run: StoredRun) -> list[Section]:
    uses = run.manifest["memory"]
    if not uses:
        return []
    rows = []
    for leg, use in enumerate(uses, 1):
        cells, shared = use["cells_visited"], use["cells_colliding"]
        colliding = "not counted" if cells is None else f"{shared} ({shared / cells:.1%})" if cells else "0"
        used = f"{use['rows_used']} ({use['rows_used'] / use['rows']:.1%})"
        visited = "not counted" if cells is None else str(cells)
        rows.append(
            [
                _leg_name(leg, len(uses)),
                str(use["rows"] * OUTPUTS * WORD_BYTES),
                str(use["rows"]),
                used,
                visited,
                colliding,
            ]
        )
        rows[-1].append(str(use["clipped"]))
    titles = ["network of leg", "memory, B", "rows", "rows used", "cells visited", "cells that share a row"]
    text = (
        "Along the planned path of one cycle. Cells are those of a CMAC before hashing; cells that share a row of "
        "memory by hashing train each other. Clipped inputs lie outside the range that the CMAC covers."
    )
    return [Section("Memory of the feedforward", [Text(text), Table([*titles, "clipped inputs"], rows)])]


def _settings(run: StoredRun) -> Section:
    rows = [[key, "null" if value is None else str(value)] for key, value in flat(run.config).items()]
    return Section("Settings", [Table(["key", "value"], rows, text_columns=2)])


def _end(run: StoredRun) -> list[Section]:
    if run.status not in ("fell", "diverged"):
        return []
    last = _last_cycle(run)
    told = Text(f"The run {_how_it_ended(run)}.")
    if last not in _kept_cycles(run):
        return [Section("How it ended", [told])]
    look = look_at(run, [max(last - 1, 1), last])
    return [Section("How it ended", [told, over_cycle.end(look, run.status)])]


def run_report(run: StoredRun, asked: Sequence[int] = ()) -> Report:
    """All that is worth seeing of one run.

    Args:
        run: finished, in whatever way.
        asked: numbers of the cycles to show; none: a choice.

    Raises:
        BadRun: a table is missing, changed or empty.
        BadInput: a cycle that the run does not have.
    """
    require_whole(run)
    cycles = chosen_cycles(run, asked)
    look = look_at(run, cycles)
    body = [Section("The body", [over_cycle.body(look)])] if run.walks else []
    sections = [
        Section("The run", [_facts(run)]),
        *_end(run),
        _per_cycle(run, cycles, look),
        Section("Over a cycle", over_cycle.tracking(look)),
        *body,
        Section("Who does the work", [over_cycle.torques(look), _shares(run, cycles)]),
        *_memory(run),
        _settings(run),
    ]
    shown = ", ".join(map(str, cycles))
    summary = f"The run {_how_it_ended(run)}. Cycles shown: {shown}."
    inputs = [run.folder / name for name in TABLES if name in run.manifest["files"]]
    asked_for = {"runs": {str(run.folder.resolve()): run.manifest["config_hash"]}, "cycles": cycles}
    return Report(f"{run.config['scenario']}: {run.folder.resolve().name}", summary, sections, inputs, asked_for)
