"""Time of the whole ``cmacexp`` command, with kernels compiled before, against the imports that every run needs."""

import tempfile
from pathlib import Path

from benchmarks.timing import Table, compared, in_turn, processor_time, python, stopwatch

FLOOR = ["-c", "import hydra, numpy, numba, pyarrow.parquet, rerun"]


def tables(quick: bool) -> list[Table]:
    """Run the benchmarks of this file and return their table."""
    targets = {"one_leg": "1.5"} if quick else {"one_leg": "1.5", "force_step": "", "quadruped": ""}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)

        def start(*arguments: str) -> None:
            python(*arguments, folder=folder)

        start("-m", "cmacexp.warm", "one_leg")
        workers = {"floor": stopwatch(lambda: start(*FLOOR))}
        for scenario in targets:
            command = ["-m", "cmacexp", f"scenario={scenario}", f"hydra.run.dir={folder}/{scenario}"]
            workers[scenario] = stopwatch(lambda command=command: start(*command))
        times = in_turn(workers, 5 if quick else 9)
        report = ["-m", "cmacexp.report", f"{folder}/one_leg", f"--out={folder}/report"]
        single = ["-m", "cmacexp", "scenario=one_leg", f"hydra.run.dir={folder}/again"]
        pair = {"report": processor_time(lambda: start(*report)), "run": processor_time(lambda: start(*single))}
        used = in_turn(pair, 2 if quick else 7)
    rows = [
        compared(times, f"`python -m cmacexp scenario={scenario}`", scenario, "floor", "imports only", target)
        for scenario, target in targets.items()
    ]
    report_name = "`python -m cmacexp.report` of that run, processor time"
    rows.append(compared(used, report_name, "report", "run", "the run itself", "1.2"))
    return [Table("Whole command, everything written", rows, f"Imports: `{FLOOR[1]}`.")]
