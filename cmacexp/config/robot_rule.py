"""``${rule:NAME}`` in a config: what the model of a robot and the rule for its gains say, as a number.

It is resolved wherever the config is read, so that it follows machine, sampling period, LEAD compensator, sensors and
actuator, and so that whoever types a number instead asks for nothing of the rule.
"""

from dataclasses import fields
from typing import Any

from omegaconf import DictConfig, OmegaConf

from cmacexp.config.component import find_option
from cmacexp.config.fields import check_fields, make_config
from cmacexp.config.machine import RobotModel, ask_for_robot, read_model
from cmacexp.errors import BadInput
from cmacexp.models.lateness import Lateness, add_up
from cmacexp.models.lead import discretise
from cmacexp.models.robot_gains import Basis, Gains, choose_period, derive_basis, derive_gains

PERIOD = "sampling_period"
DIGITS = 6
"""Significant digits of a number by rule: the config, and its hash, are the same with another MuJoCo."""


def rule_value(name: str, _root_: DictConfig) -> float:
    """The value of ``${rule:NAME}``.

    Args:
        name: ``sampling_period``, or a field of :class:`cmacexp.models.robot_gains.Basis` or
            :class:`cmacexp.models.robot_gains.Gains`.
        _root_: the config.

    Raises:
        BadInput: there is no such name, the machine is no robot, or the rule does not serve it.
    """
    names = (PERIOD, *Basis._fields, *Gains._fields)
    if name not in names:
        raise BadInput("${rule:...}", name, f"choose from {', '.join(names)}")
    robot = read_model(_read_machine(_root_))
    basis = derive_basis(robot)
    if name == PERIOD:
        value = choose_period(robot, _read_lateness(_root_))
    else:
        value = getattr(basis if name in Basis._fields else _derive_gains(basis, _root_), name)
    return float(f"{value:.{DIGITS}g}")


def _derive_gains(basis: Basis, root: DictConfig) -> Gains:
    period, lateness = _read_number(root, PERIOD), _read_lateness(root)
    if OmegaConf.select(root, "controller.lead_omega") is None:  # a custom controller without a compensator
        return derive_gains(basis, period, 1.0, lateness)
    omega, alpha = (_read_number(root, f"controller.lead_{name}") for name in ("omega", "alpha"))
    return derive_gains(basis, period, discretise(omega, alpha, period).b0, lateness)


def _read_number(root: DictConfig, key: str, least: float = 1e-9) -> float:
    value = OmegaConf.select(root, key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value < 1e9:
        allowed = "above 0" if least else "of at least 0"
        raise BadInput(key, value, f"must be a number {allowed}, from which gains follow by rule")
    return float(value)


def _read_lateness(root: DictConfig) -> Lateness:
    """Of the velocity feedback, by actuator and sensors; custom sensors may lack these fields."""

    def read(key: str) -> float:
        return 0.0 if OmegaConf.select(root, key) is None else _read_number(root, key, least=0.0)

    stages = ("actuator", "sensors.velocity")
    return add_up(*((round(read(f"{stage}.delay")), read(f"{stage}.lag")) for stage in stages))


def _read_machine(root: DictConfig) -> RobotModel:
    """The fields that say which robot it is, of the types that they must have."""
    kind = OmegaConf.select(root, "machine.kind")
    if kind != "robot":
        raise BadInput("machine.kind", kind, "must be robot where settings follow from its model: choose machine=go1")
    names = [field.name for field in fields(RobotModel)]
    given: Any = OmegaConf.to_container(OmegaConf.masked_copy(root.machine, names), resolve=True)
    model: RobotModel = make_config(RobotModel, given, "machine")
    check_fields(model, "machine")
    if find_option("plant", str(OmegaConf.select(root, "plant._target_"))) == "analytic":
        raise ask_for_robot(model)  # before the model is looked up, which may not be installed
    return model


def find_mistake(error: BaseException | None) -> BadInput | None:
    """The mistake of the user among the causes of an error that OmegaConf raised while it resolved a rule, if any."""
    while error is not None and not isinstance(error, BadInput):
        error = error.__cause__ or error.__context__
    return error


def register_rule() -> None:
    """Make ``${rule:NAME}`` known to OmegaConf."""
    OmegaConf.register_new_resolver("rule", rule_value, replace=True)
