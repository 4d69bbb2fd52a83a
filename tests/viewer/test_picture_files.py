"""Files of pictures: whole, or not there and one line."""

import pytest

from warp_pd.device.checks import OutputError
from warp_pd.viewer.pictures import new_figure, save


def test_a_picture_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "sheet.png").mkdir()
    with pytest.raises(OutputError, match=r"sheet\.png' cannot be written: Is a directory"):
        save(new_figure(1.0, 1.0), tmp_path / "sheet.png")


def test_a_folder_that_is_gone_is_one_line(tmp_path):
    with pytest.raises(OutputError, match="cannot be written: No such file or directory"):
        save(new_figure(1.0, 1.0), tmp_path / "gone" / "sheet.png")
