# SPDX-License-Identifier: Apache-2.0
"""Reports of studies: pixels come back to the bit, the page keeps to its size, its two sentences say what the rows say, and a
row is made again."""

import argparse
import json
import math
import os
import re
import subprocess

import numpy as np
import pytest
import synthetic_study
from test_study import SMALL, options

import heddle
from heddle import report, reproduce, study_items, study_run
from heddle import statistics as s
from heddle import study_images as images
from heddle.report.verdict import verdict


@pytest.fixture(scope="module", autouse=True)
def lock_of_our_own(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study_items, "LOCK", tmp_path_factory.mktemp("lock") / "lock")
        yield


# ---- Pixels ----

@pytest.mark.parametrize("shape", [(1, 1, 1), (3, 5, 1), (7, 2, 3), (4, 9, 4)])
@pytest.mark.parametrize("kind", ["float32", "float16", "uint8"])
def test_pixels_come_back_to_the_bit(shape, kind):
    random = np.random.default_rng(3)
    bits = random.integers(0, 256, (*shape, np.dtype(kind).itemsize), np.uint8)  # every NaN and denormal number there is
    values = np.ascontiguousarray(bits).view(kind)[..., 0]
    back = images.unpack(*images.pack(values))
    assert back.dtype == values.dtype and back.shape == values.shape and back.tobytes() == values.tobytes()


def test_a_kept_image_is_exact_and_a_damaged_one_is_told(tmp_path):
    image = np.random.default_rng(1).random((9, 13, 2), np.float32)
    image[2, 3] = np.nan, np.inf
    for key, kept in (("whole", image), ("half", image.astype(np.float16).astype(np.float32))):
        images.keep(tmp_path, key, kept)
        assert images.load(tmp_path, key).tobytes() == kept.tobytes()
        assert images.head_of(tmp_path, key)["type"] == {"whole": "f32", "half": "f16"}[key]
    path = images.file_of(tmp_path, "whole")
    for damage in (path.read_text()[:-40], path.read_text().replace('"sha256": "', '"sha256": "0')):
        images.file_of(tmp_path, "damaged").write_text(damage)
        with pytest.raises(ValueError):
            images.load(tmp_path, "damaged")
    assert images.head_of(tmp_path, "missing") is None


@pytest.mark.parametrize("mantissa", [10, 7, 5])
def test_rounded_halves_are_as_near_as_their_bits_allow(mantissa):
    values = np.float32(2.0) ** np.random.default_rng(2).uniform(-14, 15.99, 20000).astype(np.float32)
    values = np.concatenate([values, -values]).reshape(1, -1, 1)
    rounded = images.to_half(values, mantissa).astype(np.float64)
    # Half a step of the float16 before, and half of the shorter mantissa's.
    bound = 2.0 ** -(mantissa + 1) + (2.0 ** -11 if mantissa < 10 else 0)
    assert np.max(np.abs(rounded / values - 1)) <= bound
    odd = images.to_half(np.array([[[np.nan], [1e9], [-1e9], [0.0], [np.inf]]], np.float32), mantissa)[0, :, 0].astype(float)
    assert np.isnan(odd[0]) and odd[3] == 0 and 63000 < odd[1] <= 65504 and odd[2] == -odd[1] and odd[4] == odd[1]


def test_half_as_large_is_the_mean_of_what_is_there():
    image = np.arange(15, dtype=np.float32).reshape(3, 5, 1)
    assert images.halved(image)[..., 0].tolist() == [[3.0, 5.0, 6.5], [10.5, 12.5, 14.0]]


# ---- The page ----

@pytest.fixture(scope="module")
def explain():
    return synthetic_study.explained()


def quick_flip(page, kept, image, reference):
    """A map of the same size and about as many bits, without FLIP's work."""
    map = np.clip(255 * np.abs(image - reference).mean(axis=2, keepdims=True), 0, 255)
    return {"name": "hdr_flip", "value": 0.1, "formula": "made up"}, np.rint(map).astype(np.uint8)


