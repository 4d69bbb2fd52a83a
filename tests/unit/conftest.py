"""What the tests of modules share."""

import pytest
from small_runs import BALL, cli


@pytest.fixture(scope="session")
def ball(tmp_path_factory):
    """Folder of a small ball scene that tore; not to be changed."""
    folder = tmp_path_factory.mktemp("ball")
    done = cli("run", *BALL, "--frames", "24", "--out", folder)
    assert done.exit_code == 0, done.output
    return folder
