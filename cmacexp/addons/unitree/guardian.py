"""A process that holds and then damps a robot when its controller is silent, ends, or is killed.

The controller writes each command that it sends to a pipe. While commands arrive the guardian sends nothing, so that
the robot receives commands from one sender only. After a short silence it repeats the last command without its
velocity, with ever less stiffness; the controller may continue meanwhile. When that has lasted for ``silence``
seconds, or when the controller has ended, the guardian closes its end of the pipe and sends damping: until another
program sends commands, the robot is gone, or the guardian is ended.
"""

import os
import select
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

from cmacexp.addons.unitree.messages import (
    LAYOUTS,
    LOW_CMD,
    Message,
    decode,
    encode,
    is_damping,
    new_command,
    set_motors,
)
from cmacexp.addons.unitree.network import COMMANDS, Wire, run_first
from cmacexp.errors import CmacexpError

STARTS = 30.0
"""Longest time until the guardian is ready, s."""
PERIOD = 0.002
"""Time from one command of the guardian to the next, s."""
GONE = 3.0
"""Time without a state after which a robot is gone, s."""
FRAME = len(LAYOUTS[LOW_CMD])
"""Size of a command in the pipe, bytes: below PIPE_BUF, so that a command is in the pipe whole or not at all."""
PENDING = 64
"""Most commands that are read at once."""
EXITING = 4
"""Flag of a process in ``/proc/PID/stat`` that is about to end; its pipe closes up to 0.1 s later."""
_running: list[subprocess.Popen[bytes]] = []
"""Guardians of this process, which outlive it."""


def make_damping(damping: float) -> Message:
    """Return a command under which all joints are only damped, with ``damping``, N m s/rad."""
    command = new_command()
    set_motors(command, q=0.0, dq=0.0, tau=0.0, kp=0.0, kd=damping)
    return command


def soften(command: Message, damping: float, share: float) -> Message:
    """Return a command that holds the angles of ``command``, and at a ``share`` of 1 only damps, N m s/rad."""
    soft = command.copy()
    motors = soft["motor_cmd"]
    motors["dq"] = 0.0
    for name in ("kp", "tau"):
        motors[name] *= 1.0 - share
    motors["kd"] += share * (damping - motors["kd"])
    set_motors(soft)
    return soft


class Guardian:
    """The controller's handle of the guardian process of a robot."""

    def __init__(self, interface: str, domain: int, damping: float, hold: float, silence: float):
        """Start the process for a robot on a network ``interface`` and a DDS ``domain``.

        It holds the robot if no command is reported for ``hold``, s, and damps it, with ``damping``, N m s/rad,
        ``silence`` seconds later. Raises CmacexpError if the process does not start.
        """
        self._longest = hold + silence
        module = [sys.executable, "-m", __name__, interface, *map(str, (domain, damping, hold, silence, os.getpid()))]
        process = subprocess.Popen(module, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True)
        _running.append(process)
        assert process.stdin is not None
        assert process.stdout is not None
        self._process = process
        self.number = process.pid
        self._pipe = process.stdin.fileno()
        os.set_blocking(self._pipe, False)
        answers, _, _ = select.select([process.stdout], [], [], STARTS)
        if not answers or not process.stdout.readline():
            process.kill()
            raise CmacexpError("the guardian of the robot did not start: see what it says above")

    def report(self, command: Message) -> None:
        """Report a command that is being sent; raise CmacexpError if the guardian has taken over."""
        try:
            os.write(self._pipe, encode(command))
        except OSError as error:
            raise CmacexpError(
                f"the guardian of the robot has taken over: no command for {self._longest:g} s, or it was ended"
            ) from error

    @property
    def runs(self) -> bool:
        """True while the process runs."""
        return self._process.poll() is None

    def release(self) -> None:
        """Leave the robot to the guardian, which damps it if it was ever moved."""
        assert self._process.stdin is not None
        self._process.stdin.close()


def _is_ending(process: int) -> bool:
    """Return True if a process is about to end, or has ended."""
    try:
        state, *fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        return state in "ZX" or bool(int(fields[5]) & EXITING)
    except OSError:
        return os.getppid() != process


def watch(wire: Wire, pipe: int, damping: float, hold: float, silence: float, controller: int) -> bool:
    """Watch the commands in a ``pipe``, and hold the robot while they pause; return True when it must be damped.

    ``controller`` is the number of the controller's process; the other arguments are those of :class:`Guardian`. A
    robot need not be damped if the controller ends before its first command.
    """
    command: Message | None = None
    last = time.perf_counter()
    while True:
        ready, _, _ = select.select([pipe], [], [], PERIOD)
        quiet = time.perf_counter() - last
        if ready:
            data = os.read(pipe, PENDING * FRAME)
            if not data:
                return command is not None
            command = decode(LOW_CMD, data[-FRAME:])
            last = time.perf_counter()
        elif command is not None and (_is_ending(controller) or quiet > hold + silence):
            return True
        elif command is not None and quiet > hold:
            wire.send(soften(command, damping, (quiet - hold) / silence))


def damp(wire: Wire, damping: float) -> None:
    """Damp the robot until another program sends commands, or no state has arrived for GONE seconds."""
    command = make_damping(damping)
    wire.receive_other()  # of the controller that has ended
    last = time.monotonic()
    while time.monotonic() - last < GONE:
        wire.send(command)
        if wire.receive(PERIOD) is not None:
            last = time.monotonic()
        if (other := wire.receive_other()) is not None and not is_damping(other):
            break


def main() -> None:
    """Run the guardian; arguments are network interface and DDS domain, then those of :func:`watch`."""
    interface, domain, damping, hold, silence, controller = sys.argv[1:]
    run_first(True)
    wire = Wire(interface, int(domain), COMMANDS)
    print("ready", flush=True)
    os.dup2(
        os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno()
    )  # who reads what the controller prints need not wait
    with suppress(KeyboardInterrupt):
        if watch(wire, sys.stdin.fileno(), float(damping), float(hold), float(silence), int(controller)):
            os.close(sys.stdin.fileno())
            damp(wire, float(damping))


if __name__ == "__main__":
    main()
