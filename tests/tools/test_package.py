"""The wheel holds kernels and scenes under warp_pd, and works where it is installed."""

import ast
import pkgutil
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import warp_pd

ROOT = Path(__file__).parents[2]
# Folders of the repository, and where the wheel has them.
PLACES = {"warp_pd": "warp_pd", "kernels": "warp_pd/kernels", "scenes": "warp_pd/scenes"}


def test_the_wheel_works_away_from_the_sources(tmp_path):
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q"]
    source = tmp_path / "source"
    source.mkdir()
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE", "MANIFEST.in", *PLACES):
        subprocess.run(["cp", "-r", str(ROOT / name), str(source)], check=True)
    build = [*pip, "wheel", "--no-deps", "--no-build-isolation", "-w", str(tmp_path), str(source)]
    subprocess.run(build, check=True, capture_output=True)
    wheel = next(tmp_path.glob("*.whl"))
    modules = {f"{PLACES[name]}/{p.relative_to(ROOT / name)}" for name in PLACES for p in (ROOT / name).rglob("*.py")}
    modules |= {f"warp_pd/scenes/{p.name}" for p in (ROOT / "scenes").glob("*.svg")}
    modules |= {f"warp_pd/viewer/page/{p.name}" for p in (ROOT / "warp_pd" / "viewer" / "page").iterdir()}
    assert {"warp_pd/scenes/glove.svg", "warp_pd/viewer/page/vendor.js"} <= modules
    with zipfile.ZipFile(wheel) as archive:
        assert modules <= set(archive.namelist())
        metadata = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        description = archive.read(metadata).decode().partition("\n\n")[2]
    assert "# warp_pd" in description and "docs/" not in description and "![" not in description
    assert "[NVIDIA Warp](https://" in description and "](" not in description.replace("](https://", "")
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


def test_a_clone_runs_without_being_installed(tmp_path):
    """`python -m warp_pd` in the folder of the sources, which hide an installed package."""
    for name in PLACES:
        subprocess.run(["cp", "-r", str(ROOT / name), str(tmp_path)], check=True)
    code = (
        "import sys; sys.meta_path = [f for f in sys.meta_path if 'editable' not in str(f)]; sys.path.insert(0, '.');"
    )
    code += "import runpy; sys.argv = ['warp-pd', 'plan', 'pressure', '--points', '5', '--device', 'cpu'];"
    code += f"import warp_pd; assert warp_pd.__file__.startswith({str(tmp_path)!r});"
    code += "runpy.run_module('warp_pd', run_name='__main__')"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "family_rows" in done.stdout, done.stderr


def test_a_source_distribution_has_the_tests(tmp_path):
    """What a packager of a distribution builds and tests from."""
    source = tmp_path / "source"
    source.mkdir()
    tracked = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, tracked.split("\0")):
        if (ROOT / name).is_file() and not name.startswith("docs/gallery/"):
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, source / name)
    build = "import setuptools.build_meta as b; print(b.build_sdist('..'))"
    done = subprocess.run([sys.executable, "-c", build], cwd=source, capture_output=True, text=True, check=True)
    file = tmp_path / done.stdout.strip().splitlines()[-1]
    assert file.name == f"warp_pd-{warp_pd.__version__}.tar.gz"
    with tarfile.open(file) as archive:
        inside = {name.partition("/")[2] for name in archive.getnames()}
    assert {"tests/core/test_cli.py", "tests/references/treloar.csv", "tools/check_structure.sh", "CITATION.cff",
            "kernels/bond_associated.py", "scenes/glove.svg", "LICENSE", "docs/guide.md"} <= inside  # fmt: skip


def test_one_version():
    assert f"version: {warp_pd.__version__}\n" in (ROOT / "CITATION.cff").read_text("utf-8")
    assert f"## [{warp_pd.__version__}]" in (ROOT / "CHANGELOG.md").read_text("utf-8")


def test_import_is_lean():
    """Importing the package pulls neither torch nor pxr, h5py or matplotlib."""
    code = (
        "import sys, warp_pd; print([m for m in ('torch', 'pxr', 'h5py', 'matplotlib', 'scipy') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_no_name_of_a_lazy_package_is_that_of_a_module_in_it():
    """Importing the module would put it in the place of the name."""
    found = {}
    for path in (ROOT / "warp_pd").rglob("__init__.py"):
        text = path.read_text("utf-8")
        if "lazy(__name__)" in text:
            imports = [
                node
                for node in ast.walk(ast.parse(text))
                if isinstance(node, ast.ImportFrom) and node.level and node.module
            ]
            names = {alias.name for node in imports for alias in node.names}
            modules = {module.name for module in pkgutil.iter_modules([str(path.parent)])}
            found[str(path.relative_to(ROOT))] = names & modules
    assert len(found) > 3 and not any(found.values()), found
