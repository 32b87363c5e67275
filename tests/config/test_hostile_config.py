"""Whatever is typed gives a scenario that holds what was asked, or one line that says what is wrong.

A command line takes the same way as in the command, up to the first step.
"""

import signal
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from hypothesis import given, settings
from hypothesis import strategies as st
from support.doors import CmacexpError, make_scenario
from support.doors_effect import warnings_of
from support.fields import leaves
from support.robots import OWN

from cmacexp.config import config_folder, to_config, to_plain
from cmacexp.config.component import COMPONENTS
from cmacexp.config.compose import compose_config, compose_untyped
from cmacexp.config.fields import BOUNDS

SECONDS = 60
"""After so long a command line counts as one that hangs."""
SCENARIOS = sorted(path.stem for path in (config_folder() / "scenario").glob("*.yaml"))
GROUPS = sorted(path.name for path in config_folder().iterdir() if path.is_dir() and path.name != "for_plant")
OPTIONS = sorted({path.stem for path in config_folder().glob("*/*.yaml")})
DIGITS = "9" * 400
VALUES = [*Path(__file__).with_name("hostile_values.txt").read_text("utf-8").splitlines(), "'a\nb'"]
VALUES += [DIGITS, f"-{DIGITS}", f"0.{DIGITS}", "9" * 5000]
TARGETS = ("os.system", "os", "cmacexp", "cmacexp.errors.BadInput", "cmacexp.plants.AnalyticPlant", "a..b", "a", "3")


WRONG = (
    "",
    "x",
    "x.y",
    "cmac.layerz",
    "cmac.layers.x",
    ".cmac",
    "cmac.",
    "a b",
    "cmac@x",
    "plant@machine",
    "_target_",
)


def based_on(scenario) -> list[str]:
    """A valid command line; robots are not installed everywhere, but the project's own model is there."""
    own = ["machine=mjcf", f"machine.path={OWN}"] if scenario == "robot" else []
    return [f"scenario={scenario}", *own]


@cache
def fields_of(scenario) -> dict[str, tuple[object, dict]]:
    """Value and declaration of each field, by key."""
    return {key: rest for key, *rest in leaves(compose_config(based_on(scenario)))}


@cache
def keys() -> list[str]:
    """Keys of fields, those of richer options too, of the groups that hold them, and wrong ones."""
    richer = ["sensors=real", *(f"feedforward={name}" for name in ("rbf", "ilc", "inverse_dynamics"))]
    found = [key for name in SCENARIOS for key in fields_of(name)]
    found += [key for option in richer for key, *_ in leaves(compose_config([option]))]
    inner = [".".join(key.split(".")[:length]) for key in found for length in range(1, key.count(".") + 1)]
    return list(dict.fromkeys([*found, *inner, *WRONG]))


def near(value, declared) -> list[str]:
    """Values about that of a field and about the bounds of its range, in the ways in which they may be typed."""
    if isinstance(value, bool):
        return ["true", "no", "ON", "0"]
    bounds = [declared[name] for name in BOUNDS if name in declared]
    numbers = [each for each in (value, *bounds) if isinstance(each, int | float)]
    if isinstance(value, int):
        texts = [text for each in numbers for text in (f"{each:.0f}", f"{each + 1:_.0f}", f"{each // 2:+.0f}")]
    else:
        around = [each for number in numbers for each in (number, number / 2, number * (1 + 2**-52))]
        texts = [text for each in around for text in (f"{each!r}", f"{each:g}", f"{each:.17E}")]
    names = [text for name in declared.get("choices", ()) for text in (name, f"'{name}'", f"[{name}]")]
    return [*texts, *names, *declared.get("words", ()), *(["null"] if value is None else [])]


def near_in(scenario) -> list[str]:
    return [f"{key}={text}" for key, rest in fields_of(scenario).items() for text in near(*rest)]


KEYS = st.deferred(lambda: st.sampled_from(keys()))
TARGET_KEYS = [f"{group}._target_" for group in COMPONENTS]
FIELD = st.builds("{}={}".format, KEYS, st.sampled_from(VALUES))
ADDED = st.builds("{}{}".format, st.sampled_from(["+", "++"]), FIELD)
OPTION = st.builds("{}={}".format, st.sampled_from(GROUPS), st.sampled_from([*OPTIONS, *VALUES]))
TARGET = st.builds("{}={}".format, st.sampled_from(TARGET_KEYS), st.sampled_from(TARGETS))
SET = st.one_of(FIELD, FIELD, FIELD, FIELD, TARGET)
COMPOSED = st.one_of(OPTION, ADDED, st.builds("~{}".format, KEYS))
"""What Hydra composes anew, which takes as long as ten of the others."""


