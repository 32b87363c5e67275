"""One run from its config to its folder: roll out, trace, metrics, recording, manifest."""

import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from cmacexp import manifest as manifests
from cmacexp.config import Config, config_hash, to_plain
from cmacexp.files import sha256
from cmacexp.keep import (
    BODY,
    BODY_METRICS,
    METRICS,
    METRICS_CSV,
    RECORDING,
    TRACE,
    Scores,
    Traces,
    write_scores,
    write_traces,
)
from cmacexp.models.mechanism import LEGS_UNDER_BODY
from cmacexp.rollout import Rollout, roll_out
from cmacexp.scenario import Scenario, make_scenario
from cmacexp.sources import code_hash
from cmacexp.trace import assemble, assemble_body


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


def _clear(folder: Path) -> None:
    """Make room for a run: what an earlier one left under the same names goes, its manifest first."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in (manifests.NAME, TRACE, BODY, METRICS, METRICS_CSV, BODY_METRICS, RECORDING):
        (folder / name).unlink(missing_ok=True)
    for leftover in folder.glob(".*.part"):
        leftover.unlink(missing_ok=True)


def _traces(config: Config, scenario: Scenario, rollout: Rollout) -> Traces:
    samples = rollout.columns()
    legs = assemble(rollout.plan, samples, config.sampling_period)
    if scenario.setup.mechanism.kind != LEGS_UNDER_BODY:
        return Traces(legs, None)
    body = rollout.body_columns()
    return Traces(
        legs, assemble_body(rollout.plan, body, samples["force"], config.sampling_period, config.body_speed)
    )


def _write_files(config: Config, folder: Path, traces: Traces) -> tuple[Scores, list[str]]:
    """Write all that a rollout leaves behind but the manifest; the metrics and the names of the files."""
    names = write_traces(folder, traces)
    scores, more = write_scores(folder, traces, config.steps_per_cycle)
    names += more
    if config.record.recording and traces.legs.num_rows:
        from cmacexp.recording import write_recording

        write_recording(traces, to_plain(config), folder / RECORDING)
        names.append(RECORDING)
    return scores, names


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
        watch: is called after every cycle with the cycles done so far.
        prepared: the scenario of ``config`` if it is already made.

    Returns:
        The result; a run that diverged, failed or was interrupted keeps what it has, and says so in ``status``.

    Raises:
        BadInput: the plan asks for what the machine cannot do; nothing was simulated or written.
        OSError: the folder cannot be written.
    """
    began = time.perf_counter()
    scenario = prepared or make_scenario(config)
    _clear(folder)
    rollout = roll_out(scenario, watch)
    scores, names = _write_files(config, folder, _traces(config, scenario, rollout))
    plain = to_plain(config)
    manifest: manifests.Manifest = {
        "status": rollout.status,
        "cause": rollout.cause,
        "seed": config.seed,
        "config": plain,
        "config_hash": config_hash(plain),
        "code_hash": code_hash(),
        "versions": manifests.versions(),
        "git_commit": manifests.git_commit(),
        "steps": len(rollout.samples),
        "memory": [use._asdict() for use in getattr(scenario.feedforward, "memory", [])],
        "rollout_seconds": rollout.seconds,
        "wall_seconds": time.perf_counter() - began,
        "files": {name: sha256(folder / name) for name in names},
    }
    if rollout.error is not None:
        manifest["traceback"] = "".join(traceback.format_exception(rollout.error))
    manifests.write(folder, manifest)
    return RunResult(folder, manifest, scores)
