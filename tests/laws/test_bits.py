"""A run gives the same bits with every supported version of numpy and with all vector instructions of a processor.

Where other bits are meant, renew the digests with ``python tests/laws/test_bits.py`` and say in the commit why.
"""

import hashlib
from pathlib import Path

import numpy as np
import pytest
from support.command import ROOT, python
from support.doors import compose_config, make_scenario, roll_out

DIGESTS = Path(__file__).parent / "golden" / "bits.txt"
SHORT = "gait.cycle_time=0.5 gait.lift=0.11 cycles=2 learning.start_cycle=1"
RUNS = (
    "scenario=quadruped gait.cycle_time=1.0 gait.load_ramp=0.05 cycles=1",
    f"{SHORT} feedforward=rbf",
    f"{SHORT} feedforward=ilc",
    f"{SHORT} cmac.receptive_field=cubic learning.rule=normalised",
)


def digest(overrides):
    """Hash of all samples of a run."""
    run = roll_out(make_scenario(compose_config(overrides.split())))
    return hashlib.sha256(run.samples.tobytes() + run.body_samples.tobytes()).hexdigest()


@pytest.mark.parametrize("number", range(len(RUNS)))
def test_the_bits_are_those_of_all_supported_versions(number):
    assert digest(RUNS[number]) == DIGESTS.read_text().split()[number]


@pytest.mark.ci
def test_the_bits_do_not_depend_on_the_vector_instructions_of_the_processor(tmp_path):
    found = np.show_config(mode="dicts")["SIMD Extensions"]["found"]
    script = "from laws.test_bits import RUNS, digest\nfor each in RUNS: print(digest(each))"
    without = python(
        *("-c", script),
        folder=tmp_path,
        PYTHONPATH=f"{ROOT}:{ROOT / 'tests'}",
        NPY_DISABLE_CPU_FEATURES=" ".join(found),
        OPENBLAS_CORETYPE="Nehalem",
        NUMBA_DISABLE_JIT="1",
    )
    assert without.returncode == 0, without.stderr
    assert without.stdout.split() == DIGESTS.read_text().split()


if __name__ == "__main__":
    DIGESTS.write_text("".join(f"{digest(each)}\n" for each in RUNS))
