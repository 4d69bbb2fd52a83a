"""The register of fields."""

import warp as wp
from helpers import refused

from warp_pd.device.fields import Field, FieldRegister


def test_rows_that_warp_cannot_address_are_refused():
    """Its kernels hold the bytes from one row to the next in 32 bits; one row costs 2 GB of addresses, unused."""
    register = FieldRegister(wp.get_device("cpu"))
    with refused(match="has 178956971 entries in a row: expected at most 178956970;"):
        register.allocate(Field("bond_force", "law", "bond"), wp.vec3, shape=(0, 178_956_971))
    held = register.allocate(Field("bond_force", "law", "bond"), wp.vec3, shape=(0, 178_956_970))
    assert held.strides[0] == 12 * 178_956_970 < 2**31


def test_two_fields_of_one_name_in_frames_are_refused():
    register = FieldRegister(wp.get_device("cpu"))
    register.allocate(Field("shown", "law", output="heat"), wp.float32, shape=3)
    with refused(match="mine: output = 'heat': law already has an output of this name; expected another one"):
        register.allocate(Field("other", "mine", output="heat"), wp.float32, shape=3)
