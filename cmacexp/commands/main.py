"""``python -m cmacexp``: compose a config with Hydra, run it, report how it ended."""

import contextlib
import os
import sys
from pathlib import Path

from hydra import main as hydra_main
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig

from cmacexp.commands.command import report_usage
from cmacexp.config import config_folder, to_config
from cmacexp.config.explain import COMPOSITION_ERRORS, explain_composition
from cmacexp.config.hydra_private import report_parser_errors, skip_mode_lookup
from cmacexp.config.hydra_record import make_record
from cmacexp.errors import BadComponent, BadInput, CmacexpError, format_user_traceback, in_one_line
from cmacexp.experiment.sweep_start import SweepRefused, SweepStart
from cmacexp.jit.interrupt import end_command, heed_interrupts, interrupt_as_such, interrupt_held_back
from cmacexp.report.outputs import keep_outputs

EXIT_CODES = {"completed": 0, "failed": 1, "bad input": 2, "fell": 3, "diverged": 3, "interrupted": 130}
OUTCOMES = (
    ((BadInput, *COMPOSITION_ERRORS), "bad input"),  # before OSError, which some of them are
    ((CmacexpError, OSError, MemoryError), "failed"),
)
"""Outcomes of errors that need no stack trace; any other error fails a sweep, or ends a run with its stack trace."""


def main() -> int:
    """Run the command line.

    Returns:
        The exit code: 0 completed, 1 failed, 2 bad input and nothing simulated, 3 diverged or fell, 130 interrupted.
    """
    keep_outputs()
    report_parser_errors(report_usage)
    os.environ["HYDRA_FULL_ERROR"] = "1"  # exceptions reach the lines below, instead of Hydra's own printing
    skip_mode_lookup(sys.argv[1:])
    task = _Task()
    try:
        try:
            heed_interrupts()
            with interrupt_as_such():
                hydra_main(config_path=str(config_folder()), config_name="config", version_base="1.3")(task)()
        except KeyboardInterrupt:
            task.outcome = "interrupted"
        if SweepStart.sweep is not None:
            from cmacexp.experiment.sweep_end import finish_sweep

            ended = finish_sweep(SweepStart.sweep)
            task.outcome = ended if task.outcome == "completed" else task.outcome
    except KeyboardInterrupt:
        task.outcome = "interrupted"
    except SweepRefused as refused:
        task.outcome = _report_failure(refused.reason)
    except Exception as error:
        task.outcome = _report_failure(error, composing=not task.called)
    finally:
        if SweepStart.sweep is not None:
            SweepStart.sweep.unlock()
    end_command()
    if task.outcome == "interrupted":
        print("interrupted", file=sys.stderr)
    return EXIT_CODES[task.outcome]


class _Task:
    """What Hydra calls with the composed config of a run, or of each job of a sweep.

    Attributes:
        outcome: how the run ended; where Hydra calls nothing, as for ``--help``, ``completed``.
        called: whether Hydra has composed a config.
    """

    def __init__(self) -> None:
        self.outcome = "completed"
        self.called = False

    def __call__(self, composed: DictConfig) -> float | None:
        self.called = True
        hydra = HydraConfig.get()
        if hydra.mode == RunMode.MULTIRUN:
            from cmacexp.experiment.sweep_job import run_job

            return run_job(composed)
        folder = Path(hydra.runtime.output_dir)
        try:
            with interrupt_as_such():
                self._run(composed, folder)
        except KeyboardInterrupt:
            _remove_empty(folder)
            raise
        except Exception as error:
            _remove_empty(folder)
            self.outcome = _report_failure(error)
        if self.outcome == "interrupted":
            raise KeyboardInterrupt
        return None

    def _run(self, composed: DictConfig, folder: Path) -> None:
        """Run a config and print what it gave."""
        config = to_config(composed, HydraConfig.get().runtime.choices)
        if config.sweep.resume:
            raise BadInput("sweep.resume", True, "only a sweep can be resumed: add -m and hydra.sweep.dir=DIR")
        with interrupt_held_back():  # some libraries cannot be imported by halves
            from cmacexp.experiment.objective import check_metric
            from cmacexp.experiment.run import run_scenario
            from cmacexp.experiment.without_effect import warnings_of
            from cmacexp.loop.scenario import make_scenario
            from cmacexp.report.terminal import (
                activity,
                announce_compiling,
                describe_planning,
                print_summary,
                progress,
                say,
                warn_of_drift,
            )
            from cmacexp.stability.warn import growth_warning

        announce_compiling()
        check_metric(config.optimize, config.machine.kind)
        with activity(describe_planning(config)):
            scenario = make_scenario(config)
        for text in warnings_of(config, HydraConfig.get().overrides.task, composed):
            say(f"warning: {text}", error=True)
        if (warning := growth_warning(config, scenario)) is not None:
            say(warning, error=True)
        with progress(config.scenario, config.cycles, "cycles") as watch:
            result = run_scenario(config, folder, watch, scenario, warn_of_drift, make_record(composed))
        self.outcome = result.status
        print_summary(result)
        if result.status == "failed":
            print(result.manifest.get("traceback", ""), file=sys.stderr, end="")
            say(f"error: {result.manifest['cause']}", error=True)


def _remove_empty(folder: Path) -> None:
    """Remove the folder that Hydra made for a run, if the run left nothing in it."""
    if folder.resolve() != Path.cwd():
        with contextlib.suppress(OSError):
            folder.rmdir()


def _report_failure(error: Exception, composing: bool = False) -> str:
    """Print why a command ended early, and the table of the jobs that its sweep has done; the outcome.

    Args:
        error: what ended it.
        composing: whether Hydra raised it before there was a config: then the command line is the cause.

    Raises:
        Exception: ``error``, if it is an unexpected one outside a sweep.
    """
    outcome = next((outcome for kinds, outcome in OUTCOMES if isinstance(error, kinds)), None)
    if outcome is None and SweepStart.sweep is None:
        if not composing:
            raise error
        outcome = "bad input"
    message = in_one_line(_describe(error, outcome == "bad input"))
    if outcome == "bad input" or SweepStart.sweep is None:
        print(f"error: {message}", file=sys.stderr)
        return outcome or "failed"
    from cmacexp.experiment.sweep_end import finish_sweep

    print(f"error: the sweep broke off: {message}", file=sys.stderr)
    with contextlib.suppress(OSError):
        finish_sweep(SweepStart.sweep)
    return "failed"


def _describe(error: Exception, composing: bool) -> str:
    """The message of an error; what a custom component raised is printed with its stack trace before."""
    if isinstance(error, BadComponent):
        print(format_user_traceback(error.raised), file=sys.stderr, end="")
    if composing and not isinstance(error, CmacexpError):
        return explain_composition(error, sys.argv[1:])
    return str(error).strip() or type(error).__name__
