"""``python -m pipelines.benchmark``: compare methods that learn under contact, over tasks and worlds.

``--method my_file.MyClass`` adds your own feedforward or controller, ``--log LOG`` compares methods that learn from a
log: see ``docs/benchmark.md``.
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

ALL = "all"
"""Value of ``--machine`` that selects every machine."""
TRIALS = "trials"
"""Folder of stored outcomes, which later calls reuse, beside the reports of studies."""


def _write(machines: dict[str, Machine], methods: dict[str, Method], options: Options) -> Path:
    """Tune and test the methods, write table, JSON and page, and return the path of the page."""
    with options.start_workers() as workers:
        run_rows = partial(run_plan, machines, methods, workers.long, options.folder / TRIALS)
        chosen = tune(machines, methods, run_rows)
        frame = test(machines, methods, run_rows, chosen)
    results = Results([], {BENCHMARK: frame})
    first = next(iter(machines.values()))
    witnesses = [
        run_witness(list_overrides(first, methods[name], DEFAULT, first.draw(0)))
        for name in (() if options.quick else (ALONE, CMAC))
        if name in methods
    ]
    imported = {*find_sources("pipelines.benchmark.benchmark"), *find_sources("pipelines.perceptron")}
    digests = digest_files(sorted(imported.union(Path(__file__).parent.rglob("*.py"))), Path(__file__).parents[2])
    provenance = {
        **make_provenance(digests, results, witnesses, seeds=max(machine.worlds for machine in machines.values())),
        "runs": len(frame),
        "models": {name: find_model_hash(name) for name in machines if name in package_models()},
    }
    about = {  # code and models are in the provenance
        "version": VERSION,
        "quick": options.quick,
        "tasks_hash": hash_tasks(machines),
        "settings": {
            ", ".join(pair): {kind: text.split() for kind, text in settings.items()}
            for pair, settings in chosen.items()
        },
    }
    write_results(
        StudyFile(Path(__file__).with_name(f"{BENCHMARK}.py"), make_study(machines, methods)),
        results,
        options.choose_folder(BENCHMARK),
        options.quick,
        provenance,
        {f"{BENCHMARK}.json": json.dumps(about, indent=1) + "\n"},
    )
    return options.choose_folder(BENCHMARK) / HTML


def _refuse_in_vain(arguments: Arguments, used: Collection[str], form: str) -> None:
    """Refuse options that have no effect in this form of the command: only those ``used`` may be set.

    Raises:
        BadInput: another option differs from its default.
    """
    for name, option in {**OPTIONS, **LOG}.items():
        value = getattr(arguments, name.lstrip("-").replace("-", "_"))
        require(name in used or value == option.get("default"), name, value, f"has no effect {form}; leave it out")


def run(arguments: Arguments, options: Options) -> Path:
    """Run the benchmark or its log track, and return the path of the page."""
    if arguments.log is not None:
        log_options = ["--log"] if str(arguments.log) == log_track.SIMULATED else LOG
        _refuse_in_vain(arguments, ("--method", "--methods", *log_options), f"with --log {arguments.log}")
        return log_track.run(arguments, options)
    _refuse_in_vain(arguments, OPTIONS, "without --log")
    chosen = choose_names("--machine", arguments.machine, [*MACHINES, ALL])
    machines = {
        name: make_quick(MACHINES[name]) if options.quick else MACHINES[name]
        for name in (MACHINES if ALL in chosen else chosen)
    }
    methods = choose_methods(arguments.methods, arguments.method)
    warn_of_models(compose_config(machine.overrides).machine for machine in machines.values())
    return _write(machines, methods, options)


OPTIONS: OptionTable = {
    "--method": {
        "action": "append",
        "default": [],
        "metavar": "FILE.CLASS",
        "help": "add your own feedforward or controller; repeat the option for several classes",
    },
    "--methods": {"metavar": "NAME,...", "help": "methods of the benchmark to run (default: all)"},
    "--machine": {
        "default": LEG,
        "metavar": "NAME,...",
        "help": f"machines to run: {', '.join(MACHINES)}, or {ALL} (default: {LEG})",
    },
}
LOG: OptionTable = {
    "--log": {
        "type": Path,
        "metavar": "LOG",
        "help": f"run the log track on a log for python -m cmacexp.gap, or on the {log_track.SIMULATED} one",
    },
    "--robot": {"help": "robot of the log: an option of conf/machine, or an MJCF or URDF file"},
    **LOG_OPTIONS,
}


def main() -> NoReturn:
    """Run the command of the benchmark, and exit."""
    run_studies("pipelines.benchmark", QUESTION, run, {**OPTIONS, **LOG})


if __name__ == "__main__":
    main()
