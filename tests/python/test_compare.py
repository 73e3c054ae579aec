# SPDX-License-Identifier: Apache-2.0
"""Comparing images from Python and by the command."""

import json
import subprocess
import sys

import numpy as np
import pytest

import heddle

RNG = np.random.default_rng(5)
A, B = RNG.random((20, 31, 3), np.float32), RNG.random((20, 31, 3), np.float32)


def run(command, *arguments):
    return subprocess.run([command, *map(str, arguments)], capture_output=True, text=True)


def test_one_name_gives_a_number_and_several_give_a_table():
    d = A.astype(np.float64) - B
    assert heddle.compare(A, B, "rmse") == pytest.approx(np.sqrt(np.mean(d**2)), rel=1e-12)
    assert heddle.compare(A, B, "relmse") == pytest.approx(np.mean(d**2 / (B.astype(np.float64) ** 2 + 0.01)), rel=1e-12)
    table = heddle.compare(A, B, ["maximum", "percentile_50"])
    assert list(table) == ["maximum", "percentile_50"]
    assert table["maximum"]["value"] == np.abs(d).max()
    y, x, channel = np.unravel_index(np.abs(d).argmax(), d.shape)
    assert (table["maximum"]["pixel"], table["maximum"]["channel"]) == ([x, y], channel)
    assert heddle.compare(A, A, "psnr") == np.inf


def test_arrays_are_read_where_they_are():
    from heddle.host import _to_image

    record, array = _to_image(A)
    assert array is A or array.base is A
    assert np.ctypeslib.as_array(record.pixels, (1,)).__array_interface__["data"][0] == A.__array_interface__["data"][0]


def test_any_layout_gives_the_same_numbers():
    expected = heddle.compare(A, B, "flip")
    wide = np.zeros((20, 62, 3), np.float32)
    wide[:, ::2] = A
    assert heddle.compare(wide[:, ::2], np.asfortranarray(B), "flip") == expected
    assert heddle.compare(A.astype(np.float64), B.tolist(), "flip") == expected


def test_no_bit_depends_on_threads():
    for metric in ("flip", "ssim"):
        assert heddle.compare(A, B, metric, threads=1) == heddle.compare(A, B, metric, threads=3)


@pytest.mark.parametrize("pixels_per_degree", [1, 5, 300, 1000])
def test_flip_has_numbers_under_any_viewing_conditions(pixels_per_degree):
    # Filters narrower than a pixel, and wider than the image.
    for metric in ("flip", "hdr_flip"):
        found = heddle.error_image(A, B, metric, pixels_per_degree=pixels_per_degree)
        assert np.isfinite(found).all() and 0 < found.max() <= 1
        assert not heddle.error_image(A, A, metric, pixels_per_degree=pixels_per_degree).any()


def test_what_cannot_be_compared_is_said():
    with pytest.raises(heddle.Error, match="image a is 31 x 20 x 3, image b 30 x 20 x 3"):
        heddle.compare(A, B[:, :30], "rmse")
    bad = A.copy()
    bad[7, 11, 2] = np.nan
    with pytest.raises(heddle.Error, match="image a is not finite\n  found:    nan at x 11, y 7, channel 2"):
        heddle.compare(bad, B, "flip")
    with pytest.raises(heddle.Error, match="did you mean 'flip'"):
        heddle.compare(A, B, "flup")
    with pytest.raises(heddle.Error, match="without pixels"):
        heddle.compare(np.zeros((0, 0, 3)), np.zeros((0, 0, 3)), "rmse")
    with pytest.raises(heddle.Error, match="0 exposures"):
        heddle.compare(A, B, "hdr_flip", exposures=(0, 0, 0))


def test_each_metric_says_its_formula_and_has_an_error_image():
    for metric in heddle.metrics():
        name = metric["name"].replace("_P", "_75")
        assert heddle.compare(A, B, [name])[name]["formula"] == metric["formula"]
        image = heddle.error_image(A, B, name)
        assert image.shape[:2] == A.shape[:2] and np.isfinite(image).all()


def test_comparing_opens_no_library():
    done = subprocess.run([sys.executable, "-c", (
        "import heddle, numpy as np\n"
        "heddle.compare(np.zeros((4, 4, 3), np.float32), np.ones((4, 4, 3), np.float32), 'flip')\n"
        "maps = open('/proc/self/maps').read()\n"
        "assert 'OpenImageIO' not in maps and 'vulkan' not in maps\n")], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_a_float_picture_stays_one_and_a_png_is_told_by_its_name(command, host, tmp_path):
    hdr = tmp_path / "a.exr", tmp_path / "b.exr"
    for file, pixels in zip(hdr, (1000 * A - 3, 1000 * B)):
        host.write_image(file, pixels)
    done = run(command, "compare", *hdr, "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)["metrics"]
    assert found["rmse"]["value"] == heddle.compare((1000 * A - 3).astype(np.float32), (1000 * B).astype(np.float32), "rmse")
    assert "hdr_flip" in found and "flip" not in found
    low = tmp_path / "a.png", tmp_path / "b.png"
    for file, pixels in zip(low, (A, B)):
        host.write_image(file, pixels)
    found = json.loads(run(command, "compare", *low, "--json").stdout)["metrics"]
    assert "flip" in found and "hdr_flip" not in found
    assert found["flip"]["value"] == heddle.compare(host.read_image(low[0]), host.read_image(low[1]), "flip")


def test_the_command_writes_error_images_as_numbers_and_for_the_eye(command, host, tmp_path):
    files = tmp_path / "a.exr", tmp_path / "b.exr"
    for file, pixels in zip(files, (A, B)):
        host.write_image(file, pixels)
    numbers, colors = tmp_path / "error.exr", tmp_path / "error.png"
    for file in (numbers, colors):
        done = run(command, "compare", *files, "--metric", "hdr_flip", "--exposures", -2, 2, 3, "--error-image", file)
        assert done.returncode == 0, done.stderr
        assert "3 exposures, -2 to 2 stops, aces" in done.stdout
    expected = heddle.error_image(A, B, "hdr_flip", exposures=(-2, 2, 3))
    assert np.array_equal(host.read_image(numbers), expected)
    brightness = host.read_image(colors).mean(-1).ravel()
    order = np.argsort(expected.ravel())
    assert brightness[order[-1]] == brightness.max() and brightness[order[0]] == brightness.min()


def test_bounds_work_with_every_metric(command, host, tmp_path):
    a, b = tmp_path / "a.png", tmp_path / "b.png"
    host.write_image(a, np.full((4, 4, 3), 0.5))
    host.write_image(b, np.full((4, 4, 3), 0.6))
    assert run(command, "compare", a, b, "--bound", "flip=0.5", "--bound", "ssim=0.5").returncode == 0
    assert run(command, "compare", a, b, "--bound", "flip=0.001").returncode == 1
    assert run(command, "compare", a, b, "--bound", "ssim=0.9999").returncode == 1
    refused = run(command, "compare", a, b, "--bound", "flop=1")
    assert refused.returncode == 2 and "did you mean 'flip'" in refused.stderr
