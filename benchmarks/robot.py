"""A step of a robot: the whole loop, of which MuJoCo's own step is a part, against that step alone."""

from collections.abc import Callable

from benchmarks.loop import per_step
from benchmarks.timing import Table, compared, in_turn, make_config, stopwatch
from cmacexp.errors import BadInput
from cmacexp.loop.scenario import make_scenario
from cmacexp.plants.mujoco_robot import MujocoRobot

PLANTS = {"elastic ground": "mujoco_robot", "rigid floor": "mujoco_robot_rigid"}
ROBOT = "go1"
TARGET = "1.5 times"
STEPS = 1_000


def own_step(plant: MujocoRobot) -> Callable[[], float]:
    """A worker: seconds that MuJoCo alone takes for a sampling period, of a robot that falls."""
    mujoco, model = plant.mujoco, plant.model
    data = mujoco.MjData(model)

    def fall() -> None:
        mujoco.mj_resetData(model, data)
        for _ in range(STEPS):
            mujoco.mj_step1(model, data)
            mujoco.mj_step2(model, data)

    timed = stopwatch(fall)
    return lambda: timed() / STEPS * plant.config.substeps


def tables(quick: bool) -> list[Table]:
    """All of this file; nothing without MuJoCo or the model."""
    rows = []
    for ground, plant in PLANTS.items():
        try:
            config = make_config("scenario=robot", f"machine={ROBOT}", f"plant={plant}", "cycles=2")
        except BadInput:
            return []
        made = make_scenario(config).plant
        assert isinstance(made, MujocoRobot)
        times = in_turn({"loop": per_step(config), "mujoco": own_step(made)}, 3 if quick else 15)
        period = f"{config.sampling_period * 1e3:g} ms"
        what = f"{ROBOT}, {ground}, sampled every {period}"
        rows.append(compared(times, what, "loop", "mujoco", "MuJoCo's own step", TARGET))
    note = "MuJoCo alone: the robot falls, onto the rigid floor where there is one."
    return [Table("A robot, a step of the loop", rows, note)]
