"""What commands say of runs: their tables, that they compile, how one ended, what is special, and what to do next.

Tables are text without control characters, the same in a terminal, in a file and in a printed run. A terminal of 80
columns shows the cycles of a run; columns that do not fit side by side follow below, so that no number is folded.
"""

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
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
from cmacexp.metrics.body import describe_load
from cmacexp.metrics.drift import describe_guard, format_drift, read_drift_entry
from cmacexp.metrics.metric import MetricDisplay
from cmacexp.metrics.registry import ALL_METRICS, MAIN, find_numeric, shorten, tabulate_cycles, tabulate_runs
from cmacexp.terminal.output import print_line

WIDTH = 400
"""Most characters in a line of a table if the output is not a terminal."""
TEXT_WIDTH = 80
"""Most characters in a line of a key."""
KEY = "columns:   python -m cmacexp.report --key"
"""Printed below a table: the command that explains its columns."""
TITLE_WIDTH = 8
"""Most characters in a line of a title."""
GAP = 2
"""Characters between two columns."""


def _make_columns(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[list[str]]:
    """Each column as lines of equal length: those of its title, the last one with the unit, then a cell per row."""
    rows = [list(map(in_one_line, row)) for row in rows]
    height, numeric = 1 + max(title.count("\n") for title in titles), find_numeric(rows)
    for index, title in enumerate(titles):
        heading = [""] * (height - 1 - title.count("\n")) + list(map(in_one_line, title.split("\n")))
        lines = [*heading, *(row[index] for row in rows)]
        width = max(map(len, lines))
        yield [line.rjust(width) if index in numeric else line.ljust(width) for line in lines]


def format_table(titles: Sequence[str], rows: Sequence[Sequence[str]], width: int = TEXT_WIDTH) -> Iterator[str]:
    """Lines with rows under their titles; columns that do not fit into ``width`` follow below, after the first one.

    Titles may have line breaks; the unit is the last line.
    """
    first, *others = _make_columns(titles, rows)
    groups = [[first]]
    for column in others:
        if len(groups[-1]) > 1 and sum(len(lines[0]) + GAP for lines in groups[-1]) + len(column[0]) > width:
            groups.append([first])
        groups[-1].append(column)
    for group in groups:
        yield from ((" " * GAP).join(cells).rstrip() for cells in zip(*group, strict=True))


def print_table(
    titles: Sequence[str], rows: Sequence[Sequence[str]], what: str = "", place: object = "", count: int = 0
) -> None:
    """Print :func:`format_table`, as wide as the terminal; of many of ``what`` some, if all are in ``place``.

    ``count`` is how many there are if ``rows`` are only those that are shown.
    """
    shown = shorten(rows) if place else rows
    for line in format_table(titles, shown, get_terminal_size((WIDTH, 0)).columns):
        print_line(line)
    if len(shown) < (count := count or len(rows)):
        print_line(f"{len(shown)} of {count} {what}; all are in {place}")


def format_title(shown: MetricDisplay) -> str:
    """The title of a metric in short lines, and its unit."""
    hyphenated = shown.title.replace("overshoot", "over-shoot").replace("feedforward", "feed-forward")
    return "\n".join([*wrap(hyphenated, TITLE_WIDTH), shown.unit])


def print_key() -> None:
    """Print what the columns of metrics mean: name, symbol, meaning, name in the files, pooling over several legs."""
    for name, shown in MAIN.items():
        metric = ALL_METRICS[name]
        over_legs = f"; {metric.pooling.name} over legs" if metric.pooling.name and shown.over_legs else ""
        text = f"{shown.title:<21}{shown.symbol:<8}{metric.meaning} ({name}{over_legs})"
        print("\n".join(wrap(text, TEXT_WIDTH, subsequent_indent=" " * 29)))
    print(f"{'-':<29}undefined, e.g. where the force never settles")


def print_runs(runs: Sequence[Run], keys: Sequence[str], all_in: Path, count: int = 0) -> None:
    """Print a table of runs; of many some, and where all are: ``count`` of them if these are some of more."""
    main, rows = tabulate_runs(shorten(runs), keys)
    titles = ["run\n", *(key.replace(".", ".\n") + "\n" for key in keys), "status\n", "cycles\ndone\n"]
    print_table([*titles, *map(format_title, main.values())], rows, "runs", all_in, count or len(runs))
    if main:
        print("metrics are those of the last whole cycle")
        print(KEY)


def format_scores(scores: Scores) -> list[str]:
    """The main metrics of a run per cycle, pooled over the legs, as lines; of a long run some cycles."""
    main, rows = tabulate_cycles(scores)
    return list(format_table(["cycle\n", *map(format_title, main.values())], shorten(rows)))


def print_scores(scores: Scores, folder: Path) -> None:
    """Print the main metrics of a run per cycle, pooled over the legs; of a long run some cycles."""
    main, rows = tabulate_cycles(scores)
    print_table(["cycle\n", *map(format_title, main.values())], rows, "cycles", folder / METRICS_CSV)


def select_traced(folders: Iterable[Path]) -> list[Path]:
    """The runs that stored a trace; a line says how many are left out. All, if none did: each tells why."""
    has_trace = {run: was_written(run / TRACE_FILE) for run in folders}
    others = [run for run, has in has_trace.items() if not has]
    if 0 < len(others) < len(has_trace):
        print_line(f"left out: runs without a trace ({len(others)}, e.g. {others[0]})", error=True)
    return [run for run, has in has_trace.items() if has] or others


NEXT = {"report": "report", "replay": "replay"}
"""Commands that show more of a run with a trace, with their purpose."""


@cache
def announce_compiling() -> None:
    """Print once, if this process has to compile, that it does, and how long that has taken."""

    def announce() -> None:
        longest = read_longest_compiling()
        time = "takes up to half a minute" if longest is None else f"took up to {longest:.0f} s before"
        print_line(f"compiling the control loop, once, since so many steps repay it: {time}", error=True)

    call_before_compiling(announce)


@cache
def _warn(text: str) -> None:
    """Print a warning, once in this process."""
    print_line(f"warning: {text}", error=True)


def warn_of_models(machines: Iterable[object]) -> None:
    """Print, once in this process, which robots' models are not the ones that results were measured with."""
    for machine in {repr(machine): machine for machine in machines}.values():  # a study has many equal ones
        if other := describe_other_model(machine):
            _warn(other)


def warn_of_other_mode(overrides: Iterable[str], group: str, reason: str) -> None:
    """Print which overrides of Hydra have no effect since they are of a ``group`` that it reads in its other mode."""
    for text in overrides:
        if text.startswith(f"{group}."):
            print_line(f"warning: {text} has no effect: {reason}", error=True)


def format_outcome(result: Run, separator: str = ": ") -> str:
    """How a run ended, and after ``separator`` its steps and time."""
    manifest = result.manifest
    steps, seconds = manifest["steps"], manifest["rollout_seconds"]
    per_step = f", loop {seconds / steps * 1e6:.2f} us a step" if steps else ""
    return f"{result.ending}{separator}{steps} steps in {manifest['wall_seconds']:.2f} s{per_step}"


def describe_drift(result: Run) -> str:
    """The drift of the learning of a run, in one line; empty if there is none."""
    drift = read_drift_entry(result.manifest["drift"])
    return format_drift(drift, at_end=True) if drift else ""


def describe_idle(result: Run) -> str:
    """Whether a custom feedforward gave no torque in a whole run, in one line; empty if it gave some."""
    target, learning = result.config["feedforward"]["_target_"], result.config["learning"]
    legs = result.scores.legs
    if is_shipped(target) or not legs.num_rows or as_array(legs, "feedforward_rms").any():
        return ""
    cycles, first = result.config["cycles"], learning["start_cycle"]
    return f"{target} gave no torque in {cycles} cycles; it acts from learning.start_cycle={first} on"


def format_folder(folder: Path) -> str:
    """A folder as an argument of a command in the current one, or in that from which Hydra changed into a run's."""
    hydra: Any = sys.modules.get("hydra.core.hydra_config")  # to import it takes 60 ms, and only it changes folders
    begun = hydra is not None and hydra.HydraConfig.initialized()
    full, here = folder.resolve(), Path(hydra.HydraConfig.get().runtime.cwd) if begun else Path.cwd()
    return quote(str(full.relative_to(here) if full.is_relative_to(here) else full))


def print_next(folder: Path, commands: Mapping[str, str]) -> None:
    """Print commands over a folder to copy, each with what it is for."""
    for name, purpose in commands.items():
        print_line(f"{purpose + ':':<10} python -m cmacexp.{name} {format_folder(folder)}")


def describe_resume(folder: Path) -> str:
    """How a sweep is continued, after a killed or an interrupted one."""
    return f"the same command with sweep.resume=true hydra.sweep.dir={format_folder(folder)}"


def _list_notes(result: Run) -> Iterator[str]:
    """What is special about a run, a line for each."""
    manifest, config = result.manifest, result.config
    described = {
        "": describe_drift(result),
        "warning: ": describe_idle(result),
        "guard of learning: ": describe_guard(manifest),
        "load of the feet: ": describe_load(manifest),
    }
    yield from (f"{name}{text}" for name, text in described.items() if text)
    for name in ("lead", "rate"):
        given, taken = config["learning"][name], manifest[f"learning_{name}"]
        if taken not in (None, given):
            yield f"learning.{name}={given} is {taken:.4g} here"
    for each in manifest["dropped"]:
        time = each["step"] * config["sampling_period"]
        where = f"force sensor of leg {each['leg']} rejected at step {each['step']} (t = {time:g} s)"
        yield f"{where}: it reports a force that the ground cannot give"
    every = choose_every(manifest["steps"])
    if every > 1 and (result.folder / RECORDING_FILE).exists():
        yield f"{RECORDING_FILE}: one step in {every} of {manifest['steps']}; replay with --every 1 shows all"


def print_summary(result: Run) -> None:
    """Print the metrics of a run, how it ended, the commands that show more, and its folder."""
    scores, lines = result.scores, format_outcome(result, "\n" if result.manifest["cause"] else ": ").split("\n")
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
