"""A browser for the tests of pages: Chromium of the system or of Playwright, without a screen."""

import os
import shutil

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


def start(playwright):
    """Chromium, which draws on the CPU."""
    found = os.environ.get("CHROMIUM") or next((path for name in NAMES if (path := shutil.which(name))), None)
    options = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    return playwright.chromium.launch(executable_path=found, args=options)


@pytest.fixture(scope="module")
def browser():
    """A browser for the tests of a file."""
    api = pytest.importorskip("playwright.sync_api", reason="needs Playwright")
    with api.sync_playwright() as playwright:
        try:
            found = start(playwright)
        except api.Error as error:
            # Where .ci/run found or installed a browser, these tests must run.
            if os.environ.get("NEEDS_BROWSER"):
                raise
            pytest.skip(f"needs Chromium: {str(error).splitlines()[0]}")
        yield found
        found.close()
