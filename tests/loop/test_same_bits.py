"""External components give a run the bits of built-in ones, and plain Python those of compiled code."""

from random import Random

import pytest
from support.doors import RULES, make_scenario, roll_out
from support.loops import require_same_bits, run_both, run_elsewhere
from support.robots import OWN, RIGID, ROBOT
from support.robots import SHORT as SHORT_ROBOT

from cmacexp.loop.step import step_loop

pytestmark = pytest.mark.ci

SHORT = ("gait.cycle_time=0.5", "cycles=2", "learning.start_cycle=1", "cmac.memory_bytes=16384")
ONE_LEG = {
    "scenario": ["one_leg", "force_step"],
    "force_control": ["stiffness", "damping", "combined", "explicit"],
    "feedforward": ["none", "cmac", "inverse_dynamics"],
    "reference": ["literal", "aware", "force_feedforward"],
    "learning.lead": [-1, 0, 1, 2],
    "plant.substeps": [1, 3],
    "actuator.torque_limit": ["null", 2.5],
}
SHORT_WALK = (
    "scenario=quadruped",
    "cycles=1",
    "learning.start_cycle=1",
    "gait.cycle_time=1.5",
    "cmac.memory_bytes=65536",
)
WALK = {
    "terrain": ["soft_flat", "patchy"],
    "feedforward": ["none", "cmac", "inverse_dynamics"],
    "reference": ["literal", "aware", "force_feedforward"],
    "machine.legs.right_rear.mass_1": [0.5, 0.8],
    "machine.legs.left_front.length_2": [0.35, 0.4],
    "gait.load_ramp": [0.0, 0.1],
    "gait.vertical": ["cubic", "two_cubics"],
    "posture.gain": [0.0, 8.0],
    "learning.lead": [0, 1],
    "plant.substeps": [1, 3],
    "actuator.torque_limit": ["null", 8.0],
    "actuator.lag": [0.0, 0.003],
}
REAL = "sensors=real"
ALL = [
    *("sensors=encoders", "sensors.force.noise_relative=0.2", "sensors.force.delay=1"),
    *("sensors.position.noise=0.0005", "sensors.velocity.bias=0.001", "sensors.force.fault.kind=last"),
    *("sensors.force.fault.start=4", "sensors.force.legs=[1]", "sensors.velocity.dropout=0.05"),
]
FAULTY = {
    "sensors of one leg": [*ALL, "cycles=2", "learning.lead=auto"],
    "a mass": ["scenario=force_step", REAL, "sensors.position.noise=0.001", "sensors.velocity.quantum=0.01"],
    "late": ["cycles=2", "actuator.delay=2", "actuator.rate_limit=900", "actuator.torque_limit=9"],
    "lagging": ["cycles=2", REAL, "learning=lasting", "actuator.lag=0.004", "sensors.velocity.lag=0.005"],
    "sensors of a walk": [
        *("scenario=quadruped", REAL, "sensors.height.noise=0.0001", "sensors.tilt.delay=1"),
        *("sensors.force.fault.kind=noise", "sensors.force.fault.legs=[2]", "sensors.force.fault.value=4"),
        *("sensors.tilt_rate.noise=1", "cycles=2", "gait.cycle_time=1"),
    ],
    "guarded": ["learning=lasting", "learning.rate=0.5", "learning.lead=0", "actuator.delay=3", "cycles=3"],
    "diverging": ["controller.velocity_gain=0.5", "controller.position_gain=2000", "learning.start_cycle=1"],
}  # fmt: skip
PLAIN = {
    "inverse dynamics": ["cycles=1", "feedforward=inverse_dynamics", "learning.start_cycle=1", "plant.substeps=2"],
    "a mass": ["scenario=force_step", "gait.cycle_time=3", "force_control=explicit", "actuator.torque_limit=1.5"],
    "diverging": ["cycles=1", "controller.velocity_gain=80"],
    "a walk that learns": [*SHORT_WALK, "learning.lead=1", "machine.legs.left_front.mass_1=0.6"],
    "patchy": [
        *("scenario=quadruped", "cycles=1", "terrain=patchy", "gait.load_ramp=0.1", "learning.start_cycle=1"),
        "plant.substeps=2",
    ],
    "falling": ["scenario=quadruped", "cycles=1", "posture.gain=0"],
    "friction": ["scenario=quadruped", "cycles=1", "plant=mujoco_quadruped", "plant.start_spread=0.01"],
    "rigid floor": [*ROBOT, f"machine.path={OWN}", *SHORT_ROBOT, RIGID, "sensors=encoders", "actuator.lag=0.001"],
    **{
        name: [*FAULTY[name], "cycles=1", "sensors.force.fault.start=0.5"]
        for name in ("sensors of one leg", "sensors of a walk")
    },
}  # fmt: skip
DAMPED = ("terrain.damping=2", "plant.substeps=2", "gait.cycle_time=1", "cycles=1", "learning.start_cycle=1")
FIELDS = ("rectangular", "linear", "cubic")


def draw(spread, count, *base):
    """Commands, each with a value for each key; every value is taken equally often."""
    random = Random(1997)
    drawn = zip(*(random.sample((values * count)[:count], count) for values in spread.values()), strict=True)
    return {"-".join(map(str, case)): [*base, *map("{}={}".format, spread, case)] for case in drawn}


CASES = {
    **draw(ONE_LEG, 8, *SHORT),
    **draw(WALK, 3, *SHORT_WALK),
    **FAULTY,
    **{f"damped {name}": [f"scenario={name}", *DAMPED] for name in ("one_leg", "quadruped", "force_step")},
    **{f"{name} ilc": [f"scenario={name}", "feedforward=ilc", *DAMPED[2:]] for name in ("one_leg", "quadruped")},
    **{
        f"{rule} {network}": [*SHORT, f"learning.rule={rule}", f"learning.lead={n % 3}", network]
        for n, rule in enumerate(RULES)
        for network in ("feedforward=rbf", f"cmac.receptive_field={FIELDS[n % 3]}")
    },
}


@pytest.mark.parametrize("case", CASES)
def test_external_components_equal_built_in_ones_to_the_bit(make_config, case):
    run = run_both(make_config(*CASES[case]))
    assert run.status == "diverged" or case != "diverging"
    assert bool(run.guard) == (case == "guarded")


IN_CI = ("a walk that learns", "sensors of one leg")


@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.nightly] * (name not in IN_CI)) for name in PLAIN]
)
def test_plain_python_in_another_process_gives_the_bits_of_compiled_code(make_config, tmp_path, name):
    plain = run_elsewhere(tmp_path, PLAIN[name], NUMBA_DISABLE_JIT="1")
    require_same_bits(plain, roll_out(make_scenario(make_config(*PLAIN[name]))))


@pytest.mark.usefixtures("compiled")
def test_compiled_code_gives_the_same_bits_with_hooks(make_config):
    run_both(make_config("cycles=2", "learning.lead=1", "cmac.memory_bytes=65536"))
    assert step_loop.chosen in step_loop.forms.values()
