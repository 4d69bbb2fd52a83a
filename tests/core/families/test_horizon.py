import pytest

from warp_pd import Sheet
from warp_pd.families import notes_on_reach


@pytest.mark.parametrize(
    ("points", "horizon", "said"),
    [
        ((90, 30), 2.015, "families of 10 members reach further along one axis than along the other; expected numbers "
         "of points with equal spacings, or a horizon of 2.03"),
        ((90, 30), 2.03, ""), ((88, 30), 2.015, ""), ((90, 30), 1.5, ""), ((60, 30), 2.015, ""), ((180, 60), 2.015, ""),
    ],
)  # fmt: skip
def test_families_that_reach_further_along_one_axis_are_noted(points, horizon, said):
    sheet = Sheet.rectangle(0.06, 0.02, thickness=1e-3, density=1000.0, points=points)
    notes = notes_on_reach(sheet, horizon * sheet.spacing)
    assert len(notes) == (said != "") and all(note.endswith(said) for note in notes)


def test_clouds_and_rows_have_no_such_note():
    line = Sheet.line(0.1, 1e-6, density=1000.0, points=20)
    cloud = Sheet.rectangle(0.06, 0.02, thickness=1e-3, density=1000.0, points=(90, 30)).as_cloud()
    assert notes_on_reach(line, 2.015 * line.spacing) == [] == notes_on_reach(cloud, 2.015 * cloud.spacing)
