"""The page of a run in the frame of a notebook, in Chromium."""

from helpers import square
from small_runs import simulate

from warp_pd import Explicit, Fixed


def test_a_notebook_shows_the_page_in_a_frame(browser, tmp_path):
    sheet = square(9)
    result = simulate(
        sheet, Explicit(0.01, frames=3), loads=[Fixed(sheet.edges("left"))], fields=("stretch",)
    ).run(device="cpu", out=tmp_path / "run", usd=False, pictures=False, view=False)  # fmt: skip
    notebook = tmp_path / "notebook.html"
    notebook.write_text(f"<!doctype html><body>before{result.show(500)._repr_html_()}after</body>")
    page = browser.new_page()
    wrong = []
    page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.goto(notebook.as_uri())
    frame = page.frame_locator("iframe")
    frame.locator("#field option").first.wait_for(state="attached")
    names = frame.locator("#field option").all_inner_texts()
    assert "largest principal stretch" in names
    assert frame.locator("canvas").first.bounding_box()["width"] > 100
    assert page.locator("iframe").bounding_box()["height"] == 500 and not wrong
    page.close()
