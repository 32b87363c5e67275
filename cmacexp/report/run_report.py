"""The report of one run."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from cmacexp.config.cmac import OUTPUTS, WORD_BYTES
from cmacexp.config.difference import flat
from cmacexp.config.machine import LEG_NAMES
from cmacexp.data.integrity import faults
from cmacexp.data.stored_run import StoredRun
from cmacexp.data.tables import steps_by_cycle
from cmacexp.errors import BadInput, BadRun
from cmacexp.metrics.drift import Drift, format_drift
from cmacexp.metrics.pooling import pool_legs
from cmacexp.metrics.registry import ALL_METRICS, MAIN
from cmacexp.metrics.summary import format_cycles, format_number
from cmacexp.report import over_cycle, per_cycle
from cmacexp.report.figure_data import MOST_CYCLES, FigureData, read_figure_data
from cmacexp.report.page import Report, Section, Table, Text
from cmacexp.report.run_summary import TABLES


def require_whole(run: StoredRun) -> None:
    """Refuse a run whose tables are missing or changed.

    Raises:
        BadRun: names the first table that is missing or changed, or says that the run took no step.
    """
    for fault in faults(run.folder):
        name, _, what = fault.partition(": ")
        if name in TABLES:
            raise BadRun(f"{run.folder / name}: {what}; run it again to report it")
    if not run.manifest["steps"]:
        raise BadRun(f"{run.folder}: the run took no step")


def _read_cycles(run: StoredRun) -> list[int]:
    kept = sorted(steps_by_cycle(run.folder))
    if not kept:
        raise BadRun(f"{run.folder}: its trace holds no step; run it again without record.cycles")
    return kept


def choose_cycles(run: StoredRun, asked: Sequence[int]) -> list[int]:
    """The cycles to show: those asked for, else the first, the first that learned, the middle and the last whole one.

    For a thinned run only those in its trace.

    Raises:
        BadInput: the run or its trace does not have one, or they are too many for one figure.
        BadRun: the trace holds no step.
    """
    last, kept = run.last_cycle, _read_cycles(run)
    if len(set(asked)) > MOST_CYCLES:
        raise BadInput("--cycles", ",".join(map(str, asked)), f"at most {MOST_CYCLES} fit into one figure")
    for wanted in asked:
        if not 1 <= wanted <= last:
            raise BadInput("--cycles", wanted, f"{run.folder} has cycles 1 to {last}")
        if wanted not in kept:
            raise BadInput("--cycles", wanted, "is not in the trace, which holds only the cycles of record.cycles")
    if asked:
        return sorted(set(asked))
    whole = [cycle for cycle in kept if cycle <= run.whole_cycles] or kept[:1]
    learned = run.config["learning"]["start_cycle"] if run.manifest["memory"] else 1
    candidates = {whole[0], whole[(len(whole) - 1) // 2], whole[-1], *[c for c in whole if c >= learned][:1]}
    return sorted(candidates)


def _format_end(run: StoredRun) -> str:
    manifest = run.manifest
    cause = f" {manifest['cause']}" if manifest["cause"] else ""
    return f"{run.status}{cause}"


def _list_facts(run: StoredRun) -> Table:
    manifest, config = run.manifest, run.config
    per_step = 1e6 * manifest["rollout_seconds"] / manifest["steps"]
    facts = {
        "folder": str(run.folder),
        "ended": _format_end(run),
        "drift": format_drift(Drift(**manifest["drift"])) if manifest.get("drift") else "not detected",
        "cycles": f"{run.whole_cycles} of {config['cycles']} requested, {config['gait']['cycle_time']:g} s each",
        "steps": f"{manifest['steps']} of {1e3 * config['sampling_period']:g} ms",
        "machine": str(config["machine"]["kind"]),
        "feedforward": str(config["feedforward"]["_target_"]).rpartition(".")[2],
        "force control": f"{config['force_control']['method']}, reference {config['reference']}",
        "closed loop": f"{per_step:.2f} us a step, the whole run {manifest['wall_seconds']:.2f} s",
        "seed": str(manifest["seed"]),
        "config hash": str(manifest["config_hash"])[:16],
        "commit": str(manifest["git_commit"] or "unknown")[:16],
        "versions": ", ".join(f"{name} {version}" for name, version in manifest["versions"].items()),
    }
    return Table(["property", "value"], [[key, value] for key, value in facts.items()], text_columns=2)


def _exact(value: float) -> str:
    return "-" if value != value else f"{value:.4g}"


def _list_metrics(run: StoredRun, cycles: Sequence[int]) -> Table:
    """Every metric of the chosen cycles, in the units of the files, with its meaning."""
    rows = []
    for name, values in pool_legs(run.scores).items():
        metric = ALL_METRICS[name]
        if not np.isnan(values).all():
            meaning = [name, metric.meaning, metric.pooling.name] if run.walks else [name, metric.meaning]
            rows.append([*meaning, metric.unit or "1", *(_exact(values[cycle - 1]) for cycle in cycles)])
    titles = ["metric", "meaning", *(["over the legs"] if run.walks else []), "unit"]
    titles += [f"cycle {cycle}" for cycle in cycles]
    return Table(titles, rows, "All metrics that are defined in some cycle of the run.", len(titles) - len(cycles))


def _per_cycle(run: StoredRun, cycles: Sequence[int], data: FigureData) -> Section:
    titles, rows = format_cycles(run.scores)
    columns = [f"{title}, {unit}" if unit else title for title, unit in titles]
    parts: list[Any] = []
    if run.metrics["cycle"].max() > 1:
        parts.append(per_cycle.draw_metrics(run, "N m" if data.has_joints else "N"))
        parts += [per_cycle.draw_legs(run)] if run.walks else []
    caption = "Metrics per cycle" + (", pooled over the legs" if run.walks else "")
    return Section("Metrics per cycle", [*parts, Table(columns, rows, caption), _list_metrics(run, cycles)])


def _shares(run: StoredRun, cycles: Sequence[int]) -> Table:
    """Share of the feedforward in the absolute torque, by leg and cycle."""
    metrics = run.metrics.set_index(["leg", "cycle"])["feedforward_share"]
    legs, shown = sorted(run.metrics["leg"].unique()), MAIN["feedforward_share"]
    rows = [
        [_leg_name(leg, len(legs)), *(format_number(shown.factor * float(metrics[(leg, cycle)])) for cycle in cycles)]
        for leg in legs
    ]
    caption = "Share of the feedforward in feedforward plus feedback, absolute torques over the cycle, " + shown.unit
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
    last = run.last_cycle
    ending = Text(f"The run {_format_end(run)}.")
    if last not in _read_cycles(run):
        return [Section("How it ended", [ending])]
    data = read_figure_data(run, [max(last - 1, 1), last])
    return [Section("How it ended", [ending, over_cycle.draw_end(data, run.status)])]


def make_run_report(run: StoredRun, asked: Sequence[int] = ()) -> Report:
    """The report of one run.

    Args:
        run: that ended, with any status.
        asked: numbers of the cycles to show; empty: a selection.

    Raises:
        BadRun: a table is missing, changed or empty.
        BadInput: a cycle that the run does not have.
    """
    require_whole(run)
    cycles = choose_cycles(run, asked)
    data = read_figure_data(run, cycles)
    body = [Section("The body", [over_cycle.draw_body(data)])] if run.walks else []
    sections = [
        Section("The run", [_list_facts(run)]),
        *_end(run),
        _per_cycle(run, cycles, data),
        Section("Over a cycle", over_cycle.draw_tracking(data)),
        *body,
        Section("Feedback and feedforward", [over_cycle.draw_torques(data), _shares(run, cycles)]),
        *_memory(run),
        _settings(run),
    ]
    shown = ", ".join(map(str, cycles))
    summary = f"The run {_format_end(run)}. Cycles shown: {shown}."
    inputs = [run.folder / name for name in TABLES if name in run.manifest["files"]]
    asked_for = {"runs": {str(run.folder.resolve()): run.manifest["config_hash"]}, "cycles": cycles}
    return Report(f"{run.config['scenario']}: {run.folder.resolve().name}", summary, sections, inputs, asked_for)