def test_thirty_variants_of_five_scenes_keep_to_sixty_megabytes(tmp_path, explain, monkeypatch):
    # With --all as large as it may become; else a hundredth of the pixels, of which tiles of 8 pixels have a larger part.
    size, budget = ((640, 360), 60_000_000) if os.environ.get("HEDDLE_TEST_ALL") else ((64, 36), 4_000_000)
    monkeypatch.setattr(report.Page, "flip", quick_flip)
    kept = synthetic_study.write_study(tmp_path, explain, 30, 5, size)
    path = report.write(tmp_path, budget=budget, whole=0)
    data = report.points_of(path)
    assert path.stat().st_size <= budget
    assert len(data["points"]) == 150 and len(data["images"]) == 155
    assert data["level"] == {"scale": 2, "mantissa": 10}
    assert all(point["image"] in data["images"] for point in data["points"])
    # The tiles that are worst are whole, and to the bit.
    text = path.read_text()
    point = data["points"][37]
    image = kept[1, point["name"]]
    head = data["images"][point["image"]]
    for tile in head["tiles"]:
        found = embedded(text, tile["pixels"])
        assert np.array_equal(found, image[tile["y"]:tile["y"] + head["tile_side"], tile["x"]:tile["x"] + head["tile_side"]])
    assert np.allclose(embedded(text, head["pixels"]), images.halved(image), rtol=2**-11)


def embedded(text, head):
    import base64

    data = re.search(rf'<script type="text/plain" id="{head["id"]}">([^<]*)</script>', text)[1]
    return images.unpack(head, base64.b64decode(data)).astype(np.float32)


def test_less_room_means_fewer_bits_then_fewer_pixels(tmp_path, explain, monkeypatch):
    monkeypatch.setattr(report.Page, "flip", quick_flip)
    synthetic_study.write_study(tmp_path, explain, 4, 1, (96, 54))
    found, last = [], report.write(tmp_path).stat().st_size
    assert report.points_of(tmp_path / "report.html")["level"] == {"scale": 1, "mantissa": None}
    for _ in range(5):  # each a little smaller than the one before may be
        path = report.write(tmp_path, budget=last - 1, whole=0)
        assert path.stat().st_size < last
        last = path.stat().st_size
        level = report.points_of(path)["level"]
        found.append((level["scale"], -level["mantissa"]))
    assert found == sorted(set(found)) and found[0] == (2, -10) and found[-1][0] >= 4


def test_worst_tiles_are_those_of_the_largest_mean_error(tmp_path, explain):
    kept = synthetic_study.write_study(tmp_path, explain, 2, 1, (100, 70))
    page = report.Page(tmp_path, json.loads((tmp_path / "results.json").read_text()))
    image, reference = kept[0, "technique01"].copy(), kept[0, study_run.REFERENCE]
    image[64:70, 96:100] += 9  # in a tile of 4 x 6 pixels, at the edge
    image[16:24, 40:48] += 5
    side, tiles = page.worst_tiles(report.Kept("x", "y", "rmse", False), image, reference, 3)
    assert side == 8 and [(tile["x"], tile["y"]) for tile in tiles[:2]] == [(96, 64), (40, 16)]
    assert tiles[0]["error"] == pytest.approx(np.abs(image - reference)[64:, 96:].mean(), rel=1e-6)
    same = page.worst_tiles(report.Kept("x", "y", "rmse", False), reference, reference, 3)
    assert same == (8, [])


def test_what_a_study_says_is_no_markup(tmp_path, explain):
    evil = '</script><img src=x onerror="document.title=1"><!--<script>'
    synthetic_study.write_study(tmp_path, explain, 2, 1, title=evil)
    text = report.write(tmp_path).read_text()
    assert "<img" not in text and text.count("<!--") == 0
    assert report.points_of(tmp_path / "report.html")["title"] == evil


def test_a_lost_point_and_a_missing_image_are_told(tmp_path, explain):
    synthetic_study.write_study(tmp_path, explain, 3, 1, lost=("technique01",))
    images.file_of(tmp_path, "image0x2").unlink()
    data = report.points_of(report.write(tmp_path))
    assert [point["state"] for point in data["points"]] == ["ok", "crashed", "ok"]
    assert [point["image"] for point in data["points"]] == ["image0x0", None, None]
    assert "lost: technique01 on cornell_box view0 (crashed)" in data["verdict"][1]


def test_a_frame_graph_says_who_gives_what_to_whom(explain):
    graph = report.trimmed(explain)
    edges = {(edge["from"], edge["to"], edge["what"], edge["kind"]) for edge in graph["edges"]}
    assert ("gbuffer", "ao", "gbuffer.depth", "reads") in edges and ("shadow", "lighting", "shadow", "answers") in edges
    assert ("ao", "lighting", "ao.visibility", "reads") in edges and ("sky", "shadow", "sky.lights", "reads") in edges
    assert {each["name"] for each in graph["passes"]} == {each["name"] for each in explain["passes"]}
    assert all(edge["from"] != "scene" for edge in graph["edges"])
    assert "scene.camera" in next(each for each in graph["passes"] if each["name"] == "gbuffer")["scene"]


