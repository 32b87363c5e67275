"""``python -m cmacexp.robots``: a robot and what follows from its model, as text of 80 columns."""

import shlex
import shutil

import pytest
from support.command import call
from support.doors import compose_config
from support.robots import FEET, OWN

pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a quote in its name, and a model in it."""
    found = tmp_path_factory.mktemp("it's")
    shutil.copy(OWN, found)
    return found


def test_a_robot_is_shown_with_its_limits_and_settings_in_eighty_columns(folder):
    shown = call("robots", "robot.xml", "controller.position_gain=123", folder=folder)
    assert (shown.returncode, shown.stderr) == (0, "")
    command, *lines = shown.stdout.splitlines()
    assert shlex.split(command)[-1] == "controller.position_gain=123"
    assert str(folder / "robot.xml") in lines
    assert max(map(len, (line for line in lines if line != str(folder / "robot.xml")))) <= 80
    found = {line.split("  ")[0]: line.split() for line in lines}
    config = compose_config(["scenario=robot", "machine=mjcf", f"machine.path={OWN}"])
    assert found["largest torque"][-3:] == ["30", "30", "40"]
    assert found["least angle, all legs"][-3:] == ["-0.9", "-1.5", "-2.7"]
    assert found["controller.position_gain"][1:] == ["N/m", "123"]
    assert found["machine.hip_height"][1:] == ["m", f"{config.machine.hip_height:.3g}"]
    planned, share = (float(found[name][-1]) for name in ("largest planned torque", "over the largest torque"))
    assert share == pytest.approx(planned / 40, rel=0.01)
    assert "feet stand 0.26 m apart in front and 0.26 m in the rear" in shown.stdout
    margins = [line.split()[:2] for line in lines if line.startswith(("hybrid", "drives"))]
    assert margins == [["hybrid", "0.002"], ["hybrid", "0.001"], ["drives", "0.002"]]


def test_legs_of_other_names_are_found_and_typed_as_printed(folder):
    (folder / "other robot.xml").write_text(
        OWN.read_text().replace("FL_", "left of it ").replace("calf_joint", "null")
    )
    found = call("robots", "other robot.xml", folder=folder)
    assert (found.returncode, found.stderr) == (0, "")
    command = next(line for line in found.stdout.splitlines() if line.startswith("python -m cmacexp "))
    machine = compose_config(shlex.split(command)[3:]).machine
    assert machine.joints[0] == ["left of it hip_joint", "left of it thigh_joint", "left of it null"]
    assert (machine.path, machine.feet) == (str(folder / "other robot.xml"), list(FEET))
