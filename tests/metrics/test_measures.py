"""Laws of the measures of responses: how they depend on each other, on masks and on time."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from cmacexp.metrics import measures

SEEDS = st.integers(0, 2**32 - 1)
STEP = 0.02


def drawn(seed):
    """Values (3, 40) of three responses, a mask that has samples of each, and times."""
    rng = np.random.default_rng(seed)
    mask = rng.random((3, 40)) < 0.6
    mask[:, 7] = True
    return rng.normal(1.0, 2.0, size=(3, 40)), mask, STEP * np.arange(40.0)


@given(SEEDS)
def test_mean_square_is_that_of_mean_and_ripple(seed):
    value, mask, _ = drawn(seed)
    parts = measures.mean(value, mask) ** 2 + measures.ripple(value, mask) ** 2
    assert_allclose(measures.rms(value, mask) ** 2, parts)


@given(SEEDS)
def test_integrals_are_those_of_constant_samples(seed):
    error, mask, elapsed = drawn(seed)
    duration = STEP * mask.sum(axis=1)
    iae = measures.iae(error, mask, STEP)
    assert_allclose(iae, measures.mean(np.abs(error), mask) * duration)
    ones = np.ones_like(error)
    late = measures.itae(elapsed + 3.0, error, mask, STEP) - measures.itae(elapsed, error, mask, STEP)
    assert_allclose(late, 3.0 * iae)
    assert_allclose(measures.itae(elapsed, ones, mask, STEP), measures.mean(elapsed * ones, mask) * duration)


@given(SEEDS)
def test_integrals_over_two_parts_add_up_and_the_largest_is_in_one_of_them(seed):
    error, mask, elapsed = drawn(seed)
    early, late = mask & (np.arange(40) <= 7), mask & (np.arange(40) >= 7)
    both = mask & (np.arange(40) == 7)
    for integral in (
        lambda part: measures.iae(error, part, STEP),
        lambda part: measures.itae(elapsed, error, part, STEP),
    ):
        assert_allclose(integral(early) + integral(late) - integral(both), integral(mask), atol=1e-12)
    parts = np.maximum(measures.largest(error, early), measures.largest(error, late))
    assert_allclose(measures.largest(error, mask), parts)


@given(SEEDS)
def test_what_no_sample_of_the_mask_shows_is_undefined_and_changes_nothing(seed):
    value, mask, elapsed = drawn(seed)
    other = np.where(mask, value, 1e6)
    mask[1] = False
    for measure in (
        measures.mean,
        measures.rms,
        measures.ripple,
        measures.largest,
        lambda value, mask: measures.iae(value, mask, STEP),
        lambda value, mask: measures.itae(elapsed, value, mask, STEP),
    ):
        assert_allclose(measure(other, mask), measure(value, mask))
        assert np.isnan(measure(value, mask)).tolist() == [False, True, False]


@given(st.floats(0.1, 1.0), st.floats(1.0, 50.0))
def test_a_response_of_first_order_settles_as_its_exponential(constant, way):
    """Within 2 % in ln 50 time constants, to a sample."""
    elapsed = STEP * np.arange(1000.0)
    value = way * (1.0 - np.exp(-elapsed / constant))
    settled, mask = np.asarray(way), np.ones(1000, dtype=bool)
    settling = measures.settling_time(elapsed, value, settled, mask, STEP)
    assert -1e-9 <= settling - constant * np.log(50.0) <= STEP + 1e-9
