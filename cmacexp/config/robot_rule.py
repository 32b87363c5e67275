"""``${rule:NAME}`` in a config: a number derived from the model of a robot, such as a gain.

It is resolved whenever the config is read, from the machine, sampling period, LEAD compensator, sensors and actuator
of the run. A number typed on the command line replaces the rule.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any

from omegaconf import DictConfig, ListConfig, OmegaConf

from cmacexp.config.component import find_option
from cmacexp.config.fields import listed, read_field
from cmacexp.config.gait import PATTERNS, SHORTEST_RAMP_SAMPLES, GaitPattern
from cmacexp.config.machine import RobotModel, ask_for_robot, read_model
from cmacexp.errors import BadInput, require, require_name
from cmacexp.models.lead import discretise
from cmacexp.models.loop_delay import LoopDelay, add_delays
from cmacexp.models.robot_file import find_model
from cmacexp.models.robot_gains import (
    ROTOR_INERTIA,
    Basis,
    Contact,
    DriveGains,
    Gains,
    Sampling,
    derive_basis,
    derive_contact,
    derive_drive_gains,
    derive_gains,
    limit_period,
    make_sampling,
    recommend_period,
)
from cmacexp.models.robot_search import Names, find_names, find_yaw

PERIOD = "sampling_period"
FOUND = (*Names._fields, "yaw", "rotor_inertia")
"""Names of the rules for what is found in the model of a robot, which are those of fields of the machine."""
READ = frozenset({PERIOD, "machine", "gait", "controller", "sensors", "actuator", "plant"})
"""Keys and groups of the config that rules depend on."""
PERIODS = {PERIOD: math.inf, "rigid_sampling_period": 0.001}
"""Names of the rules for the sampling period, with the longest period for their ground, s."""
LONGEST_STROKE = 0.6
"""Longest stroke, over the length of a leg; for a longer one the cycle is shortened."""
LIFT = 0.117
"""Lift of a foot in the longest cycle of a gait, over the length of a leg; proportionally less in shorter cycles."""
HIGHEST_LIFT = 0.05
"""Largest lift of a foot, m."""
CYCLE_STEP = 0.04
"""Cycles are multiples of this, s, so that feet touch down at samples."""
SHORTEST_CYCLE = 0.12
"""Duration of the shortest cycle, s."""
RAMP_SHARE = 0.05
"""Duration of the load ramps over that of the cycle."""
SHORTEST_RAMP_TIME = 0.012
"""Duration of the shortest load ramp, s."""
ROTOR_DIGITS = 3
"""Significant digits of a nominal rotor inertia."""
DIGITS = 6
"""Significant digits of a derived number: config and hash do not depend on the rounding of a MuJoCo version."""


def rule_value(name: str, _root_: DictConfig) -> float | ListConfig:
    """Compute the value of ``${rule:NAME}`` for the config ``_root_``.

    ``name`` is one of :data:`PERIODS`, :data:`STRIDE` or :data:`FOUND`, or a field of :class:`Basis`, :class:`Gains`,
    :class:`DriveGains` or :class:`Contact`. Raises BadInput if there is no such name, the machine is no robot, or the
    rule does not apply to it.
    """
    if name in STRIDE:
        return STRIDE[name](_root_)
    of_model = (field for kind in (Basis, Gains, DriveGains, Contact) for field in kind._fields)
    require_name("${rule:...}", name, (*PERIODS, *STRIDE, *FOUND, *of_model))
    if name in FOUND:
        value = vars(read_machine(_root_))[name]
        return OmegaConf.create(value) if isinstance(value, list) else value
    robot = read_model(read_machine(_root_))
    basis = derive_basis(robot)
    if name in PERIODS:
        value = recommend_period(basis.ratio, _read_loop_delay(_root_), _find_pattern(_root_).gain)
        value = min(value, PERIODS[name], limit_period(robot))
    elif name in DriveGains._fields:
        value = derive_drive_gains(robot, _read_sampling(_root_))._asdict()[name]
    elif name in Contact._fields:
        value = derive_contact(basis, _read_number(_root_, PERIOD))._asdict()[name]
    else:
        gains = basis if name in Basis._fields else _derive_gains(basis, _root_)
        value = gains._asdict()[name]
    return float(f"{value:.{DIGITS}g}")


def _find_pattern(root: DictConfig) -> GaitPattern:
    name = OmegaConf.select(root, "gait.pattern")
    pattern = PATTERNS.get(name)
    if pattern is None or not pattern.stroke:
        fitting = listed([name for name, pattern in PATTERNS.items() if pattern.stroke])
        raise BadInput("gait.pattern", name, f"with machine.kind=robot choose from {fitting}")
    return pattern


def _choose_cycle(root: DictConfig) -> float:
    """Choose the duration of the cycle, s: that of the gait, or less if the stroke would be too long at the speed."""
    pattern = _find_pattern(root)
    longest = sum(read_model(read_machine(root)).links) * LONGEST_STROKE
    if OmegaConf.select(root, "gait.speed") is None:
        return pattern.cycle_time
    speed = _read_number(root, "gait.speed", least=0.0)
    duty = _read_number(root, "gait.duty_factor")
    fastest = longest / (duty * SHORTEST_CYCLE)
    require(
        speed <= fastest, "gait.speed", speed, f"must be at most {fastest:.3g} m/s, for legs that long and this gait"
    )
    multiple = math.floor(min(pattern.cycle_time, longest / max(speed * duty, 1e-9)) / CYCLE_STEP + 1e-9)
    return round(multiple * CYCLE_STEP, DIGITS)


def _choose_stroke(root: DictConfig) -> float:
    if OmegaConf.select(root, "gait.speed") is None:
        return _find_pattern(root).stroke
    speed = _read_number(root, "gait.speed", least=0.0)
    duty = _read_number(root, "gait.duty_factor")
    return float(f"{speed * duty * _read_number(root, 'gait.cycle_time'):.{DIGITS}g}")


def _choose_lift(root: DictConfig) -> float:
    highest = min(HIGHEST_LIFT, LIFT * sum(read_model(read_machine(root)).links))
    return round(highest * min(1.0, _read_number(root, "gait.cycle_time") / _find_pattern(root).cycle_time), 3)


def _choose_touch_downs(root: DictConfig) -> ListConfig:
    pattern = _find_pattern(root)
    duty = _read_number(root, "gait.duty_factor")
    phases = [round((start + slope * (duty - pattern.overlap)) % 1.0, DIGITS) for start, slope in pattern.touch_downs]
    return OmegaConf.create(phases)


STRIDE: dict[str, Callable[[DictConfig], float | ListConfig]] = {
    "cycle_time": _choose_cycle,
    "stroke": _choose_stroke,
    "lift": _choose_lift,
    "touch_down": _choose_touch_downs,
    "load_ramp": lambda root: round(
        max(
            RAMP_SHARE * _read_number(root, "gait.cycle_time"),
            SHORTEST_RAMP_TIME,
            SHORTEST_RAMP_SAMPLES * _read_number(root, PERIOD),
        ),
        DIGITS,
    ),
    "start_cycle": lambda root: (
        2 + math.ceil(_read_number(root, "plant.blend") / _read_number(root, "gait.cycle_time"))
    ),
}
"""Functions that derive the fields of the gait from its pattern, its speed and the length of the legs, and the first
cycle that learns, after those that ``plant.blend`` spoils and one of feedback only."""


def _derive_gains(basis: Basis, root: DictConfig) -> Gains:
    period = _read_number(root, PERIOD)
    loop_delay = _read_loop_delay(root)
    if OmegaConf.select(root, "controller.lead_omega") is None:  # a custom controller without a compensator
        return derive_gains(basis, period, 1.0, loop_delay)
    omega, alpha = (_read_number(root, f"controller.lead_{name}") for name in ("omega", "alpha"))
    return derive_gains(basis, period, discretise(omega, alpha, period).b0, loop_delay)


def _read_sampling(root: DictConfig) -> Sampling | None:
    """Read the delays of drives that compute once a command; None if the receiver of commands does not."""
    if not OmegaConf.select(root, "plant.bus.sampled"):
        return None
    period = _read_number(root, PERIOD)
    lag, latency = (_read_number(root, key, least=0.0) for key in ("actuator.lag", "machine.latency"))
    return make_sampling(period, round(_read_number(root, "actuator.delay", least=0.0)), lag, latency)


def _read_number(root: DictConfig, key: str, least: float = 1e-9) -> float:
    value = OmegaConf.select(root, key)
    is_number = isinstance(value, int | float) and not isinstance(value, bool) and least <= value < 1e9
    allowed = "above 0" if least else "of at least 0"
    require(is_number, key, value, f"must be a number {allowed}, from which others follow by rule")
    return float(value)


def _read_loop_delay(root: DictConfig) -> LoopDelay:
    """Read delay and lag of the velocity feedback loop: those of actuator and sensors, and ``machine.latency``.

    Fields that custom sensors lack count as 0.
    """

    def read(key: str) -> float:
        return 0.0 if OmegaConf.select(root, key) is None else _read_number(root, key, least=0.0)

    stages = ("actuator", "sensors.velocity")
    delays = ((round(read(f"{stage}.delay")), read(f"{stage}.lag")) for stage in stages)
    return add_delays(*delays, latency=read("machine.latency"))


def _require_robot(root: DictConfig) -> None:
    """Require a robot in MuJoCo, before its model is read, which may not be installed; raises BadInput."""
    kind = OmegaConf.select(root, "machine.kind")
    require(
        kind == "robot",
        "machine.kind",
        kind,
        "must be robot where settings follow from its model: use scenario=robot",
    )
    if find_option("plant", str(OmegaConf.select(root, "plant._target_"))) == "analytic":
        raise ask_for_robot(OmegaConf.select(root, "machine.model"))


def read_machine(root: DictConfig) -> RobotModel:
    """Read the fields of a config that define the model of its robot, and find in the model those that it leaves out.

    A field is left out if its value is the rule of its name. Rules are not resolved here, since they call this
    function. Raises BadInput.
    """
    _require_robot(root)
    plain: Any = OmegaConf.to_container(root.machine, resolve=False)
    values: dict[str, Any] = {}
    for name in (field.name for field in fields(RobotModel) if field.name in plain):
        if plain[name] != f"${{rule:{name}}}":
            is_reference = OmegaConf.is_interpolation(root.machine, name)
            value = OmegaConf.select(root, f"machine.{name}") if is_reference else plain[name]
            values[name] = read_field(RobotModel, name, value, f"machine.{name}")
    missing = [name for name in FOUND if name in plain and name not in values]
    return _find_missing(values, missing) if missing else RobotModel(**values)


def _find_missing(values: dict[str, Any], missing: Sequence[str]) -> RobotModel:
    """Find fields of a robot, by their names ``missing``, in its model; ``values`` are all others."""
    path = find_model(values["model"], values["path"])
    weld = values.get("weld", ())
    if "yaw" in missing:
        values["yaw"] = float(f"{find_yaw(path, weld, values.get('joints', ())):.{DIGITS}g}")
    if wanted := [name for name in Names._fields if name in missing]:
        given = {name: values[name] for name in Names._fields if name in values}
        names = find_names(path, weld, values.get("yaw", 0.0), **given)
        values |= {name: names._asdict()[name] for name in wanted}
    model = RobotModel(**values)
    if "rotor_inertia" not in missing or (robot := read_model(model)).armature.any():
        return model
    inertia = ROTOR_INERTIA * robot.mass * sum(robot.links) ** 2
    return replace(model, rotor_inertia=float(f"{inertia:.{ROTOR_DIGITS}g}"))


def find_mistake(error: BaseException | None) -> BadInput | None:
    """Return the BadInput among the causes of an error that OmegaConf raised while it resolved a rule, else None."""
    while error is not None and not isinstance(error, BadInput):
        error = error.__cause__ or error.__context__
    return error