# ---- The two sentences ----

def rows_for(*points):
    """(scene, variant, verdict of time, its log ratio, verdict of error, its difference)"""
    rows = []
    for scene, variant, time, ratio, error, gap in points:
        common = {"scene": scene, "variant": variant, "knobs": "", "state": "ok", "against": "first", "smallest_seen": 0.01}
        rows += [common | {"quantity": "frame", "verdict": time, "difference": ratio},
                 common | {"quantity": "rmse", "verdict": error, "difference": gap}]
    return rows


@pytest.mark.parametrize(("points", "sentence"), [
    ([("a", "x", s.BETTER, -0.3, s.BETTER, -0.02), ("a", "y", s.BETTER, -0.1, s.BETTER, -0.2)],
     "x is both faster (-25.9 %) and nearer to the reference (rmse -0.02) than first, as is 1 other."),
    ([("a", "x", s.BETTER, -0.3, s.BETTER, -0.02), ("b", "x", s.WORSE, 0.1, s.BETTER, -0.2)],
     "Nothing was seen to be both faster and nearer to the reference than first on both scenes: the other one is better in neither "
     "on every scene."),
    ([("a", "x", s.BETTER, -0.3, s.SAME, 0.0), ("a", "y", s.WORSE, 0.3, s.BETTER, -0.1)],
     "x is faster (-25.9 %) than first, with no difference seen in rmse."),
    ([("a", "x", s.BETTER, -0.3, s.WORSE, 0.1), ("a", "y", s.WORSE, 0.3, s.BETTER, -0.1), ("a", "z", s.UNDECIDED, 0, s.BETTER, -1)],
     "Nothing was seen to be both faster and nearer to the reference than first: of 3 others 1 is faster with a larger error, 1 is "
     "slower with a smaller error, 1 is undecided in time or error."),
    ([("a", "x", s.UNDECIDED, 0, s.BETTER, -0.1), ("a", "y", s.UNDECIDED, 0, s.BETTER, -0.1)],
     "Nothing was seen to be both faster and nearer to the reference than first: both others are undecided in time or error."),
    ([("a", name, s.UNDECIDED, 0, s.BETTER, -0.1) for name in "xyz"],
     "Nothing was seen to be both faster and nearer to the reference than first: all 3 others are undecided in time or error."),
    ([], "Nothing was compared: the study has one point, or no verdict of both time and error."),
])
def test_the_verdict_says_what_the_rows_say(points, sentence):
    first, second = verdict({"metrics": ["rmse"]}, rows_for(*points), {"a": []})
    assert first == sentence and second.endswith(".")


def test_the_verdict_says_what_could_not_be_told():
    rows = rows_for(("a", "x", s.UNDECIDED, 0.0, s.BETTER, -0.1), ("b", "x", s.BETTER, -0.1, s.BETTER, -0.1))
    rows[0]["smallest_seen"] = 0.5
    text = verdict({"metrics": ["rmse"]}, rows, {"a": ["it was busy", "it drifts"]})[1]
    assert text == ("A difference of frame times below 1 % to 65 % could not have been seen, and 1 of 4 comparisons is undecided; the "
                    "machine was restless: it was busy (1 more sign of it stands under \"Machine and versions\").")
    rows[0]["smallest_seen"] = math.inf
    assert "below 1 % to more than 100 %" in verdict({"metrics": ["rmse"]}, rows, {"a": list("abc")})[1]
    assert "a (2 more signs of it stand under" in verdict({"metrics": ["rmse"]}, rows, {"a": list("abc")})[1]


@pytest.mark.parametrize("least", [math.log1p(80.9), math.log(2) + 1e-6, math.inf])
def test_a_run_that_could_not_see_a_factor_of_two_says_so_without_a_number(least):
    rows = rows_for(("a", "x", s.UNDECIDED, 0.0, s.BETTER, -0.1))
    rows[0]["smallest_seen"] = least
    assert verdict({"metrics": ["rmse"]}, rows, {})[1] == (
        "This run could tell nothing about times: a frame that took twice as long could have been missed, and 1 of 2 comparisons is "
        "undecided.")
    rows[0]["smallest_seen"] = math.log(2)
    assert verdict({"metrics": ["rmse"]}, rows, {})[1].startswith("A difference of frame times below 100 % could not have been seen")


# ---- A real study, and a row of it again ----

