"""Laws of the polygon of support, against hulls of scipy."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from cmacexp.planning.stability import margins


@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
def test_a_foot_on_an_edge_or_within_changes_no_margin(scale):
    corners = scale * np.array([[0.3, 0.2], [0.25, -0.2], [-0.3, 0.1], [-0.2, -0.3]])
    for more in ((corners[0] + corners[1]) / 2.0, 0.25 * corners[2] + 0.75 * corners[3], np.zeros(2)):
        assert_allclose(margins(np.vstack([corners, more])), margins(corners), rtol=1e-9)
