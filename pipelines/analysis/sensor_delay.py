"""Late torques: the lead that a delay of the actuator requires."""

from cmacexp.report.page import Drawing, Section, Table, Text
from pipelines.analysis import figures_sensors as figures
from pipelines.shared.runs import Runs
from pipelines.shared.study import Jobs

DELAYS = (0, 1, 2)
LEADS = ("0", "1", "auto")
CYCLES, LONG = 2000, 10000
WINDOW = 1000
"""The last cycles, over which nothing may grow."""
BOUND = 1.2
"""Largest error over the best, in the last cycles of a run that stays bounded."""


def jobs(quick: bool) -> Jobs:
    """One leg, learning for long."""
    leg = ["scenario=one_leg", "record.every_nth_step=600"]
    many = 120 if quick else CYCLES
    runs = {
        f"delay {delay} lead {lead}": [*leg, f"actuator.delay={delay}", f"learning.lead={lead}", f"cycles={many}"]
        for delay in (DELAYS[:2] if quick else DELAYS)
        for lead in (LEADS[::2] if quick else LEADS)
    }
    if not quick:
        for delay in DELAYS:
            long = [f"actuator.delay={delay}", "learning.lead=auto", f"cycles={LONG}"]
            runs[f"delay {delay} lead auto, long"] = [*leg, *long]
    return runs


def _same(good: list[str]) -> str:
    """Says so where lead 1 is bounded because that is what auto comes to."""
    return " (lead 1 where nothing is late, which is what auto comes to)" if "delay 0 lead 1" in good else ""


def sections(runs: Runs) -> list[Section]:
    """Delays and leads."""
    rows, good, bad = [], [], []
    for name, run in runs.items():
        if not name.startswith("delay"):
            continue
        y = 1e3 * run.metrics["transfer_rmse_y"]
        late = y.iloc[-WINDOW:]
        growth = float(late.max() / late.min())
        bounded = run.status == "completed" and growth <= BOUND
        (good if bounded else bad).append(name)
        delay, lead = run.config["actuator"]["delay"], run.config["learning"]["lead"]
        resolved = f"{lead} ({run.manifest['learning_lead']})" if lead == "auto" else str(lead)
        end = f"{run.status}, {len(y)} cycles"
        rows.append([str(delay), resolved, end, f"{y.min():.2f}", f"{y.iloc[-1]:.2f}", f"{growth:.2f}"])
    columns = [
        "delay, samples", "lead", "ends", "best y, mm", "last y, mm", f"worst over best of the last {WINDOW} cycles",
    ]  # fmt: skip
    kept = [name for name in good if "auto" in name]
    asked = [name for name in runs if name.startswith("delay") and "auto" in name]
    advice = Text(
        f"Of {len(asked)} runs with learning.lead=auto {len(kept)} stay bounded (at most {BOUND} times their own "
        f"best over the last {WINDOW} cycles); of those with "
        f"lead 0 or 1 {len(good) - len(kept)} of {len(good) + len(bad) - len(asked)}"
        f"{_same(good)}. Advice: give learning.lead=auto and say how late actuator and "
        "velocity sensors are: the lead is 1 for the sampling, plus that delay. Late positions need no lead, late "
        "velocities do: at the frequencies where a wrong lead makes errors grow, above 20 Hz, velocity is nearly all "
        "of the feedback."
    )
    drawing = Drawing(
        "delay",
        figures.delays({name: run for name, run in runs.items() if name.startswith("delay") and "long" not in name}),
        "Transfer error of one leg while it learns. A cross: the run diverged.",
    )
    table = Table(columns, rows, "One leg with delayed torques", text_columns=3)
    return [Section("Actuators that are late", [table, drawing, advice], beyond=True)]
