"""A process that damps a robot when its controller process stops sending commands, ends, or is killed.

The controller writes a byte to a pipe for every command that it sends. While bytes arrive the guardian sends nothing,
so that the robot receives commands from one sender only. When none has arrived for ``silence`` seconds, or the pipe
is closed because the controller has ended, the guardian closes its end of the pipe, which stops a controller that was
only slow, and sends damping from then on.
"""

import os
import select
import subprocess
import sys
import time
from contextlib import suppress

from cmacexp.addons.unitree.messages import Message, new_command, set_motors
from cmacexp.addons.unitree.network import COMMANDS, Wire, run_first
from cmacexp.errors import CmacexpError

ALIVE, DONE = b"+", b"."
"""Bytes that the controller writes: with each command, and when the robot needs no guardian any more."""
STARTS = 30.0
"""Longest time until the guardian is ready, s."""
PERIOD = 0.002
"""Time from one damping command to the next, s."""
LASTS = 10.0
"""Time for which the guardian damps the robot, s: long enough for it to lie down."""


def make_damping(damping: float) -> Message:
    """Return a command under which all joints are only damped, with ``damping``, N m s/rad."""
    command = new_command()
    set_motors(command, q=0.0, dq=0.0, tau=0.0, kp=0.0, kd=damping)
    return command


class Guardian:
    """The controller's handle of the guardian process of a robot."""

    def __init__(self, interface: str, domain: int, damping: float, silence: float):
        """Start the process; it damps the robot if no command is reported for ``silence``, s.

        The damping is in N m s/rad; the robot is on a network ``interface`` and a DDS ``domain``. Raises CmacexpError
        if the process does not start.
        """
        self._silence = silence
        module = [sys.executable, "-m", __name__, interface, str(domain), str(damping), str(silence)]
        self._process = subprocess.Popen(
            module, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._pipe = self._process.stdin.fileno()
        os.set_blocking(self._pipe, False)
        answers, _, _ = select.select([self._process.stdout], [], [], STARTS)
        if not answers or not self._process.stdout.readline():
            self._process.kill()
            raise CmacexpError("the guardian of the robot did not start: see what it says above")

    def report(self) -> None:
        """Report that a command is being sent; raise CmacexpError if the guardian has taken over."""
        try:
            os.write(self._pipe, ALIVE)
        except (BrokenPipeError, BlockingIOError) as error:
            raise CmacexpError(
                f"the guardian of the robot has taken over: no command for {1e3 * self._silence:g} ms, "
                "or it was ended"
            ) from error

    def end(self) -> None:
        """End the guardian; the robot must be safe."""
        with suppress(subprocess.TimeoutExpired, ValueError):  # it ends by itself later, or was ended before
            self._process.communicate(DONE, LASTS + 5.0)


def watch(pipe: int, silence: float) -> bool:
    """Wait until the controller is done or has been silent for ``silence``, s; return True to damp the robot.

    It need not be damped if the controller ends before its first command.
    """
    first = received = os.read(pipe, 1)
    while received and not received.endswith(DONE):
        ready, _, _ = select.select([pipe], [], [], silence)
        received = os.read(pipe, 1 << 16) if ready else b""
    return bool(first) and not received


def main() -> None:
    """Run the guardian; arguments are network interface, DDS domain, damping, N m s/rad, and silence, s."""
    interface, domain, damping, silence = sys.argv[1:]
    run_first(True)
    wire = Wire(interface, int(domain), COMMANDS, None)
    command = make_damping(float(damping))
    print("ready", flush=True)
    if watch(sys.stdin.fileno(), float(silence)):
        os.close(sys.stdin.fileno())
        end = time.monotonic() + LASTS
        while time.monotonic() < end:
            wire.send(command)
            time.sleep(PERIOD)


if __name__ == "__main__":
    main()
