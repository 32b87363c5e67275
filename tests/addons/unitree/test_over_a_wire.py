"""A robot at the other end of a wire, on loopback: it walks and sits down, and is damped when its controller dies."""

import json
import os
import signal
import subprocess
import sys
from threading import Thread

import numpy as np
import pandas as pd
import pytest
from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
from cyclonedds.domain import DomainParticipant
from cyclonedds.qos import Policy
from support.doors import compose_config, read_log
from support.robots import OWN

from cmacexp.addons.unitree.messages import get_motors, new_command, set_motors
from cmacexp.addons.unitree.network import COMMANDS, LOOPBACK, STATES, Wire
from cmacexp.addons.unitree.service import release_sport_mode, serve_mode
from cmacexp.addons.unitree.simulated import SimulatedRobot
from cmacexp.errors import BadInput

pytestmark = pytest.mark.ci
DOMAIN = 100 + os.getpid() % 100
"""Of DDS, so that workers do not hear each other."""
ROBOT = ["machine=mjcf", f"machine.path={OWN}", "actuator.lag=0.005"]
OTHERS = ["feedforward=none", "sensors=proprioceptive"]
SIMULATED = ["-m", "cmacexp", "robot", "--simulate", "--patient", f"--domain={DOMAIN}", "plant/as_built=as_modelled"]
WALK = [
    "-m", "cmacexp", "scenario=robot", "plant=unitree", "controller=drives", f"plant.domain={DOMAIN}",
    "plant.guardian=2", "plant.limits.silence=9", "gait.cycle_time=0.8", "gait.stroke=0.04", "gait.lift=0.02",
    "cycles=2", "record=trace",
]  # fmt: skip
CONTROLLER = f"""
import os, signal
from cmacexp.addons.unitree.guardian import Guardian
from cmacexp.addons.unitree.messages import new_command, set_motors
guardian, command = Guardian("{LOOPBACK}", {{}}, 3.0, 0.02, 1.0), new_command()
set_motors(command, q=0.5, dq=1.0, tau=1.0, kp=50.0, kd=1.0)
guardian.report(command)
os.kill(os.getpid(), signal.{{}})
"""


@pytest.mark.parametrize("how", ["SIGKILL", "SIGSTOP"])
def test_the_guardian_damps_a_robot_whose_controller_dies_and_holds_one_whose_controller_stops(how):
    domain = DOMAIN + getattr(signal, how)
    wire = Wire(LOOPBACK, domain, STATES)
    controller = subprocess.Popen([sys.executable, "-c", CONTROLLER.format(domain, how)])
    stiffness, damping = [], []
    while not stiffness or stiffness[-1] > 0.0:
        motors = wire.receive(60.0)["motor_cmd"]
        stiffness.append(get_motors(motors["kp"]).max())
        damping.append(get_motors(motors["kd"]).max())
    assert damping[-1] == 3.0
    if how == "SIGKILL":
        assert len(stiffness) == 1
    else:
        assert len(stiffness) > 10
        assert (np.diff(stiffness) <= 0.0).all()
    command = new_command()
    set_motors(command, kp=1.0)
    other = Wire(LOOPBACK, domain, COMMANDS)
    answers = 0
    while (heard := wire.receive(1.0)) is not None:  # another program moves the robot: the guardian leaves it alone
        if not heard["motor_cmd"]["kp"].any():
            other.send(command)
            answers += 1
        assert answers < 1000
    controller.send_signal(signal.SIGKILL)
    controller.wait()


def test_a_motion_program_is_released_and_a_robot_without_the_service_is_refused_unless_here(monkeypatch):
    domain = DOMAIN + 30
    assert "as in a simulator" in release_sport_mode(LOOPBACK, domain)
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr("cmacexp.addons.unitree.service.LOOPBACK", "another")
        with pytest.raises(BadInput, match=r"plant\.release=false"):
            release_sport_mode(LOOPBACK, domain)
    Thread(target=serve_mode, args=(LOOPBACK, domain, "normal"), daemon=True).start()
    assert release_sport_mode(LOOPBACK, domain) == "motion program normal ended"
    assert release_sport_mode(LOOPBACK, domain) == "no motion program runs"


def test_topics_are_announced_without_a_description_of_their_types():
    """Its request ends a peer on Cyclone DDS 0.10.5 with a segmentation fault."""
    domain = DOMAIN + 32
    wire = Wire(LOOPBACK, domain, COMMANDS)
    participant = DomainParticipant(domain)
    for topic in (BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription):
        found = {end.topic_name: end for end in BuiltinDataReader(participant, topic).take(100)}
        names = {"rt/lowcmd"} if topic is BuiltinTopicDcpsPublication else {"rt/lowcmd", "rt/lowstate"}
        assert names <= set(found)
        for name in names:
            assert found[name].type_id is None
            assert Policy.DataRepresentation(True, False) in found[name].qos
    assert wire.receive_other() is None


def test_a_robot_walks_over_the_wire_and_a_fault_ends_it_in_damping(tmp_path):
    for fault, stages, code in (("none", ["sit down", "damp"], 0), ("sign", ["check while it hangs", "damp"], 3)):
        robot = subprocess.Popen([sys.executable, *SIMULATED, f"--fault={fault}", *ROBOT], stdout=subprocess.PIPE)
        robot.stdout.readline()
        run = subprocess.run(
            [
                sys.executable,
                *WALK,
                *ROBOT,
                f"plant.log={tmp_path / fault}.parquet",
                f"hydra.run.dir={tmp_path / fault}",
            ],
            stderr=subprocess.PIPE,
            text=True,
        )
        assert run.returncode == code, run.stderr
        manifest = json.loads((tmp_path / fault / "manifest.json").read_text())
        assert (run.returncode, [each["stage"] for each in manifest["plant"]["stages"]][-2:]) == (code, stages)
        assert manifest["plant"]["trouble"] is None
        assert "L2 and B stop the robot" in run.stderr
        steps = pd.read_parquet(tmp_path / fault / "body.parquet").dropna(subset=["answer_time"])
        assert (steps["answer_time"] > 0.0).sum() == (800 if fault == "none" else 0)
        assert (steps["states_missed"] <= manifest["plant"]["states_missed"]).all()
        rows = pd.read_parquet(tmp_path / f"{fault}.parquet")
        rows[rows["kp_FL_hip_joint"] == rows["kp_FL_hip_joint"][0]].to_parquet(tmp_path / "hung.parquet")
        log = read_log(tmp_path / "hung.parquet")  # as cmacexp gap does, of one pair of gains
        assert (len(log.joints), log.has_gains, log.torque is None) == (12, True, False)
        assert b"at the end its body" in robot.communicate()[0]


def test_the_played_robot_follows_a_command_in_the_step_that_follows():
    config = compose_config(["scenario=robot", *ROBOT[:2], "plant=mujoco_robot_rigid", "controller=drives", *OTHERS])
    robot, command = SimulatedRobot(config, True, [0.0, 1.36, -2.65]), new_command()
    set_motors(command, q=0.0, dq=0.0, tau=1.5, kp=0.0, kd=0.0)
    robot.step()
    robot.take(command)
    robot.step()
    assert (robot.plant.signals.torque == 1.5).all()


def test_without_a_robot_or_a_network_one_line_says_so(tmp_path):
    for override, said in (("plant.interface=eth99", "choose from"), ("plant.domain=99", "cmacexp robot --simulate")):
        run = subprocess.run(
            [sys.executable, *WALK, *ROBOT, override, f"hydra.run.dir={tmp_path}/no"], capture_output=True, text=True
        )
        assert run.returncode == 2
        assert said in run.stderr.splitlines()[-1]
