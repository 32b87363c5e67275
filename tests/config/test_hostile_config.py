"""Whatever is typed gives a scenario that holds what was asked, or one line that says what is wrong.

A command line takes the same way as in the command, up to the first step.
"""

from functools import cache
from pathlib import Path

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from hypothesis import given, settings
from hypothesis import strategies as st
from support.doors import CmacexpError, list_idle_overrides, make_scenario
from support.fields import leaves
from support.robots import OWN

from cmacexp.config import config_folder, to_config, to_plain
from cmacexp.config.compose import compose_config, compose_untyped

BASES = {path.stem: [f"scenario={path.stem}"] for path in (config_folder() / "scenario").glob("*.yaml")}
BASES["robot"] += ["machine=mjcf", f"machine.path={OWN}"]  # robots are not installed everywhere
RICHER = ["sensors=real", *(f"feedforward={name}" for name in ("rbf", "ilc", "inverse_dynamics"))]
GROUPS = sorted(path.name for path in config_folder().iterdir() if path.is_dir() and path.name != "for_plant")
COMPONENTS = ("plant", "sensors", "controller", "feedforward")
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


def near(value, declared) -> list[str]:
    """Values about that of a field and about the bounds of its range, in the ways in which they may be typed."""
    bounds = [declared[name] for name in ("above", "at least", "below", "at most") if name in declared]
    numbers = [each for each in (value, *bounds) if isinstance(each, int | float)]
    texts = [text for each in numbers for text in (f"{each!r}", f"{each:.17E}", f"{each + 1:+g}", f"{each / 2:_.0f}")]
    names = [text for name in declared.get("choices", ()) for text in (name, f"'{name}'", f"[{name}]")]
    return [*texts, *names, *declared.get("words", ()), "null", "ON"]


@cache
def fields_of(*overrides) -> dict[str, tuple[object, dict]]:
    """Value and declaration of each field, by key."""
    return {key: rest for key, *rest in leaves(compose_config(overrides))}


@st.composite
def lines(draw, composes):
    """Command lines with an override that may well be valid, and others; ``composes``: by Hydra anew."""
    scenario = draw(st.sampled_from(sorted(BASES)))
    option = [draw(st.sampled_from(RICHER))] if scenario != "robot" and draw(st.booleans()) else []
    fields = fields_of(*BASES[scenario], *option)
    groups = {key.rpartition(".")[0] for key in fields} - {""}
    field, other = draw(st.sampled_from(sorted(fields))), draw(st.sampled_from([*fields, *sorted(groups), *WRONG]))
    value = draw(st.sampled_from(VALUES))
    hostile = [f"{other}={value}", f"{draw(st.sampled_from(COMPONENTS))}._target_={draw(st.sampled_from(TARGETS))}"]
    if composes:
        group = draw(st.sampled_from(GROUPS))
        hostile = [f"{group}={draw(st.sampled_from([*OPTIONS, value]))}", f"+{other}={value}", f"++{other}={value}"]
        hostile.append(f"~{other}")
    valid = f"{field}={draw(st.sampled_from(near(*fields[field])))}"
    return [*BASES[scenario], *option, valid, *draw(st.lists(st.sampled_from(hostile), max_size=2))]


def is_asked(asked, got) -> bool:
    """Whether a value of a config is the one that was typed."""
    if isinstance(asked, dict):
        return isinstance(got, dict) and all(name in got and is_asked(asked[name], got[name]) for name in asked)
    if isinstance(asked, list):
        return isinstance(got, list) and len(asked) == len(got) and all(map(is_asked, asked, got))
    if isinstance(got, bool):
        return str(asked).lower() in (("true", "yes", "y", "on", "1") if got else ("false", "no", "n", "off", "0"))
    if isinstance(got, int | float):
        return not isinstance(asked, bool) and float(asked) == got
    return type(asked) is type(got) and asked == got


def check_values(line, plain):
    """What each field was set to last is what the config holds."""
    parsed = [each for each in OverridesParser.create().parse_overrides(line) if each.key_or_group not in GROUPS]
    for i, each in enumerate(parsed):
        key, later = each.key_or_group, [f"{other.key_or_group}." for other in parsed[i + 1 :]]
        touched = any(f"{key}.".startswith(other) or other.startswith(f"{key}.") for other in later)
        if not (each.is_delete() or touched or "$" in each.input_line or key.endswith("_target_")):
            value, got = each.value(), plain
            for name in key.split("."):
                got = got[name]
            assert is_asked(getattr(value, "text", value), got), each.input_line


def try_line(line):
    """Do with a command line what the command does before the first step."""
    try:
        composed, _ = compose_untyped(line)
        config = to_config(composed)
        check_values(line, to_plain(config))
        said = list_idle_overrides(config, line, composed)
        small = config.cmac.memory_bytes <= 2**22 and config.cmac.layers <= 256 and config.actuator.delay < 10**4
        if small and config.steps_per_cycle * config.legs <= 4000 and "_target_" not in " ".join(line):
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
@settings(max_examples=2000)
@given(st.sampled_from([False, False, False, True]).flatmap(lines))
def test_every_command_line_is_refused_in_one_line_or_gives_what_was_asked(line):
    """A quarter is composed by Hydra anew, which takes longer."""
    try_line(line)
