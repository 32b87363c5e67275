"""A sweep of 64 runs of one leg, by each launcher, against the same sweep of an empty Hydra app."""

import importlib.util
import tempfile
from collections.abc import Callable
from pathlib import Path

from benchmarks.timing import Table, compared, in_turn, python, stopwatch

EMPTY = """
import hydra
@hydra.main(version_base="1.3", config_path=None)
def main(config): pass
main()
"""
CORES = 2


def tables(quick: bool) -> list[Table]:
    """All of this file."""
    runs = 8 if quick else 64
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "empty.py").write_text(EMPTY)

        def sweep(kind: str, *command: str) -> Callable[[], float]:
            arguments = [*command, f"hydra.sweep.dir={folder}/{kind}"]
            return stopwatch(lambda: python(*arguments, folder=folder))

        ours = ["-m", "cmacexp", "-m", f"seed=range({runs})", "record=trace"]
        workers = {
            "empty": sweep("empty", "empty.py", "-m", f"+seed=range({runs})"),
            "cores": sweep("cores", *ours),
            "basic": sweep("basic", *ours, "hydra/launcher=basic"),
        }
        if importlib.util.find_spec("hydra_plugins.hydra_joblib_launcher"):
            workers["joblib"] = sweep("joblib", *ours, "hydra/launcher=joblib", f"hydra.launcher.n_jobs={CORES}")
        times = in_turn(workers, 1 if quick else 2)
    what = f"{runs} runs, `basic`"
    rows = [
        compared(times, f"{runs} runs as typed, `cores`", "cores", "empty", "empty Hydra app", "0.35"),
        compared(times, what, "basic", "empty", "empty Hydra app", "1.6"),
    ]
    if "joblib" in times:
        rows.append(compared(times, f"{runs} runs, `joblib` on {CORES} cores", "joblib", "cores", "`cores`"))
    return [Table("Sweep, `record=trace`", rows)]
