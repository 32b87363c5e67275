"""What the guard of learning did in a run, in words, from the manifest."""

from collections.abc import Mapping
from typing import Any


def format_event(event: Mapping[str, Any]) -> str:
    """One event: what has acted since then, and why."""
    acts = f"the torque of cycle {event['restored']} acts" if event["restored"] else "feedback alone acts"
    return f"guard of learning: {acts} from here on ({event['cause']})"


def describe_guard(manifest: Mapping[str, Any]) -> str:
    """All events of a run in one line; empty if the guard did nothing."""
    return "; ".join(f"cycle {event['cycle']}: {format_event(event)}" for event in manifest.get("guard", ()))
