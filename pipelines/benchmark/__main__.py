"""``python -m pipelines.benchmark``: how well methods learn under contact, over tasks and worlds.

``--method my_file.MyClass`` enters a feedforward or a controller of your own, ``--log LOG`` tries methods that
take a log: see ``docs/benchmark.md``.
"""

import json
from collections.abc import Collection
from functools import partial
from pathlib import Path
from typing import NoReturn

from cmacexp.addons.gap.command import LOG_OPTIONS
from cmacexp.addons.study.command import Options, run_studies, write_results
from cmacexp.addons.study.provenance import digest_files, make_provenance
from cmacexp.addons.study.study_file import StudyFile
from cmacexp.commands.command import Arguments, OptionTable
from cmacexp.config.component import find_sources
from cmacexp.config.compose import compose_config
from cmacexp.data.own_files import HTML
from cmacexp.errors import require
from cmacexp.models.robot_file import package_models
from cmacexp.study import Results
from cmacexp.terminal.messages import warn_of_models
from pipelines.benchmark import log_track
from pipelines.benchmark.benchmark import BENCHMARK, QUESTION, make_study
from pipelines.benchmark.entrants import (
    ALONE,
    CMAC,
    LEG,
    MACHINES,
    VERSION,
    Machine,
    Method,
    choose_methods,
    choose_names,
    hash_tasks,
    make_quick,
)
from pipelines.benchmark.results import DEFAULT, list_overrides, run_plan, test, tune
from pipelines.results import find_model_hash, run_witness

ALL, TRIALS = "all", "trials"
"""Every machine; the folder of outcomes, which are used again, beside the reports of studies."""


def _write(machines: dict[str, Machine], methods: dict[str, Method], options: Options) -> Path:
    """Tune and test; write table, JSON and page; returns the page."""
    with options.start_workers() as workers:
        run_rows = partial(run_plan, machines, methods, workers.long, options.folder / TRIALS)
        chosen = tune(machines, methods, run_rows)
        frame = test(machines, methods, run_rows, chosen)
    results = Results([], {BENCHMARK: frame})
    first, known = next(iter(machines.values())), () if options.quick else (ALONE, CMAC)
    witnesses = [
        run_witness(list_overrides(first, methods[name], DEFAULT, first.draw(0))) for name in known if name in methods
    ]
    imported = {*find_sources("pipelines.benchmark.benchmark"), *find_sources("pipelines.perceptron")}
    own = digest_files(sorted(imported.union(Path(__file__).parent.rglob("*.py"))), Path(__file__).parents[2])
    provenance = {
        **make_provenance(own, results, witnesses, seeds=max(each.worlds for each in machines.values())),
        "runs": len(frame),
        "models": {name: find_model_hash(name) for name in machines if name in package_models()},
    }
    about = {  # code and models are in the provenance
        "version": VERSION,
        "quick": options.quick,
        "tasks_hash": hash_tasks(machines),
        "settings": {
            ", ".join(place): {kind: text.split() for kind, text in own.items()} for place, own in chosen.items()
        },
    }
    file = StudyFile(Path(__file__).with_name(f"{BENCHMARK}.py"), make_study(machines, methods))
    write_results(
        file,
        results,
        options.choose_folder(BENCHMARK),
        options.quick,
        provenance,
        {f"{BENCHMARK}.json": json.dumps(about, indent=1) + "\n"},
    )
    return options.choose_folder(BENCHMARK) / HTML


def _refuse_in_vain(arguments: Arguments, used: Collection[str], form: str) -> None:
    """Refuse an option that a form of the command does not use; raises BadInput."""
    for name, option in {**OPTIONS, **LOG}.items():
        given = getattr(arguments, name.lstrip("-").replace("-", "_"))
        require(name in used or given == option.get("default"), name, given, f"has no effect {form}; leave it out")


def run(arguments: Arguments, options: Options) -> Path:
    """Run the benchmark or its log track; returns the page."""
    if arguments.log is not None:
        own = ["--log"] if str(arguments.log) == log_track.SIMULATED else LOG
        _refuse_in_vain(arguments, ("--method", "--methods", *own), f"with --log {arguments.log}")
        return log_track.run(arguments, options)
    _refuse_in_vain(arguments, OPTIONS, "without --log")
    chosen = choose_names("--machine", arguments.machine, [*MACHINES, ALL])
    names = MACHINES if ALL in chosen else chosen
    machines = {name: make_quick(MACHINES[name]) if options.quick else MACHINES[name] for name in names}
    methods = choose_methods(arguments.methods, arguments.method)
    warn_of_models(compose_config(machine.overrides).machine for machine in machines.values())
    return _write(machines, methods, options)


OPTIONS: OptionTable = {
    "--method": {
        "action": "append",
        "default": [],
        "metavar": "FILE.CLASS",
        "help": "a feedforward or controller of your own that takes part, as often as needed",
    },
    "--methods": {"metavar": "NAME,...", "help": "methods of the benchmark that take part (default: all)"},
    "--machine": {
        "default": LEG,
        "metavar": "NAME,...",
        "help": f"{', '.join(MACHINES)}, or {ALL} (default: {LEG})",
    },
}
LOG: OptionTable = {
    "--log": {
        "type": Path,
        "metavar": "LOG",
        "help": f"try methods that take a log on this one for python -m cmacexp.gap, or on {log_track.SIMULATED}",
    },
    "--robot": {"help": "of the log: an option of conf/machine, or an MJCF or URDF file"},
    **LOG_OPTIONS,
}


def main() -> NoReturn:
    """The command."""
    run_studies("pipelines.benchmark", QUESTION, run, {**OPTIONS, **LOG})


if __name__ == "__main__":
    main()
