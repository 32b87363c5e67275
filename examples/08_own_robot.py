"""A robot from its MJCF or URDF file learns: python examples/08_own_robot.py FILE (pip install -e ".[mujoco]")."""

import sys
from pathlib import Path

import cmacexp

OWN = Path(__file__).parents[1] / "tests" / "support" / "robot.xml"
file = sys.argv[1] if len(sys.argv) > 1 else OWN
machine = ["scenario=robot", "machine=mjcf", f"machine.path={file}"]
# Where names are not the usual ones (FL_hip_joint, ...), python -m cmacexp.robots FILE prints further overrides.

for feedforward in ("none", "cmac"):
    run = cmacexp.run([*machine, f"feedforward={feedforward}", "cycles=6"], f"outputs/examples/own_{feedforward}")
    print(run)
    error = 1e3 * run.metrics.groupby("cycle")["transfer_rmse"].mean().iloc[-1]
    print(f"feedforward={feedforward}: {run.status}, foot error {error:.2f} mm in the last cycle")
