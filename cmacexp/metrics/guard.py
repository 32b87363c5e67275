"""What the guard of learning did in a run, in words, from the manifest."""

from collections.abc import Mapping
from typing import Any


def format_event(event: Mapping[str, Any]) -> str:
    """One event: what acts since then, and why."""
    acts = f"the torque of cycle {event['restored']} acts" if event["restored"] else "feedback alone acts"
    return f"{acts} ({event['cause']})"


def describe_guard(manifest: Mapping[str, Any]) -> str:
    """All events of a run in one line, and where it learnt again; empty if the guard did nothing."""
    events = [(event["cycle"], format_event(event)) for event in manifest.get("guard", ())]
    again = [(each["cycle"], f"learns again with lead {each['lead']}") for each in manifest.get("lead_estimates", ())]
    return "; ".join(f"cycle {cycle}: {text}" for cycle, text in sorted(events + again[1:]))
