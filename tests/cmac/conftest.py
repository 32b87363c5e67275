"""Short batches are not worth compiling, which a CMAC outside a run would be."""

import pytest
from support.doors import workload


@pytest.fixture(autouse=True, scope="module")
def _in_plain_python():
    with workload(1):
        yield
