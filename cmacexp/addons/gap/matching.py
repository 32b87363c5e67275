"""Joints of a log and of a model: they are matched by name, by the numbers in their names, or as the user says."""

import re
from collections.abc import Mapping, Sequence

from cmacexp.errors import BadInput, require, suggest

MOST_KNOWN = 2
"""Joints of the log that the model has, for each one that it lacks, from which these are left out."""
MOST_SAID = 8
"""Most joints without a proposal that a message repeats in an option."""


def plain(name: str) -> str:
    """Return a name without separators and letter case, which do not matter."""
    return "".join(c for c in name.lower() if c.isalnum())


def spell(name: str) -> str:
    """Return a name as other authors may write it: *left* for L, *right* for R, without *joint*."""
    words = [word for word in re.split(r"[^a-z0-9]+", name.lower()) if word != "joint"]
    return "".join({"l": "left", "r": "right"}.get(word, word) for word in words)


def match_names(
    names: Sequence[str], joints: Sequence[str], pairs: Mapping[str, str], left_out: Sequence[str] = ()
) -> tuple[str, ...]:
    """Return the joint of a model for each name of a log, from the ``joints`` of the model.

    It is the one in ``pairs``, by names of the log, else the one with the same name, else that with the same number
    (see :func:`_count`), else the only one whose name contains it. Letter case and separators do not matter.
    ``left_out`` are other names of the log. Raises BadInput, with all names that no joint, or more than one, fits, or
    if two names fit one joint.
    """
    for name, joint in pairs.items():
        known = [*names, *left_out]
        reason = f"the log has no joint {name}{suggest(name, known)}; it has {', '.join(known)}"
        require(name in known, "--joints", f"{name}={joint}", reason)
    counted = _count([*names, *left_out], joints) or ({names[0]: [*joints]} if len(names) == len(joints) == 1 else {})
    fitting = dict[str, list[str]]()
    for name in names:
        wanted = pairs.get(name, name)
        equal = [joint for joint in joints if plain(joint) == plain(wanted)] or counted.get(wanted, [])
        equal = equal or [joint for joint in joints if spell(joint) == spell(wanted)]
        fitting[name] = [wanted] if wanted in joints else equal or [j for j in joints if _contains(j, wanted)]
    if unfit := [name for name, close in fitting.items() if len(close) != 1]:
        raise _list_unfit(unfit, fitting, joints)
    matched = [close[0] for close in fitting.values()]
    for joint in matched:
        both = [name for name, match in zip(names, matched, strict=True) if match == joint]
        require(
            len(both) == 1,
            "joint of the model",
            joint,
            f"fits {' and '.join(both)} of the log; say which one it is by --joints",
        )
    return tuple(matched)


def _contains(joint: str, name: str) -> bool:
    """Return True if the name of a ``joint`` contains a ``name``; a number as a whole one."""
    return int(name) in map(int, re.findall(r"\d+", joint)) if name.isdigit() else plain(name) in plain(joint)


def list_absent(names: Sequence[str], joints: Sequence[str], pairs: Mapping[str, str]) -> list[str]:
    """Return ``names`` of a log, without ``pairs``, that no joint of the model fits, if most others, or all, are its.

    They are joints, such as those of a gripper, that the model lacks.
    """
    known = {plain(joint) for joint in joints}
    absent = [name for name in names if name not in pairs and not any(plain(name) in joint for joint in known)]
    equal = [name for name in names if plain(name) in known or name in pairs]
    is_most = len(equal) >= min(MOST_KNOWN * len(absent), len(joints))
    return absent if is_most and len(equal) + len(absent) == len(names) else []


