"""The cache of kernels: not writable, read-only, damaged, full."""

import os
import shutil
import subprocess
import sys

import pytest
import warp as wp
from warp._src import codegen

from warp_pd.device import kernel_cache
from warp_pd.device.cores import start_warp

CODE = """
import sys
import warp as wp
from warp_pd.device import kernel_cache
from warp_pd.device.cores import load_kernel, start_warp

@wp.func
def twice(value: float):
    return 2.0 * value

@wp.kernel(enable_backward=False)
def double(values: wp.array(dtype=float)):
    i = wp.tid()
    values[i] = twice(values[i])

start_warp()
for _ in range(2):
    load_kernel(double, wp.get_device("cpu"))
values = wp.array([1.0, 2.0], dtype=float, device="cpu")
wp.launch(double, 2, [values], device="cpu")
print(values.numpy().tolist(), wp.config.kernel_cache_dir, *kernel_cache.notes(), sep="\\n")
"""


def run(folder, cache, **more):
    (folder / "doubles.py").write_text(CODE)
    path = os.pathsep.join([str(folder), *sys.path])
    given = {**os.environ, "PYTHONPATH": path, "WARP_CACHE_PATH": str(cache), **more}
    done = subprocess.run(
        [sys.executable, folder / "doubles.py"], env=given, cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    values, where, *notes = done.stdout.strip().splitlines()
    assert values == "[2.0, 4.0]" and "Traceback" not in done.stderr
    return where, notes


def test_a_cache_that_cannot_be_written_is_a_note(tmp_path):
    (tmp_path / "file").write_text("mine")
    where, notes = run(tmp_path, tmp_path / "file" / "cache")
    assert len(notes) == 1 and "cannot be written (Not a directory)" in notes[0] and "WARP_CACHE_PATH" in notes[0]
    assert not os.path.exists(where), "the temporary folder ends with the process"


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """A cache with one module."""
    folder = tmp_path_factory.mktemp("filled")
    run(folder, folder / "cache")
    return folder / "cache"


def test_a_kernel_is_written_once(filled):
    """By itself Warp writes this one for known strides too, and compiles both; and its function's adjoint."""
    (source,) = filled.rglob("*.cpp")
    assert "twice_0(" in source.read_text() and "adj_twice" not in source.read_text()
    assert "_cpu_forward_tasks<false>(" in source.read_text()
    assert "_cpu_forward_tasks<true>(" not in source.read_text()


@pytest.mark.parametrize("left", [b"", b"\\0" * 300, None])
def test_a_damaged_module_is_compiled_once_more(filled, tmp_path, left):
    """Cut, overwritten, and without its description."""
    cache = tmp_path / "cache"
    shutil.copytree(filled, cache)
    objects, descriptions = list(cache.rglob("*.o")), list(cache.rglob("*.meta"))
    assert len(objects) == len(descriptions) == 1
    for file in objects if left is not None else descriptions:
        file.write_bytes(left or b"")
    headers = {file: file.stat().st_mtime_ns for file in cache.rglob("*.pch")}
    _, notes = run(tmp_path, cache)
    assert notes == [] and next(iter(cache.rglob("*.o"))).stat().st_size > 300
    again = {file: file.stat().st_mtime_ns for file in cache.rglob("*.pch")}
    assert len(headers) == 1 and again == headers, "a second process takes the headers of the first"


def test_damaged_headers_are_done_without(filled, tmp_path):
    """Cut: the module is compiled without them, and they are gone for the next one."""
    cache = tmp_path / "cache"
    shutil.copytree(filled, cache)
    shutil.rmtree(next(iter(cache.rglob("*.o"))).parent)
    (headers,) = cache.rglob("*.pch")
    headers.write_bytes(headers.read_bytes()[:1000])
    _, notes = run(tmp_path, cache)
    assert notes == [] and list(cache.rglob("*.o")) and not headers.exists()


def test_a_cache_that_can_only_be_read_is_used(tmp_path):
    """Its files are linked into the temporary folder, where others can be added."""
    (tmp_path / "cache" / "module").mkdir(parents=True)
    (tmp_path / "cache" / "module" / "one.o").write_text("one")
    (tmp_path / "own").mkdir()
    kernel_cache._link(tmp_path / "cache", tmp_path / "own")
    (tmp_path / "own" / "module" / "two.o").write_text("two")
    assert (tmp_path / "own" / "module" / "one.o").read_text() == "one"
    assert os.listdir(tmp_path / "cache" / "module") == ["one.o"]


def test_a_full_cache_is_one_line(tmp_path, monkeypatch):
    with pytest.raises(kernel_cache.InputError, match="expected WARP_CACHE_PATH to name a folder with room"):
        kernel_cache._require_room(tmp_path / "missing")


def test_overloads_are_looked_for_once(monkeypatch):
    """A second function with calls of the same types asks Warp for none, and one without an overload is refused."""
    start_warp()
    tried, match = [], codegen.func_match_args
    monkeypatch.setattr(codegen, "func_match_args", lambda *given, **more: tried.append(given) or match(*given, **more))

    def first(x: wp.vec3d, s: wp.float64):
        return wp.normalize(x) * s + wp.cross(x, x)

    def second(y: wp.vec3d, t: wp.float64):
        return wp.cross(y, y) * t + wp.normalize(y)

    def wrong(y: wp.vec3d, t: wp.float64):
        return wp.cross(y, t)

    written = codegen.Adjoint(first), codegen.Adjoint(second)
    written[0].build(None, {})
    tried.clear()
    written[1].build(None, {})
    assert not tried and "wp::cross(var_y, var_y)" in "".join(written[1].blocks[0].body_forward)
    for _ in range(2):
        with pytest.raises(codegen.WarpCodegenError, match=r"overload for 'cross'.*vec3d, float64"):
            codegen.Adjoint(wrong).build(None, {})
