"""A robot at the other end of a wire, on loopback: it walks and sits down, and is damped when its controller dies."""

import json
import os
import signal
import subprocess
import sys

import pytest
from support.robots import OWN

from cmacexp.wire.messages import get_motors
from cmacexp.wire.network import COMMANDS, LOOPBACK, STATES, Wire

pytestmark = pytest.mark.ci
pytest.importorskip("cyclonedds")
DOMAIN = 100 + os.getpid() % 100
"""Of DDS, so that workers do not hear each other."""
ROBOT = ["machine=mjcf", f"machine.path={OWN}", "actuator.lag=0.005"]
SIMULATED = ["-m", "cmacexp", "robot", "--simulate", "--patient", f"--domain={DOMAIN}", "plant/as_built=as_modelled"]
WALK = [
    "-m", "cmacexp", "scenario=robot", "plant=unitree", "controller=drives", f"plant.domain={DOMAIN}",
    "plant.guardian=5", "plant.limits.silence=4", "gait.cycle_time=0.8", "gait.stroke=0.04", "gait.lift=0.02",
    "cycles=2", "record=metrics",
]  # fmt: skip
CONTROLLER = f"""
import os, signal
from cmacexp.wire.guardian import Guardian
guardian = Guardian("{LOOPBACK}", {{}}, 3.0, 0.02)
guardian.report()
os.kill(os.getpid(), signal.{{}})
"""


@pytest.mark.parametrize("how", ["SIGKILL", "SIGSTOP"])
def test_the_guardian_damps_a_robot_whose_controller_dies_or_stops(how):
    domain = DOMAIN + getattr(signal, how)
    wire = Wire(LOOPBACK, domain, STATES, COMMANDS)
    controller = subprocess.Popen([sys.executable, "-c", CONTROLLER.format(domain, how)])
    command = wire.receive(30.0)
    assert command is not None
    assert (get_motors(command, "motor_cmd.kd") == 3.0).all()
    assert not get_motors(command, "motor_cmd.kp").any()
    controller.send_signal(signal.SIGKILL)
    controller.wait()


def test_a_robot_walks_over_the_wire_and_a_fault_ends_it_in_damping(tmp_path):
    for fault, stages, code in (("none", ["sit down", "damp"], 0), ("sign", ["check while it hangs", "damp"], 3)):
        robot = subprocess.Popen([sys.executable, *SIMULATED, f"--fault={fault}", *ROBOT], stdout=subprocess.PIPE)
        robot.stdout.readline()
        run = subprocess.run([sys.executable, *WALK, *ROBOT, f"hydra.run.dir={tmp_path / fault}"])
        manifest = json.loads((tmp_path / fault / "manifest.json").read_text())
        assert (run.returncode, [each["stage"] for each in manifest["plant"]["stages"]][-2:]) == (code, stages)
        assert manifest["plant"]["trouble"] is None
        assert b"at the end its body" in robot.communicate(timeout=60)[0]


def test_without_a_robot_or_a_network_one_line_says_so(tmp_path):
    for override, said in (("plant.interface=eth99", "choose from"), ("plant.domain=99", "cmacexp robot --simulate")):
        run = subprocess.run(
            [sys.executable, *WALK, *ROBOT, override, f"hydra.run.dir={tmp_path}/no"], capture_output=True, text=True
        )
        assert run.returncode == 2
        assert said in run.stderr.splitlines()[-1]
