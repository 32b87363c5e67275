"""Tables of the public Python API: signatures and what they do, from the code."""

import inspect
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from importlib import import_module
from typing import Any

from docs.markdown import format_table

API: Mapping[str, Sequence[str]] = {
    "cmacexp": ("run", "load", "run_many", "write_many", "load_sweep", "open_loop", "Run"),
    "cmacexp.loop.stepwise": ("OpenLoop", "LoopState"),
    "cmacexp.gym": ("make", "LoopEnv"),
    "cmacexp.cmac": ("Cmac",),
    "cmacexp.study": (
        "Study", "grid", "starting_from", "declare", "Results", "Claim", "Finding", "Criterion", "at_most",
        "at_least", "between", "estimate", "over_cycles", "over_setting", "tabulate", "cross_tabulate",
    ),
    "cmacexp.addons.study.comparison": ("compare", "estimate_ratios", "find_order"),
    "cmacexp.report.figures": ("Series", "Panel", "draw"),
    "cmacexp.addons.export.tables": ("write_wide", "write_mcap"),
    "cmacexp.protocols": (
        "Plant", "Sensors", "Controller", "Feedforward", "Measurement", "RobotSignals", "Action", "Setup",
    ),
    "cmacexp.config": ("number", "choice", "FeedforwardConfig"),
    "cmacexp.errors": ("CmacexpError", "BadInput", "BadRun", "WithoutEffect"),
}  # fmt: skip
"""Public names by module."""


def format_signature(name: str, member: Any) -> str:
    """Format a call without types and ``self``; only the name of exceptions and protocols, which nobody calls."""
    if inspect.isclass(member) and (issubclass(member, BaseException) or getattr(member, "_is_protocol", False)):
        return name
    signature = inspect.signature(member)
    parameters = [
        parameter.replace(annotation=inspect.Parameter.empty) for parameter in signature.parameters.values()
    ]
    bound = [parameter for parameter in parameters if parameter.name not in ("self", "cls")]
    text = str(signature.replace(parameters=bound, return_annotation=inspect.Signature.empty))
    return name + re.sub(r"<[^,)]*>", "...", text)


def summarise(member: Any) -> str:
    """Return the first paragraph of the docstring, without the markup of references."""
    text = (inspect.getdoc(member) or "").partition("\n\n")[0]
    return re.sub(r":\w+:`~?(.*?)`", r"`\1`", text).replace("``", "`")


def list_members(owner: type) -> Iterator[tuple[str, str]]:
    """Yield a row for each public method and property that a class itself defines."""
    for name, member in vars(owner).items():
        if name.startswith("_"):
            continue
        if isinstance(member, property | cached_property):
            yield f"`.{name}`", summarise(member)
        elif isinstance(member, staticmethod | classmethod):
            yield f"`.{format_signature(name, member.__func__)}`", summarise(member.__func__)
        elif inspect.isfunction(member):
            yield f"`.{format_signature(name, member)}`", summarise(member)


def list_rows(module: str, names: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield a row for each public name of a module, followed by the members of classes."""
    for name in names:
        member = getattr(import_module(module), name)
        yield f"`{format_signature(name, member)}`", summarise(member)
        if inspect.isclass(member) and not issubclass(member, tuple):
            yield from list_members(member)


def format_api() -> str:
    """Format the tables of all public modules."""
    return "\n\n".join(
        f"### `{module}`\n\n{format_table(('name', 'does'), list_rows(module, names))}"
        for module, names in API.items()
    )
