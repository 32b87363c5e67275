"""One job of a sweep, in whatever process: it prints a line, and leaves on disk how it ended."""

from pathlib import Path
from typing import Any

from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from cmacexp.config import Config, to_config
from cmacexp.data import manifest as manifests
from cmacexp.errors import BadComponent, BadInput, CmacexpError, format_user_traceback
from cmacexp.sweep.start import without_sweep


def _plain(composed: DictConfig) -> dict[str, Any]:
    """A config as far as it can be told, with what cannot be resolved as it was typed."""
    for resolve in (True, False):
        try:
            plain: Any = OmegaConf.to_container(composed, resolve=resolve)
            return dict(plain)
        except OmegaConfBaseException:
            continue
    return {}


def _cause(error: Exception) -> str:
    """Why a job failed, in one line."""
    if isinstance(error, EOFError):
        from cmacexp.jit.compiler import remove_compiled

        return remove_compiled()
    told = str(error) if isinstance(error, CmacexpError | OSError) else f"{type(error).__name__}: {error}"
    return " ".join(told.split())


def _leave_failure(folder: Path, composed: DictConfig, error: Exception, cause: str) -> None:
    """Leave a manifest that says why there is no result, and nothing else; as far as the disk takes it."""
    from cmacexp.experiment import clear

    manifest = manifests.make_manifest(_plain(composed), "failed", cause, bad_input=isinstance(error, BadInput))
    if isinstance(error, BadComponent) or not isinstance(error, CmacexpError | OSError | MemoryError):
        manifest["traceback"] = format_user_traceback(error.raised if isinstance(error, BadComponent) else error)
    try:
        clear(folder)
        manifests.write(folder, manifest)
    except OSError:
        pass  # the run without a manifest counts as broken off, and its cause is said in the terminal


def _run(config: Config, folder: Path, name: str) -> None:
    """Run the job unless it is finished and the sweep resumes; say how it ended."""
    from cmacexp.data.integrity import is_finished
    from cmacexp.experiment import run_scenario
    from cmacexp.loop.scenario import make_scenario
    from cmacexp.report.terminal import announce_compiling, format_outcome, progress, say

    announce_compiling()
    if config.sweep.resume and is_finished(folder, config):
        say(f"{name}: finished before, not run again")
        return
    alone = HydraConfig.get().launcher._target_.endswith(".BasicLauncher")
    with progress(config, shown=alone) as watch:
        result = run_scenario(config, folder, watch, make_scenario(config))
    if result.status == "failed":
        say(f"error: {name}: {result.manifest['cause']}", error=True)
    else:
        say(f"{name}: {format_outcome(result)}")
    if result.status == "interrupted":
        raise KeyboardInterrupt


def run_job(composed: DictConfig) -> float | None:
    """Run one job of a sweep; a failure is left on disk and does not take the sweep down.

    Returns:
        What the sweeper asked for by ``optimize``, as :func:`cmacexp.sweep.objective.read_objective` gives it.
    """
    hydra = HydraConfig.get()
    folder, metric = Path(hydra.runtime.output_dir), composed.get("optimize")
    name = f"#{hydra.job.num} {' '.join(without_sweep(hydra.overrides.task))}"
    from cmacexp.report.run_summary import read_summary
    from cmacexp.report.terminal import say
    from cmacexp.sweep.objective import check_metric, read_objective

    try:
        config = to_config(composed, hydra.runtime.choices)
        check_metric(config.optimize)
        _run(config, folder, name)
    except Exception as error:
        cause = _cause(error)
        _leave_failure(folder, composed, error, cause)
        say(f"error: #{hydra.job.num}: {cause}", error=True)
    return None if metric is None else read_objective(metric, read_summary(folder))
