"""The network of a stored run as C: ``cmac_leg.h``, ``cmac_leg.c``, and ``main.c``, which checks them.

Of a run only numbers enter the text, and words that are listed here or in the package.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from cmacexp.addons.export.network import Network, make_vectors, read_network
from cmacexp.cmac.addressing import RECEPTIVE_FIELDS
from cmacexp.cmac.rules import (
    DECAYING,
    MEAN,
    NO_GOAL,
    OUTSIDE_DEAD_ZONE,
    REGULARISED,
    RULES,
    ZERO_BY_ERROR,
)
from cmacexp.config.cmac import PHASE
from cmacexp.data.files import write_atomically
from cmacexp.data.folder import OUT_KEY
from cmacexp.data.own_files import require_own_file
from cmacexp.data.run import Run
from cmacexp.data.version import __version__
from cmacexp.models.mix import MULTIPLIER

FILES = ("cmac_leg.h", "cmac_leg.c", "main.c")
LAW_FILES = ("cmac_walk.h", "cmac_walk.c", "walk_main.c")
MARK = "cmacexp"
"""Text that identifies a file written by export, which may be overwritten."""
TITLES = {
    "cmac": "CMAC feedforward",
    "cmac_on_model": "CMAC feedforward on top of the torque of a model",
    "rbf": "Feedforward of radial basis functions",
}
GOAL_NAMES = {NO_GOAL: "", ZERO_BY_ERROR: "zero_by_error", MEAN: "mean"}
"""Names of the goals of learning rules in the template; any other goal is ``zero``."""
QUANTITIES = {"angle": ("rad", "m"), "velocity": ("rad/s", "m/s"), "acceleration": ("rad/s^2", "m/s^2")}
"""Units of planned inputs: for joints, and for a point mass, whose joints are its axes."""


def write_c(
    run: Run, folder: Path, single: bool = False, one_path: bool = False, law: dict[str, Any] | None = None
) -> Path:
    """Write the C code of a run's network into ``folder`` and return the path of the header.

    With ``one_path`` the code contains the cells of the planned path as a table instead of the addressing. ``law``,
    as from :func:`cmacexp.addons.export.c_law.describe_law`, implies that and adds the files of the control law; it
    requires double precision. Raises BadInput or BadRun.
    """
    network = read_network(run, one_path or law is not None)
    context = {
        **describe(network, single),
        "period": repr(float(run.config["sampling_period"])),
        **_list_tables(network),
        **make_vectors(network, single),
        **(law or {}),
    }
    files = FILES + LAW_FILES * (law is not None)
    texts = [_render(name, context, single) for name in files]
    folder.mkdir(parents=True, exist_ok=True)
    for name in files:
        require_own_file(folder / name, MARK.encode(), OUT_KEY)
    for name, text in zip(files, texts, strict=True):
        with write_atomically(folder / name) as temporary:
            temporary.write_text(text, encoding="ascii")
    return folder / (LAW_FILES[0] if law else FILES[0])


def format_real(value: Any, single: bool) -> str:
    """Format a number as a C constant of exactly this value, in single or double precision."""
    rounded = float(np.float32(value)) if single else float(value)
    text = repr(rounded) if rounded == round(rounded, 2) and abs(rounded) < 1e6 else rounded.hex()
    return text + "f" * single


def _render(name: str, context: dict[str, Any], single: bool) -> str:
    """Render the template of a C file."""
    from jinja2 import Environment, PackageLoader

    def text_of(value: Any) -> str:
        return format_real(value, single) if isinstance(value, float | np.floating) else str(int(value))

    def table(values: Iterable[Any], text: Any = text_of) -> str:
        words = [text(value) for value in values]
        return ",\n".join("    " + ", ".join(words[k : k + 8]) for k in range(0, len(words), 8))

    def matrix(rows: Any, text: Any = text_of) -> str:
        return ",\n".join("    {" + ", ".join(map(text, row)) + "}" for row in rows)

    environment = Environment(
        loader=PackageLoader("cmacexp.addons.export", ""),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.globals.update(
        real=lambda value: format_real(float(value), single),
        table=table,
        matrix=matrix,
        cube=lambda rows: ",\n".join("  {\n" + matrix(row) + "}" for row in rows),
        wide=lambda rows: matrix(rows, "UINT64_C({})".format),
        doubles=lambda rows: matrix(rows, lambda value: format_real(value, False)),
    )
    return environment.get_template(f"{name}.jinja").render(context, strength=format_real(context["factor"], single))


def describe(network: Network, single: bool) -> dict[str, Any]:
    """Return the template variables of a network, except its tables."""
    learning = network.params.learning
    rule = learning.rule
    one_path = not network.addresses
    legs, rows, joints = network.params.weights.shape
    samples, _, layers = network.params.cells.shape
    name = next(name for name, entry in RULES.items() if entry.params == rule._replace(strength=0.0))
    on_axes = network.setup.config.machine.kind == "point_mass"
    columns = ["x", "y"] if on_axes else [f"q{n + 1}" for n in range(joints)]
    small = rows <= 2**16 - bool(network.visited)
    size = 4 if single else 8
    state = size * (legs * rows * joints + 1) + 8
    if not one_path:  # the active cells of the last steps
        state += 8 + (learning.lead + 2) * legs * layers * ((2 if small else 4) + size * network.is_weighted)
    return {
        "title": TITLES[network.kind],
        "version": __version__,
        "precision": "single" if single else "double",
        "single": single,
        "legs": legs,
        "joints": joints,
        "inputs": network.inputs.shape[2],
        "layers": layers,
        "rows": rows,
        "samples": samples,
        "lead": learning.lead,
        "rate": float(learning.rate[0]),
        "ring": learning.lead + 2,
        "back": (-1 - learning.lead) % samples if one_path else 1,
        "one_path": one_path,
        "weighted": network.is_weighted,
        "field": next((key for key, value in RECEPTIVE_FIELDS.items() if value == network.field), ""),
        "visited": bool(network.visited),
        "bisections": rows.bit_length(),
        "hashed": not one_path and network.addresses[0].hashed,
        "seed": 0 if one_path else network.addresses[0].seed,
        "multiplier": MULTIPLIER,
        "blocks": 0 if one_path else network.addresses[0].resolution_elements,
        "quanta": 0 if one_path else (network.addresses[0].resolution_elements - 1) * layers,
        "rule": name,
        "source": RULES[name].source,
        "goal": GOAL_NAMES.get(rule.goal, "zero"),
        "teaches": "outside" if rule.teaches == OUTSIDE_DEAD_ZONE else "error",
        "regularised": rule.divisor == REGULARISED,
        "decays": rule.rate == DECAYING,
        "factor": rule.strength,
        "learnt": network.setup.learnt is not None,
        "known": network.model_torque is not None,
        "small": small,
        "unit": "N" if on_axes else "N m",
        "joint_line": f"columns {', '.join(columns)}; torques act in the direction in which they grow.",
        "input_lines": [*_list_inputs(network, columns, on_axes)],
        "state_bytes": -(-state // size) * size,
    }


def _list_inputs(network: Network, columns: list[str], on_axes: bool) -> Iterable[str]:
    """Yield meaning and unit of each input of a leg, in order."""
    for name in network.input_names:
        if name != PHASE:
            for column in columns:
                yield f"{name} of {column}, {QUANTITIES[name][on_axes]}"
    if PHASE in network.input_names:
        yield from ("cosine of the phase, 2 pi sample / CMAC_SAMPLES", "sine of the phase")


def _list_tables(network: Network) -> dict[str, Any]:
    """Return the tables of a network as template variables."""
    params = network.params
    legs, rows, joints = params.weights.shape
    flat = params.weights.reshape(legs * rows, joints)
    learnt = np.flatnonzero((flat != 0.0).any(axis=1))
    model_torque = network.model_torque
    tables: dict[str, Any] = {
        "learnt_rows": learnt.tolist(),
        "learnt_weights": flat[learnt],
        "model_torque": [] if model_torque is None else model_torque.reshape(len(model_torque), -1),
    }
    if not network.addresses:
        return tables | {"path_cells": params.cells, "path_activation": params.activation}
    padding = 2**64 - 1  # legs that visited fewer cells than others
    return tables | {
        "low": [address.ranges.low for address in network.addresses],
        "high": [address.ranges.high for address in network.addresses],
        "displacement": network.addresses[0].displacement,
        "visited_cells": [[*cells.tolist(), *[padding] * (rows - len(cells))] for cells in network.visited],
    }
