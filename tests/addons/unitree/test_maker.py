"""Unitree's own simulator, where it is installed: it lives when we join, and a crawl and a trot walk in it."""

import pytest
from support import maker

pytestmark = [pytest.mark.nightly, pytest.mark.skipif(not maker.FOLDER, reason=maker.REASON)]


def test_the_simulator_lives_when_the_wire_joins(tmp_path):
    ((_, lives, _),) = maker.count_peers(tmp_path, 2)
    assert lives.startswith("2 of 2")


@pytest.mark.timeout(1800)
def test_crawl_and_trot_complete_in_the_simulator_of_unitree(tmp_path):
    for what, done, errors in maker.count_walks(tmp_path, 1, cycles=6):
        assert done.startswith("1 of 1"), (what, errors)