@pytest.fixture(scope="module")
def studied(tmp_path_factory):
    folder = tmp_path_factory.mktemp("studied")
    (folder / "small.toml").write_text(SMALL)
    assert study_run.run_study(options(files=[str(folder / "small.toml")], folder=str(folder / "out")), lambda: None) == 0
    return folder / "out"


def test_a_study_leaves_a_page_with_its_numbers_and_images(studied, host):
    data = report.points_of(studied / "report.html")
    results = json.loads((studied / "results.json").read_text())
    assert [point["name"] for point in data["points"]] == ["few", "rays samples=1", "rays samples=4"]
    for point in data["points"]:
        row = next(row for row in results["rows"] if row["quantity"] == "rmse" and (row["variant"], row["knobs"]) == (
            point["variant"], " ".join(f"{k}={v}" for k, v in point["knobs"])))
        assert point["rows"]["rmse"]["value"] == pytest.approx(row["value"], rel=1e-7)
        # The number is that of the image that is shown.
        if point["name"] == "few":
            image, reference = (images.load(studied, key) for key in (point["image"], data["scenes"][0]["reference"]["image"]))
            assert heddle.compare(image, reference, "rmse") == pytest.approx(row["value"], rel=1e-9)
            head = data["images"][point["image"]]
            assert np.array_equal(embedded((studied / "report.html").read_text(), head["pixels"]), image)
            assert head["flip"]["value"] == pytest.approx(heddle.compare(image, reference, "hdr_flip"), rel=1e-6)
    graph = data["graphs"][data["points"][0]["frame_graph"]]
    assert any(each["name"] == "ao" and not each["is_pruned"] for each in graph["passes"]) and graph["memory"]["own_bytes"] > 0
    assert len(data["rounds"][0]) == 7 and not data["is_encoded"] and data["level"]["scale"] == 1


