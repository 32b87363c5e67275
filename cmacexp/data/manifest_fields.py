"""What a manifest holds: its entries, declared as the fields of a config are, and what readers use of its config."""

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from pathlib import PurePosixPath
from typing import Any

from cmacexp.config import config_hash, to_plain
from cmacexp.config.component import COMPONENTS, ComponentConfig
from cmacexp.config.fields import choice, number, read_field, read_fields
from cmacexp.config.machine import LEG_KEYS, MACHINES
from cmacexp.config.schema import Config
from cmacexp.data.records import MOST, CarriedLoad, Drift, DroppedSensor, GuardEvent, LeadEstimate, MemoryUse
from cmacexp.errors import require, require_name
from cmacexp.models.chain import CHAIN_FIELDS
from cmacexp.typing import ENDS, RESULTS

REPORT, SWEEP = "report", "sweep"
"""Kinds of manifests that name a report and its runs, or a sweep and how it ended; a run has no kind."""
MAX_STEPS_PER_CYCLE = 1 << 32
READ = (
    "scenario",
    "sampling_period",
    "cycles",
    "gait.cycle_time",
    "terrain.stiffness",
    "terrain.slope",
    "terrain.slope_start",
    "machine.hip_height",
    "learning.start_cycle",
    "record.every_nth_step",
    "record.cycles",
    *(f"{group}._target_" for group in COMPONENTS),
)
"""Fields of a config that are read without simulating; all that its machine has are, too."""


@dataclass
class RobotGeometry:
    """Geometry of the legs of a robot, for views of its trace; raises BadInput unless there are four."""

    chains: list[list[float]] = number("m")
    """Chain of each leg, see :mod:`cmacexp.models.chain`."""
    hips: list[list[float]] = number("m")
    """Hips in the body frame, forward and left."""
    foot_radius: float = number("m")

    def __post_init__(self) -> None:
        for name, rows, size in (("chains", self.chains, CHAIN_FIELDS), ("hips", self.hips, 2)):
            fits = [len(row) for row in rows] == [size] * len(LEG_KEYS)
            require(fits, f"robot.{name}", rows, f"must have {size} numbers for each of {len(LEG_KEYS)} legs")


@dataclass
class SweepManifest:
    """How a sweep ended."""

    status: str
    config: dict[str, Any]
    """Only whether its jobs keep traces, ``record.trace``; empty if they do."""
    files: dict[str, str]
    """SHA-256 of the tables of jobs that have no folders, by name."""


@dataclass(kw_only=True)
class RunManifest:
    """What a run says of itself; entries with a default were not in those of all earlier versions."""

    status: str = choice(*ENDS)
    cause: str | None
    """Why it did not complete; empty if it did."""
    seed: Any
    config: dict[str, Any]
    """Its config as plain dictionaries; whatever could be composed, if it took no step."""
    config_hash: str
    """Hash of what changes the results, see :func:`cmacexp.config.config_hash`."""
    versions: dict[str, str]
    """Versions of this package, Python, and all that results can depend on."""
    git_commit: str | None
    """Commit of the checkout that ran it; None outside one."""
    steps: int = number("", at_least=0, at_most=MOST)
    """Steps that it took."""
    rollout_seconds: float = number("s", at_least=0)
    """Time of the closed loop alone, without compiling."""
    wall_seconds: float = number("s", at_least=0)
    """Time of the whole run."""
    files: dict[str, str]
    """SHA-256 of the files that it wrote, by name."""
    dropped: list[DroppedSensor] = field(default_factory=list)
    memory: list[MemoryUse] = field(default_factory=list)
    """Use of memory by each leg; empty if nothing learns."""
    drift: Drift | None = None
    """The first drift, with the growth in the last cycle."""
    processor_seconds: float | None = number("s", at_least=0, default=None)
    """Time that the closed loop took of all cores."""
    guard: list[GuardEvent] = field(default_factory=list)
    lead_estimates: list[LeadEstimate] = field(default_factory=list)
    learning_lead: int | None = number("samples", default=None)
    """What ``learning.lead`` gave."""
    learning_rate: float | None = number("", default=None)
    """What ``learning.rate`` gave."""
    carried: list[CarriedLoad] = field(default_factory=list)
    code_hash: str | None = None
    """Hash of this package's code on which results depend."""
    custom_code: str | None = None
    """Hash of the code of components of the user's own; None if there are none."""
    start_weights: str | None = None
    """SHA-256 of the weights that it started from."""
    model_hash: str | None = None
    """Hash of the model of a robot."""
    robot: RobotGeometry | None = None
    plant: Any = None
    """What the plant said of the run, see :class:`cmacexp.protocols.Plant`."""
    overrides: list[str] | None = None
    """Overrides from which its config was composed; None if it came whole."""
    traceback: str = ""
    """Traceback of an error that is no mistake of the input."""
    bad_input: bool | None = None
    """Whether the input is why the config gave no run; None: it gave one."""


def fill(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Entries of a manifest that was checked when it was written, with the defaults of those that it lacks."""
    return {**{each.name: [] if each.default is MISSING else each.default for each in fields(RunManifest)}, **entries}


def complete(plain: Any) -> dict[str, Any]:
    """A manifest, as read from its file, with all entries of :class:`RunManifest`, and those of later versions.

    That of a sweep has the entries of :class:`SweepManifest` at least. Raises BadInput if an entry is missing or not
    what it must be.
    """
    require(isinstance(plain, dict), "manifest", plain, "must be an object")
    kind = plain.get("kind")
    if kind == REPORT:  # for people: nothing else of it is read
        require(isinstance(plain.get("files", {}), dict), "files", plain.get("files"), "must be an object")
        return dict(plain)
    schema = SweepManifest if kind == SWEEP else RunManifest
    names = [each.name for each in fields(schema)]
    manifest: Any = read_fields(schema, {name: plain[name] for name in names if name in plain}, texts=False)
    for name in manifest.files:
        is_inside = name and PurePosixPath(name).name == name and "\0" not in name
        require(is_inside, "files", name, "must be names of files in its folder")
    if isinstance(manifest, RunManifest):
        is_own = manifest.config_hash == config_hash(manifest.config)
        require(is_own, "config", "(changed)", "is not the one of its config_hash")
        if manifest.files or manifest.steps or manifest.status in RESULTS:  # else its config can be anything
            _check_config(manifest.config)
    return {**plain, **to_plain(manifest)}


def _check_config(config: Mapping[str, Any]) -> None:
    """Check what readers use of a config by the fields that it has in this version; raises BadInput."""
    machine: Any = config.get("machine")
    kind: Any = machine.get("kind") if isinstance(machine, dict) else machine
    require_name("config.machine.kind", kind, tuple(MACHINES))
    schemas = {each.name: each.type for each in fields(Config)} | dict.fromkeys(COMPONENTS, ComponentConfig)
    schemas |= {"": Config, "machine": MACHINES[kind]}
    geometry = [f"machine.{each.name}" for each in fields(MACHINES[kind]) if each.name in machine]
    for key in (*READ, *geometry):
        group, _, name = key.rpartition(".")
        node: Any = config.get(group) if group else config
        require(isinstance(node, dict) and name in node, f"config.{key}", "(not set)", "must have a value")
        read_field(schemas[group], name, node[name], f"config.{key}", texts=False)
    steps = config["gait"]["cycle_time"] / config["sampling_period"]
    allowed = f"must have from 1 to {MAX_STEPS_PER_CYCLE} steps of config.sampling_period"
    require(0.5 < steps < MAX_STEPS_PER_CYCLE, "config.gait.cycle_time", config["gait"]["cycle_time"], allowed)
