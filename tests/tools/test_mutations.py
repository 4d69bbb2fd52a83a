"""Changes that the campaign makes: Python that says something else, of every kind, in the order of the seed."""

import ast
from itertools import islice

from code_changes import ROOT, mutations, mutations_in

FILE = "kernels/gas/enclosed_volume.py"


def test_changes_are_python_that_says_something_else():
    source = (ROOT / FILE).read_bytes()
    before, found = ast.dump(ast.parse(source)), mutations_in(FILE)
    assert {mutation.row["kind"] for mutation in found} == {"constant", "sign", "comparison", "term", "factor"}
    for begin, end, text, _ in found:
        assert ast.dump(ast.parse(source[:begin] + text.encode() + source[end:])) != before
    assert ("gas_leak.lose_gas", "2.0", "2.08") in {(m.row["function"], m.row["before"], m.row["after"]) for m in found}


def test_the_order_is_that_of_the_seed_and_begins_with_one_change_of_each_file():
    first = [mutation.row for mutation in islice(mutations("warp_pd/contact"), 12)]
    assert first == [mutation.row for mutation in islice(mutations("warp_pd/contact"), 12)]
    assert len({row["file"] for row in first}) == 12
