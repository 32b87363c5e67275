"""Times that README and documentation speak of: the whole command against its imports, and the loop per step.

``python benchmarks/one_leg.py`` runs both commands in turn, after one run that is not counted, and prints medians
and their ratio; machines are noisy, so trust the ratio.
"""

import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

FLOOR = ["-c", "import hydra, numpy, numba, pyarrow.parquet, rerun"]
"""What no run can do without."""
PAIRS = 7


def seconds(arguments: list[str], folder: Path) -> float:
    """Wall time of one Python process."""
    began = time.perf_counter()
    subprocess.run([sys.executable, *arguments], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - began


def main() -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        command = ["-m", "cmacexp", "scenario=one_leg", f"hydra.run.dir={folder}/run"]
        seconds(command, folder)
        pairs = [(seconds(command, folder), seconds(FLOOR, folder)) for _ in range(PAIRS)]
        manifest = json.loads((folder / "run" / "manifest.json").read_text())
    whole, floor = (statistics.median(column) for column in zip(*pairs, strict=True))
    ratio = statistics.median(a / b for a, b in pairs)
    print(f"whole command {whole:.2f} s, imports alone {floor:.2f} s, ratio {ratio:.2f}")
    print(
        f"loop {manifest['rollout_seconds'] / manifest['steps'] * 1e6:.2f} us a step over {manifest['steps']} steps"
    )


if __name__ == "__main__":
    main()