def test_a_study_that_was_measured_writes_the_same_page_again(studied, monkeypatch):
    before = report.points_of(studied / "report.html")
    monkeypatch.setattr(study_run.SceneRun, "render_image", lambda *_: 1 // 0)
    assert study_run.run_study(options(files=[str(studied.parent / "small.toml")], folder=str(studied)), lambda: None) == 0
    after = report.points_of(studied / "report.html")
    assert {key: value for key, value in after.items() if key not in ("written", "command")} == {
        key: value for key, value in before.items() if key not in ("written", "command")}


def test_an_image_that_was_not_kept_is_rendered_again(studied, monkeypatch):
    data = report.points_of(studied / "report.html")
    files = [images.file_of(studied, point["image"]) for point in data["points"]]
    before = [file.read_bytes() for file in files]
    files[1].unlink()
    assert study_run.run_study(options(files=[str(studied.parent / "small.toml")], folder=str(studied)), lambda: None) == 0
    assert [file.read_bytes() for file in files] == before


def reproduce_options(file, *row, **given):
    known = {"file": str(file), "row": [str(each) for each in row], "output": None, "no_times": True, "rounds": None, "device": None,
             "timeout": 120.0, "quiet": False}
    return argparse.Namespace(**(known | given))


@pytest.mark.parametrize("row", ["2", "rays samples=1", "rays samples=1 cornell_box front"])
def test_a_row_is_made_again_to_the_bit(studied, tmp_path, capsys, row):
    file = tmp_path / "again.exr"
    assert reproduce.reproduce(reproduce_options(studied / "report.html", *row.split(), output=str(file)), lambda: None) == 0
    assert "image: bytes equal (32 x 18 x 1" in capsys.readouterr().out and file.exists()


def test_times_are_compared_as_ratios_in_rounds(studied, capsys):
    status = reproduce.reproduce(reproduce_options(studied / "report.html", 1, no_times=False), lambda: None)
    said = capsys.readouterr().out
    words = re.search(r"time against rays samples=1: (no difference seen|undecided|better than then|worse than then) \(", said)
    assert words and "image: bytes equal" in said
    assert status == (1 if words[1][:5] in ("bette", "worse") else 0)


def changed_page(studied, tmp_path, change):
    text = (studied / "report.html").read_text()
    data = report.points_of(studied / "report.html")
    change(data)
    begin = text.index(">", text.index('id="data"')) + 1
    page = tmp_path / "report.html"
    page.write_text(text[:begin] + json.dumps(data) + text[text.index("</script>", begin):])
    return page


def test_other_bytes_are_told_with_the_first_pixel(studied, tmp_path, capsys):
    def other(data):
        data["points"][0]["settings"].append("ao.params.steps=3")

    page = changed_page(studied, tmp_path, other)
    assert reproduce.reproduce(reproduce_options(page, 1), lambda: None) == 1
    assert "is not beside the page" in capsys.readouterr().out
    (tmp_path / "images").symlink_to(studied / "images")
    assert reproduce.reproduce(reproduce_options(page, 1), lambda: None) == 1
    said = capsys.readouterr().out
    assert re.search(r"image: DIFFERENT: \d+ of 576 pixels, by 0\.\d+ at most; the first is \d+, \d+\n  found: ", said)


def test_changed_files_and_another_machine_are_told(studied, tmp_path, capsys):
    def other(data):
        library = next(file for file in data["files"] if file.endswith("libheddle.so"))
        data["files"][library] = 16 * "0"
        data["machine"]["processor"] = "another one"

    page = changed_page(studied, tmp_path, other)
    assert reproduce.reproduce(reproduce_options(page, 1, no_times=False), lambda: None) == 0
    said = capsys.readouterr().out
    assert re.search(r"note: 1 of \d+ files are not what they were: .*libheddle.so", said)
    assert "time: not compared: this is not the study's machine and driver" in said


@pytest.mark.parametrize(("row", "message"), [
    (["9"], "has no row 9\n  expected: 1 to 3"), (["0"], "has no row 0"), (["nix"], "has no row 'nix'\n  expected: a row's number\n            1: few of")])
def test_a_row_that_is_not_there_is_told(studied, row, message):
    with pytest.raises(heddle.Error) as raised:
        reproduce.reproduce(reproduce_options(studied / "report.html", *row), lambda: None)
    assert raised.value.status == 2 and message in str(raised.value)


def test_what_is_missing_or_no_report_is_told(studied, tmp_path, command):
    (tmp_path / "page.html").write_text("<html></html>")
    for file, said in ((tmp_path / "page.html", "there is no study in it"), (tmp_path / "nix.html", "No such file")):
        done = subprocess.run([command, "reproduce", str(file), "1"], capture_output=True, text=True)
        assert done.returncode == 2 and "is no report of a study" in done.stderr and said in done.stderr

    def moved(data):
        data["scenes"][0]["file"] = "/nowhere/scene.py"

    with pytest.raises(heddle.Error, match="the study was made of /nowhere/scene.py, which is not here"):
        reproduce.reproduce(reproduce_options(changed_page(studied, tmp_path, moved), 1), lambda: None)


def test_the_command_reproduces(studied, command):
    done = subprocess.run([command, "reproduce", str(studied / "report.html"), "few", "--no-times"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "bytes equal" in done.stdout
    wrong = subprocess.run([command, "reproduce", str(studied / "report.html"), "1", "--no-time"], capture_output=True, text=True)
    assert wrong.returncode == 2 and "has no option '--no-time'" in wrong.stderr


def made_up_rounds(random, factor=1.0, row=1.0, spread=0.003, rounds=15):
    return [{name: math.log(ms * factor) + spread * random.standard_normal() for name, ms in
             (("first", 10.0), (study_run.AGAIN, 10.0), ("row", 20.0 * row))} for _ in range(rounds)]


@pytest.mark.parametrize(("factor", "row", "word"), [(1.0, 1.0, s.SAME), (2.5, 1.0, s.SAME), (1.0, 1.1, s.WORSE), (3.0, 0.9, s.BETTER)])
def test_a_busier_machine_is_no_difference_and_a_slower_row_is(factor, row, word):
    random = np.random.default_rng(5)
    data = {"points": [{"name": "first"}], "study": {"resolution": 0.03}}
    found, text = reproduce.judge(data, "row", "first", made_up_rounds(random), made_up_rounds(random, factor, row))
    assert found == word and "smallest seen" in text
    then, now = map(float, re.search(r"the frame took (\S+) ms then, (\S+) ms now", text).groups())
    assert then == pytest.approx(20, rel=0.01) and now == pytest.approx(20 * factor * row, rel=0.01)


def test_equal_rows_rarely_get_a_false_verdict():
    random, data = np.random.default_rng(6), {"points": [{"name": "first"}], "study": {"resolution": 0.03}}
    words = [reproduce.judge(data, "row", "first", made_up_rounds(random, rounds=7), made_up_rounds(random, 1.7, rounds=7))[0]
             for _ in range(400)]
    # At most 2.5 % each; more than 20 of 400 would have a probability below 0.005.
    assert sum(word in (s.BETTER, s.WORSE) for word in words) <= 20
    assert reproduce.judge(data, "row", "first", made_up_rounds(random, rounds=5), made_up_rounds(random))[0] == s.UNDECIDED
