"""The runs of studies: found by the hash of their config if they are complete, else run, on all cores."""

import hashlib
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from cmacexp.config import Config, config_hash, to_config, to_plain
from cmacexp.config.compose import compose_untyped
from cmacexp.data.folder import RUN_KEY, replacing
from cmacexp.data.integrity import is_finished
from cmacexp.experiment.workers import Each, share_progress
from cmacexp.jit.compiler import expect_runs
from cmacexp.report.terminal import announce_compiling
from cmacexp.study.study import Request

HASH_DIGITS, THIN_DIGITS = 12, 4
Collected = Mapping[Request, tuple[Path, Mapping[str, str]]]
"""Folder of the run of each request, and the option that was chosen in each group."""


def _describe_files(config: Config) -> str:
    """What a run stores, which its config hash leaves out: studies that thin traces differently share no folder."""
    rows = repr((config.record.every_nth_step, config.record.cycles))
    thin = f"-thin-{hashlib.sha256(rows.encode()).hexdigest()[:THIN_DIGITS]}" if config.record.thins else ""
    return thin + ("-weights" if config.record.weights else "")


def _look_up(overrides: Sequence[str], store: Path) -> tuple[Path, Config, Mapping[str, str], bool]:
    """Folder of the run of ``overrides``, its config, its options, and whether it is complete."""
    composed, choices = compose_untyped([*overrides, "record=trace"])
    config = to_config(composed)
    folder = store / f"{config.scenario}-{config_hash(to_plain(config))[:HASH_DIGITS]}{_describe_files(config)}"
    return folder, config, choices, is_finished(folder, config)


def _run(number: int, folder: Path, config: Config, runs: int) -> None:
    """Run one of so many."""
    from cmacexp.experiment.run import run_scenario

    announce_compiling()
    expect_runs(runs)
    with replacing(folder, RUN_KEY, wait=True) as place:
        if not is_finished(folder, config):  # another study may have run it while this one waited
            report = share_progress(number)
            run_scenario(config, place, lambda cycles: report(cycles / config.cycles))


def _collect_ready(each: Each, requests: Sequence[Request], store: Path, before: Collected) -> Collected:
    """Collect requests whose start weights, if any, are those of runs in ``before``."""

    def overrides(request: Request) -> tuple[str, ...]:
        if request.starts_from is None:
            return request.overrides
        return (*request.overrides, f"learning.start_from='{before[request.starts_from][0]}'")

    wanted = sorted({overrides(request) for request in requests})
    looked_up = dict(zip(wanted, each("looking for runs", _look_up, [(o, store) for o in wanted]), strict=True))
    missing = {folder: config for folder, config, _, finished in looked_up.values() if not finished}
    print(f"{len(looked_up)} runs, {len(missing)} of them to be run", file=sys.stderr)
    if missing:
        each("running", _run, [(i, *item, len(missing)) for i, item in enumerate(missing.items())], long=True)
    return {request: (looked_up[overrides(request)][0], looked_up[overrides(request)][2]) for request in requests}


def collect(each: Each, requests: Sequence[Request], store: Path) -> Collected:
    """The runs of requests; equal ones are run once, complete ones not at all.

    Args:
        each: runs work on all cores.
        requests: each of one seed, see :meth:`Request.with_seed`.
        store: folder of all runs.

    Raises:
        CmacexpError: overrides that cannot be run.
    """
    first = [request for request in requests if request.starts_from is None]
    later = [request for request in requests if request.starts_from is not None]
    first = list(dict.fromkeys([*first, *(request.starts_from for request in later if request.starts_from)]))
    collected = dict(_collect_ready(each, first, store, {}))
    if later:
        collected |= _collect_ready(each, later, store, collected)
    return collected
