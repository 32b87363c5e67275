"""Topics over DDS on one network interface, by the C interface of Cyclone DDS: LowCmd, LowState and services.

The Python interface of Cyclone DDS 11 announces each type with its description. A peer on 0.10.5, which is about what
a Go2 runs, ends with a segmentation fault when it asks for that description and gets it (3 of 3 times). Topics that
are created here are announced by the name of their type only, as by compilers of interface files before 0.10, and
only in plain CDR. Peers then compare names.
"""

import ctypes as ct
import os
import socket
from contextlib import suppress
from functools import cache
from typing import Any, NamedTuple

from cmacexp.addons.unitree.messages import LAYOUTS, LOW_CMD, LOW_STATE, Message, decode, encode
from cmacexp.errors import BadInput, CmacexpError, require, require_extra

LOOPBACK = "lo"
MOST = 230
"""Largest number of a DDS domain for which the port numbers are valid."""
SETTINGS = """<CycloneDDS><Domain Id="any">
<General><Interfaces><NetworkInterface name="{interface}" multicast="default"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex></Discovery>
</Domain></CycloneDDS>"""
FIELD, STRING, SEQUENCE, ARRAY = 1 << 24, 5 << 16, 7 << 16, 8 << 16
BYTES = 1 << 8
NUMBERS = {1: 1 << 16, 2: 2 << 16, 4: 3 << 16, 8: 4 << 16}
"""Numbers of a given size in bytes. These and the constants above are instructions of ``dds_opcodes.h``."""
NEW = 2 | 12 | 112
"""Mask of samples that were not taken, of any view and instance."""
PLAIN_CDR = 0
IGNORE_OWN = 1
"""A reader receives nothing from its own participant."""
PRIORITY = 10
"""Real-time priority of a thread that controls a robot; below that of threads of the kernel."""


class Sequence(ct.Structure):
    """A sequence of bytes, empty unless it is received."""

    _fields_ = (("most", ct.c_uint32), ("length", ct.c_uint32), ("data", ct.c_void_p), ("release", ct.c_bool))


class _Descriptor(ct.Structure):
    """``dds_topic_descriptor_t``, with no description of the type for other participants."""

    _fields_ = (
        *((name, ct.c_uint32) for name in ("size", "align", "flags", "keys")),
        ("name", ct.c_char_p),
        ("key", ct.c_void_p),
        ("count", ct.c_uint32),
        ("program", ct.POINTER(ct.c_uint32)),
        *((name, ct.c_void_p) for name in ("meta", "type", "type_size", "mapping", "mapping_size")),
        *((name, ct.c_uint32) for name in ("representations", "members")),
    )


class _SampleInfo(ct.Structure):
    """``dds_sample_info_t``."""

    _fields_ = (
        *((name, ct.c_int32) for name in ("sample", "view", "instance")),
        ("valid", ct.c_bool),
        ("time", ct.c_int64),
        *((name, ct.c_uint64) for name in ("handle", "publication")),
        *((name, ct.c_uint32) for name in ("disposed", "unwritten", "rank", "generation", "absolute")),
    )


class Topic(NamedTuple):
    """A topic of DDS: its name, and the name and the layout of its type, a structure of ctypes."""

    name: str
    type_name: str
    layout: type[ct.Structure]


def _make_bytes(size: int) -> type[ct.Structure]:
    """Make the layout of ``size`` bytes, which DDS does not interpret."""
    return type("Bytes", (ct.Structure,), {"_fields_": (("data", ct.c_ubyte * size),)})


COMMANDS, STATES = (
    Topic(f"rt/{name.lower()}", f"unitree_go::msg::dds_::{name}_", _make_bytes(len(LAYOUTS[kind])))
    for name, kind in (("LowCmd", LOW_CMD), ("LowState", LOW_STATE))
)
KINDS = {COMMANDS: LOW_CMD, STATES: LOW_STATE}


def run_first(first: bool) -> None:
    """Give this thread, and those that it starts, real-time priority if ``first``, else the normal one.

    Nothing changes if the system does not allow it; Linux allows it to root.
    """
    with suppress(AttributeError, OSError):
        policy, priority = (os.SCHED_FIFO, PRIORITY) if first else (os.SCHED_OTHER, 0)
        os.sched_setscheduler(0, policy, os.sched_param(priority))


@cache
def _load() -> ct.CDLL:
    """Load the C library of the package cyclonedds; raise CmacexpError without the package."""
    require_extra("cyclonedds")
    from cyclonedds.__library__ import library_path

    return ct.CDLL(str(library_path))


def _call(name: str, *arguments: Any) -> int:
    """Call a function of DDS that returns an entity or a number; raise CmacexpError if it returns an error."""
    library = _load()
    value = int(library[name](*arguments))
    if value < 0:
        library.dds_strretcode.restype = ct.c_char_p
        raise CmacexpError(f"DDS: {name} failed: {library.dds_strretcode(value).decode()}")
    return value


