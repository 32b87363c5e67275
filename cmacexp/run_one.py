"""One run from its config to its folder: roll out, trace, metrics, recording, manifest."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from cmacexp import manifest as manifests
from cmacexp.config import Config, config_hash, to_plain
from cmacexp.errors import BadAnswer, users_traceback
from cmacexp.files import remove_leftovers, sha256
from cmacexp.keep import (
    BODY,
    BODY_METRICS,
    METRICS,
    METRICS_CSV,
    RECORDING,
    TRACE,
    Scores,
    Traces,
    steps_by_cycle,
    write_scores,
    writing,
)
from cmacexp.models.mechanism import LEGS_UNDER_BODY
from cmacexp.rollout import End, Samples, stream
from cmacexp.scenario import Scenario, make_scenario
from cmacexp.sensors.protocol import altered_by
from cmacexp.sources import code_hash
from cmacexp.trace import BODY_COLUMNS, COLUMNS, assemble, assemble_body, with_measured


@dataclass(frozen=True)
class RunResult:
    """What a run gave, and where it is kept."""

    folder: Path
    manifest: manifests.Manifest
    scores: Scores

    @property
    def status(self) -> str:
        """``completed``, ``fell``, ``diverged``, ``failed`` or ``interrupted``."""
        return str(self.manifest["status"])


def clear(folder: Path) -> None:
    """Make room for a run: what an earlier one left under the same names goes, its manifest first."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in (manifests.NAME, TRACE, BODY, METRICS, METRICS_CSV, BODY_METRICS, RECORDING):
        (folder / name).unlink(missing_ok=True)
    remove_leftovers(folder)


def _traces(scenario: Scenario, samples: Samples) -> Traces:
    """The part of the traces that some steps give."""
    plan, config, columns = scenario.setup.plan, scenario.setup.config, samples.columns()
    period, start, altered = config.sampling_period, samples.start, altered_by(scenario.sensors)
    legs = assemble(plan, columns, period, start, with_measured(COLUMNS, altered))
    if scenario.setup.mechanism.kind != LEGS_UNDER_BODY:
        return Traces(legs, None)
    body, shown = samples.body_columns(), with_measured(BODY_COLUMNS, altered)
    return Traces(legs, assemble_body(plan, body, columns["force"], period, config.body_speed, start, shown))


def _roll_out(scenario: Scenario, folder: Path, watch: Callable[[int], None]) -> tuple[End, Scores, list[str]]:
    """Run, and write all that it leaves behind but the manifest; how it ended, its metrics, names of the files."""
    config, walks = scenario.setup.config, scenario.setup.mechanism.kind == LEGS_UNDER_BODY
    altered = altered_by(scenario.sensors)
    with writing(folder, config.record, config.steps_per_cycle, walks, altered) as writer:
        end = stream(scenario, lambda samples: writer.add(_traces(scenario, samples)), watch)
    scores = writer.scores
    names = [TRACE, BODY] if walks else [TRACE]
    names += write_scores(folder, scores)
    if config.record.recording and (kept := steps_by_cycle(folder)):
        from cmacexp.recording import part_of, write_recording

        write_recording(folder, to_plain(config), folder / RECORDING, part=part_of(kept))
        names.append(RECORDING)
    return end, scores, names


def run_scenario(
    config: Config,
    folder: Path,
    watch: Callable[[int], None] = lambda cycle: None,
    prepared: Scenario | None = None,
) -> RunResult:
    """Run a scenario and keep what it gives in ``folder``.

    Args:
        config: a checked config.
        folder: is made if missing; files of an earlier run in it are replaced.
        watch: is called with the cycles done so far, see :func:`cmacexp.rollout.stream`.
        prepared: the scenario of ``config`` if it is already made.

    Returns:
        The result; a run that diverged, failed or was interrupted keeps what it has, and says so in ``status``.

    Raises:
        BadInput: the plan asks for what the machine cannot do; nothing was simulated or written.
        OSError: the folder cannot be written.
    """
    began = time.perf_counter()
    scenario = prepared or make_scenario(config)
    clear(folder)
    end, scores, names = _roll_out(scenario, folder, watch)
    plain = to_plain(config)
    manifest: manifests.Manifest = {
        "status": end.status,
        "cause": end.cause,
        "seed": config.seed,
        "config": plain,
        "config_hash": config_hash(plain),
        "code_hash": code_hash(),
        "versions": manifests.versions(),
        "git_commit": manifests.git_commit(),
        "steps": end.steps,
        "learning_lead": config.lead,
        "memory": [use._asdict() for use in getattr(scenario.feedforward, "memory", [])],
        "rollout_seconds": end.seconds,
        "wall_seconds": time.perf_counter() - began,
        "files": {name: sha256(folder / name) for name in names},
    }
    if end.error is not None and not isinstance(end.error, BadAnswer):
        manifest["traceback"] = users_traceback(end.error)
    manifests.write(folder, manifest)
    return RunResult(folder, manifest, scores)
