"""LowCmd and LowState over DDS: one writer and one reader of the bytes of messages, on one network interface."""

import os
import socket
from contextlib import suppress
from functools import cache
from typing import Any

from cmacexp.errors import BadInput, require_extra
from cmacexp.wire.messages import STRUCTURES, Message

COMMANDS, STATES = "rt/lowcmd", "rt/lowstate"
"""Topics of LowCmd and LowState."""
LOOPBACK = "lo"
MOST = 230
"""The last DDS domain, whose ports are still ports."""
SETTINGS = """<CycloneDDS><Domain Id="any">
<General><Interfaces><NetworkInterface name="{interface}" multicast="default"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex></Discovery>
</Domain></CycloneDDS>"""


PRIORITY = 10
"""Among the processes in real time; below those of the kernel."""


def ask_for_priority() -> bool:
    """Let this thread, and those that it starts, run before others; whether the system allows it (Linux, as root)."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except (AttributeError, OSError):
        return False
    return True


def give_up_priority() -> None:
    """Let this thread run as others do."""
    with suppress(AttributeError, OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def make_sample(kind: Any, data: bytes, /, **options: Any) -> Any:
    """A sample of a type of messages, which has its bytes as ``data``."""
    sample = kind.__new__(kind)
    sample.data = data
    return sample


@cache
def make_types() -> dict[str, Any]:
    """The types of messages for DDS, by name, see :func:`make_sample`: nothing converts their bytes."""
    from cyclonedds.idl import annotations, make_idl_struct, types

    numbers = {"u1": "uint8", "u2": "uint16", "u4": "uint32", "i2": "int16", "i4": "int32", "f4": "float32"}
    kinds: dict[Any, Any] = {short: getattr(types, name) for short, name in numbers.items()}
    array: Any = types.array
    for name, fields in STRUCTURES.items():
        declared = {field: kinds[kind] if count == 1 else array[kinds[kind], count] for field, kind, count in fields}
        made: Any = make_idl_struct(name, f"unitree_go.msg.dds_.{name}", declared)
        made.serialize, made.deserialize = lambda sample, **options: sample.data, classmethod(make_sample)
        kinds[fields] = annotations.autoid("sequential")(annotations.final(made))
    return {name: kinds[fields] for name, fields in STRUCTURES.items()}


@cache
def join(interface: str, domain: int) -> Any:
    """The DDS ``domain`` on a network ``interface``, which stays as it is as long as this process runs.

    Raises BadInput if there is no such interface, or if the domain is on another one.
    """
    from cyclonedds.core import DDSException
    from cyclonedds.domain import Domain

    if not 0 <= domain <= MOST:
        raise BadInput("plant.domain", domain, f"must be at least 0 and at most {MOST}")
    known = [name for _, name in socket.if_nameindex()]
    if interface not in known:
        raise BadInput("plant.interface", interface, f"no such network interface; choose from {', '.join(known)}")
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

        types = make_types()
        join(interface, domain)
        self._participant = DomainParticipant(domain)
        self._kind = types["LowCmd_" if sends == COMMANDS else "LowState_"]
        if sends is not None:
            self._writer = DataWriter(self._participant, Topic(self._participant, sends, self._kind))
        self._received = "LowCmd_" if receives == COMMANDS else "LowState_"
        if receives is not None:
            self._reader = DataReader(self._participant, Topic(self._participant, receives, types[self._received]))
            self._arrivals = WaitSet(self._participant)
            self._new = ReadCondition(self._reader, ViewState.Any | InstanceState.Any | SampleState.NotRead)
            self._arrivals.attach(self._new)

    def receive(self, timeout: float) -> Message | None:
        """The newest message that has arrived, None if none does within ``timeout``, s.

        The reader keeps one message: an older one that nobody has asked for is lost.
        """
        if self._arrivals.wait(int(timeout * 1e9)) == 0:
            return None
        data = [sample.data for sample in self._reader.take(1) if hasattr(sample, "data")]
        return Message(self._received, data[-1]) if data else None

    def send(self, data: bytes) -> None:
        """Send the bytes of a message."""
        self._writer.write(make_sample(self._kind, data))