def _count(names: Sequence[str], joints: Sequence[str]) -> dict[str, list[str]]:
    """Return the joints that numbered ``names`` count, by name; empty if the names, or the joints, are not so.

    Names that are numbers from 0 or 1 on count as many ``joints``, or as many that differ in their number alone.
    Names that differ in their number alone count the only joints with the same numbers, or those from 1 on for 0 on.
    """
    numbers = {name: number for name in names if (number := _split(name)[1]) is not None}
    stems = {_split(name)[0] for name in names}
    if len(numbers) != len(names) or len(stems) != 1:
        return {}
    groups = dict[str, dict[int, str]]()
    for joint in joints:
        stem, number = _split(joint)
        groups.setdefault(stem, {}).update({} if number is None else {number: joint})
    ordered = sorted(names, key=lambda name: numbers[name])
    if stems == {""} and [numbers[name] for name in ordered] in ([*range(len(names))], [*range(1, len(names) + 1)]):
        alike = [list(joints), *([group[k] for k in sorted(group)] for group in groups.values())]
        fitting = [group for group in alike if len(group) == len(names)]
        return {name: [joint] for name, joint in zip(ordered, fitting[0], strict=True)} if fitting else {}
    for shift in (0, 1) if min(numbers.values()) == 0 else (0,):  # 0 to 6 for 1 to 7
        same = [group for group in groups.values() if sorted(group) == sorted(k + shift for k in numbers.values())]
        if len(same) == 1:
            return {name: [same[0][number + shift]] for name, number in numbers.items()}
    return {}


def _split(name: str) -> tuple[str, int | None]:
    """Return a name with the last number in it left out, and that number; None if it has none."""
    match = re.fullmatch(r"(.*?)(\d+)(\D*)", name)
    return (f"{match[1]}{match[3]}", int(match[2])) if match else (name, None)


def _list_unfit(names: Sequence[str], fitting: Mapping[str, Sequence[str]], joints: Sequence[str]) -> BadInput:
    """Return the error for all ``names`` of a log that no joint, or more than one, of the model fits.

    If as many joints of the model are left as names, or the names are numbers, it proposes them in order; names that
    share a word, such as FL, with as many joints are paired with these.
    """
    taken = {close[0] for close in fitting.values() if len(close) == 1}
    free = [joint for joint in joints if joint not in taken]
    texts = [f"{name} fits {' and '.join(fitting[name][:4])}" for name in names if fitting[name]]
    if absent := [name for name in names if not fitting[name]]:
        texts.append(f"the model has no joint {', '.join(absent)}")
    choices = _pair_words(names, free)
    if choices is None:
        counts = len(free) == len(names) or (len(free) > len(names) and all(name.isdigit() for name in names))
        choices = dict(zip(names, free, strict=False)) if counts else {}
    proposes = bool(choices)
    said = names if proposes or len(names) <= MOST_SAID else names[:2]
    pairs = ",".join(f"{name}={choices.get(name, 'JOINT')}" for name in said)
    near = suggest(names[0], joints) if len(names) == 1 and not proposes else ""
    joint_option = f"--joints {pairs}{',...' * (len(said) < len(names))}"
    allowed = "" if proposes else f", with joints of {', '.join(joints) or 'which it has none'}"
    reason = (
        f"{'; '.join(texts)}{near}; say {'if it is this order, ' * proposes}{joint_option}{allowed}, or --leave-out "
        f"{','.join(names)}"
    )
    return BadInput("joints of the log", ",".join(names), reason)


def _pair_words(names: Sequence[str], joints: Sequence[str]) -> dict[str, str] | None:
    """Return joints by name that share a word, in order among those with that word; None if no word is shared.

    It is empty if some name is left over.
    """
    words = {name: set(re.split(r"[^a-z]+", name.lower())) - {"", "joint"} for name in (*names, *joints)}
    shared = set.union(*(words[name] for name in names)) & set.union(set(), *(words[joint] for joint in joints))
    if not shared:
        return None
    pairs = dict[str, str]()
    for word in sorted(shared):
        own = sorted(name for name in names if word in words[name])
        other = [joint for joint in joints if word in words[joint]]
        pairs |= dict(zip(own, other, strict=True)) if len(own) == len(other) else {}
    return pairs if len(pairs) == len(names) and len(set(pairs.values())) == len(pairs) else {}
