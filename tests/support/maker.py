"""Counts of walks, stalls, kills and second senders in Unitree's simulator: python tests/support/maker.py.

UNITREE_MUJOCO names a clone of unitree_mujoco, UNITREE_PYTHON a Python with unitree-sdk2py-dimos, mujoco and pygame;
that with Cyclone DDS 0.10.5 is a peer on 0.10.5 too. It prints a table, and takes about five hours of a machine that
is otherwise idle; ``--tries 1`` takes half an hour, names of counts as arguments fewer.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from cmacexp.addons.unitree.messages import JOINTS, is_damping
from cmacexp.addons.unitree.network import LOOPBACK, STATES, Wire

FOLDER = os.environ.get("UNITREE_MUJOCO", "")
PYTHON = os.environ.get("UNITREE_PYTHON", sys.executable)
REASON = "UNITREE_MUJOCO does not name a clone of unitree_mujoco"
HEADLESS = Path(__file__).with_name("headless.py")
TREE = Path(__file__).parents[2]
WALK = [
    "scenario=robot", "machine=go2", "plant=unitree_mujoco", "controller=drives", "sampling_period=0.005",
    "record=trace", "plant.log=null",
]  # fmt: skip
GAITS = {"crawl": [], "trot": ["gait=trot", "gait.speed=0.4"]}
LEARNERS = {"feedback only": ["feedforward=none"], "learning": []}
STALLS = (20, 50, 100, 200, 500)
ALIGNED = 200
"""Samples by which a trace is found in the recording of the simulator."""
_domains = iter(range(40 + os.getpid() % 100, 230))


@contextmanager
def simulate(truth):
    """Run the simulator; yield its process and its domain."""
    domain = next(_domains)
    process = subprocess.Popen(
        [PYTHON, str(HEADLESS), FOLDER, str(domain), str(truth)], stdout=subprocess.PIPE, text=True
    )
    try:
        while "simulates" not in (line := process.stdout.readline()):
            assert line, "the simulator did not start"
        yield process, domain
    finally:
        process.send_signal(signal.SIGCONT)
        process.terminate()
        process.wait()


def start(folder, domain, overrides):
    """Start a walk."""
    command = [
        sys.executable,
        "-m",
        "cmacexp",
        *WALK,
        *overrides,
        f"plant.domain={domain}",
        f"hydra.run.dir={folder}",
    ]
    return subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, cwd=TREE)


def wait_for_walk(process):
    """Wait until the robot is about to move and has stood up; return the number of its guardian."""
    while "[ ] at the end process" not in (line := process.stderr.readline()):
        assert line, "the walk did not start"
    time.sleep(20.0)
    return int(line.split("process ")[1].split()[0])


def read_end(folder):
    """Status and cause of a walk; a walk without a manifest was refused."""
    path = folder / "manifest.json"
    manifest = json.loads(path.read_text()) if path.is_file() else {"status": "refused"}
    return manifest["status"], manifest.get("cause")


def measure(folder, truth):
    """Foot error, mm, and force error, N, estimated and true, in the last cycle."""
    trace = pd.read_parquet(folder / "trace.parquet")
    simulated = np.load(truth)
    true = simulated["q"][:, JOINTS]
    forces = simulated["force"][:, JOINTS[:, 0] // 3]
    angles = np.stack([trace[f"q{n}"].to_numpy().reshape(-1, 4) for n in (1, 2, 3)], axis=2)
    desired, estimated, support, cycle = (
        trace[name].to_numpy().reshape(-1, 4) for name in ("force_desired", "force", "phase", "cycle")
    )
    actual = np.zeros_like(desired)
    starts = range(len(true) - ALIGNED)
    at = min(starts, key=lambda row: np.abs(true[row : row + ALIGNED] - angles[:ALIGNED]).mean())
    for step, q in enumerate(angles):
        at += int(np.abs(true[at : at + 20] - q).max(axis=(1, 2)).argmin())
        actual[step] = forces[at]
    x, y = (trace[f"{axis}"].to_numpy() - trace[f"{axis}_desired"].to_numpy() for axis in ("x", "y"))
    foot = np.hypot(x, y).reshape(-1, 4)
    last = cycle == cycle.max()
    pressed = last & (support == "support")
    force_errors = [np.sqrt(((force - desired)[pressed] ** 2).mean()) for force in (estimated, actual)]
    return [1e3 * np.sqrt((foot[last] ** 2).mean()), *force_errors]


def count_walks(folder, tries, cycles=30, gaits=GAITS):
    for gait in gaits:
        for learner, overrides in LEARNERS.items():
            ends, errors = [], []
            for n in range(tries):
                run, truth = folder / f"{gait}_{learner}_{n}".replace(" ", "_"), folder / "truth.npz"
                with simulate(truth) as (_, domain):
                    start(run, domain, [*GAITS[gait], *overrides, f"cycles={cycles}"]).communicate()
                ends.append(read_end(run))
                if ends[-1][0] == "completed":
                    errors.append(measure(run, truth))
            done = sum(status == "completed" for status, _ in ends)
            each = np.round(errors, 1).tolist()
            yield (
                f"{gait}, {learner}, {cycles} cycles",
                f"{done} of {tries} completed",
                f"mm, N, true N: {each}; {set(ends)}",
            )


def count_stalls(folder, tries):
    for milliseconds in STALLS:
        ends = []
        for n in range(tries):
            run = folder / f"stall_{milliseconds}_{n}"
            with simulate(folder / "truth.npz") as (simulator, domain):
                process = start(run, domain, ["cycles=5", "feedforward=none"])
                wait_for_walk(process)
                simulator.send_signal(signal.SIGSTOP)
                time.sleep(1e-3 * milliseconds)
                simulator.send_signal(signal.SIGCONT)
                process.communicate()
            ends.append(read_end(run))
        done = sum(status == "completed" for status, _ in ends)
        yield f"stall of the simulator, {milliseconds} ms", f"{done} of {tries} completed", str(set(ends))


def listen(domain, seconds, begin):
    """Times, s, at which commands arrive after ``begin()``, and True if they only damp."""
    wire = Wire(LOOPBACK, domain, STATES)
    end = time.monotonic() + 10.0
    while wire.receive(0.1) is None and time.monotonic() < end:
        pass
    begin()
    begun = time.perf_counter()
    heard = []
    while time.perf_counter() < begun + seconds:
        if (command := wire.receive(0.05)) is not None:
            heard.append((time.perf_counter() - begun, is_damping(command)))
    return heard


def find_damped(heard):
    """Time from which on all commands only damp, s."""
    moving = [at for at, damps in heard if not damps]
    later = [at for at, damps in heard if damps and (not moving or at > moving[-1])]
    return later[0] if later else np.inf


def count_kills(folder, tries):
    delays = []
    for n in range(5 * tries):
        with simulate(folder / "truth.npz") as (_, domain):
            process = start(folder / f"kill_{n}", domain, ["cycles=30", "feedforward=none"])
            guardian = wait_for_walk(process)
            delays.append(find_damped(listen(domain, 1.0, process.kill)))
            os.kill(guardian, signal.SIGTERM)
        print(f"kill {n}: {1e3 * delays[-1]:.1f} ms", file=sys.stderr, flush=True)
    within = sum(delay <= 0.02 for delay in delays)
    yield "SIGKILL of the controller", f"{within} of {len(delays)} damped within 20 ms", f"worst {max(delays):.4f} s"


def count_senders(folder, tries):
    def disturb(domain):
        return subprocess.Popen([sys.executable, "-c", MOVER, str(domain)])

    for when in ("before", "during", "together"):
        ends = []
        for n in range(tries):
            runs = [folder / f"{when}_{n}_{k}" for k in range(2)]
            with simulate(folder / "truth.npz") as (_, domain):
                others = [disturb(domain)] if when == "before" else []
                time.sleep(5.0 if others else 0.0)
                walks = [start(runs[0], domain, ["cycles=5", "feedforward=none"])]
                if when == "during":
                    wait_for_walk(walks[0])
                    others = [disturb(domain)]
                elif when == "together":
                    walks.append(start(runs[1], domain, ["cycles=5", "feedforward=none"]))
                for process in walks:
                    process.communicate()
                for process in others:
                    process.kill()
                    process.wait()
            ends += [read_end(run) for run in runs[: len(walks)]]
        stopped = sum(status in ("refused", "diverged") for status, _ in ends)
        yield f"second sender {when}", f"{stopped} of {len(ends)} refused or damped", str(set(ends))


MOVER = """
import sys, time
from cmacexp.addons.unitree.messages import new_command, set_motors
from cmacexp.addons.unitree.network import COMMANDS, LOOPBACK, Wire
wire, command = Wire(LOOPBACK, int(sys.argv[1]), COMMANDS), new_command()
set_motors(command, q=[0.0, 1.0, -2.0], kp=50.0, kd=2.0)
while True:
    wire.send(command)
    time.sleep(0.002)
