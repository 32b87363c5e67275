"""The whole command, compiled before, against the imports that every run needs."""

import os
import tempfile
from pathlib import Path

from benchmarks.timing import ROOT, Table, compared, in_turn, python, stopwatch

FLOOR = ["-c", "import hydra, numpy, numba, pyarrow.parquet, rerun"]


def tables(quick: bool) -> list[Table]:
    """All of this file."""
    targets = {"one_leg": "1.5"} if quick else {"one_leg": "1.5", "force_step": "", "quadruped": ""}
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)

        def start(*arguments: str) -> None:
            python(*arguments, folder=folder, environment=environment)

        workers = {"floor": stopwatch(lambda: start(*FLOOR))}
        for scenario in targets:
            command = ["-m", "cmacexp", f"scenario={scenario}", f"hydra.run.dir={folder}/{scenario}"]
            workers[scenario] = stopwatch(lambda command=command: start(*command))
        times = in_turn(workers, 5 if quick else 9)
    rows = [
        compared(times, f"`python -m cmacexp scenario={scenario}`", scenario, "floor", "imports alone", target)
        for scenario, target in targets.items()
    ]
    return [Table("Whole command, everything written", rows, f"Imports: `{FLOOR[1]}`.")]
