"""The file of a network, and what the neural law refuses as its network."""

import dataclasses
import json

import numpy as np
import pytest
from helpers import GENT, NEO, refused
from point_laws import tiny

from warp_pd import Neural


def saved(path, edit=None, **changes):
    network = tiny(**changes)
    network.save(path)
    if edit is not None:
        with np.load(path) as stored:
            arrays = dict(stored)
        edit(arrays)
        np.savez(path, **arrays)
    return path


def of_version(version):
    def edit(arrays):
        facts = json.loads(bytes(arrays["facts"])) | {"version": version}
        arrays["facts"] = np.frombuffer(json.dumps(facts).encode(), np.uint8)

    return edit


def with_nan(arrays):
    arrays["weights_1"][2, 1] = np.nan


def with_wrong_width(arrays):
    arrays["weights_0"] = arrays["weights_0"][:, :3]


BAD_FILES = {
    "other version": (of_version(7), "expected a network of version 1, got version 7; train it again"),
    "NaN weight": (with_nan, "layer 1 has a weight that is not finite; .*finite numbers$"),
    "wrong width": (with_wrong_width, r"layer 0 has weights \(5, 3\)\W.*: expected \(n, 4\) and \(n,\)$"),
    "lost layer": (lambda arrays: arrays.pop("biases_1"), "the file is damaged"),
    "no facts": (lambda arrays: arrays.pop("facts"), "the file is damaged"),
    "three outputs": (
        lambda arrays: arrays.update(weights_2=np.zeros((3, 7)), biases_2=np.zeros(3)),
        r"it has 3 outputs\W.* 2$",
    ),
    "zero scale": (
        lambda arrays: arrays.update(input_scale=np.zeros(4)),
        r"input_scale = \[0\.0, 0\.0, 0\.0, 0\.0\]\W.* 4 finite scales$",
    ),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_bad_model_files_end_with_one_line(case, tmp_path):
    edit, said = BAD_FILES[case]
    path = saved(tmp_path / "bad.npz", edit)
    with refused(match=rf"^network = [^\n]*bad\.npz': {said}"):
        Neural(NEO, network=path)


def test_missing_and_foreign_files_and_materials_are_refused(tmp_path):
    (tmp_path / "text.npz").write_text("no network")
    trained = r"(?=.*'the default').*NeoHookean\(bulk/mu = 100\)"
    cases = [
        (lambda: Neural(NEO, network=tmp_path / "none.npz"), "^network = .*none.npz': the file does not exist"),
        (lambda: Neural(NEO, network=tmp_path / "text.npz"), "^network = .*text.npz': the file is damaged"),
        (lambda: Neural(GENT), rf"^material = Gent\(bulk/mu = 200, lock = 160\): {trained}"),
        (lambda: Neural(dataclasses.replace(NEO, bulk=2e5)), rf"^material = NeoHookean\(bulk/mu = 200\): {trained}"),
        (lambda: Neural(NEO, network=tiny(ratios={"bulk/mu": 50.0})), r"^material = .* NeoHookean\(bulk/mu = 50\)"),
        (lambda: Neural(NEO, network=3), "^network = 3: expected a Network"),
        (lambda: Neural(NEO, evaluation="exact"), "^evaluation = 'exact': expected one of 'torch', 'fused'"),
        (
            lambda: Neural(NEO, evaluation="fused", network=tiny(hidden=(100, 100))),
            "at most 10000 weights .* got 10802",
        ),
        (
            lambda: Neural(NEO, evaluation="fused", network=lambda x: x),
            "^network: expected .* evaluation 'fused'$",
        ),
        (lambda: Neural(NEO, evaluation="closed_form", network=tiny()), "^network: expected None .* 'closed_form'$"),
        (lambda: Neural(NEO, horizon=-1.0), "^horizon = -1.0: expected a positive number$"),
    ]
    for make, said in cases:
        with refused(match=said):
            make()
