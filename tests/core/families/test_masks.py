"""Masks of family members."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from warp_pd.families import pack, unpack


@settings(max_examples=60, deadline=None)
@given(rows=st.integers(1, 5), members=st.integers(1, 100), seed=st.integers(0, 1000))
def test_pack_and_unpack(rows, members, seed):
    mask = np.random.default_rng(seed).random((rows, members)) < 0.5
    assert (unpack(pack(mask), members) == mask).all()
    assert pack(mask).shape == (rows, -(-members // 32))
