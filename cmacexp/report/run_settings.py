"""The settings of a run: those that are not the default first, all with their unit and meaning."""

from cmacexp.config.describe import Described, describe_fields, read_defaults
from cmacexp.config.difference import flat
from cmacexp.data.stored_run import StoredRun
from cmacexp.metrics.text import format_setting
from cmacexp.report.parts import Folded, Part, Section, Table

NOT_DECLARED = Described("", "")


def list_settings(run: StoredRun) -> Section:
    """The config of the run, compared with that of its scenario without any change."""
    settings, described = flat(run.config), describe_fields(run.config)
    scenario = str(run.config["scenario"])
    defaults = read_defaults(scenario)
    changed = [key for key, value in settings.items() if value != defaults.get(key)] if defaults else []

    def row(key: str, *more: str) -> list[str]:
        field = described.get(key, NOT_DECLARED)
        return [key, format_setting(settings[key]), *more, field.unit, field.meaning]

    parts: list[Part] = []
    if not defaults:
        parts.append(f"There is no scenario {scenario} here to compare with: changed settings are not marked.")
    elif not changed:
        parts.append(f"All {len(settings)} settings are the defaults of scenario={scenario}.")
    else:
        titles = ["setting", "value", f"default of {scenario}", "unit", "meaning"]
        rows = [row(key, format_setting(defaults[key]) if key in defaults else "not set") for key in changed]
        caption = f"{len(changed)} of {len(settings)} settings differ from the defaults of scenario={scenario}"
        parts.append(Table(titles, rows, caption, cards=True))
    marked = {index for index, key in enumerate(settings) if key in changed}
    note = "Those that differ from the default are marked." if changed else ""
    table = Table(["setting", "value", "unit", "meaning"], [row(key) for key in settings], note, True, marked)
    return Section("Settings", [*parts, Folded(f"All {len(settings)} settings", [table])])
