"""Runs of studies: complete ones are found by the hash of their config, missing ones are executed."""

import hashlib
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from cmacexp.addons.study.study import Request
from cmacexp.config import Config, config_hash, to_config, to_plain
from cmacexp.config.compose import compose_untyped
from cmacexp.data.integrity import is_finished
from cmacexp.engine.job import ensure_run, write_failure
from cmacexp.engine.launcher import Launcher
from cmacexp.errors import BadInput, CmacexpError
from cmacexp.terminal.messages import warn_of_models
from cmacexp.typing import Status

HASH_DIGITS = 12
THIN_DIGITS = 4
Collected = Mapping[Request, tuple[Path, Mapping[str, str]]]
"""Folder of the run of each request, and its chosen option by config group."""


def _look_up(overrides: Sequence[str], store: Path) -> tuple[Path, Config | str, Mapping[str, str], bool]:
    """Look up the run of ``overrides`` below ``store``.

    Returns its folder, its config or the reason why the config is refused, its option by config group, and true if
    the run is complete.
    """
    composed, choices = compose_untyped([*overrides, "record=trace"])
    try:
        config = to_config(composed)
    except BadInput as error:
        folder = store / f"refused-{hashlib.sha256(repr(overrides).encode()).hexdigest()[:HASH_DIGITS]}"
        write_failure(folder, composed, error)
        return folder, str(error), choices, False
    name = f"{config.scenario}-{config_hash(to_plain(config))[:HASH_DIGITS]}"
    record = config.record
    if record.thins:  # the hash leaves out what a run stores: studies that differ in it share no folder
        rows = repr((record.every_nth_step, record.cycles))
        name += f"-thin-{hashlib.sha256(rows.encode()).hexdigest()[:THIN_DIGITS]}"
    folder = store / (f"{name}-weights" if record.weights else name)
    return folder, config, choices, is_finished(folder, config)


def _run(folder: Path, config: Config, runs: int) -> str | None:
    """Execute one of ``runs`` runs, unless another study has finished it; returns the cause of a failure."""
    try:
        run, _ = ensure_run(config, folder, runs)
    except BadInput as error:
        run = write_failure(folder, to_plain(config), error)
    return run.manifest["cause"] if run.status == Status.FAILED else None


class Workers(NamedTuple):
    """Launchers of a study: ``here`` looks up and measures runs, ``long`` executes missing runs."""

    here: Launcher
    long: Launcher


def _collect_ready(workers: Workers, requests: Sequence[Request], store: Path, before: Collected) -> Collected:
    """Return the runs of requests; execute missing ones.

    A request may start from the weights of another request, whose run must be in ``before``.
    """

    def overrides(request: Request) -> tuple[str, ...]:
        if request.starts_from is None:
            return request.overrides
        return (*request.overrides, f"learning.start_from='{before[request.starts_from][0]}'")

    wanted = sorted({overrides(request) for request in requests})
    items = [(overrides, store) for overrides in wanted]
    looked_up = dict(zip(wanted, workers.here.map_in_order("looking for runs", _look_up, items), strict=True))
    failed = [reason for _, reason, *_ in looked_up.values() if isinstance(reason, str)]
    missing = {
        folder: config for folder, config, _, done in looked_up.values() if not (isinstance(config, str) or done)
    }
    print(f"{len(looked_up)} runs, {len(missing)} of them to be run", file=sys.stderr)
    warn_of_models(config.machine for _, config, _, _ in looked_up.values() if isinstance(config, Config))
    if missing:
        ran = workers.long.map_in_order("running", _run, [(*item, len(missing)) for item in missing.items()])
        failed += [cause for cause in ran if cause is not None]
    if failed and len(failed) == len(looked_up):
        raise CmacexpError(failed[0])
    for cause, count in Counter(failed).items():
        print(f"error: {count} of {len(looked_up)} runs failed: {cause}", file=sys.stderr)
    return {request: (looked_up[overrides(request)][0], looked_up[overrides(request)][2]) for request in requests}


def ensure_runs(workers: Workers, requests: Sequence[Request], store: Path) -> Collected:
    """Return the runs of requests with one seed each, stored below ``store``; execute each missing run once.

    Raises:
        CmacexpError: Hydra cannot compose the overrides, or every run failed.
    """
    first = list(dict.fromkeys(request.starts_from or request for request in requests))
    later = [request for request in requests if request.starts_from is not None]
    collected = dict(_collect_ready(workers, first, store, {}))
    if later:
        collected |= _collect_ready(workers, later, store, collected)
    return collected
