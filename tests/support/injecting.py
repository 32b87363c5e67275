"""``python injecting.py FAULTS EVERY FOLDER [COMMAND...]``: lets system calls of commands fail, or kills them there.

A command is a fork of this process, which has imported everything. Undisturbed, strace lists its calls that change
what is below its folder. Then for every EVERYth of these calls the command begins again, with the same earlier result
and files of others around it, and strace injects the next of the FAULTS there: ``error=EIO``, or ``signal=KILL``
before the call. A line for each says ``fine``, ``missed`` if the command did not come to that call, or what is wrong
after it, or after the same command undisturbed.
"""

import json
import os
import pickle
import re
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib import import_module
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import command
import pyarrow.parquet as pq
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from server import IMPORTED

from cmacexp.addons.study import command as studies
from cmacexp.data.folder import TABLE_CSV
from cmacexp.data.integrity import faults
from cmacexp.data.manifest import MANIFEST, REPORT, RUNS_FILE, SWEEP
from cmacexp.data.own_files import HTML
from cmacexp.engine.workers import Here

CALLS = (
    "rename,renameat,renameat2,link,linkat,symlink,mkdir,mkdirat,unlink,unlinkat,rmdir,open,openat,write,pwrite64,"
    "writev,fsync,fdatasync,fallocate,ftruncate,copy_file_range,sendfile"
)
"""System calls that change files."""
CALL = re.compile(r'(\d+) +(\w+)\((?:[\w-]+<([^>]*)>)?(?:, )?(?:"([^"]*)")?(.*)')
"""A line of strace: thread, call, the file of its descriptor, path, the rest."""
PAGES = {REPORT: HTML, SWEEP: TABLE_CSV}
"""Files that tell a result from another, by its kind; runs have hashes."""
MOST_LINES, WORKERS = 12, 2
STUDY = """
from cmacexp.study import *
STUDY = Study(title="{0}", question="Q", tables={{"t": lambda results: results.table}}, findings={{}},
    runs=lambda quick: grid("scenario=force_step", "cycles=1", over={{"gait.cycle_time": [{0}]}}))
"""
NOTES = [
    f"{folder}{name}" for folder in ("", "sweep/", "studies/", "studies/runs/") for name in ("notes.txt", ".notes")
]
OTHERS = {
    **dict.fromkeys(NOTES, "of others"),
    **{f"first/made.{end}": text for end, text in {"py": STUDY.format(0.9), "md": "{{ table('t') }}"}.items()},
    **{f"second/made.{end}": text for end, text in {"py": STUDY.format(1.0), "md": "{{ table('t') }}"}.items()},
}
"""Files of others around the results."""
SHORT = ["scenario=force_step", "cycles=1", "warn=false", "hydra/launcher=basic"]
REPORT_TO, STUDY_IN = ["report", "--out", "page"], ["study", "--folder", "studies"]
RESUME, REFUSED, SWEEP_DIR = "sweep.resume=true", "refused", f"hydra.sweep.dir={SWEEP}"
TRACE, METRICS, RECORDING = "record=trace", "record=metrics", "record=full"
State = dict[str, list[Any]]
"""Status and content of each visible result, by its place below a folder."""


def run(seconds: float, folder: str = "out", record: str = TRACE) -> list[str]:
    return ["main", *SHORT, f"gait.cycle_time={seconds}", record, f"hydra.run.dir={folder}"]


def sweep(seconds: str, *more: str) -> list[str]:
    return ["main", "-m", *SHORT, f"gait.cycle_time={seconds}", SWEEP_DIR, *more]


COMMANDS = {
    "run": ([], run(1.0)),
    "rerun": ([run(0.9)], run(1.0)),
    "recording": ([run(0.9, record=RECORDING)], run(1.0, record=RECORDING)),
    REFUSED: ([run(0.9)], run(1.0)),
    "sweep": ([], sweep("1.0,1.1")),
    "resweep": ([sweep("0.8,0.9")], sweep("1.0,1.1")),
    "metrics": ([sweep("0.8,0.9", METRICS)], sweep("1.0,1.1", METRICS)),
    "resume": ([sweep("0.9")], sweep("0.9,1.0", RESUME)),
    "resume-metrics": ([sweep("0.9", METRICS)], sweep("0.9,1.0", METRICS, RESUME)),
    "report": ([run(0.9, "a"), run(1.0, "b"), [*REPORT_TO, "a"]], [*REPORT_TO, "b"]),
    "study": ([[*STUDY_IN, "first/made.py"]], [*STUDY_IN, "second/made.py"]),
}
"""What runs before, and the command, by a name; one is refused for a file of others in the folder of a result."""


