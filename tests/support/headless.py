"""Run Unitree's simulator of a Go2 without its screen: python headless.py FOLDER DOMAIN TRUTH.

FOLDER is a clone of unitree_mujoco. Its program runs unmodified; in place of the screen an object records the angles
of the motors and the forces of the feet in every step, until SIGTERM, and writes them to the file TRUTH (NPZ). The
ground is that of scene.xml without its boxes.
"""

import os
import runpy
import signal
import sys
import threading
import types
from pathlib import Path

import mujoco
import numpy as np

FEET = ("FR", "FL", "RR", "RL")
"""In the order of the motors."""


class Screen:
    """The object in place of the screen."""

    def __init__(self, model, data):
        self.model, self.data, self.rows, self.runs = model, data, [], True

    def is_running(self):
        return self.runs

    def sync(self):
        forces, force = dict.fromkeys(FEET, 0.0), np.zeros(6)
        for number, contact in enumerate(self.data.contact):
            for geom in contact.geom:
                if (name := self.model.geom(int(geom)).name) in forces:
                    mujoco.mj_contactForce(self.model, self.data, number, force)
                    forces[name] += force[0]
        self.rows.append([*self.data.sensordata[:12], *forces.values(), *np.abs(self.data.actuator_force)])


def main(folder, domain, truth):
    os.chdir(Path(folder) / "simulate_python")
    sys.path.insert(0, os.getcwd())
    robot = Path("../unitree_robots/go2").resolve()
    lines = (robot / "scene.xml").read_text().splitlines()
    (robot / "scene_flat.xml").write_text("\n".join(line for line in lines if "<geom pos=" not in line))
    import config

    config.DOMAIN_ID, config.USE_JOYSTICK, config.PRINT_SCENE_INFORMATION = int(domain), 0, False
    config.ROBOT_SCENE, config.VIEWER_DT = str(robot / "scene_flat.xml"), config.SIMULATE_DT
    screens = []
    viewer = types.ModuleType("mujoco.viewer")
    viewer.launch_passive = lambda model, data, **options: screens.append(Screen(model, data)) or screens[0]
    mujoco.viewer = sys.modules["mujoco.viewer"] = viewer
    ended = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: ended.set())
    runpy.run_path("unitree_mujoco.py", run_name="__main__")
    print("simulates", flush=True)
    ended.wait()
    screens[0].runs = False
    rows = np.array(screens[0].rows)
    np.savez(truth, q=rows[:, :12], force=rows[:, 12:16], torque=rows[:, 16:])
    os._exit(0)  # threads of the SDK do not end


if __name__ == "__main__":
    main(*sys.argv[1:])
