"""The benchmarks compare like with like: the same bits from C, the same cells from NumPy; no page loses a line."""

import numpy as np
import pytest
from support.rollout import roll_out

from benchmarks.__main__ import BEGIN, END, replace_results
from benchmarks.c_loop import COLUMNS, build, compiler, run_in_c
from benchmarks.peers import NumpyCmac
from benchmarks.timing import format_time, in_turn, ratio
from cmacexp.cmac.addressing import InputRange
from cmacexp.cmac.network import Cmac
from cmacexp.loop.scenario import make_scenario


@pytest.mark.skipif(compiler() is None, reason="compares the loop with C, which nothing else needs a compiler for")
@pytest.mark.parametrize(
    "overrides",
    [
        [],
        ["learning.start_cycle=1", "cmac.inputs=[angle]"],
        [
            "reference=force_feedforward",
            "actuator.torque_limit=6.0",
            "cmac.layers=8",
            "cmac.displacement=odd_lattice",
        ],
    ],
)
def test_the_loop_in_c_gives_the_trace_of_the_fused_loop(make_config, overrides):
    config = make_config("scenario=one_leg", *overrides)
    library = build(config.cmac.layers, 2 * len(config.cmac.inputs))
    columns = roll_out(make_scenario(config)).columns()
    ours = np.stack([columns[name][:, 0] for name in COLUMNS], axis=1)
    samples, _ = run_in_c(library, make_scenario(config))
    assert len(samples) == len(ours) == 3000
    np.testing.assert_allclose(samples, ours, rtol=1e-9, atol=1e-12)


def test_a_compiled_sample_and_a_whole_array_find_the_same_cells_and_weights(make_config):
    cmac = Cmac.from_config(make_config("scenario=one_leg").cmac, InputRange(-np.ones(4), np.ones(4)), seed=3)
    rng = np.random.default_rng(0)
    inputs, errors = rng.uniform(-1.2, 1.2, size=(500, 4)), rng.normal(size=(500, 2))
    plain = NumpyCmac(cmac.address, cmac.weights, 0.2)
    assert (plain.cells(inputs) == cmac.cells(inputs)).all()
    plain.batch(inputs, errors)
    cmac.update(inputs, errors, 0.2)
    np.testing.assert_allclose(plain.weights, cmac.weights, atol=1e-12)
    np.testing.assert_allclose(plain.batch(inputs, errors), cmac.predict(inputs), atol=1e-12)


def test_workers_take_turns_and_ratios_are_of_best_times():
    order, give = [], iter([9.0, 9.0, 4.0, 2.0, 3.0, 8.0])

    def worker(name):
        return lambda: (order.append(name), next(give))[1]

    times = in_turn({"a": worker("a"), "b": worker("b")}, 2)
    assert order == ["a", "b"] * 3
    assert times == {"a": [4.0, 3.0], "b": [2.0, 8.0]}
    assert ratio(times, "a", "b") == 1.5
    assert [format_time(s) for s in (2.0, 0.0123, 4.567e-6, 9e-8)] == ["2 s", "12.3 ms", "4.57 us", "90 ns"]


def test_only_what_stands_between_the_markers_is_replaced():
    assert replace_results(f"before\n{BEGIN}\nold\n{END}\nafter\n", "new") == f"before\n{BEGIN}\nnew\n{END}\nafter\n"
    with pytest.raises(ValueError, match="expected"):
        replace_results("a page without markers", "new")
