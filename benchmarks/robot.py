"""Time per step of a robot in the closed loop, MuJoCo's step included, against MuJoCo's step only."""

from collections.abc import Callable

from benchmarks.loop import per_step
from benchmarks.timing import Table, compared, in_turn, stopwatch
from cmacexp.config.compose import compose_config
from cmacexp.errors import BadInput
from cmacexp.loop.scenario import make_scenario
from cmacexp.plants.mujoco_robot import MujocoRobot

PLANTS = {"elastic ground": "mujoco_robot", "rigid floor": "mujoco_robot_rigid"}
ROBOT = "go1"
TARGET = "1.5 times"
STEPS = 1_000


def step_of_mujoco(plant: MujocoRobot) -> Callable[[], float]:
    """Return a worker that gives MuJoCo's time per sampling period for a falling robot, s."""
    mujoco = plant.mujoco
    model = plant.model
    data = mujoco.MjData(model)

    def fall() -> None:
        mujoco.mj_resetData(model, data)
        for _ in range(STEPS):
            mujoco.mj_step1(model, data)
            mujoco.mj_step2(model, data)

    timed = stopwatch(fall)
    return lambda: timed() / STEPS * plant.config.substeps


def tables(quick: bool) -> list[Table]:
    """Run the benchmarks of this file and return their table; none without MuJoCo or the robot's model."""
    rows = []
    for ground, plant in PLANTS.items():
        try:
            config = compose_config(["scenario=robot", f"machine={ROBOT}", f"plant={plant}", "cycles=2"])
        except BadInput:
            return []
        robot = make_scenario(config).plant
        assert isinstance(robot, MujocoRobot)
        times = in_turn({"loop": per_step(config), "mujoco": step_of_mujoco(robot)}, 3 if quick else 15)
        what = f"{ROBOT}, {ground}, sampled every {config.sampling_period * 1e3:g} ms"
        rows.append(compared(times, what, "loop", "mujoco", "MuJoCo's own step", TARGET))
    note = "MuJoCo only: the robot falls, onto the rigid floor where there is one."
    return [Table("A robot, a step of the loop", rows, note)]
