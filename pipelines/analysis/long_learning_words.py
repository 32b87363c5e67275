"""Captions, tables and advice of the study of long learning; every figure in them is that of its runs."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

from cmacexp.report.page import Table, Text
from pipelines.analysis.long_learning_runs import Long, best, final
from pipelines.analysis.measured import listed

if TYPE_CHECKING:
    import pandas as pd

WITHIN = 0.01
"""Tolerance of a predicted growth per cycle."""


def _number(value: float, digits: int = 3) -> str:
    return "-" if value != value else f"{value:.{digits}g}"


def _end(run: Long) -> str:
    return f"completed {run.cycles} cycles" if run.lasts else f"{run.status} in cycle {run.cycles + 1}"


def _name(run: Long) -> str:
    return f"{run.rule} with lead {run.lead}"


def table(runs: Sequence[Long]) -> Table:
    """Every rule and lead: best, final, end, drift."""
    walks = runs[0].tilt is not None
    rows = []
    for run in runs:
        least, at = best(run.error)
        values = [_number(least), str(at), _number(final(run.error)) if run.lasts else "-"]
        values += [_number(final(run.force)), _number(final(run.tilt))] if walks and run.tilt is not None else []
        values += [f"{run.share[-1]:.3f}", "lasts" if run.lasts else f"{run.status} in {run.cycles + 1}"]
        values += [f"{run.drift['cycle']}, {run.drift['named']}" if run.drift else "-"]
        rows.append([run.rule, run.lead, *values])
    columns = ["rule", "lead", "best, mm", "in cycle", "final, mm"]
    columns += ["force, N", "tilt, mrad"] if walks else []
    caption = (
        "Error in transfer (x and y together): least, and median of the last hundred cycles. Drift: since which "
        "cycle, and when it was detected."
    )
    return Table([*columns, "share", "ends", "drift"], rows, caption, 2)


def of_cycles(runs: Sequence[Long]) -> str:
    """Caption of the errors over the cycles."""
    asked = max(run.asked for run in runs)
    below = "the force error over the whole cycle" if runs[0].tilt is not None else "what learning still changes"
    return f"Errors over {asked} cycles, and {below}; a cross ends a run that fell or diverged."


def of_ends(runs: Sequence[Long]) -> str:
    """Caption of the map of rules and leads."""
    lasting = [run for run in runs if run.lasts]
    return f"{len(lasting)} of {len(runs)} combinations reach cycle {runs[0].asked}; blue: the error they end with."


def _never_worse(run: Long, last: int = 1000) -> float:
    return max(float(v[-last:].max() / v[-last:].min()) for v in (run.x, run.y))


def advice_leg(runs: Sequence[Long], aware: Long) -> list[Text]:
    """What to take for one leg."""
    lasting = sorted((run for run in runs if run.lasts), key=lambda run: final(run.error))
    if not lasting:
        return [Text("Advice: none of these lasts.")]
    paper = next((run for run in runs if run.rule == "paper" and run.lead == "0"), runs[0])
    one = next((run for run in runs if run.rule == "paper" and run.lead == "1"), lasting[0])
    summary = (
        f"The law as published {_end(paper)}; with lead 1 it ends at {final(one.x):.3f} mm in x and "
        f"{final(one.y):.2f} mm in y, never more than {_never_worse(one):.3f} times the best of the last thousand "
        f"cycles, with a share of the feedforward of {one.share[-1]:.3f}. With "
        f"reference=aware the force settles within {abs(aware.steady):.2%} of the desired one."
    )
    others = [_name(run) for run in lasting if run is not one]
    rest = f"Of the rest {listed(others[:4])}{' and others last' if len(others) > 4 else ' last'}." if others else ""
    least = lasting[0] if final(lasting[0].error) < ENOUGH * final(one.error) else one
    why = "with the smallest error" if least is lasting[0] else "no other is a tenth better"
    advice = (
        f"Advice: take {_name(least)}, {why} at the end ({final(least.error):.2g} mm). A rule that keeps the weights "
        "bounded is no substitute for the right lead: it pays for it with the error it leaves."
    )
    return [Text(f"{summary} {rest}"), Text(advice)]


def of_drift(runs: Sequence[Long]) -> str:
    """Caption of the figure of drift."""
    named = [run for run in runs if run.rule == "paper" and run.drift]
    summary = ", ".join(f"lead {r.lead}: cycle {r.drift['named']:.0f} of {r.cycles + 1}" for r in named if r.drift)
    return f"The paper's rule with other leads; a circle where drift was detected ({summary or 'none'})."


def advice_drift(runs: Sequence[Long]) -> Text:
    """How well drift predicts a divergence or fall."""
    ended = [run for run in runs if not run.lasts]
    detected = [run for run in ended if run.drift]
    lead = [run.cycles + 1 - run.drift["named"] for run in detected if run.drift]
    before = f", {np.median(lead):.0f} cycles before their end in the median" if lead else ""
    lasting = [run for run in runs if run.lasts]
    groups = {which: [run for run in lasting if bool(run.drift) == which] for which in (False, True)}
    worse = {which: _times_best(group) for which, group in groups.items()}
    return Text(
        f"Drift was detected in {len(detected)} of the {len(ended)} runs that diverged or fell{before}. Of the "
        f"{len(lasting)} runs that completed, {len(groups[False])} showed none; they end at {worse[False]} times "
        f"their best error in the median, the {len(groups[True])} others at {worse[True]} times. Advice: watch drift "
        "in the manifest instead of the errors; when it is detected the errors are still near their best, and "
        "learning can be stopped there."
    )


def _times_best(runs: Sequence[Long]) -> str:
    """Final over best error in the median; a dash of no runs."""
    return f"{np.median([final(run.error) / best(run.error)[0] for run in runs]):.2f}" if runs else "-"


def growth_table(runs: Sequence[Long]) -> pa.Table:
    """Growth per cycle, predicted and measured, of every run."""
    return pa.table(
        {
            "machine": ["one leg" if run.tilt is None else "quadruped" for run in runs],
            "rule": [run.rule for run in runs],
            "lead": [run.lead for run in runs],
            "predicted": [run.predicted for run in runs],
            "measured": [run.measured for run in runs],
        }
    )


def _misses(growth: "pd.DataFrame") -> "pd.Series[float]":
    return (growth["predicted"] - growth["measured"]).abs().dropna()


def of_growth(growth: "pd.DataFrame") -> str:
    """Caption of the growth figure."""
    misses = _misses(growth)
    return (
        f"Growth of the feedback's change per cycle; {int((misses <= WITHIN).sum())} of {len(misses)} predictions "
        f"are within {WITHIN:g} (dotted)."
    )


def _of_lead(growth: "pd.DataFrame", name: str, lead: str = "0") -> float:
    return float(growth[name].loc[growth["lead"] == lead].iloc[0])


def advice_growth(growth: "pd.DataFrame") -> Text:
    """How good the predictions are."""
    known = growth.dropna(subset=["predicted", "measured"])
    right = ((known["predicted"] > 1.0) == (known["measured"] > 1.0)).sum()
    own = known[known["rule"] == "paper"]
    summary = "".join(
        f" {str(machine).capitalize()} under the paper's rule: within {_misses(group).median():.1g} in the median "
        f"over the leads; as published {_of_lead(group, 'predicted'):.4f} predicted, "
        f"{_of_lead(group, 'measured'):.4f} measured."
        for machine, group in own.groupby("machine", sort=False)
        if (group["lead"] == "0").any()
    )
    return Text(
        f"The linearised loop predicts correctly in {right} of {len(known)} cases whether the feedback grows."
        f"{summary} Rules that change with the size of the error or with time are predicted less accurately: they "
        "are linearised at one cycle. Advice: run python -m cmacexp.stability DIR on a run of thirty cycles first."
    )


def of_late(runs: Sequence[Long]) -> str:
    """Caption of the map of delays."""
    return f"One leg, {max(run.asked for run in runs)} cycles, with delayed torques."


def advice_late(runs: Sequence[Long]) -> Text:
    """Which lead a delay needs."""
    delays = []
    for delay in sorted({run.delay for run in runs}):
        own = [run for run in runs if run.delay == delay and run.rule == "paper"]
        lasting = [run.lead for run in own if run.lasts]
        delays.append(f"{delay} late: {listed(lasting)} last" if lasting else f"{delay} late: none lasts")
    smooth = [run for run in runs if run.rule == "weight_smoothing"]
    kept = [
        f"{delay} late with {listed([run.lead for run in smooth if run.lasts and run.delay == delay])}"
        for delay in sorted({run.delay for run in smooth})
    ]
    return Text(
        f"Leads that last under the paper's rule: {'; '.join(delays)}. Weight smoothing: {'; '.join(kept)}. Advice: "
        "take learning.lead=auto, the number of samples from a torque to the feedback it causes."
    )


ENOUGH = 0.9
"""Fraction of the error of the paper's rule below which another rule is recommended."""
SMALL = 1.0
"""Error in transfer that counts as learnt, mm."""


