"""LowCmd and LowState over DDS: a writer and a reader of messages as bytes, on one network interface."""

import os
import socket
from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np

from cmacexp.addons.unitree.messages import LOW_CMD, LOW_STATE, STRUCTURES, Message, decode, encode
from cmacexp.errors import BadInput, require, require_extra

COMMANDS, STATES = "rt/lowcmd", "rt/lowstate"
TOPICS = {COMMANDS: LOW_CMD, STATES: LOW_STATE}
"""Types of the messages, by topic."""
LOOPBACK = "lo"
MOST = 230
"""Largest number of a DDS domain for which the port numbers are valid."""
SETTINGS = """<CycloneDDS><Domain Id="any">
<General><Interfaces><NetworkInterface name="{interface}" multicast="default"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex></Discovery>
</Domain></CycloneDDS>"""


PRIORITY = 10
"""Real-time priority of a thread that controls a robot; below that of threads of the kernel."""


def run_first(first: bool) -> None:
    """Give this thread, and those that it starts, real-time priority if ``first``, else the normal one.

    Nothing changes if the system does not allow it; Linux allows it to root.
    """
    with suppress(AttributeError, OSError):
        policy, priority = (os.SCHED_FIFO, PRIORITY) if first else (os.SCHED_OTHER, 0)
        os.sched_setscheduler(0, policy, os.sched_param(priority))


def make_sample(kind: Any, data: bytes, /, **options: Any) -> Any:
    """Return a DDS sample of a type of messages that holds its bytes as ``data``."""
    sample = kind.__new__(kind)
    sample.data = data
    return sample


@cache
def make_type(kind: np.dtype[Any]) -> Any:
    """Return the DDS type for a type of NumPy; its samples hold bytes, which DDS does not convert."""
    from cyclonedds.idl import annotations, make_idl_struct, types

    array: Any = types.array
    if kind.subdtype is not None:
        inner, (count,) = kind.subdtype
        return array[make_type(inner), count]
    if kind not in STRUCTURES:
        return vars(types)[kind.name]
    name = STRUCTURES[kind]
    fields = {field: make_type(kind[field]) for field in kind.names or ()}
    struct: Any = make_idl_struct(name, f"unitree_go.msg.dds_.{name}", fields)
    struct.serialize = lambda sample, **options: sample.data
    struct.deserialize = classmethod(make_sample)
    return annotations.autoid("sequential")(annotations.final(struct))


@cache
def join(interface: str, domain: int) -> Any:
    """Return the DDS ``domain`` on a network ``interface``; it is kept until this process ends.

    Raises BadInput if there is no such interface, or if this process has joined the domain on another one.
    """
    from cyclonedds.core import DDSException
    from cyclonedds.domain import Domain

    require(0 <= domain <= MOST, "plant.domain", domain, f"must be at least 0 and at most {MOST}")
    names = [name for _, name in socket.if_nameindex()]
    require(
        interface in names, "plant.interface", interface, f"no such network interface; choose from {', '.join(names)}"
    )
    try:
        return Domain(domain, SETTINGS.format(interface=interface))
    except DDSException as error:
        raise BadInput(
            "plant.domain", domain, "this process has joined it on another interface: start another process"
        ) from error


class Wire:
    """A DDS participant that sends messages of one topic and receives those of another."""

    def __init__(self, interface: str, domain: int, sends: str | None, receives: str | None):
        """Join a DDS ``domain`` on a network ``interface``; raise BadInput if that fails.

        The topics ``sends`` and ``receives`` are COMMANDS or STATES; None: nothing is sent, or received.
        """
        require_extra("cyclonedds")
        from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState, WaitSet
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.pub import DataWriter
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        join(interface, domain)
        self._participant = participant = DomainParticipant(domain)
        if sends is not None:
            self._kind = make_type(TOPICS[sends])
            self._writer = DataWriter(participant, Topic(participant, sends, self._kind))
        if receives is not None:
            self._received = TOPICS[receives]
            self._reader = DataReader(participant, Topic(participant, receives, make_type(self._received)))
            self._arrivals = WaitSet(participant)
            self._new = ReadCondition(self._reader, ViewState.Any | InstanceState.Any | SampleState.NotRead)
            self._arrivals.attach(self._new)

    def receive(self, timeout: float) -> Message | None:
        """Wait for a message and return the newest, or None if none arrives within ``timeout``, s.

        Only the newest message is kept; older ones that were not received are lost.
        """
        if self._arrivals.wait(int(timeout * 1e9)) == 0:
            return None
        data = [vars(sample)["data"] for sample in self._reader.take(1) if "data" in vars(sample)]
        return decode(self._received, data[-1]) if data else None

    def send(self, message: Message) -> None:
        """Send a message."""
        self._writer.write(make_sample(self._kind, encode(message)))