"""


LISTENER = """
import sys
from cmacexp.addons.unitree.network import COMMANDS, LOOPBACK, Wire
assert Wire(LOOPBACK, int(sys.argv[1]), COMMANDS).receive(20.0) is not None
"""


def count_peers(folder, tries):
    lives = 0
    for _ in range(tries):
        with simulate(folder / "truth.npz") as (simulator, domain):
            joined = subprocess.run([sys.executable, "-c", LISTENER, str(domain)], cwd=TREE).returncode == 0
            time.sleep(2.0)
            lives += joined and simulator.poll() is None
    show = [PYTHON, "-c", "from importlib.metadata import version; print(version('cyclonedds'))"]
    version = subprocess.run(show, capture_output=True, text=True).stdout.strip()
    yield f"peer on cyclonedds {version}", f"{lives} of {tries} live and are heard", ""


def count_readings(folder, tries):
    """Walk with our own robot while one joint after the other is read 0.5 rad too large, in ten states a second."""
    commanded, received, ends = [], [], []
    for motor in range(JOINTS.size):
        domain, log = next(_domains), folder / f"readings_{motor}.parquet"
        play = ["robot", "--simulate", "--fault=leap", "--after=1", f"--domain={domain}", f"--motor={motor}"]
        robot = subprocess.Popen([sys.executable, "-m", "cmacexp", *play], stdout=subprocess.PIPE, cwd=TREE)
        robot.stdout.readline()
        walk = [
            *WALK[:2],
            "plant=unitree",
            "controller=drives",
            "actuator.lag=0.0151",
            "cycles=5",
            f"plant.log={log}",
        ]
        run = folder / f"readings_{motor}"
        command = [sys.executable, "-m", "cmacexp", *walk, f"plant.domain={domain}", f"hydra.run.dir={run}"]
        subprocess.run(command, cwd=TREE, stderr=subprocess.DEVNULL)
        robot.communicate()
        ends.append(read_end(run))
        rows = pd.read_parquet(log)
        commanded.append(rows.filter(regex="^tau_ff_").abs().max(axis=None))
        received.append(rows.filter(regex="^tau_(?!ff_)").abs().max(axis=None))
    done = sum(status == "completed" for status, _ in ends)
    yield (
        "one joint read 0.5 rad too large",
        f"{done} of {len(ends)} completed",
        f"largest torque commanded {max(commanded):.1f} N m, at the motor {max(received):.1f} N m; {set(ends)}",
    )


COUNTS = {
    "readings": count_readings,
    "peers": count_peers,
    "walks": count_walks,
    "trots": partial(count_walks, gaits=("trot",)),
    "stalls": count_stalls,
    "kills": count_kills,
    "senders": count_senders,
}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("counts", nargs="*", choices=[*COUNTS, []], default=[])
    parser.add_argument("--tries", type=int, default=10)
    arguments = parser.parse_args()
    assert FOLDER, REASON
    with tempfile.TemporaryDirectory() as folder:
        for name in arguments.counts or COUNTS:
            for row in COUNTS[name](Path(folder), arguments.tries):
                print(" | ".join(row), flush=True)
    print(f"load of the machine at the end: {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
