"""Tables of the report of one run: its properties, metrics and settings."""

from collections.abc import Sequence

from markupsafe import Markup

from cmacexp.config.describe import Described, describe_fields, flatten_config, read_defaults
from cmacexp.data.run import Run
from cmacexp.metrics.body import describe_load
from cmacexp.metrics.drift import describe_guard, format_drift, read_drift_entry
from cmacexp.metrics.pooling import count_legs, pool_legs, select_main
from cmacexp.metrics.registry import ALL_METRICS
from cmacexp.metrics.text import format_cell, format_setting
from cmacexp.report.page_elements import Folded, PageElement, Section, Table


def list_facts(run: Run) -> Table:
    """How the run ended, its size, components, cost and versions."""
    manifest, config, drift = run.manifest, run.config, read_drift_entry(run.manifest["drift"])
    per_step = 1e6 * manifest["rollout_seconds"] / manifest["steps"]
    facts = {
        "folder": str(run.folder),
        "ended": run.ending,
        "drift": format_drift(drift, at_end=True) if drift else "not detected",
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
    """The main metrics in the cycles that are shown."""
    pooled = pool_legs(run.scores)
    rows = []
    for name, shown in select_main(pooled, count_legs(run.scores)).items():
        numbers = [format_cell(shown.factor * pooled[name][cycle - 1]) for cycle in cycles]
        symbol, _, below = shown.symbol.partition("_")
        title = Markup("{} <i>{}</i><sub>{}</sub>").format(shown.title, symbol, below)
        rows.append([title, ALL_METRICS[name].meaning, shown.unit, *numbers])
    caption = "Key metrics" + (", pooled over the legs" if run.walks else "")
    titles = ["metric", "meaning", "unit", *(f"cycle {cycle}" for cycle in cycles)]
    return Table(titles, rows, caption, cards=True)


def list_settings(run: Run) -> Section:
    """The config of the run, compared with that of its scenario without any change."""
    settings, described = flatten_config(run.config), describe_fields(run.config)
    scenario = str(run.config["scenario"])
    defaults = read_defaults(scenario)
    changed = [key for key, value in settings.items() if value != defaults.get(key)] if defaults else []

    def row(key: str, *more: str) -> list[str]:
        field = described.get(key, Described("", ""))
        return [key, format_setting(settings[key]), *more, field.unit, field.meaning]

    parts: list[PageElement] = []
    if not defaults:
        parts.append(f"There is no scenario {scenario} here to compare with: changed settings are not listed.")
    elif not changed:
        parts.append(f"All {len(settings)} settings are the defaults of scenario={scenario}.")
    else:
        titles = ["setting", "value", f"default of {scenario}", "unit", "meaning"]
        rows = [row(key, format_setting(defaults[key]) if key in defaults else "not set") for key in changed]
        caption = f"{len(changed)} of {len(settings)} settings differ from the defaults of scenario={scenario}"
        parts.append(Table(titles, rows, caption, cards=True))
    table = Table(["setting", "value", "unit", "meaning"], [row(key) for key in settings], cards=True)
    return Section("Settings", [*parts, Folded(f"All {len(settings)} settings", [table])])
