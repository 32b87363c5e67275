"""``python -m cmacexp``: compose a config with Hydra, run it, and print the outcome."""

import argparse
import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra import initialize_config_dir
from hydra import main as hydra_main
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.utils import configure_log, run_job
from hydra.errors import ConfigCompositionException
from hydra.experimental.callback import Callback
from hydra.types import HydraContext, RunMode
from omegaconf import DictConfig, OmegaConf

from cmacexp.commands.command import BAD_INPUT, COMPLETED, FAILED, STOPPED, run_command
from cmacexp.commands.group_help import find_group, format_help
from cmacexp.config import Config, config_folder, to_config
from cmacexp.config.compose import make_record, split_overrides
from cmacexp.config.explain import COMPOSITION_ERRORS, explain_composition
from cmacexp.data.version import __version__
from cmacexp.errors import BadInput, CmacexpError, require
from cmacexp.jit.interrupt import interrupt_held_back
from cmacexp.typing import Status

if TYPE_CHECKING:
    from cmacexp.data.records import Drift
    from cmacexp.data.run import Run
    from cmacexp.loop.scenario import Scenario

EXIT_CODES: dict[str, int] = {
    Status.COMPLETED: COMPLETED,
    Status.FAILED: FAILED,
    Status.BAD_INPUT: BAD_INPUT,
    Status.FELL: STOPPED,
    Status.DIVERGED: STOPPED,
}
"""Exit codes by the status of a run or a sweep."""

OPTIONS = (
    *("-h", "--help", "--hydra-help", "--version", "-c", "--cfg", "--resolve", "-p", "--package", "-i", "--info"),
    *("-r", "--run", "-m", "--multirun", "-sc", "--shell-completion", "--experimental-rerun"),
    *("-cp", "--config-path", "-cn", "--config-name", "-cd", "--config-dir"),
)
"""Options of Hydra's command line; any other is refused here in one line, by Hydra in nine."""


def main() -> int:
    """Run the command line and return the exit code."""
    return run_command(run_or_sweep)


def run_or_sweep() -> int:
    """Execute the run or the sweep of the command line, or answer a question for help; return the exit code."""
    words = sys.argv[1:]
    if text := _answer(words):
        print(text)
        return COMPLETED
    os.environ["HYDRA_FULL_ERROR"] = "1"  # exceptions reach the lines below; else Hydra prints them
    task = _Task()
    options, overrides = _parse(words)
    mode = RunMode.MULTIRUN if options.multirun else RunMode.RUN
    try:
        composes = not any(text.startswith(("-", "hydra.mode")) for text in overrides)
        if composes:  # Hydra itself would compose a run, and each job of a sweep, twice
            with _compose(options, [*overrides, f"hydra.mode={mode.name}"], mode) as (config, context):
                composes = mode is RunMode.MULTIRUN or not config.hydra.callbacks
                if composes and mode is RunMode.MULTIRUN:
                    task.sweep(config, context)
                elif composes:
                    run_job(task, config, "hydra.run.dir", None, context)
        if not composes:  # Hydra does the rest: options such as --cfg, and callbacks
            hydra_main(config_path=str(config_folder()), config_name="config", version_base="1.3")(task)()
    except Exception as error:
        task.error = error
    if task.error is not None:
        raise task.explain(task.error)
    return EXIT_CODES[task.status]


def _answer(words: list[str]) -> str:
    """Answer ``--version`` and ``GROUP=help``, else return an empty text; raises CmacexpError for a bad option."""
    if "--version" in words:
        return f"cmacexp {__version__}"
    if group := find_group(words):
        return format_help(group, words)
    for text in words:
        if text.startswith("-") and text.partition("=")[0] not in OPTIONS:
            advice = f"an override has no dashes: {text.lstrip('-')}; " if "=" in text else ""
            usage = "python -m cmacexp --help shows how it is used"
            raise CmacexpError(f"unrecognized arguments: {text}; {advice}{usage}")
    return ""


def _parse(words: list[str]) -> tuple[argparse.Namespace, list[str]]:
    """Parse the options of a run or a sweep; return them, and the other words: overrides and options of Hydra."""
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("-m", "--multirun", action="store_true")
    parser.add_argument("-cp", "--config-path", default=config_folder())
    parser.add_argument("-cn", "--config-name", default="config")
    parser.add_argument("-cd", "--config-dir")
    return parser.parse_known_args(words)


