"""The wheel holds kernels and scenes under warp_pd, and works where it is installed."""

import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
# Folders of the repository, and where the wheel has them.
PLACES = {"warp_pd": "warp_pd", "kernels": "warp_pd/kernels", "scenes": "warp_pd/scenes"}


def test_the_wheel_works_away_from_the_sources(tmp_path):
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q"]
    source = tmp_path / "source"
    source.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE", *PLACES):
        subprocess.run(["cp", "-r", str(ROOT / name), str(source)], check=True)
    build = [*pip, "wheel", "--no-deps", "--no-build-isolation", "-w", str(tmp_path), str(source)]
    subprocess.run(build, check=True, capture_output=True)
    wheel = next(tmp_path.glob("*.whl"))
    modules = {f"{PLACES[name]}/{p.relative_to(ROOT / name)}" for name in PLACES for p in (ROOT / name).rglob("*.py")}
    modules |= {f"warp_pd/scenes/{p.name}" for p in (ROOT / "scenes").glob("*.svg")}
    modules |= {f"warp_pd/output/page/{p.name}" for p in (ROOT / "warp_pd" / "output" / "page").iterdir()}
    assert {"warp_pd/scenes/glove.svg", "warp_pd/output/page/vendor.js"} <= modules
    assert modules <= set(zipfile.ZipFile(wheel).namelist())
    site = tmp_path / "site"
    subprocess.run([*pip, "install", "--no-deps", "--no-index", "--target", str(site), str(wheel)], check=True)
    code = (
        "import warp_pd, warp_pd.kernels.materials, warp_pd.scenes.pressure as scene; "
        "print(warp_pd.__file__); print(scene.build(points=5, solver='explicit').plan('cpu').count('drift'))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env={"PYTHONPATH": str(site), "HOME": str(tmp_path)},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    where, count = done.stdout.split("\n")[-3:-1]
    assert Path(where).is_relative_to(site)
    assert int(count) == 1


def test_import_is_lean():
    """Importing the package pulls neither torch nor pxr, h5py or matplotlib."""
    code = (
        "import sys, warp_pd; print([m for m in ('torch', 'pxr', 'h5py', 'matplotlib', 'scipy') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
