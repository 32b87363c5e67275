"""The report of one run."""

from pathlib import Path

from cmacexp.data.folder import require_no_link
from cmacexp.data.integrity import faults
from cmacexp.data.run import Run
from cmacexp.data.tables import TABLES
from cmacexp.data.trace import count_steps_by_cycle
from cmacexp.errors import BadRun
from cmacexp.report.cycle_data import read_cycle_data
from cmacexp.report.page import REPORT, Report, write_report
from cmacexp.report.page_elements import Section
from cmacexp.report.run_figures import draw_body, draw_end, draw_metrics, draw_torques, draw_tracking
from cmacexp.report.run_tables import list_facts, list_key_metrics, list_settings


def require_whole(run: Run) -> None:
    """Refuse a run whose tables are missing or changed, or that took no step; raises BadRun."""
    for fault in faults(run.folder):
        name, _, problem = fault.partition(": ")
        if name in TABLES:
            raise BadRun(f"{run.folder / name}: {problem}; run it again to report it")
    if not run.manifest["steps"]:
        raise BadRun(f"{run.folder}: the run took no step")


def _read_cycles(run: Run) -> list[int]:
    kept = sorted(count_steps_by_cycle(run.folder))
    if not kept:
        raise BadRun(f"{run.folder}: its trace holds no step; run it again without record.cycles")
    return kept


def choose_cycles(run: Run) -> list[int]:
    """The cycles to show: the first, the first that learned, the middle and the last whole one; raises BadRun."""
    kept = _read_cycles(run)
    whole = run.select_whole(kept) or kept[:1]
    learned = run.config["learning"]["start_cycle"] if run.manifest["memory"] else 1
    candidates = {whole[0], whole[(len(whole) - 1) // 2], whole[-1], *[c for c in whole if c >= learned][:1]}
    return sorted(candidates)


def _end(run: Run) -> list[Section]:
    if run.status not in ("fell", "diverged"):
        return []
    last = run.last_cycle
    ending = f"The run {run.ending}."
    if last not in _read_cycles(run):
        return [Section("How it ended", [ending])]
    data = read_cycle_data(run, [max(last - 1, 1), last])
    return [Section("How it ended", [ending, draw_end(data, run.status)])]


def make_run_report(run: Run) -> Report:
    """The report of a run that ended, with any status; raises BadRun."""
    require_whole(run)
    cycles = choose_cycles(run)
    data = read_cycle_data(run, cycles)
    body = [Section("The body", [draw_body(data)])] if run.walks else []
    sections = [
        Section("In short", [list_key_metrics(run, cycles)]),
        *_end(run),
        *([Section("Over the cycles", [draw_metrics(run)])] if run.last_cycle > 1 else []),
        Section("Over a cycle", draw_tracking(data)),
        *body,
        Section("Feedback and feedforward", [draw_torques(data)]),
        list_settings(run),
        Section("The run", [list_facts(run)]),
    ]
    shown = ", ".join(map(str, cycles))
    summary = f"The run {run.ending}. Cycles shown: {shown}."
    inputs = [run.folder / name for name in TABLES if name in run.manifest["files"]]
    asked_for = {"runs": {str(run.folder.resolve()): run.manifest["config_hash"]}, "cycles": cycles}
    return Report(f"{run.config['scenario']}: {run.folder.resolve().name}", summary, sections, inputs, asked_for)


def write_run_report(run: Run) -> Path:
    """Write the report of one run into its folder; returns the page. Raises BadRun."""
    return write_report(make_run_report(run), require_no_link(run.folder / REPORT))