@contextlib.contextmanager
def _compose(
    options: argparse.Namespace, overrides: list[str], mode: RunMode
) -> Iterator[tuple[DictConfig, HydraContext]]:
    """Compose the config of a run or of a sweep; yield it with the context for its jobs."""
    if options.config_dir:
        require(Path(options.config_dir).is_dir(), "--config-dir", options.config_dir, "is no folder")
        overrides.append(f"hydra.searchpath=[file://{Path(options.config_dir).resolve()}]")
    with initialize_config_dir(str(Path(options.config_path).resolve()), "main", version_base="1.3"):
        loader = GlobalHydra.instance().config_loader()
        try:
            config = loader.load_configuration(options.config_name, overrides, mode)
        except ConfigCompositionException:
            if mode is RunMode.RUN:
                raise
            # Hydra sets values in the default option of a swept group, which may lack them; jobs check them.
            values = [text for text in split_overrides(overrides)[1] if not text.startswith(("+", "hydra"))]
            texts = {f"++{text}" if text in values else text: text for text in overrides}
            config = loader.load_configuration(options.config_name, [*texts], mode)
            config.hydra.overrides.task = [texts[text] for text in config.hydra.overrides.task]
        configure_log(config.hydra.hydra_logging, config.hydra.verbose)
        yield config, HydraContext(loader, Callback())  # type: ignore[arg-type]


class _Task:
    """The task that Hydra calls with the composed config of a run or a sweep.

    ``called`` is True once the config is composed; ``status`` is that of the run or the sweep, ``completed`` where
    Hydra does not call the task, as for ``--help``; ``error`` is the exception of the run.
    """

    def __init__(self) -> None:
        self.called = False
        self.status = str(Status.COMPLETED)
        self.error: Exception | None = None

    def __call__(self, composed: DictConfig) -> None:
        self.called = True
        hydra: Any = HydraConfig.get()
        folder = Path(hydra.runtime.output_dir)
        try:
            config, scenario = _prepare(composed, hydra)
            from cmacexp.engine.run import run_scenario
            from cmacexp.terminal.output import show_progress

            record = make_record(composed, hydra) if config.record.trace else None
            with show_progress(config.scenario, config.cycles, "cycles") as watch:
                run = run_scenario(config, folder, watch, scenario, _warn_of_drift, record, hydra.overrides.task)
            self.status = _report(run)
        except Exception as error:  # Hydra would print it in many lines
            self.error = error
        finally:
            if folder.resolve() != Path.cwd():
                with contextlib.suppress(OSError):
                    folder.rmdir()  # which Hydra made, if the run left it empty

    def sweep(self, config: DictConfig, context: HydraContext) -> None:
        """Execute a sweep."""
        with interrupt_held_back():  # some libraries cannot be imported partially
            from cmacexp.engine.sweep import Sweep
        sweep = Sweep(config, context)
        self.called = True
        self.status = sweep.run()

    def explain(self, error: Exception) -> Exception:
        """Return an error that explains the mistake in the command line; ``error`` itself if it has another cause."""
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


def _prepare(composed: DictConfig, hydra: Any) -> tuple[Config, "Scenario"]:
    """Check a config and plan its run; print warnings of idle overrides, a small delay margin and other models."""
    config = to_config(composed)
    resumes = "only a sweep can be resumed: add -m and hydra.sweep.dir=DIR"
    require(not config.sweep.resume, "sweep.resume", True, resumes)
    with interrupt_held_back():  # some libraries cannot be imported partially
        from cmacexp.engine.objective import check_metric
        from cmacexp.engine.without_effect import list_idle_overrides
        from cmacexp.loop.scenario import make_scenario
        from cmacexp.terminal.messages import announce_compiling, warn_of_models, warn_of_other_mode
        from cmacexp.terminal.output import print_line, show_activity

    options: Any = OmegaConf.to_container(hydra.overrides.hydra, resolve=False)
    warn_of_other_mode(options, "hydra.sweep", "needs -m; the folder of a run is hydra.run.dir")
    announce_compiling()
    check_metric(config.optimize, config.machine.kind)
    with show_activity(f"planning {config.steps_per_cycle} steps a cycle"):
        scenario = make_scenario(config)
    for text in [*list_idle_overrides(config, hydra.overrides.task, composed), *scenario.warnings]:
        print_line(f"warning: {text}", error=True)
    warn_of_models([config.machine])
    return config, scenario


def _warn_of_drift(drift: "Drift") -> None:
    from cmacexp.metrics.drift import format_drift
    from cmacexp.terminal.output import print_line

    print_line(f"warning: {format_drift(drift)}", error=True)


def _report(run: "Run") -> str:
    """Print the results of a run and return its status; raises KeyboardInterrupt if the run was interrupted."""
    from cmacexp.terminal.messages import print_summary
    from cmacexp.terminal.output import print_line

    print_summary(run)
    if run.status == Status.INTERRUPTED:
        raise KeyboardInterrupt
    if run.status == Status.FAILED:
        print(run.manifest["traceback"], file=sys.stderr, end="")
        print_line(f"error: {run.manifest['cause']}", error=True)
    return run.status