class Case(NamedTuple):
    """A command, and what there is without a disturbance."""

    name: str
    begun: Path
    """A folder to copy, in which it is about to begin."""
    before: State
    after: State
    calls: list[tuple[str, int]]
    """Those to disturb: their names, and how many of the name there were in the thread until then."""


def forked(work: Callable[[], int]) -> int:
    """Fork a process that does ``work``, whose exit code is what that gives."""
    process = os.fork()
    if not process:
        try:
            code = work()
        except BaseException as error:
            print(repr(error), file=sys.stderr)
            code = 99
        sys.stdout.flush()
        os._exit(code)
    return process


def end_of(process: int) -> int:
    """Wait for the exit code of a process; negative if it was killed."""
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


def begin(words: Sequence[str], root: Path, stops: bool = False) -> int:
    """Start a command in a process of its own, which first ``stops`` itself if asked to; gives that process."""

    def work() -> int:
        if stops:
            os.kill(os.getpid(), signal.SIGSTOP)
        done = command.call(*words, folder=root)
        root.with_suffix(".errors").write_text(done.stderr)
        return done.returncode

    return forked(work)


def trace(words: Sequence[str], root: Path, *options: str) -> tuple[int, list[tuple[str, ...]]]:
    """Run a command with strace: its exit code, and its calls as :data:`CALL` has them."""
    log, process = root.with_suffix(".calls"), begin(words, root, stops=True)
    os.waitpid(process, os.WUNTRACED)
    tracer = ["strace", "-f", "-y", "-s", "0", "-o", str(log), *options, "-p", str(process)]
    with subprocess.Popen(tracer, stderr=subprocess.PIPE, text=True) as started:
        started.stderr.readline()  # it is attached
        os.kill(process, signal.SIGCONT)
        code = end_of(process)
        started.communicate()
    return code, [found.groups("") for found in map(CALL.match, log.open()) if found]


def is_change(call: Sequence[str], root: Path) -> bool:
    """Whether a call changes something below a folder."""
    _, name, opened, path, rest = call
    is_read = name.startswith("open") and not re.search("O_WRONLY|O_RDWR|O_CREAT", rest)
    return bool(opened or path) and (root / opened / path).is_relative_to(root) and not is_read


