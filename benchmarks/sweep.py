"""Many runs against an empty Hydra app: a sweep by each launcher, processor time per job, and a million runs."""

import importlib.util
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks.timing import Row, Table, compared, format_time, in_turn, processor_time, python, stopwatch

EMPTY = """
import hydra
@hydra.main(version_base="1.3", config_path=None)
def main(config): pass
main()
"""
CORES = 2
CHUNK = 50
LOAD = "import sys; from cmacexp import load_sweep; load_sweep(sys.argv[1])"
BATCH = "import sys; from cmacexp import run_many; run_many([[f'seed={i}'] for i in range(int(sys.argv[1]))])"
MILLION = 10**6


Start = Callable[..., Callable[[], None]]
"""Function that returns a worker, which runs Python with the given arguments."""


def tables(quick: bool) -> list[Table]:
    """Run the benchmarks of this file and return their tables."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "empty.py").write_text(EMPTY)

        def start(*arguments: str) -> Callable[[], None]:
            return lambda: python(*arguments, folder=folder)

        return [_compare_launchers(start, 8 if quick else 64, 1 if quick else 2), *_count(start, folder, quick)]


def _sweep(start: Start, kind: str, count: int, *overrides: str) -> Callable[[], None]:
    return start("-m", "cmacexp", "-m", f"seed=range({count})", f"hydra.sweep.dir={kind}", *overrides)


def _start_empty(start: Start, count: int) -> Callable[[], None]:
    """Return a worker that runs the same sweep of an app that does nothing."""
    return start("empty.py", "-m", f"+seed=range({count})", "hydra.sweep.dir=empty")


def _compare_launchers(start: Start, runs: int, rounds: int) -> Table:
    """Compare the elapsed time of a sweep by each launcher."""
    launchers = {"cores": [], "basic": ["hydra/launcher=basic"]}
    if importlib.util.find_spec("distributed"):
        launchers["dask"] = ["hydra/launcher=dask", f"hydra.launcher.processes={CORES}"]
    commands = {kind: _sweep(start, kind, runs, "record=trace", *chosen) for kind, chosen in launchers.items()}
    commands["empty"] = _start_empty(start, runs)
    times = in_turn({kind: stopwatch(command) for kind, command in commands.items()}, rounds)
    rows = [
        compared(times, f"{runs} runs as typed, `cores`", "cores", "empty", "empty Hydra app", "0.35"),
        compared(times, f"{runs} runs, `basic`", "basic", "empty", "empty Hydra app", "1.6"),
    ]
    if "dask" in times:
        rows.append(compared(times, f"{runs} runs, `dask` on {CORES} cores", "dask", "cores", "`cores`"))
    return Table("Sweep, `record=trace`", rows)


def _count(start: Start, folder: Path, quick: bool) -> list[Table]:
    """Return tables of the processor time per job and of the extrapolation to a million runs."""
    runs, many = (8, 16) if quick else (1_000, 10_000)
    base = processor_time(_start_empty(start, runs))() / runs
    chunked = ["record=metrics", f"sweep.chunk={CHUNK}", "hydra/launcher=submitit_local"]
    commands: list[tuple[str, Callable[[], None], str]] = [
        (f"{runs} runs, `record=trace`", _sweep(start, "trace", runs), "0.2"),
        (f"{runs} runs, `record=metrics`", _sweep(start, "metrics", runs, "record=metrics"), "0.1"),
        (f"{runs} runs, `run_many`", start("-c", BATCH, str(runs)), ""),
        (
            f"{runs} runs, `submitit_local`, `sweep.chunk={CHUNK}`",
            _sweep(start, "chunks", runs, *chunked),
            "0.1 s a job",
        ),
    ]
    rows = []
    used = []
    for what, command, target in commands:
        used.append(processor_time(command)() / runs)
        against = f"empty Hydra app: {format_time(base)}"
        rows.append(Row(what, format_time(used[-1]), against, used[-1] / base, target))
    sweeping = stopwatch(_sweep(start, "many", many, "record=metrics"))()
    loading = stopwatch(start("-c", LOAD, "metrics"))()
    importing = stopwatch(start("-c", "import cmacexp, pandas"))()
    for what, seconds, target in (
        (f"{many} runs, `record=metrics`, elapsed", sweeping, "2 min for 10,000"),
        (f"`load_sweep` of {runs} runs, elapsed", loading - importing, "2 s for 1,000"),
    ):
        rows.append(Row(what, format_time(seconds), "", None, target))
    size, files = zip(*(_measure(folder / kind, runs) for kind in ("trace", "metrics")), strict=True)
    return [Table("Many runs of one leg, processor time a job", rows), _extrapolate(used, size, files, runs)]


def _measure(folder: Path, runs: int) -> tuple[float, float]:
    """Return bytes on disk per run, and the number of files and folders per run, as means over ``runs`` runs."""
    paths = list(folder.rglob("*"))
    return sum(path.stat().st_size for path in paths if path.is_file()) / runs, len(paths) / runs


def _extrapolate(used: Sequence[float], size: Sequence[float], files: Sequence[float], runs: int) -> Table:
    """Extrapolate processor time, disk space and files of ``runs`` runs to a million runs."""
    rows = []
    for what, seconds, bytes_a_run, count in zip(("trace", "metrics"), used, size, files, strict=False):
        disk = f"{MILLION * bytes_a_run / 1e9:.3g} GB, {MILLION * count:.2g} files and folders"
        rows.append(Row(f"`record={what}`", f"{MILLION * seconds / 3600:.3g} h", disk, None, ""))
    return Table(f"A million runs of one leg: processor time and disk, from {runs}", rows)
