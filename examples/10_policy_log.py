"""Identify the joints of a simulated Go2 from the log of a noisy policy (pip install -e ".[robots]").

The trunk is held, the drives are soft, and a policy sends targets with noise at 50 Hz, as many learned ones do. The
figure shows what is identified beside the truth.
"""

import copy
import json
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import mujoco
import numpy as np
import pandas as pd

from cmacexp.config.compose import compose_config
from cmacexp.config.machine import read_model

KP, KD = 20.0, 0.5
"""Gains of the drives, N m/rad and N m s/rad."""
VISCOUS, DRY = 0.08, 0.15
"""Friction of each joint beside that of the model, N m s/rad and N m."""
STEP, ROW, TARGET = 1e-3, 5, 20
"""Time step of the simulation, s; steps in a row of the log, and in a target of the policy."""
SECONDS = 10.0
FOLDER = Path("outputs/examples")

robot = read_model(compose_config(["scenario=robot", "machine=go2"]).machine)
model = copy.copy(robot.model)
joints = robot.legs.joint.ravel()
rates, angles = model.jnt_dofadr[joints], model.jnt_qposadr[joints]
names = [model.joint(int(joint)).name for joint in joints]
trunk = int(model.jnt_dofadr[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE][0])
model.opt.timestep = STEP
model.geom_contype[:] = model.geom_conaffinity[:] = 0
model.dof_armature[trunk : trunk + 6] = 1e9  # holds the trunk
model.dof_damping[rates] += VISCOUS
model.dof_frictionloss[rates] += DRY

data = mujoco.MjData(model)
home = data.qpos[angles] = robot.home.ravel()
random = np.random.default_rng(1)
wander = np.zeros(len(joints))
rows = []
for k in range(round(SECONDS / STEP)):
    if k % TARGET == 0:
        wander = 0.95 * wander + random.normal(0.0, 0.06, len(joints))
        swing = 0.25 * np.sin(2.0 * np.pi * 1.6 * k * STEP + 0.9 * np.arange(len(joints)))
        target = home + swing + wander + random.normal(0.0, 0.12, len(joints))
    if k % ROW == 0:
        rows.append([k * STEP, *(data.qpos[angles] + random.normal(0.0, 2e-4, len(joints))), *target])
    data.qfrc_applied[rates] = KP * (target - data.qpos[angles]) - KD * data.qvel[rates]
    mujoco.mj_step(model, data)

FOLDER.mkdir(parents=True, exist_ok=True)
log = FOLDER / "policy.parquet"
columns = ["time", *(f"q_{name}" for name in names), *(f"q_des_{name}" for name in names)]
pd.DataFrame(rows, columns=columns).to_parquet(log)
page = FOLDER / "policy"
command = ["gap", str(log), "--robot", "go2", f"--kp={KP}", f"--kd={KD}", f"--out={page}"]
subprocess.run([sys.executable, "-m", "cmacexp", *command], check=True)

found = json.loads((page / "gap.json").read_text())["parameters"]
truth = {
    "rotor_inertia": model.dof_armature[rates],
    "viscous_friction": model.dof_damping[rates],
    "coulomb_friction": model.dof_frictionloss[rates],
}
units = ["kg m²", "N m s/rad", "N m"]
figure, axes = plt.subplots(1, 3, figsize=(9, 4), sharey=True, layout="constrained")
inside = 0
for ax, (name, values), unit in zip(axes, truth.items(), units, strict=True):
    for j, joint in enumerate(names):
        value, error = (np.mean(found[joint][name][kind] or 0.0) for kind in ("value", "deviation"))
        ax.errorbar(value, j, xerr=1.96 * error, color="C0", marker=".", capsize=2)
        inside += abs(value - values[j]) < 1.96 * error
    ax.plot(values, range(len(names)), "k|", markersize=9)
    ax.set(xlabel=f"{name.replace('_', ' ')}, {unit}", xlim=(0.0, None))
axes[0].set(yticks=range(len(names)), yticklabels=names)
axes[0].invert_yaxis()
figure.suptitle("identified with 95 % intervals, and the truth (black)", fontsize=10)
figure.savefig(FOLDER / "policy_log.png", dpi=90)
print(f"{inside} of {3 * len(names)} intervals contain the truth")
