"""A simulated Go2 on the loopback network: a killed controller, 100 injected faults, and a walk in real time."""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.timing import ROOT, Row, Table, format_time
from cmacexp.addons.unitree.guardian import Guardian
from cmacexp.addons.unitree.messages import get_motors, new_command, set_motors
from cmacexp.addons.unitree.network import COMMANDS, LOOPBACK, STATES, Wire, run_first

SILENCE = 0.02
"""Time without a command after which the guardian must switch to damping, s."""
WALK = [
    *("-m", "cmacexp", "scenario=robot", "machine=go2", "plant=unitree", "controller=drives", "actuator.lag=0.0151"),
    *("record=metrics", "warn=false"),
]
PATIENT = ["plant.guardian=0.6", "plant.limits.silence=0.4"]
OF_A_MOTOR = ("nan", "stuck", "sign", "sign_of_encoder")
OF_A_LEG = ("swapped", "swapped_encoders")
OF_ALL = ("lost_states", "lost_commands", "remote", "frozen", "frozen_numbers", "hot", "empty")
SECONDS = (3, 12, 22, 29, 32, 35)
"""Start times of faults after the first command, s: during the joint check, while being lowered, while walking."""


class Case(NamedTuple):
    """A fault injected into the simulated robot."""

    kind: str
    after: int
    motor: int


def list_cases() -> Iterator[Case]:
    """Yield 100 faults; faults of the wiring are present from the start."""
    for motor in range(12):
        for kind in OF_A_MOTOR:
            yield Case(kind, 0 if kind.startswith("sign") else SECONDS[motor % len(SECONDS)], motor)
    for motor in (0, 3, 6, 9):
        yield from (Case(kind, 0, motor) for kind in OF_A_LEG)
    for kind in OF_ALL:
        yield from (Case(kind, after, 0) for after in SECONDS)
    yield from (Case("stuck", 35, motor) for motor in (1, 2))


def walk(folder: Path, domain: int, robot: list[str], overrides: list[str]) -> tuple[dict[str, Any], int, str]:
    """Run a walk of the simulated robot over the network.

    Returns:
        The manifest of the run (empty if the robot was refused), its exit code, and the simulator's output, or else
        the last line of the run's standard error.
    """
    simulator = [sys.executable, "-m", "cmacexp", "robot", "--simulate", f"--domain={domain}", *robot]
    process = subprocess.Popen(simulator, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    assert process.stdout is not None
    process.stdout.readline()
    command = [sys.executable, *WALK, f"plant.domain={domain}", *overrides, f"hydra.run.dir={folder}"]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if run.returncode == 2:  # nothing was moved
        process.terminate()
    said = process.communicate()[0].strip()
    manifest = json.loads((folder / "manifest.json").read_text()) if run.returncode != 2 else {}
    return manifest, run.returncode, said or run.stderr.strip().splitlines()[-1]


def kill(count: int) -> list[float]:
    """Kill a controller that sends a command every 2 ms; return the delays until the first damping command, s."""
    run_first(True)
    delays = []
    wire = Wire(LOOPBACK, 60, STATES)
    for _ in range(count):
        controller = subprocess.Popen([sys.executable, "-m", "benchmarks.wire"], cwd=ROOT)
        while (seen := wire.receive(1.0)) is None or not get_motors(seen["motor_cmd"]["kp"]).all():
            pass
        time.sleep(0.2)
        controller.send_signal(signal.SIGKILL)
        begun = time.perf_counter()
        while (seen := wire.receive(1.0)) is not None and get_motors(seen["motor_cmd"]["kp"]).any():
            pass
        delays.append(time.perf_counter() - begun)
        controller.wait()
        while (seen := wire.receive(0.2)) is not None:  # until its guardian has ended
            pass
    return delays


def control() -> None:
    """Send commands every 2 ms until the process is killed."""
    guardian = Guardian(LOOPBACK, 60, 3.0, SILENCE, 0.2)
    wire = Wire(LOOPBACK, 60, COMMANDS)
    command = new_command()
    set_motors(command, q=np.zeros((4, 3)), dq=0.0, tau=0.0, kp=20.0, kd=1.0)
    while True:
        guardian.report(command)
        wire.send(command)
        time.sleep(0.002)


def tables(quick: bool) -> list[Table]:
    """Run the benchmarks of this file and return their table.

    They need the extras robots and unitree, and half an hour.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        delays = kill(3 if quick else 50)
        late = sum(delay > SILENCE for delay in delays)
        what = f"SIGKILL of the controller, {len(delays)} times: {late} damped later than {1e3 * SILENCE:g} ms"
        median = format_time(float(np.median(delays)))
        killed = Row(what, format_time(max(delays)), f"median {median}", max(delays) / SILENCE, "1", 1.0)

        def practise(number: int, case: Case) -> str:
            robot = ["--patient", f"--fault={case.kind}", f"--after={case.after}", f"--motor={case.motor}"]
            manifest, code, said = walk(folder / str(number), 70 + number, robot, [*PATIENT, "cycles=5"])
            stages = [stage["stage"] for stage in manifest["plant"]["stages"]] if manifest else ["refused"]
            print(case, code, stages[-2:], manifest.get("cause") or said, file=sys.stderr, flush=True)
            if stages == ["refused"] and case.after > 0:  # refused for another reason, before the fault began
                return "not tried"
            return "silent" if code == 0 else stages[-1]

        cases = list(list_cases())[:: 25 if quick else 1]
        with ThreadPoolExecutor(2) as threads:
            ends = dict(zip(cases, threads.map(practise, range(len(cases)), cases), strict=True))
        silent = [case for case, end in ends.items() if end in ("silent", "not tried")]
        refused = sum(end == "refused" for end in ends.values())
        damped = sum(end == "damp" for end in ends.values())
        what = f"{len(ends)} faults: {refused} before it stood up, {damped} ended in damping"
        named = ", ".join(f"{ends[case]}: {' '.join(map(str, case))}" for case in silent)
        faults = Row(what, f"{len(silent)} silent or not tried", named, float(len(silent)), "0", 0.0)
        manifest, _, said = walk(folder / "walk", 61, [], [f"cycles={10 if quick else 900}"])
    plant = manifest["plant"]
    steps = manifest["steps"]
    late_robot = re.search(r"(\d+) late", said)
    played = f"the played robot was itself late {late_robot[1] if late_robot else '?'} times"
    what = f"walk of {steps * 0.002:.0f} s in real time, {manifest['status']}: "
    what += f"{plant['states_missed']} states missed, {plant['steps_overran']} steps overran"
    worst = f"{plant['work_ms']['worst']} ms at worst"
    walked = Row(what, worst, played, plant["states_missed"] / steps, "0.001", 0.001)
    note = f"Load of the machine at the end: {os.getloadavg()[0]:.1f}. Ratios: to the limit, faults, share of states."
    return [Table("A robot over a wire", [killed, faults, walked], note)]


if __name__ == "__main__":
    control()
