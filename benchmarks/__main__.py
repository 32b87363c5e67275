"""``python -m benchmarks``: run the benchmarks, print their tables, and optionally write them to a file."""

import argparse
import importlib
import math
import os
import platform
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

from benchmarks.c_loop import compiler
from benchmarks.timing import Table, markdown
from cmacexp.jit.compiler import expect_runs

ON_REQUEST = ("wire", "law")
"""Benchmarks that run only if named: they need a robot's model and take half an hour or more."""
ALL = ("loop", "robot", "cmac", "trace", "command", "sweep")


def machine() -> str:
    """Describe the computer, the library versions and the load in one line."""
    cpu = re.findall(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text()) or [platform.machine()]
    parts = [f"{cpu[0]}, {os.cpu_count()} cores, {platform.system()}", f"Python {platform.python_version()}"]
    parts += [f"{name} {version(name)}" for name in ("numba", "numpy", "pyarrow", "hydra-core")]
    if compiler_path := compiler():
        version_text = subprocess.run([compiler_path, "--version"], capture_output=True, text=True).stdout
        parts.append(version_text.splitlines()[0])
    return f"{', '.join(parts)}; load {os.getloadavg()[0]:.1f} at the start"


def main() -> None:
    """Run the benchmarks named on the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"benchmarks to run: {', '.join(ALL)}; default: all of these"
    )
    parser.add_argument("--quick", action="store_true", help="fewer rounds and shorter runs, as a smoke test")
    parser.add_argument("--write", type=Path, metavar="FILE", help="write the tables to this file")
    chosen = parser.parse_args()
    if unknown := set(chosen.names) - {*ALL, *ON_REQUEST}:
        parser.error(f"no benchmark {', '.join(sorted(unknown))}; choose from {', '.join([*ALL, *ON_REQUEST])}")
    expect_runs(math.inf)  # else short runs are not compiled
    parts = [f"On {machine()}."]
    print(parts[0], file=sys.stderr)
    wrong: list[str] = []
    for name in chosen.names or ALL:
        tables: list[Table] = importlib.import_module(f"benchmarks.{name}").tables(chosen.quick)
        for table in tables:
            parts.append(markdown(table))
            wrong += [
                f"{row.what}: {row.ratio:.3g} is above {row.limit}"
                for row in table.rows
                if row.ratio is not None and not row.ratio <= row.limit
            ]
            print(f"\n{parts[-1]}", flush=True)
        if chosen.write:  # after each, so that an interrupted session keeps its results
            chosen.write.write_text("\n\n".join(parts) + "\n")
    if wrong:
        sys.exit("\n".join(wrong))


if __name__ == "__main__":
    main()
