"""Text output of the commands: tables, compile notice, outcome, notes, warnings and next commands.

Tables are text without control characters, the same in a terminal, in a file and in a printed run. The table of a run
fits 80 columns; columns that do not fit side by side follow below, so that no line is wrapped.
"""

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from shlex import quote
from shutil import get_terminal_size
from textwrap import wrap
from typing import Any

from cmacexp.config.component import is_shipped
from cmacexp.config.machine import describe_other_model
from cmacexp.data.manifest import was_written
from cmacexp.data.run import Run
from cmacexp.data.tables import METRICS_CSV, RECORDING_FILE, TRACE_FILE, Scores, as_array
from cmacexp.data.window import choose_every
from cmacexp.errors import in_one_line
from cmacexp.jit.compiler import call_before_compiling, read_longest_compiling
from cmacexp.jit.sources import find_refused_cache
from cmacexp.metrics.body import describe_load
from cmacexp.metrics.drift import describe_guard, format_drift, read_drift_entry
from cmacexp.metrics.metric import MetricDisplay
from cmacexp.metrics.progress import describe_little_progress
from cmacexp.metrics.registry import ALL_METRICS, MAIN, find_numeric, shorten, tabulate_cycles, tabulate_runs
from cmacexp.terminal.output import print_line

WIDTH = 400
"""Most characters in a line of a table if the output is not a terminal."""
TEXT_WIDTH = 80
"""Most characters in a line of text or of the key of a table."""
KEY = "columns:   cmacexp report --key"
"""Line below a table with the command that explains its columns."""
TITLE_WIDTH = 8
"""Most characters in a line of the title of a column."""
GAP = 2
"""Spaces between two columns."""


