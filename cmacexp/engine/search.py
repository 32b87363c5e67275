"""A search by Optuna, which proposes trials; a sweep runs them as jobs with their numbers and reports the metric."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, IntervalSweep, Override, RangeSweep
from omegaconf import OmegaConf

from cmacexp.data.files import write_atomically
from cmacexp.data.folder import SEARCH
from cmacexp.errors import BadInput, format_install_command

if TYPE_CHECKING:
    from cmacexp.engine.sweep import Sweep

SAMPLERS = {
    "tpe": "TPESampler",
    "random": "RandomSampler",
    "gp": "GPSampler",
    "cmaes": "CmaEsSampler",
    "qmc": "QMCSampler",
}


def _make_distribution(override: Override) -> Any:
    """Make Optuna's distribution of a key that is typed as an interval, a range or a list of values."""
    from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

    swept = override.value()
    if isinstance(swept, IntervalSweep):
        kind: Any = (
            IntDistribution if isinstance(swept.start, int) and isinstance(swept.end, int) else FloatDistribution
        )
        return kind(swept.start, swept.end, log="log" in swept.tags)
    if isinstance(swept, ChoiceSweep | RangeSweep):
        return CategoricalDistribution([*override.sweep_string_iterator()])
    key, _, value = str(override.input_line).partition("=")
    raise BadInput(key, value, "a search takes interval(low,high), range(first,end) or a list: 8,16")


def _open_study(sweep: "Sweep", options: Mapping[str, Any]) -> Any:
    """Make a study, or load it from the storage to resume it; raises BadInput if the storage does not fit."""
    try:
        import optuna
    except ImportError:
        raise BadInput("hydra/sweeper", "optuna", f"needs Optuna: {format_install_command('optuna')}") from None
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    sampler, storage, name = options["sampler"], options["storage"], options["study_name"] or str(sweep.folder)
    direction: Any = sweep.direction
    try:
        return optuna.create_study(
            storage=storage,
            sampler=vars(optuna.samplers)[SAMPLERS[sampler["name"]]](seed=sampler["seed"]),
            study_name=name,
            direction=direction,
            load_if_exists=bool(sweep.config.sweep.resume),
        )
    except optuna.exceptions.DuplicatedStudyError:
        reason = f"has a study {name}; add sweep.resume=true, or choose another hydra.sweeper.study_name"
        raise BadInput("hydra.sweeper.storage", storage, reason) from None
    except ImportError as error:
        reason = f"{str(error).splitlines()[0]}; install it, or choose another"
        raise BadInput("hydra/sweeper/sampler", sampler["name"], reason) from None
    except Exception as error:  # of a database
        raise BadInput("hydra.sweeper.storage", storage, f"cannot be used: {str(error).splitlines()[0]}") from None


def search(sweep: "Sweep", arguments: Sequence[str], options: Mapping[str, Any]) -> None:
    """Run the jobs of a search, with the options of ``hydra.sweeper``; the number of a job is that of its trial.

    A search that is resumed from a storage runs only what has no result: trials that were under way when it was
    killed, and those that are still to be asked for.
    """
    texts = [*(f"{key}={value}" for key, value in options["params"].items()), *arguments]
    typed = OverridesParser.create(config_loader=sweep.context.config_loader).parse_overrides(texts)
    fixed = [str(override.input_line) for override in typed if not override.is_sweep_override()]
    swept = [override for override in typed if override.is_sweep_override()]
    study = _open_study(sweep, options)
    space = {override.get_key_element(): _make_distribution(override) for override in swept}
    earlier = study.trials
    finished = {trial.number for trial in earlier if trial.state.is_finished()}

    def run(trials: Sequence[Any], first: int) -> None:
        jobs = [[*fixed, *(f"{key}={value}" for key, value in trial.params.items())] for trial in trials]
        for trial, job in zip(trials, sweep.launch(jobs, first), strict=True):
            if trial.number not in finished:
                study.tell(trial.number, job.return_value, skip_if_finished=True)

    if earlier:
        run(earlier, 0)
    for first in range(len(earlier), options["n_trials"], options["n_jobs"]):
        run([study.ask(space) for _ in range(min(options["n_jobs"], options["n_trials"] - first))], first)
    best = {"name": "optuna", "best_params": study.best_params, "best_value": study.best_value}
    with write_atomically(sweep.folder / SEARCH) as path:
        OmegaConf.save(OmegaConf.create(best), path)
