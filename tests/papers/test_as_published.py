"""`warp-pd run SCENE --as-published`: what a paper prints for its example."""

import inspect
import json
import re

import pytest
from small_runs import cli

from warp_pd.command.scene_files import build_scene, load_scene, scene_file, scene_names
from warp_pd.papers.as_published import PRINTED, as_published


def test_every_scene_that_a_paper_printed_has_its_arguments():
    texts = {name: scene_file(name).read_text() for name in scene_names()}
    assert {name for name, text in texts.items() if re.search(r'section="(BA|NN|IM|HE|VE) ', text)} == set(PRINTED)


@pytest.mark.parametrize("scene", PRINTED)
def test_the_printed_arguments_build_the_scene(scene):
    settings = as_published(scene, {})
    assert settings.keys() <= inspect.signature(load_scene(scene).build).parameters.keys()
    built = build_scene(scene, settings)
    assert {name: built.settings[name] for name in settings} == settings
    if settings.get("weights") == "published":
        # BA and NN have one volume a point.
        assert built.sheet.areas.min() == built.sheet.areas.max()


def test_what_is_given_replaces_what_is_printed():
    assert as_published("pressure", {"points": 21})["points"] == 21
    assert as_published("stretch", {"mode": "uniaxial"})["points"] == 50
    assert as_published("metamaterial", {"failure": "true"})["rate"] == 1e6


def test_a_run_as_published_says_so_in_its_summary(tmp_path):
    arguments = ["run", "bimodular_bar", "--as-published", "--points", "40", "--device", "cpu", "--no-usd"]
    done = cli(*arguments, "--no-pictures", "--quiet", "--out", tmp_path / "run")
    assert done.exit_code == 0
    settings = json.loads((tmp_path / "run" / "summary.json").read_text())["settings"]
    assert (settings["points"], settings["horizon"], settings["tolerance"]) == (40, 3.0, 1e-5)


def test_a_scene_that_no_paper_printed_is_refused_in_one_line():
    done = cli("run", "needle", "--as-published")
    assert done.exit_code == 2 and len(done.output.strip().splitlines()) == 1
    assert "--as-published: no paper printed scene 'needle'; expected one of tension" in done.output
