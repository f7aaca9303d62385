import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from viewbench.selectors._normalise import normalise


@given(arrays(np.float64, st.tuples(st.integers(1, 20), st.just(3)), elements=st.floats(-1e6, 1e6, width=32)))
def test_the_bounding_box_is_centred_and_its_longest_side_is_8(positions):
    scaled = normalise(positions)
    extent = np.ptp(positions, axis=0)
    if extent.max() == 0:
        assert (scaled == 0).all()
        return
    np.testing.assert_allclose(scaled.max(axis=0), -scaled.min(axis=0), atol=1e-9)
    np.testing.assert_allclose(np.ptp(scaled, axis=0), 8 * extent / extent.max(), atol=1e-6)
