"""Services of a robot over DDS: which motion program runs on it, and its release.

Requests and answers are those of Unitree's public interface files (``unitree_api/msg``), numbers of requests those of
its SDK (``unitree_sdk2py`` 1.0.1, ``motion_switcher_api.py`` and ``sport_api.py``).
"""

import ctypes as ct
import json
import time

from cmacexp.addons.unitree.network import LOOPBACK, Reader, Sequence, Topic, Writer, open_participant
from cmacexp.errors import BadInput

CHECK_MODE, RELEASE_MODE, STAND_DOWN = 1001, 1003, 1005
SWITCHER, SPORT = "motion_switcher", "sport"
FOUND = 2.0
"""Longest time until a service is found, s."""
ANSWERED = 5.0
"""Longest time until a service answers, s."""
RELEASES = 5
"""Number of requests to release the motion program, a second apart."""


class Request(ct.Structure):
    """``unitree_api::msg::dds_::Request_``, its nested structures written out."""

    _fields_ = (
        *((name, ct.c_int64) for name in ("id", "api", "lease")),
        ("priority", ct.c_int32),
        ("no_reply", ct.c_bool),
        ("parameter", ct.c_char_p),
        ("binary", Sequence),
    )


class Response(ct.Structure):
    """``unitree_api::msg::dds_::Response_``, its nested structures written out."""

    _fields_ = (
        *((name, ct.c_int64) for name in ("id", "api")),
        ("status", ct.c_int32),
        ("data", ct.c_char_p),
        ("binary", Sequence),
    )


def _make_topics(service: str) -> tuple[Topic, Topic]:
    """Make the topics of requests to a ``service`` and of its answers."""
    name = "unitree_api::msg::dds_::{}_"
    return (
        Topic(f"rt/api/{service}/request", name.format("Request"), Request),
        Topic(f"rt/api/{service}/response", name.format("Response"), Response),
    )


class Service:
    """A service of a robot."""

    def __init__(self, participant: int, name: str):
        """Look for the service ``name`` by a ``participant`` of DDS."""
        request, response = _make_topics(name)
        self._requests = Writer(participant, request)
        self._answers = Reader(participant, response)
        end = time.monotonic() + FOUND
        while not self._requests.has_reader() and time.monotonic() < end:
            time.sleep(0.05)
        self.exists = self._requests.has_reader()

    def call(self, api: int) -> str:
        """Send a request and return the answer; raise TimeoutError without one, OSError if it is refused."""
        request = Request(id=time.monotonic_ns(), api=api, parameter=b"{}")
        self._requests.write(request)
        end = time.monotonic() + ANSWERED
        while (left := end - time.monotonic()) > 0.0:
            answer = self._answers.read(left)
            if answer is not None and answer.id == request.id:
                if answer.status:
                    raise OSError(f"request {api} is refused with code {answer.status}")
                return (answer.data or b"").decode()
        raise TimeoutError(f"no answer to request {api} within {ANSWERED:g} s")


def _read_mode(switcher: Service) -> str:
    """Return the name of the motion program that runs; empty: none."""
    return str(json.loads(switcher.call(CHECK_MODE)).get("name") or "")


def release_sport_mode(interface: str, domain: int) -> str:
    """Let the robot lie down and end its motion program, as Unitree's example does; return one line about it.

    Raises BadInput if the program cannot be ended, or if the robot, unlike a simulator on this computer, has no such
    service.
    """
    participant = open_participant(interface, domain)
    switcher = Service(participant, SWITCHER)
    if not switcher.exists:
        if interface == LOOPBACK:
            return "no service motion_switcher, as in a simulator"
        reason = "the robot has no service motion_switcher; if no motion program runs on it set plant.release=false"
        raise BadInput("plant.interface", interface, reason)
    try:
        name = _read_mode(switcher)
        if not name:
            return "no motion program runs"
        sport = Service(participant, SPORT)
        for _ in range(RELEASES):
            if sport.exists:
                sport.call(STAND_DOWN)
            switcher.call(RELEASE_MODE)
            time.sleep(1.0)
            if not (running := _read_mode(switcher)):
                return f"motion program {name} ended"
    except (OSError, ValueError) as error:
        raise BadInput("plant.release", True, f"the motion program of the robot was not released: {error}") from error
    raise BadInput("plant.release", True, f"motion program {running} runs on after {RELEASES} requests to end it")


def serve_mode(interface: str, domain: int, name: str) -> None:
    """Answer requests as a robot with a motion program ``name`` does, which RELEASE_MODE ends."""
    participant = open_participant(interface, domain)
    ends = [
        (Reader(participant, request), Writer(participant, answer))
        for request, answer in map(_make_topics, (SWITCHER, SPORT))
    ]
    while True:
        for requests, answers in ends:
            request = requests.read(0.02)
            if request is not None:
                name = "" if request.api == RELEASE_MODE else name
                data = json.dumps({"form": "0", "name": name}).encode()
                answers.write(Response(id=request.id, api=request.api, data=data))