@cache
def join(interface: str, domain: int) -> int:
    """Join the DDS ``domain`` on a network ``interface`` until this process ends; return its entity.

    Raises BadInput if there is no such interface, or if this process has joined the domain on another one.
    """
    require(0 <= domain <= MOST, "plant.domain", domain, f"must be at least 0 and at most {MOST}")
    names = [name for _, name in socket.if_nameindex()]
    require(
        interface in names, "plant.interface", interface, f"no such network interface; choose from {', '.join(names)}"
    )
    _load()
    try:
        return _call("dds_create_domain", ct.c_uint32(domain), SETTINGS.format(interface=interface).encode())
    except CmacexpError as error:
        raise BadInput(
            "plant.domain", domain, "this process has joined it on another interface: start another process"
        ) from error


def _list_program(layout: type[ct.Structure]) -> list[int]:
    """List the instructions by which DDS reads and writes a structure in CDR."""
    program = []
    for name, kind, *_ in layout._fields_:
        offset = vars(layout)[name].offset
        if kind is ct.c_char_p:
            program += [FIELD | STRING, offset]
        elif kind is Sequence:
            program += [FIELD | SEQUENCE | BYTES, offset]
        elif issubclass(kind, ct.Array):
            program += [FIELD | ARRAY | BYTES, offset, kind._length_]
        else:
            program += [FIELD | NUMBERS[ct.sizeof(kind)], offset]
    return [*program, 0]


def open_participant(interface: str, domain: int) -> int:
    """Open a participant of a DDS ``domain`` on a network ``interface``; raise BadInput if it cannot be joined."""
    join(interface, domain)
    return _call("dds_create_participant", ct.c_uint32(domain), None, None)


def _open(function: str, participant: int, topic: Topic) -> int:
    """Open a reader or a writer of a topic, and return its entity."""
    library = _load()
    library.dds_create_qos.restype = ct.c_void_p
    quality = ct.c_void_p(library.dds_create_qos())
    library.dds_qset_data_representation(quality, 1, (ct.c_int16 * 1)(PLAIN_CDR))
    library.dds_qset_ignorelocal(quality, IGNORE_OWN)
    program = _list_program(topic.layout)
    descriptor = _Descriptor(
        size=ct.sizeof(topic.layout),
        align=ct.alignment(topic.layout),
        name=topic.type_name.encode(),
        count=len(program),
        program=(ct.c_uint32 * len(program))(*program),
    )
    entity = _call("dds_create_topic", participant, ct.byref(descriptor), topic.name.encode(), None, None)
    return _call(function, participant, entity, quality, None)


class Writer:
    """A writer of one topic."""

    def __init__(self, participant: int, topic: Topic):
        """Open a writer of a topic."""
        self._entity = _open("dds_create_writer", participant, topic)

    def write(self, sample: Any) -> None:
        """Write a sample, in the layout of the topic."""
        _call("dds_write", self._entity, ct.byref(sample))

    def has_reader(self) -> bool:
        """Return True if anybody reads the topic."""
        return _call("dds_get_matched_subscriptions", self._entity, None, ct.c_size_t(0)) > 0


class Reader:
    """A reader of one topic, which keeps the newest sample only."""

    def __init__(self, participant: int, topic: Topic):
        """Open a reader of a topic."""
        self._entity = _open("dds_create_reader", participant, topic)
        self._layout = topic.layout
        self._arrivals = _call("dds_create_waitset", participant)
        condition = _call("dds_create_readcondition", self._entity, ct.c_uint32(NEW))
        _call("dds_waitset_attach", self._arrivals, condition, ct.c_ssize_t(0))

    def read(self, timeout: float) -> Any:
        """Wait for a sample and return the newest, or None if none arrives within ``timeout``, s."""
        if timeout > 0.0 and not _call(
            "dds_waitset_wait", self._arrivals, None, ct.c_size_t(0), ct.c_int64(int(timeout * 1e9))
        ):
            return None
        sample = self._layout()
        info = _SampleInfo()
        address = (ct.c_void_p * 1)(ct.addressof(sample))
        count = _call("dds_take", self._entity, address, ct.byref(info), ct.c_size_t(1), ct.c_uint32(1))
        return sample if count and info.valid else None


class Wire:
    """A DDS participant that sends LowCmd or LowState, and receives both."""

    def __init__(self, interface: str, domain: int, sends: Topic):
        """Join a DDS ``domain`` on a network ``interface``; raise BadInput if that fails.

        The topic ``sends`` is COMMANDS or STATES.
        """
        participant = open_participant(interface, domain)
        self._writer = Writer(participant, sends)
        self._readers = {topic: Reader(participant, topic) for topic in KINDS}
        self._sends = sends
        self._receives = STATES if sends == COMMANDS else COMMANDS

    def receive(self, timeout: float) -> Message | None:
        """Wait for a message and return the newest, or None if none arrives within ``timeout``, s.

        Only the newest message is kept; older ones that were not received are lost.
        """
        return self._read(self._receives, timeout)

    def receive_other(self) -> Message | None:
        """Return the newest message that another participant has sent on the topic of this one, if it is new."""
        return self._read(self._sends, 0.0)

    def _read(self, topic: Topic, timeout: float) -> Message | None:
        sample = self._readers[topic].read(timeout)
        return None if sample is None else decode(KINDS[topic], bytes(sample))

    def send(self, message: Message) -> None:
        """Send a message."""
        self._writer.write(self._sends.layout.from_buffer_copy(encode(message)))
