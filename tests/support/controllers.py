"""Custom controllers for the tests: one that is right, and what can be wrong with one."""

from pathlib import Path

CONTROLLERS = """
from dataclasses import dataclass
import numpy as np
from cmacexp.config import ComponentConfig
from cmacexp.control import Action

class Still:
    def __init__(self, gain=1.0): self.gain = gain
    def reset(self, setup, feedforward): self.legs = len(setup.mechanism.legs)
    def act(self, reference, measurement): return Action(np.zeros((self.legs, 2)), np.zeros((self.legs, 2)))

class Needs(Still):
    def __init__(self, stiffness): super().__init__()

class Flat(Still):
    def act(self, reference, measurement): return Action(np.zeros(2), np.zeros((self.legs, 2)))

class Raises(Still):
    def act(self, reference, measurement): return {}["torque"]

class Narrow(Still):
    def act(self, reference): return None

class Other(Still):
    @dataclass
    class Config(ComponentConfig):
        stiffness: float = 1.0

class CannotBeMade(Still):
    def __init__(self): raise ValueError("no licence")

number = 3
"""


def write_module(folder: Path, text: str) -> str:
    """Write a module that no other test has imported into a folder; its name."""
    name = f"own_{abs(hash(folder))}"
    (folder / f"{name}.py").write_text(text)
    return name
