"""A process that damps a robot when the process that controls it falls silent, ends, or is killed.

The controller writes a byte for every command that it sends. While these come the guardian sends nothing, so that the
robot hears one sender. When none has come for ``silence``, or the pipe is closed since the controller is gone, the
guardian closes its own end, which stops a controller that was only slow, and sends damping from then on.
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
"""What the controller writes: after a command, and when the robot needs no guardian any more."""
STARTS = 30.0
"""Longest time until it is ready, s."""
PERIOD = 0.002
"""Time from one damping command to the next, s."""
LASTS = 10.0
"""Time for which the guardian damps the robot, s: long enough to lie down."""


def make_damping(damping: float) -> Message:
    """A command under which the joints give no torque but ``damping``, N m s/rad, times their velocity."""
    command = new_command()
    set_motors(command, q=0.0, dq=0.0, tau=0.0, kp=0.0, kd=damping)
    return command


class Guardian:
    """The guardian of a robot, in a process of its own, seen from the controller."""

    def __init__(self, interface: str, domain: int, damping: float, silence: float):
        """Start the process on a network ``interface``; it damps with ``damping``, N m s/rad, after ``silence``, s.

        Raises CmacexpError if it does not start.
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
        """Say that a command has been sent, or is about to be; raises CmacexpError if the guardian has taken over."""
        try:
            os.write(self._pipe, ALIVE)
        except (BrokenPipeError, BlockingIOError) as error:
            raise CmacexpError(
                f"the guardian of the robot has taken over: no command for {1e3 * self._silence:g} ms, "
                "or it was ended"
            ) from error

    def end(self) -> None:
        """End the guardian, whose robot is safe."""
        with suppress(subprocess.TimeoutExpired, ValueError):  # it ends by itself, or has been ended before
            self._process.communicate(DONE, LASTS + 5.0)


def watch(pipe: int, silence: float) -> bool:
    """Wait until the controller is done, or silent for ``silence``, s; whether the robot must be damped.

    Before the first command there is nothing to guard.
    """
    begun = words = os.read(pipe, 1)
    while words and not words.endswith(DONE):
        ready, _, _ = select.select([pipe], [], [], silence)
        words = os.read(pipe, 1 << 16) if ready else b""
    return bool(begun) and not words


def main() -> None:
    """Guard: the arguments are the network interface, the DDS domain, the damping, N m s/rad, and the silence, s."""
    interface, domain, damping, silence = sys.argv[1:]
    run_first(True)
    wire, command = Wire(interface, int(domain), COMMANDS, None), make_damping(float(damping))
    print("ready", flush=True)
    if watch(sys.stdin.fileno(), float(silence)):
        os.close(sys.stdin.fileno())
        end = time.monotonic() + LASTS
        while time.monotonic() < end:
            wire.send(command)
            time.sleep(PERIOD)


if __name__ == "__main__":
    main()