def list_calls(calls: Sequence[Sequence[str]], root: Path) -> Iterator[tuple[str, int]]:
    """Those that change something; of many in a row on one file the first, one amid them, and the last."""
    counts, found = Counter[tuple[str, str]](), []
    for call in calls:
        thread, name, *file, _ = call
        counts[thread, name] += 1
        if is_change(call, root):
            found.append((name, counts[thread, name], file))
    for _, alike in groupby(found, lambda each: (each[0], each[2])):
        row = [(name, when) for name, when, _ in alike]
        yield from dict.fromkeys([row[0], row[len(row) // 2], row[-1]])


def read_state(root: Path) -> State:
    """Read all visible results below a folder; raises AssertionError if one is not whole."""
    state = {}
    for path in root.rglob("*"):
        place, folder = path.relative_to(root), path.parent
        if path.is_dir() or any(part.startswith(".") for part in place.parts):
            continue
        if path.suffix == ".parquet":
            assert pq.ParquetFile(path, pre_buffer=False).read(use_threads=False).num_columns, place
            if folder == root / SWEEP and path.name != RUNS_FILE:  # which has times in it
                state[str(place)] = ["table", path.read_bytes()]
        elif path.name == MANIFEST:
            manifest = json.loads(path.read_text())
            assert not (found := faults(folder)), f"{place}: {found}"
            page = folder / PAGES.get(manifest.get("kind"), "")
            held = manifest["files"] if page == folder else page.read_text() if page.exists() else None
            state[str(place.parent)] = [manifest["status"], held]
    return state


def read_others(root: Path, name: str) -> set[tuple[Path, bytes]]:
    """Read the files of others below a folder; where a command is refused, all files are."""
    paths = root.rglob("*") if name == REFUSED else map(root.joinpath, OTHERS)
    return {(path.relative_to(root), path.read_bytes()) for path in paths if path.is_file()}


def is_right(place: str, case: Case, now: State, is_killed: bool) -> bool:
    """Whether a place holds the earlier result or the new one, or what may be there besides."""
    held, earlier, beside = now.get(place), case.before.get(place), re.fullmatch(r"(.*)\.earlier[^/]*", place)
    if held is None:  # it was about to be replaced, or never made
        return earlier == now.get(f"{place}.earlier")
    if held in (earlier, case.after.get(place)) or (beside and held == case.before.get(beside[1])):
        return True
    is_of_sweep = place == SWEEP or held[0] == "table"  # it tells of jobs that failed, too
    return held[0] != "completed" and (is_of_sweep or not (earlier or is_killed))


def list_wrong(case: Case, root: Path, code: int, is_again: bool = False) -> Iterator[str]:
    """What is wrong after a command that ended so, disturbed, or when it came ``again`` undisturbed."""
    is_killed, errors = code == -signal.SIGKILL, root.with_suffix(".errors").read_text().splitlines()
    told = sum(line.startswith("error: ") for line in errors)
    is_told = told > 0 if SWEEP_DIR in COMMANDS[case.name][1] else told == 1  # each job has its own
    expected = (2,) if case.name == REFUSED else (0,) if is_again else (0, 1, 2)
    if not is_killed and (code not in expected or (code > 0 and not is_told) or (code == 0 and told)):
        yield f"exit code {code} with {told} errors"
    if not is_killed and ("Traceback" in str(errors) or len(errors) > MOST_LINES):
        yield f"prints {errors}"
    if lost := read_others(case.begun, case.name) - read_others(root, case.name):
        yield f"files of others lost, e.g. {min(lost)[0]}"
    try:
        now = read_state(root)
    except Exception as error:
        yield f"not whole: {error}"
        return
    missing = [place for place in case.after if code == 0 and now.get(place) != case.after[place]]
    strange = [place for place in {*case.before, *now} if not is_right(place, case, now, is_killed)]
    for place in {*missing, *strange}:
        yield f"{place}: {now.get(place, ['absent'])[0]}, neither the earlier nor the new one"


def copy(source: Path, root: Path) -> None:
    """Make a folder a copy of another."""
    shutil.rmtree(root, ignore_errors=True)
    shutil.copytree(source, root)


def disturb(case: Case, root: Path, call: str, when: int, how: str) -> int:
    """Begin a command anew with a disturbance of one call, and then once more without; prints what was wrong."""
    words = COMMANDS[case.name][1]
    copy(case.begun, root)
    code, calls = trace(words, root, "-e", f"trace={call}", "-e", f"inject={call}:{how}:when={when}")
    if code == -signal.SIGKILL or any("(INJECTED)" in each[-1] and is_change(each, root) for each in calls):
        wrong = [*list_wrong(case, root, code)]
        again = end_of(begin(words, root))
        wrong += [f"again {text}" for text in list_wrong(case, root, again, is_again=True)]
    else:
        wrong = ["missed"]
    line = f"{case.name} {call}:{how}:when={when} exit {code}: {'; '.join(wrong) or 'fine'}\n"
    os.write(sys.stdout.fileno(), line.encode())  # at once: another worker writes too
    return 0


def prepare(name: str, root: Path) -> Case:
    """Make the folder in which a command begins, and run it undisturbed."""
    before, words = COMMANDS[name]
    shutil.rmtree(root, ignore_errors=True)
    for path, text in OTHERS.items():
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_text(text)
    for each in before:
        assert end_of(begin(each, root)) == 0, root.with_suffix(".errors").read_text()
    if name == REFUSED:
        (root / "out" / ".notes").write_text("of others")
    begun, earlier = root.with_name(name), read_state(root)
    copy(root, begun)
    # So that forks need not import or compose anything; threads that record would not be in them.
    command.call(*(text.replace(RECORDING, TRACE) for text in words), folder=root)
    copy(begun, root)
    _, calls = trace(words, root, "-e", f"trace={CALLS}")
    return Case(name, begun, earlier, read_state(root), sorted(list_calls(calls, root)))


def work(names: Sequence[str], kinds: Sequence[str], every: int, folder: Path) -> int:
    """Disturb some of the commands, with one of the faults after the other."""
    for start, name in enumerate(names):
        case = prepare(name, folder / "here")
        for number, (call, when) in enumerate(case.calls[start % every :: every], start):
            disturbance = partial(disturb, case, folder / "here", call, when, kinds[number % len(kinds)])
            assert end_of(forked(disturbance)) == 0
    return 0


compose, composed = ConfigLoaderImpl.load_configuration, dict[tuple[str, ...], bytes]()


def compose_once(loader: Any, config_name: str, overrides: list[str], *others: Any, **named: Any) -> Any:
    """Compose as Hydra does, which takes most of a command's time, or copy what was composed in this folder."""
    key = os.getcwd(), *overrides
    if key not in composed:
        composed[key] = pickle.dumps(compose(loader, config_name, overrides, *others, **named))
    return pickle.loads(composed[key])


if __name__ == "__main__":
    kinds, every, folder, *names = sys.argv[1:]
    ConfigLoaderImpl.load_configuration = compose_once
    vars(studies)["start_workers"] = lambda _: Here()
    for name in (*IMPORTED, "cmacexp.commands.report"):
        import_module(name)
    shares = [((names or [*COMMANDS])[number::WORKERS], Path(folder) / str(number)) for number in range(WORKERS)]
    workers = [forked(partial(work, own, kinds.split(","), int(every), place)) for own, place in shares]
    sys.exit(max(map(end_of, workers)))