@st.composite
def lines(draw, override):
    """Command lines with an override of a kind, some that may well be valid, or both."""
    scenario = draw(st.sampled_from(SCENARIOS))
    valid = st.sampled_from(near_in(scenario))
    kinds = (valid,), (valid, valid), (override,), (valid, override)
    return [*based_on(scenario), *draw(st.one_of(st.tuples(*kind) for kind in kinds))]


@contextmanager
def limited(line):
    """A time limit."""

    def late(*_):
        raise AssertionError(f"{line} hangs")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(SECONDS)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


TRUE, FALSE = ("true", "yes", "y", "on", "1"), ("false", "no", "n", "off", "0")


def is_asked(asked, got) -> bool:
    """Whether a value of a config is the one that was typed."""
    if isinstance(asked, dict):
        return isinstance(got, dict) and all(
            name in got and is_asked(each, got[name]) for name, each in asked.items()
        )
    if isinstance(asked, list):
        return isinstance(got, list) and len(asked) == len(got) and all(map(is_asked, asked, got))
    if isinstance(got, bool):
        return str(asked).lower() in (TRUE if got else FALSE)
    if isinstance(got, int | float):
        return not isinstance(asked, bool) and float(asked) == got
    return type(asked) is type(got) and asked == got


def value_at(plain, key):
    for name in key.split("."):
        plain = plain[name]
    return plain


def check_values(line, plain):
    """What each field was set to last is what the config holds."""
    parsed = [each for each in OverridesParser.create().parse_overrides(line) if each.key_or_group not in GROUPS]
    for i, each in enumerate(parsed):
        key, later = each.key_or_group, [other.key_or_group for other in parsed[i + 1 :]]
        touched = any(f"{key}.".startswith(f"{other}.") or f"{other}.".startswith(f"{key}.") for other in later)
        if not (each.is_delete() or touched or "$" in each.input_line or key.endswith("_target_")):
            value = each.value()
            assert is_asked(getattr(value, "text", value), value_at(plain, key)), each.input_line


def is_cheap(line, config) -> bool:
    """Whether a scenario is made at once, and no class but ours is called for it."""
    ours = not any("_target_" in text for text in line)
    small = config.cmac.memory_bytes <= 2**22 and config.cmac.layers <= 256 and config.actuator.delay < 10**4
    return ours and small and config.steps_per_cycle * config.legs <= 4000


def try_line(line):
    """Do with a command line what the command does before the first step."""
    with limited(line):
        try:
            composed, _ = compose_untyped(line)
            config = to_config(composed)
            check_values(line, to_plain(config))
            said = warnings_of(config, line, composed)
            if is_cheap(line, config):
                make_scenario(config)
        except CmacexpError as error:
            said = [str(error)]
    assert all(text.isprintable() for text in said), f"{line}: {said!r}"


SAMPLE = (
    *("cycles=nan", "cycles=1e400", "cycles=-0.0", f"cycles={DIGITS}", "seed=18446744073709551616", "seed=0x10"),
    *("record.cycles=[[1]]", "record.cycles=[1,2", "record.cycles=1,2", "machine.leg=${gait}", "machine.leg={a:1}"),
    *("sampling_period=5e-324", "gait.stroke=inf", "gait.lift=null", "gait.touch_down=[0.0,0.5,0.8,0.3]"),
    *("cmac.inputs=[angle,angle]", "cmac.inputs=[${seed}]", "cmac.layers=${nothing}", "learning.rate='a\nb'"),
    *("plant._target_=os.system", "feedforward._target_=a..b", "cmac={_target_:os.system}", "feedforward=日本"),
    *("+cmac.layerz=1", "~cmac.layers", "scenario=../x", "=", "a b=1"),
)


@pytest.mark.parametrize("override", SAMPLE)
def test_a_value_is_refused_in_one_line_or_is_that_of_the_run(override):
    try_line(["scenario=one_leg", override])


@pytest.mark.nightly
@settings(max_examples=1500)
@given(lines(SET))
def test_every_value_is_refused_in_one_line_or_is_that_of_the_run(line):
    try_line(line)


@pytest.mark.nightly
@settings(max_examples=500)
@given(lines(COMPOSED))
def test_every_command_line_is_refused_in_one_line_or_gives_what_was_asked(line):
    try_line(line)
