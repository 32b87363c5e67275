"""The report of one run: its properties, metrics and settings as tables, and its figures."""

from collections.abc import Sequence
from pathlib import Path

from markupsafe import Markup

from cmacexp.config.describe import Described, describe_fields
from cmacexp.data.folder import require_no_link
from cmacexp.data.run import Run
from cmacexp.metrics.body import describe_load
from cmacexp.metrics.drift import describe_guard
from cmacexp.metrics.registry import ALL_METRICS, count_legs, format_cell, format_setting, pool_legs, select_main
from cmacexp.recording.run_view import RunView, count_kept
from cmacexp.report.page import REPORT, PageElement, Report, Section, Table, write_report
from cmacexp.report.run_figures import draw_body, draw_end, draw_metrics, draw_torques, draw_tracking
from cmacexp.terminal.messages import describe_drift
from cmacexp.typing import Status


def list_facts(run: Run) -> Table:
    """Tabulate the properties of a run: status, drift, guard, size, computing time, seed and versions."""
    manifest = run.manifest
    config = run.config
    per_step = 1e6 * manifest["rollout_seconds"] / manifest["steps"]
    facts = {
        "folder": str(run.folder),
        "ended": run.ending,
        "drift": describe_drift(run) or "not detected",
        "guard of learning": describe_guard(manifest) or f"{config['learning'].get('guard', 'none')}, did not act",
        "load of the feet": describe_load(manifest) or "as planned",
        "cycles": f"{run.whole_cycles} of {config['cycles']} requested, {config['gait']['cycle_time']:g} s each",
        "steps": f"{manifest['steps']} of {1e3 * config['sampling_period']:g} ms",
        "closed loop": f"{per_step:.2f} us a step, the whole run {manifest['wall_seconds']:.2f} s",
        "seed": str(manifest["seed"]),
        "commit": str(manifest["git_commit"] or "unknown")[:16],
        "versions": ", ".join(f"{name} {version}" for name, version in manifest["versions"].items()),
    }
    return Table(["property", "value"], [[key, value] for key, value in facts.items()])


def list_key_metrics(run: Run, cycles: Sequence[int]) -> Table:
    """Tabulate the main metrics in the given cycles."""
    pooled = pool_legs(run.scores)
    rows = []
    for name, display in select_main(pooled, count_legs(run.scores)).items():
        numbers = [format_cell(display.factor * pooled[name][cycle - 1]) for cycle in cycles]
        symbol, _, subscript = display.symbol.partition("_")
        title = Markup("{} <i>{}</i><sub>{}</sub>").format(display.title, symbol, subscript)
        rows.append([title, ALL_METRICS[name].meaning, display.unit, *numbers])
    caption = "Key metrics" + (", pooled over the legs" if run.walks else "")
    titles = ["metric", "meaning", "unit", *(f"cycle {cycle}" for cycle in cycles)]
    return Table(titles, rows, caption, cards=True)


def list_settings(run: Run) -> list[PageElement]:
    """List the overrides of a run as they were typed, and a table of its complete config."""
    fields = dict.fromkeys(run.settings, Described("", "")) | describe_fields(run.config)
    rows = [[k, format_setting(value), fields[k].unit, fields[k].meaning] for k, value in run.settings.items()]
    overrides = " ".join(run.manifest["overrides"] or ())
    set_for_run = f"Set for this run: {overrides}" if overrides else "Its manifest lists no overrides."
    return [
        set_for_run,
        Table(["setting", "value", "unit", "meaning"], rows, cards=True, folded=f"All {len(rows)} settings"),
    ]


def choose_cycles(run: Run) -> list[int]:
    """Choose the cycles to report: first, first with learning, middle and last of the complete cycles in the trace.

    Raises BadRun if the trace is empty.
    """
    kept = sorted(count_kept(run))
    whole = run.select_whole(kept) or kept[:1]
    learned = run.config["learning"]["start_cycle"] if run.manifest["memory"] else 1
    return sorted({whole[0], whole[(len(whole) - 1) // 2], whole[-1], *[c for c in whole if c >= learned][:1]})


def show_ending(run: Run) -> list[PageElement]:
    """Explain why a run fell or diverged, with its last steps if they are in the trace; empty for other runs."""
    if run.status not in (Status.FELL, Status.DIVERGED):
        return []
    ending = f"The run {run.ending}."
    last = run.last_cycle
    if last not in count_kept(run):
        return [ending]
    return [ending, draw_end(RunView(run, run.read_trace([max(last - 1, 1), last])))]


def make_run_report(run: Run) -> Report:
    """Make the report of a run with any status; raises BadRun if it has no readable trace."""
    cycles = choose_cycles(run)
    view = RunView(run, run.read_trace(cycles))
    sections: dict[str, Sequence[PageElement]] = {
        "In short": [list_key_metrics(run, cycles)],
        "How it ended": show_ending(run),
        "Over the cycles": [draw_metrics(run)] if run.last_cycle > 1 else [],
        "Over a cycle": draw_tracking(view),
        "The body": [draw_body(view)] if run.walks else [],
        "Feedback and feedforward": [draw_torques(view)],
        "Settings": list_settings(run),
        "The run": [list_facts(run)],
    }
    summary = f"The run {run.ending}. Cycles shown: {', '.join(map(str, cycles))}."
    request = {"runs": {str(run.folder.resolve()): run.manifest["config_hash"]}, "cycles": cycles}
    title = f"{run.config['scenario']}: {run.folder.resolve().name}"
    return Report(title, summary, [Section(heading, parts) for heading, parts in sections.items() if parts], request)


def write_run_report(run: Run) -> Path:
    """Write the report of a run into its folder; return the path of the page. Raises BadRun without a trace."""
    return write_report(make_run_report(run), require_no_link(run.folder / REPORT))
