"""Settings that a method is tuned over: drawn by chance, as many for each method, and chosen in other worlds."""

import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cmacexp.typing import Array
from pipelines.benchmark.entrants import Method

Setting = tuple[str, ...]
DEFAULT: Setting = ()
DIGITS = 4
"""Of a drawn number."""


def _write(value: Any) -> str:
    """A value as an override says it."""
    if isinstance(value, list):
        return "[" + ",".join(map(str, value)) + "]"
    return f"{value:.{DIGITS}g}" if isinstance(value, float) else str(value)


def _draw_value(chance: np.random.Generator, tuned: Any) -> str:
    if isinstance(tuned, list):
        return _write(tuned[chance.integers(len(tuned))])
    low, high = tuned
    drawn = float(np.exp(chance.uniform(np.log(low), np.log(high))))
    return _write(drawn if isinstance(low, float) or isinstance(high, float) else round(drawn))


def draw_settings(method: Method, number: int) -> list[Setting]:
    """The default setting of a method, and ``number`` others from what its fields are tuned over; none without any.

    The same method always gets the same ones: the first of a larger number are those of a smaller one.
    """
    if not method.tuned:
        return [DEFAULT]
    chance = np.random.default_rng(zlib.crc32(method.name.encode()))
    drawn = [tuple(f"++{key}={_draw_value(chance, tuned)}" for key, tuned in method.tuned) for _ in range(number)]
    return [DEFAULT, *dict.fromkeys(drawn)]


def choose_setting(settings: Sequence[Setting], scores: Mapping[Setting, Array]) -> Setting:
    """The setting with which the fewest runs fail, of these that with the least mean score; of equal ones the first.

    Args:
        settings: in the order in which they were drawn.
        scores: any shape, by setting; infinite where a run failed.
    """

    def rank(setting: Setting) -> tuple[int, float]:
        done = scores[setting][np.isfinite(scores[setting])]
        return scores[setting].size - done.size, float(done.mean()) if done.size else np.inf

    return min(settings, key=rank)