def learnt(run: Long) -> float:
    """First cycle with an error of at most SMALL; NaN if there is none."""
    small = np.flatnonzero(run.error <= SMALL)
    return float(small[0] + 1) if len(small) else float("nan")


def rate_table(runs: Mapping[str, Long]) -> Table:
    """How fast learning is at other rates, and how it ends."""
    rows = []
    for name, run in runs.items():
        least, at = best(run.error)
        values = [_number(learnt(run)), _number(least), str(at), _number(final(run.error)) if run.lasts else "-"]
        rows.append([name, *values, _end(run), f"{run.drift['named']}" if run.drift else "-"])
    columns = ["rate", f"{SMALL:g} mm in cycle", "best, mm", "in cycle", "final, mm", "ends", "drift detected"]
    return Table(columns, rows, "One leg, the paper's rule at other rates; 0.195 is the paper's.")


def advice_rate(runs: Mapping[str, Long]) -> Text:
    """Which rate to take."""
    lasting = {name: run for name, run in runs.items() if run.lasts and not run.drift and learnt(run) == learnt(run)}
    if not lasting:
        return Text("Advice: none of these rates lasts.")
    fastest = min(lasting, key=lambda name: learnt(lasting[name]))
    drifting = [name for name, run in runs.items() if run.drift]
    return Text(
        f"Of what lasts, rate {fastest} is at {SMALL:g} mm first, in cycle {learnt(lasting[fastest]):.0f}. Drift at "
        f"{listed(drifting)}: a smaller rate delays divergence in proportion, it does not prevent it. Advice: choose "
        "the lead first; with it the paper's rate is safe, and the rate decides speed alone."
    )


