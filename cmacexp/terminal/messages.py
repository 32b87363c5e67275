"""What commands say of runs: that they compile, how one ended, what is special about it, and what to do next."""

from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from shlex import quote

from cmacexp.config.machine import describe_other_model
from cmacexp.data.parquet import as_array
from cmacexp.data.run import Run
from cmacexp.data.tables import RECORDING_FILE
from cmacexp.data.window import choose_every
from cmacexp.jit.compiler import call_before_compiling
from cmacexp.metrics.body import describe_load
from cmacexp.metrics.drift import describe_guard, format_drift, read_drift_entry
from cmacexp.terminal.output import print_line
from cmacexp.terminal.tables import KEY, print_scores

NEXT = {"report": "report", "replay": "replay"}
"""Commands that show more of a run with a trace, with their purpose."""
COMPILING = "compiling the control loop: takes up to half a minute, once; so many steps repay it"


@cache
def announce_compiling() -> None:
    """Print :data:`COMPILING`, once, if this process has to compile."""
    call_before_compiling(lambda: print_line(COMPILING, error=True))


@cache
def _warn(text: str) -> None:
    """Print a warning, once in this process."""
    print_line(f"warning: {text}", error=True)


def warn_of_models(machines: Iterable[object]) -> None:
    """Print, once in this process, which robots' models are not the ones that results were measured with."""
    for machine in {repr(machine): machine for machine in machines}.values():  # a study has many equal ones
        if other := describe_other_model(machine):
            _warn(other)


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
    if target.startswith("cmacexp.") or not legs.num_rows or as_array(legs, "feedforward_rms").any():
        return ""
    cycles, first = result.config["cycles"], learning["start_cycle"]
    return f"{target} gave no torque in {cycles} cycles; it acts from learning.start_cycle={first} on"


def format_folder(folder: Path) -> str:
    """A folder as an argument of a command in the current one."""
    full = folder.resolve()
    return quote(str(full.relative_to(Path.cwd()) if full.is_relative_to(Path.cwd()) else full))


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
        given, taken = config["learning"][name], manifest.get(f"learning_{name}")
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
