"""Many runs: processor time a job, against a job of an empty Hydra app; and what a million of them take."""

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks.sweep import EMPTY
from benchmarks.timing import Row, Table, format_time, processor_time, python, stopwatch

CHUNK = 50
LOAD = "import sys; from cmacexp import load_sweep; load_sweep(sys.argv[1])"
BATCH = "import sys; from cmacexp import run_many; run_many([[f'seed={i}'] for i in range(int(sys.argv[1]))])"
MILLION = 10**6


def tables(quick: bool) -> list[Table]:
    """All of this file."""
    runs, many = (8, 16) if quick else (1_000, 10_000)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "empty.py").write_text(EMPTY)

        def start(*arguments: str) -> Callable[[], None]:
            return lambda: python(*arguments, folder=folder)

        def sweep(kind: str, count: int, *overrides: str) -> Callable[[], None]:
            swept = [f"seed=range({count})", f"hydra.sweep.dir={kind}", *overrides]
            return start("-m", "cmacexp", "-m", *swept)

        empty = start("empty.py", "-m", f"+seed=range({runs})", "hydra.sweep.dir=empty")
        base = processor_time(empty)() / runs
        chunked = ["record=metrics", f"sweep.chunk={CHUNK}", "hydra/launcher=submitit_local"]
        commands: list[tuple[str, Callable[[], None], str]] = [
            (f"{runs} runs, `record=trace`", sweep("trace", runs), "0.2"),
            (f"{runs} runs, `record=metrics`", sweep("metrics", runs, "record=metrics"), "0.1"),
            (f"{runs} runs, `run_many`", start("-c", BATCH, str(runs)), ""),
            (f"{runs} runs, `submitit_local`, `sweep.chunk={CHUNK}`", sweep("chunks", runs, *chunked), "0.1 s a job"),
        ]
        against = f"empty Hydra app: {format_time(base)}"
        rows, used = [], []
        for what, command, target in commands:
            used.append(processor_time(command)() / runs)
            rows.append(Row(what, format_time(used[-1]), against, used[-1] / base, target))
        all_of_it = stopwatch(sweep("many", many, "record=metrics"))()
        loading = stopwatch(start("-c", LOAD, "metrics"))()
        importing = stopwatch(start("-c", "import cmacexp, pandas"))()
        rows.append(_elapsed(f"{many} runs, `record=metrics`, elapsed", all_of_it, "2 min for 10,000"))
        rows.append(_elapsed(f"`load_sweep` of {runs} runs, elapsed", loading - importing, "2 s for 1,000"))
        size, files = zip(*(_measure(folder / kind, runs) for kind in ("trace", "metrics")), strict=True)
    return [Table("Many runs of one leg, processor time a job", rows), _extrapolate(used, size, files, runs)]


def _elapsed(what: str, seconds: float, target: str) -> Row:
    return Row(what, format_time(seconds), "", None, target)


def _measure(folder: Path, runs: int) -> tuple[float, float]:
    """Bytes of a run on disk, and its files and folders; those of all runs are shared out."""
    paths = list(folder.rglob("*"))
    return sum(path.stat().st_size for path in paths if path.is_file()) / runs, len(paths) / runs


def _extrapolate(used: Sequence[float], size: Sequence[float], files: Sequence[float], runs: int) -> Table:
    """What a million runs take if each takes what one of so many took."""
    rows = []
    for what, seconds, bytes_a_run, count in zip(("trace", "metrics"), used, size, files, strict=False):
        hours, amount = MILLION * seconds / 3600, f"{MILLION * bytes_a_run / 1e9:.3g} GB"
        rows.append(
            Row(f"`record={what}`", f"{hours:.3g} h", f"{amount}, {MILLION * count:.2g} files and folders", None, "")
        )
    return Table(f"A million runs of one leg: processor time and disk, from {runs}", rows)