def advice_walk(runs: Sequence[Long]) -> Text:
    """What to take for the quadruped."""
    lasting = sorted((run for run in runs if run.lasts), key=lambda run: final(run.force))
    if not lasting:
        return Text("Advice: none of these lasts.")
    one = lasting[0]
    return Text(
        f"{len(lasting)} of {len(runs)} walk to the end. Least force error: {_name(one)}, {final(one.force):.2f} N. "
        "Advice: take lead 1 under a body too, and give the force feedback more weight than the paper does (next "
        "section): with its gains learning hardly sees an error of force while four feet stand."
    )


def of_settings(runs: Mapping[str, Long]) -> str:
    """Caption of the figure of settings."""
    return (
        f"{max(run.asked for run in runs.values())} cycles. Ramp: a foot takes its desired force within 0.12 s; "
        "felt: elasticity and admittance 1e-3 instead of 1e-4."
    )


def advice_settings(runs: Mapping[str, Long]) -> list[Table | Text]:
    """The effect of each setting of the quadruped."""
    rows = []
    for name, run in runs.items():
        at = [f"{run.force[n - 1]:.2f}" if run.cycles >= n else "-" for n in (20, 100, 500, 2000)]
        worst = _number(float(run.force[100:].max())) if run.cycles > 100 else "-"
        tilt = _number(final(run.tilt)) if run.lasts and run.tilt is not None else "-"
        rows.append([name, *at, worst, tilt, "lasts" if run.lasts else f"{run.status} in {run.cycles + 1}"])
    lasting = {name: run for name, run in runs.items() if run.lasts}
    columns = ["settings", "cycle 20", "100", "500", "2000", "worst after 100", "tilt, mrad", "ends"]
    shown = Table(columns, rows, "Force error over the whole cycle, N, all legs.")
    if not lasting:
        return [shown, Text("Advice: none of these lasts.")]
    name = min(lasting, key=lambda n: final(lasting[n].force))
    run = lasting[name]
    worst = run.force[min(100, run.cycles - 1) :].max()
    advice = (
        f"Advice: take {name} (scenario=quadruped_lasting has ramp, felt and lead 1): it ends with "
        f"{final(run.force):.2f} N, and its force error stays below {worst:.2f} N from cycle 100 on."
    )
    return [shown, Text(advice)]


def seeds_table(runs: Mapping[str, Long]) -> Table:
    """Final errors over the seeds of the hash."""
    rows = []
    for machine in ("one leg", "quadruped"):
        own = [run for name, run in runs.items() if name.startswith(machine)]
        for what, unit, values in (
            ("transfer x", "mm", [final(run.x) for run in own]),
            ("transfer y", "mm", [final(run.y) for run in own]),
            ("force", "N", [final(run.force) for run in own]),
        ):
            span = [_number(v) for v in (min(values), float(np.median(values)), max(values))]
            rows.append([machine, what, unit, str(len(own)), str(sum(run.lasts for run in own)), *span])
    columns = ["machine", "error", "unit", "seeds", "last", "least", "median", "largest"]
    return Table(columns, rows, "Final errors with lead 1 (quadruped: ramp and felt), other seeds of the hash.", 3)


def advice_seeds(runs: Mapping[str, Long]) -> Text:
    """The effect of the seed of the hash."""
    lasting = sum(run.lasts for run in runs.values())
    return Text(
        f"{lasting} of {len(runs)} runs last. Advice: once the lead is right the seed of the hash does not decide "
        "whether learning lasts; judge other changes against the spread above."
    )
