"""A run gives the same bits with every supported version of numpy and with all vector instructions of a processor.

Where other bits are meant, renew the digests with ``python tests/laws/test_bits.py`` and say in the commit why.
"""

import ast
import hashlib
from pathlib import Path

import numpy as np
import pytest
from support.command import ROOT, python
from support.rollout import roll_out

import cmacexp
from cmacexp.config.compose import compose_config
from cmacexp.jit.sources import KERNEL_ROOMS
from cmacexp.loop.scenario import make_scenario

VARYING = {
    *("exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "power", "float_power", "cbrt"),
    *("tan", "tanh", "sinh", "cosh", "arcsin", "arccos", "arctan"),
    *("dot", "vdot", "inner", "matmul", "tensordot", "einsum", "fft", "linalg"),
}
"""Names of numpy that compute in another way, or another order, with another version or processor."""
EXACT = {"linalg", "linalg.norm"}
"""Of these, the square root of a sum of squares along an axis; the module itself."""
DIGESTS = Path(__file__).parent / "golden" / "bits.txt"
NOT_PROMISED = {
    *(f"models/{name}.py" for name in ("chain", "robot", "robot_gains")),
    *(f"models/robot_{name}.py" for name in ("feet", "search", "spec")),
    *("planning/robot.py", "planning/robot_dynamics.py"),
    *(f"plants/{name}.py" for name in ("mujoco_kernels", "mujoco_model", "mujoco_plant", "mujoco_robot")),
}
"""MuJoCo, in which robots move, has its own arithmetic."""
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


def files():
    package = Path(cmacexp.__file__).parent
    found = [package / room for room in KERNEL_ROOMS]
    found = [file for path in found for file in (sorted(path.rglob("*.py")) if path.is_dir() else [path])]
    return [file for file in found if file.relative_to(package).as_posix() not in NOT_PROMISED]


@pytest.mark.parametrize("file", files(), ids=lambda file: f"{file.parent.name}/{file.stem}")
def test_the_path_of_a_run_has_no_function_of_numpy_whose_bits_vary(file):
    nodes = list(ast.walk(ast.parse(file.read_text())))
    dotted = {ast.unparse(node) for node in nodes if isinstance(node, ast.Attribute)}
    names = {name.removeprefix("np.") for name in dotted if name.startswith("np.")} - EXACT
    assert not {name for name in names if name.split(".")[0] in VARYING}
    assert not any(isinstance(node, ast.MatMult) for node in nodes)


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
    assert without.stdout.split() == [digest(each) for each in RUNS]


def test_the_bits_are_those_of_all_supported_versions():
    assert [digest(each) for each in RUNS] == DIGESTS.read_text().split()


if __name__ == "__main__":
    DIGESTS.write_text("".join(f"{digest(each)}\n" for each in RUNS))
