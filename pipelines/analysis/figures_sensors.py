"""Figures of the study of sensors."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from cmacexp.data.stored_run import StoredRun
from cmacexp.report.style import DASHES, DESIRED, MARKERS, SERIES, label, new_figure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

MARGIN = 1.5
"""Seconds before and after a failure that are shown."""


def failures(rows: "pd.DataFrame") -> "Figure":
    """Share of failures survived and force error of the broken leg, over the gain, with and without the check."""
    figure, (left, right) = new_figure(1, 2, 2.6)
    broken = rows[(rows["kind"] != "sound") & (rows["feedforward"] == "cmac")]
    for check, colour, mark, name in (("none", SERIES[0], "o", "no check"), ("force", SERIES[1], "s", "checked")):
        own = broken[broken["check"] == check].groupby("gain")
        share = own["walks"].mean()
        left.semilogx(share.index, 100.0 * share, color=colour, marker=mark, label=name)
        quartiles = own["own"].quantile([0.25, 0.5, 0.75]).unstack()
        right.semilogx(quartiles.index, quartiles[0.5], color=colour, marker=mark)
        right.fill_between(quartiles.index, quartiles[0.25], quartiles[0.75], color=colour, alpha=0.2, lw=0)
    sound = rows[(rows["kind"] == "sound") & (rows["feedforward"] == "cmac") & rows["walks"]]
    right.semilogx(sound["gain"], sound["others"], color=DESIRED, label="sound machine")
    left.set_ylim(-4.0, 104.0)
    right.set_ylim(bottom=0.0)
    label(left, "survived", "P_fn, V_fn, m/N and m/(N s)", "failures survived, %")
    label(right, "broken leg: median and quartiles", "P_fn, V_fn, m/N and m/(N s)", "force rmse, N")
    left.legend(loc="lower left")
    right.legend(loc="lower left")
    return figure


def failure(runs: Mapping[str, StoredRun], leg: int, start: float) -> "Figure":
    """True and measured force of a leg around a failure, without and with the check."""
    figure, axes = new_figure(len(runs), 1, 1.7, sharex=True, sharey=True)
    for axis, (check, run) in zip(axes, runs.items(), strict=True):
        trace = run.trace
        near = (trace["leg"] == leg) & (trace["time"] > start - MARGIN) & (trace["time"] < start + 2.0 * MARGIN)
        shown = trace[near]
        axis.plot(shown["time"], shown["force_desired"], color=DESIRED, label="desired")
        axis.plot(shown["time"], shown["force"], color=SERIES[1], label="true")
        axis.plot(shown["time"], shown["force_measured"], color=SERIES[3], ls="--", label="measured")
        axis.axvline(start, color=SERIES[0], lw=0.8)
        for dropped in run.manifest["dropped"]:
            at = dropped["step"] * run.config["sampling_period"]
            axis.axvline(at, color=SERIES[2], ls=":")
            axis.annotate(" dropped", (at, axis.get_ylim()[1]), va="top", color=SERIES[2])
        label(axis, "no check" if check == "none" else "checked", "", "force, N")
    axes[-1].set_xlabel("time, s")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside right upper")
    return figure


def noise(rows: "pd.DataFrame", keys: Mapping[str, str]) -> "Figure":
    """Errors over the level of noise, a column for each signal and a row for each of ``keys``."""
    signals = [name for name in dict.fromkeys(rows["signal"]) if name != "sound"]
    figure, axes = new_figure(len(keys), len(signals), 1.7, sharex="col", sharey="row")
    sound = rows[rows["signal"] == "sound"].iloc[0]
    for n, (key, name) in enumerate(keys.items()):
        for m, signal in enumerate(signals):
            axis, own = axes[n * len(signals) + m], rows[rows["signal"] == signal].sort_values("level")
            axis.axhline(sound[key].mean, color=DESIRED)
            means, halves = (np.array([getattr(value, part) for value in own[key]]) for part in ("mean", "half"))
            axis.errorbar(own["level"], means, np.nan_to_num(halves), color=SERIES[m], marker=MARKERS[m], capsize=2)
            axis.set_xscale("log")
            axis.minorticks_off()
            ends = [own["level"].min(), own["level"].max()]
            axis.set_xticks(ends, [f"{level:g}" for level in ends])
            axis.set_ylim(0.0, 1.15 * max(value.mean + np.nan_to_num(value.half) for value in rows[key]))
            if n == 0:
                axis.set_title(signal)
            if m == 0:
                axis.set_ylabel(name)
    figure.supxlabel("level of the noise: of the force, rad, rad/s, m, rad", fontsize=8.5)
    return figure


def delays(runs: Mapping[str, StoredRun]) -> "Figure":
    """Transfer error over the cycles, a column for each delay."""
    late = sorted({run.config["actuator"]["delay"] for run in runs.values()})
    figure, axes = new_figure(1, len(late), 2.4, sharey=True)
    for axis, delay in zip(axes, late, strict=True):
        own = [run for run in runs.values() if run.config["actuator"]["delay"] == delay]
        for run, colour, dash in zip(own, SERIES, DASHES, strict=False):
            table = run.metrics
            lead = run.config["learning"]["lead"]
            axis.loglog(table["cycle"], 1e3 * table["transfer_rmse_y"], color=colour, ls=dash, label=f"lead {lead}")
            if run.status != "completed":
                last = table.iloc[-1]
                axis.plot(last["cycle"], 1e3 * last["transfer_rmse_y"], "x", color=colour, ms=7, mew=2.0)
        label(axis, f"delay {delay}", "cycle", "transfer y, mm" if delay == late[0] else "")
    axes[0].legend(loc="lower left")
    return figure
