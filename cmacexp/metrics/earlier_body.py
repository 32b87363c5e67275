"""True stability margins for a trace of the body that an earlier version wrote without them."""

from collections.abc import Mapping
from typing import Any, cast

import numpy as np
import pyarrow as pa
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from cmacexp.config.environment import PayloadConfig
from cmacexp.config.machine import QuadrupedMachine
from cmacexp.data.parquet import arrow, as_array
from cmacexp.data.signals import TRUE_MARGINS
from cmacexp.errors import BadRun
from cmacexp.planning.machine import make_mechanism
from cmacexp.planning.true_margins import Masses, true_margins
from cmacexp.plants.environment import make_payload


def _read_part(kind: type, values: Mapping[str, Any]) -> Any:
    """A part of the config in a manifest.

    Raises:
        BadRun: a field is missing or unknown.
    """
    try:
        return OmegaConf.to_object(OmegaConf.merge(OmegaConf.structured(kind), values))
    except OmegaConfBaseException as error:
        raise BadRun(f"config: {str(error).splitlines()[0]}; run it again with this version") from None


def add_true_margins(body: pa.Table, legs: pa.Table, config: Mapping[str, Any]) -> pa.Table:
    """The trace of a body with its true margins; unchanged if it has them.

    Args:
        body: one row per step.
        legs: rows of the same steps, one per leg.
        config: of the run, as in its manifest.

    Raises:
        BadRun: the config describes the machine in another way than this version.
    """
    if set(TRUE_MARGINS) <= set(body.column_names):
        return body
    machine = cast(QuadrupedMachine, _read_part(QuadrupedMachine, config["machine"]))
    no_payload = {"weight": 0.0, "x": 0.0, "y": 0.0, "time": 0.0}
    payload = make_payload(_read_part(PayloadConfig, config.get("payload", no_payload)), config["sampling_period"])
    mechanism = make_mechanism(machine)
    of_legs = {name: as_array(legs, name).reshape(-1, len(mechanism.legs)) for name in ("x", "y", "q1", "force")}
    of_body = {name: as_array(body, name) for name in ("pitch", "roll")}
    moves = "yaw" in body.column_names and bool(np.any(as_array(body, "yaw")))  # where the plant moves the body
    carried = as_array(body, "step") >= payload.start
    masses = Masses(mechanism, machine.body_mass if moves else None, payload.load, carried)
    found = true_margins(masses, of_legs, of_body)
    for name, values in zip(TRUE_MARGINS, found.T, strict=True):
        body = body.append_column(name, arrow(values, pa.float64()))
    return body
