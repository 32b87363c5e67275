"""``python -m cmacexp``: compose a config with Hydra, run it, report how it ended."""

import argparse
import contextlib
import os
import re
import sys
from pathlib import Path
from typing import Any, NoReturn

from hydra import main as hydra_main
from hydra.core.hydra_config import HydraConfig
from hydra.types import HydraContext
from omegaconf import DictConfig, OmegaConf

from cmacexp.commands.command import BAD_INPUT, COMPLETED, FAILED, STOPPED, report_usage, run_command
from cmacexp.commands.group_help import find_group, format_help
from cmacexp.config import config_folder, to_config
from cmacexp.config.compose import make_record
from cmacexp.config.explain import COMPOSITION_ERRORS, explain_composition
from cmacexp.config.hydra_private import report_parser_errors, skip_mode_lookup, take_over_sweeps
from cmacexp.data.version import __version__
from cmacexp.errors import BadInput, CmacexpError, require
from cmacexp.jit.interrupt import interrupt_held_back
from cmacexp.typing import Status

EXIT_CODES: dict[str, int] = {
    Status.COMPLETED: COMPLETED,
    Status.FAILED: FAILED,
    Status.BAD_INPUT: BAD_INPUT,
    Status.FELL: STOPPED,
    Status.DIVERGED: STOPPED,
}
"""Exit codes by the status of a run, or how a sweep ended."""

MULTIRUN = ("-m", "--multirun")


def main() -> int:
    """Run the command line; its exit code."""
    return run_command(_run_or_sweep)


def _report_usage(parser: argparse.ArgumentParser, message: str) -> NoReturn:
    dashes = re.search(r"unrecognized arguments: --?(\w\S*=\S*)", message)
    report_usage(parser, f"{message}; an override has no dashes: {dashes[1]}" if dashes else message)


def _run_or_sweep() -> int:
    if "--version" in sys.argv[1:]:
        print(f"cmacexp {__version__}")
        return COMPLETED
    if group := find_group(sys.argv[1:]):
        print(format_help(group, sys.argv[1:]))
        return COMPLETED
    sys.argv[1:] = sorted(sys.argv[1:], key=lambda text: text not in MULTIRUN)  # which Hydra reads before overrides
    os.environ["HYDRA_FULL_ERROR"] = "1"  # exceptions reach the lines below, instead of Hydra's own printing
    task = _Task()
    report_parser_errors(_report_usage)
    skip_mode_lookup(sys.argv[1:])
    take_over_sweeps(task.sweep)
    try:
        hydra_main(config_path=str(config_folder()), config_name="config", version_base="1.3")(task)()
    except Exception as error:
        task.error = error
    if task.error is not None:
        raise task.explain(task.error)
    return EXIT_CODES[task.status]


class _Task:
    """What Hydra calls with the composed config of a run, or of a sweep.

    ``called`` says whether all that can be composed is; ``status`` is that of the run, or how the sweep ended:
    ``completed`` where Hydra calls nothing, as for ``--help``; ``error`` is what the run raised.
    """

    def __init__(self) -> None:
        self.called, self.status = False, str(Status.COMPLETED)
        self.error: Exception | None = None

    def __call__(self, composed: DictConfig) -> None:
        self.called, hydra = True, HydraConfig.get()
        folder = Path(hydra.runtime.output_dir)
        try:
            self.status = _run(composed, hydra)
        except Exception as error:  # of which Hydra would print more than a line
            self.error = error
        finally:
            if folder.resolve() != Path.cwd():
                with contextlib.suppress(OSError):
                    folder.rmdir()  # that Hydra made, if the run left nothing in it

    def sweep(self, config: DictConfig, context: HydraContext) -> None:
        """Run a sweep."""
        with interrupt_held_back():  # some libraries cannot be imported partially
            from cmacexp.engine.sweep import Sweep
        sweep = Sweep(config, context)
        self.called = True
        self.status = sweep.run()

    def explain(self, error: Exception) -> Exception:
        """The error that says what is wrong with the command line, if that is the cause of ``error``."""
        if isinstance(error, COMPOSITION_ERRORS) or not (self.called or isinstance(error, CmacexpError | OSError)):
            return CmacexpError(explain_composition(error, sys.argv[1:]))
        if (
            isinstance(error, OSError)
            and error.filename  # else it is the current folder that is gone
            and not (self.called or str(error.filename).endswith(".yaml"))
        ):
            return BadInput(
                "hydra.run.dir", error.filename, f"cannot be made: {error.strerror}; choose another folder"
            )
        return error


def _run(composed: DictConfig, hydra: Any) -> str:
    """Run a config and print what it gave; the status of the run."""
    config = to_config(composed)
    require(
        not config.sweep.resume,
        "sweep.resume",
        True,
        "only a sweep can be resumed: add -m and hydra.sweep.dir=DIR",
    )
    with interrupt_held_back():  # some libraries cannot be imported partially
        from cmacexp.engine.objective import check_metric
        from cmacexp.engine.run import run_scenario
        from cmacexp.engine.without_effect import list_idle_overrides
        from cmacexp.loop.scenario import make_scenario
        from cmacexp.metrics.drift import format_drift
        from cmacexp.terminal.messages import announce_compiling, print_summary, warn_of_models, warn_of_other_mode
        from cmacexp.terminal.output import print_line, show_activity, show_progress

    typed: Any = OmegaConf.to_container(hydra.overrides.hydra, resolve=False)
    warn_of_other_mode(typed, "hydra.sweep", "needs -m; the folder of a run is hydra.run.dir")
    announce_compiling()
    check_metric(config.optimize, config.machine.kind)
    with show_activity(f"planning {config.steps_per_cycle} steps a cycle"):
        scenario = make_scenario(config)
    for text in list_idle_overrides(config, hydra.overrides.task, composed):
        print_line(f"warning: {text}", error=True)
    if scenario.warning:
        print_line(f"warning: {scenario.warning}", error=True)
    warn_of_models([config.machine])
    folder, record = Path(hydra.runtime.output_dir), make_record(composed, hydra) if config.record.trace else None
    with show_progress(config.scenario, config.cycles, "cycles") as watch:
        result = run_scenario(
            config,
            folder,
            watch,
            scenario,
            lambda drift: print_line(f"warning: {format_drift(drift)}", error=True),
            record,
            hydra.overrides.task,
        )
    print_summary(result)
    if result.status == Status.INTERRUPTED:
        raise KeyboardInterrupt
    if result.status == Status.FAILED:
        print(result.manifest["traceback"], file=sys.stderr, end="")
        print_line(f"error: {result.manifest['cause']}", error=True)
    return result.status