def _make_columns(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[list[str]]:
    """Yield each column as lines of equal length: those of its title, the last with the unit, then its cells."""
    rows = [list(map(in_one_line, row)) for row in rows]
    height = 1 + max(title.count("\n") for title in titles)
    numeric = find_numeric(rows)
    for index, title in enumerate(titles):
        heading = [""] * (height - 1 - title.count("\n")) + list(map(in_one_line, title.split("\n")))
        lines = [*heading, *(row[index] for row in rows)]
        width = max(map(len, lines))
        yield [line.rjust(width) if index in numeric else line.ljust(width) for line in lines]


def format_table(titles: Sequence[str], rows: Sequence[Sequence[str]], width: int = TEXT_WIDTH) -> Iterator[str]:
    """Yield the lines of a table of at most ``width`` characters; columns that do not fit follow below.

    The first column is repeated there. Titles may have line breaks; their last line is the unit.
    """
    first, *columns = _make_columns(titles, rows)
    groups = [[first]]
    for column in columns:
        if len(groups[-1]) > 1 and sum(len(lines[0]) + GAP for lines in groups[-1]) + len(column[0]) > width:
            groups.append([first])
        groups[-1].append(column)
    for group in groups:
        yield from ((" " * GAP).join(cells).rstrip() for cells in zip(*group, strict=True))


def print_table(
    titles: Sequence[str], rows: Sequence[Sequence[str]], what: str = "", file: object = "", count: int = 0
) -> None:
    """Print a table, as wide as the terminal; a long one is shortened if ``file`` contains all rows.

    Args:
        titles: titles of the columns, see :func:`format_table`.
        rows: cells of each row.
        what: noun for the rows, in the plural.
        file: file with all rows; empty: all rows are printed.
        count: number of all rows, if ``rows`` are already shortened.
    """
    printed = shorten(rows) if file else rows
    for line in format_table(titles, printed, get_terminal_size((WIDTH, 0)).columns):
        print_line(line)
    if len(printed) < (count := count or len(rows)):
        print_line(f"{len(printed)} of {count} {what}; all are in {file}")


def format_title(display: MetricDisplay) -> str:
    """Format the title of a metric in lines of TITLE_WIDTH characters, with its unit in the last line."""
    hyphenated = display.title.replace("overshoot", "over-shoot").replace("feedforward", "feed-forward")
    return "\n".join([*wrap(hyphenated, TITLE_WIDTH), display.unit])


def print_key() -> None:
    """Print the key of the main metrics: title, symbol, meaning, name in the files, pooling over the legs."""
    for name, display in MAIN.items():
        metric = ALL_METRICS[name]
        over_legs = f"; {metric.pooling.name} over legs" if metric.pooling.name and display.over_legs else ""
        text = f"{display.title:<21}{display.symbol:<8}{metric.meaning} ({name}{over_legs})"
        print("\n".join(wrap(text, TEXT_WIDTH, subsequent_indent=" " * 29)))
    print(f"{'-':<29}undefined, e.g. where the force never settles")


def print_runs(runs: Sequence[Run], keys: Sequence[str], all_in: Path, count: int = 0) -> None:
    """Print a table of runs with their values of ``keys``; of many some, and the file ``all_in`` with all.

    ``count`` is the number of all runs if ``runs`` are some of them.
    """
    main, rows = tabulate_runs(shorten(runs), keys)
    titles = ["run\n", *(key.replace(".", ".\n") + "\n" for key in keys), "status\n", "cycles\ndone\n"]
    print_table([*titles, *map(format_title, main.values())], rows, "runs", all_in, count or len(runs))
    if main:
        print("metrics are those of the last whole cycle")
        print(KEY)


def format_scores(scores: Scores) -> list[str]:
    """Format the main metrics of a run as lines, pooled over the legs; of a long run only some cycles."""
    main, rows = tabulate_cycles(scores)
    return list(format_table(["cycle\n", *map(format_title, main.values())], shorten(rows)))


def print_scores(scores: Scores, folder: Path) -> None:
    """Print the main metrics of a run per cycle, pooled over the legs; of a long run only some cycles."""
    main, rows = tabulate_cycles(scores)
    print_table(["cycle\n", *map(format_title, main.values())], rows, "cycles", folder / METRICS_CSV)


def select_traced(folders: Iterable[Path]) -> list[Path]:
    """Select the runs that stored a trace, and print how many did not.

    If none did, all are returned, so that the error of each says the reason.
    """
    has_trace = {run: was_written(run / TRACE_FILE) for run in folders}
    without_trace = [run for run, has in has_trace.items() if not has]
    if 0 < len(without_trace) < len(has_trace):
        print_line(f"left out: runs without a trace ({len(without_trace)}, e.g. {without_trace[0]})", error=True)
    return [run for run, has in has_trace.items() if has] or without_trace


NEXT = {"report": "report", "replay": "replay"}
"""Commands for a closer look at a run with a trace, with their purpose."""


def announce_compiling() -> None:
    """Print a notice before this process compiles next, with the longest compile time so far."""

    def announce() -> None:
        longest = read_longest_compiling()
        time = "takes up to half a minute" if longest is None else f"took up to {longest:.0f} s before"
        folder = find_refused_cache()
        refused = (
            f"; {folder} cannot hold it: delete it, or set NUMBA_CACHE_DIR to a folder of your own" if folder else ""
        )
        text = f"compiling the control loop once, which pays off for this many steps: {time}{refused}"
        print_line(text, error=True)

    call_before_compiling(announce)


def warn_of_models(machines: Iterable[object]) -> None:
    """Warn, once each, of robot models that differ from those with which results were measured."""
    different = {repr(machine): machine for machine in machines}  # a study has many equal machines
    for text in sorted({*map(describe_other_model, different.values())} - {""}):
        print_line(f"warning: {text}", error=True)


def warn_of_other_mode(overrides: Iterable[str], group: str, reason: str) -> None:
    """Warn of overrides of a ``group`` that Hydra reads only in its other mode, run or sweep."""
    for text in overrides:
        if text.startswith(f"{group}."):
            print_line(f"warning: {text} has no effect: {reason}", error=True)


def _list_outcome(result: Run) -> list[str]:
    """List how a run ended, and its number of steps and computing time, in a line of their own after a cause."""
    manifest = result.manifest
    steps = manifest["steps"]
    per_step = f", loop {manifest['rollout_seconds'] / steps * 1e6:.2f} us a step" if steps else ""
    times = f"{steps} steps in {manifest['wall_seconds']:.2f} s{per_step}"
    return [result.ending, times] if manifest["cause"] else [f"{result.ending}: {times}"]


def describe_drift(result: Run) -> str:
    """Describe the drift of learning in a run, in one line; empty without drift."""
    drift = read_drift_entry(result.manifest["drift"])
    return format_drift(drift, at_end=True) if drift else ""


def describe_idle(result: Run) -> str:
    """Report, in one line, a custom feedforward whose torque is 0 in the whole run; empty for all other runs."""
    config = result.config
    target = config["feedforward"]["_target_"]
    legs = result.scores.legs
    if is_shipped(target) or not legs.num_rows or as_array(legs, "feedforward_rms").any():
        return ""
    acts = f"it acts from learning.start_cycle={config['learning']['start_cycle']} on"
    return f"{target} gave no torque in {config['cycles']} cycles; {acts}"


def format_folder(folder: Path) -> str:
    """Format a folder as a quoted command argument, relative to the folder in which the user started the command.

    Hydra may have changed the current folder to that of the run since.
    """
    hydra: Any = sys.modules.get("hydra.core.hydra_config")  # if Hydra is not imported, it changed no folder
    is_hydra_job = hydra is not None and hydra.HydraConfig.initialized()
    here = Path(hydra.HydraConfig.get().runtime.cwd) if is_hydra_job else Path.cwd()
    full = folder.resolve()
    return quote(str(full.relative_to(here) if full.is_relative_to(here) else full))


def print_next(folder: Path, commands: Mapping[str, str]) -> None:
    """Print ``commands`` for a folder, by name with their purpose, ready to copy."""
    for name, purpose in commands.items():
        print_line(f"{purpose + ':':<10} cmacexp {name} {format_folder(folder)}")


def describe_resume(folder: Path) -> str:
    """Describe how to continue the killed or interrupted sweep in ``folder``."""
    return f"the same command with sweep.resume=true hydra.sweep.dir={format_folder(folder)}"


def _list_notes(result: Run) -> Iterator[str]:
    """Yield a line per remarkable fact of a run: drift, guard, computed lead or rate, rejected sensors, thinning."""
    manifest = result.manifest
    described = {
        "": describe_drift(result),
        "warning: ": describe_idle(result) or describe_little_progress(result.config, result.scores),
        "guard of learning: ": describe_guard(manifest),
        "load of the feet: ": describe_load(manifest),
    }
    yield from (f"{name}{text}" for name, text in described.items() if text)
    for name in ("lead", "rate"):
        setting, value = result.config["learning"][name], manifest[f"learning_{name}"]
        if value not in (None, setting):
            yield f"learning.{name}={setting} is {value:.4g} here"
    for sensor in manifest["dropped"]:
        time = sensor["step"] * result.config["sampling_period"]
        where = f"force sensor of leg {sensor['leg']} rejected at step {sensor['step']} (t = {time:g} s)"
        yield f"{where}: it reports a force that the ground cannot give"
    every = choose_every(manifest["steps"])
    if every > 1 and (result.folder / RECORDING_FILE).exists():
        yield f"{RECORDING_FILE}: one step in {every} of {manifest['steps']}; replay with --every 1 shows all"


def print_summary(result: Run) -> None:
    """Print the metrics of a run, its outcome and notes, commands for a closer look, and its folder."""
    scores = result.scores
    lines = _list_outcome(result)
    if scores.legs.num_rows:
        print_scores(scores, Path(format_folder(result.folder)))
        lines = ["", *lines]
    for line in [*lines, *_list_notes(result)]:
        print_line(line)
    if scores.legs.num_rows:
        print_line(KEY)
        explain = {"stability": "explain"} if result.manifest["drift"] else {}
        print_next(result.folder, explain | NEXT if result.config["record"]["trace"] else {})
    print_line(str(result.folder))
