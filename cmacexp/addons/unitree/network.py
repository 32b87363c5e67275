"""LowCmd and LowState over DDS: one writer and one reader of the bytes of messages, on one network interface."""

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
"""What is sent on each."""
LOOPBACK = "lo"
MOST = 230
"""The last DDS domain, whose ports are still ports."""
SETTINGS = """<CycloneDDS><Domain Id="any">
<General><Interfaces><NetworkInterface name="{interface}" multicast="default"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex></Discovery>
</Domain></CycloneDDS>"""


PRIORITY = 10
"""Among the processes in real time; below those of the kernel."""


def run_first(first: bool) -> None:
    """Let this thread, and those that it starts, run before others, or as others do.

    Nothing changes where the system does not allow it: Linux does, as root.
    """
    with suppress(AttributeError, OSError):
        policy, priority = (os.SCHED_FIFO, PRIORITY) if first else (os.SCHED_OTHER, 0)
        os.sched_setscheduler(0, policy, os.sched_param(priority))


def make_sample(kind: Any, data: bytes, /, **options: Any) -> Any:
    """A sample of a type of messages, which has its bytes as ``data``."""
    sample = kind.__new__(kind)
    sample.data = data
    return sample


@cache
def make_type(kind: np.dtype[Any]) -> Any:
    """The type of DDS of a type of NumPy, see :func:`make_sample`: DDS does not convert the bytes of structures."""
    from cyclonedds.idl import annotations, make_idl_struct, types

    array: Any = types.array
    if kind.subdtype is not None:
        inner, (count,) = kind.subdtype
        return array[make_type(inner), count]
    if kind not in STRUCTURES:
        return vars(types)[kind.name]
    name, fields = STRUCTURES[kind], {field: make_type(kind[field]) for field in kind.names or ()}
    struct: Any = make_idl_struct(name, f"unitree_go.msg.dds_.{name}", fields)
    struct.serialize = lambda sample, **options: sample.data
    struct.deserialize = classmethod(make_sample)
    return annotations.autoid("sequential")(annotations.final(struct))


@cache
def join(interface: str, domain: int) -> Any:
    """The DDS ``domain`` on a network ``interface``, which stays as it is as long as this process runs.

    Raises BadInput if there is no such interface, or if the domain is on another one.
    """
    from cyclonedds.core import DDSException
    from cyclonedds.domain import Domain

    require(0 <= domain <= MOST, "plant.domain", domain, f"must be at least 0 and at most {MOST}")
    known = [name for _, name in socket.if_nameindex()]
    require(
        interface in known, "plant.interface", interface, f"no such network interface; choose from {', '.join(known)}"
    )
    try:
        return Domain(domain, SETTINGS.format(interface=interface))
    except DDSException as error:
        raise BadInput(
            "plant.domain", domain, "this process has joined it on another interface: start another process"
        ) from error


class Wire:
    """Sends messages of one topic and receives those of the other."""

    def __init__(self, interface: str, domain: int, sends: str | None, receives: str | None):
        """A participant of a DDS ``domain``; raises BadInput if it cannot be joined on a network ``interface``.

        ``sends`` and ``receives`` are of COMMANDS and STATES; None: it sends, or receives, nothing.
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
        """The newest message that has arrived, None if none does within ``timeout``, s.

        The reader keeps one message: an older one that nobody has asked for is lost.
        """
        if self._arrivals.wait(int(timeout * 1e9)) == 0:
            return None
        data = [vars(sample)["data"] for sample in self._reader.take(1) if "data" in vars(sample)]
        return decode(self._received, data[-1]) if data else None

    def send(self, message: Message) -> None:
        """Send a message."""
        self._writer.write(make_sample(self._kind, encode(message)))
