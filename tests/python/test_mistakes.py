# SPDX-License-Identifier: Apache-2.0
"""Lines that are wrong: what the command says of them, for scenes in Python and for others."""

import pathlib
import subprocess

import pytest


def said(command, *words):
    done = subprocess.run([command, *words], capture_output=True, text=True)
    assert done.returncode == 2 and done.stdout == "" and "Traceback" not in done.stderr, done.stderr
    return done.stderr.splitlines()


@pytest.mark.parametrize("count", ["0", "-3"])
@pytest.mark.parametrize("words", [["run"], ["inspect", "1,1"], ["check"]], ids=lambda words: words[0])
def test_there_is_at_least_one_frame(command, words, count):
    first, _help = said(command, *words, "cornell_box.py", "--frames", count)
    assert first == f"error: --frames: {count} is no number of frames: expected 1 to 1000000"
    assert count in said(command, *words, "none.glb", "--frames", count)[0]


@pytest.mark.parametrize("words, first", [
    (["run", "cornell_box.py", "--time", "abc"], "error: --time: 'abc' is no number"),
    (["run", "cornell_box.py", "--seed", "1.5"], "error: --seed: '1.5' is no whole number"),
    (["tune", "cornell_box.py", "--time", "abc"], "error: --time: 'abc' is no number"),
    (["tune", "cornell_box.py", "--budget", "-4ms"], "error: --budget '-4ms' is no time of a frame"),
], ids=lambda value: " ".join(value) if isinstance(value, list) else "")
def test_a_wrong_value_is_one_error_without_usage(command, words, first):
    lines = said(command, *words)
    assert lines[0] == first and len(lines) == 2


@pytest.mark.parametrize("words, option, nearest", [
    (["run", "cornell_box.py", "--frame", "3"], "--frame", "--frames"),
    (["run", "cornell_box.py", "--folder=x"], "--folder", "--output"),
], ids=lambda value: " ".join(value) if isinstance(value, list) else "")
def test_an_unknown_option_is_told_with_those_that_there_are(command, words, option, nearest):
    lines = said(command, *words)
    assert lines[0] == f"error: heddle {words[0]} has no option '{option}'" and lines[1].startswith("  expected: one of --")
    assert lines[2] == f"  help:     did you mean '{nearest}'? heddle {words[0]} --help says what they do" and len(lines) == 3


@pytest.mark.parametrize("words, first, nearest", [
    (["runn"], "error: there is no command 'runn'", "run"),
    (["lst"], "error: there is no command 'lst'", "list"),
    (["list", "ambient_oclusion"], "error: there is no role 'ambient_oclusion'", "ambient_occlusion"),
    (["study", "ambient_oclusion"], "error: there is neither a file nor a shipped study 'ambient_oclusion'",
     "ambient_occlusion"),
], ids=lambda value: " ".join(value) if isinstance(value, list) else "")
def test_a_wrong_name_is_told_with_the_nearest(command, words, first, nearest):
    lines = said(command, *words)
    assert lines[0] == first and lines[-1] == f"  help:     did you mean '{nearest}'?" and len(lines) == 3


def test_a_name_that_is_near_to_none_is_told_without(command):
    lines = said(command, "xyzzyxyzzy")
    assert len(lines) == 2 and lines[1].startswith("  expected: one of run, ")


@pytest.fixture(scope="module")
def triangle(tmp_path_factory):
    """A graph of 16 x 16 pixels, and the same for a scene in Python and for a scene file: one's own code reads each."""
    folder = tmp_path_factory.mktemp("outputs")
    (folder / "scene.py").write_text("import heddle\n\n\ndef build(scene):\n    scene.camera((0, 0, 3), (0, 0, 0))\n")
    (folder / "scene.gltf").write_text('{"asset": {"version": "2.0"}}')
    return folder


@pytest.mark.parametrize("scene", ["scene.py", "scene.gltf"])
def test_an_output_with_an_equals_sign_in_a_folder_is_a_file(command, triangle, scene):
    for file in (triangle / f"{scene}.a=b.png", pathlib.Path(f"./{scene}=c.png")):
        given = str(file) if file.is_absolute() else f"./{file}"
        done = subprocess.run([command, "run", scene, "--set", "extent=[16,16]", "--output", given,
                               "--output", f"gbuffer.depth={scene}=depth.exr"], cwd=triangle, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        assert (triangle / file).stat().st_size > 0 and (triangle / f"{scene}=depth.exr").stat().st_size > 0
        (triangle / f"{scene}=depth.exr").unlink()


@pytest.mark.parametrize("scene", ["scene.py", "scene.gltf"])
def test_an_output_that_names_no_port_says_how_to_name_a_file(command, triangle, scene):
    words = ["run", str(triangle / scene), "--set", "extent=[16,16]"]
    lines = said(command, *words, "--output", "gbufer.depth=b.png")
    assert "the graph has no port 'gbufer.depth'" in lines[0]
    assert lines[-2:] == ["  help:     did you mean 'gbuffer.depth'?",
                          "  help:     if 'gbufer.depth=b.png' is a file, write --output './gbufer.depth=b.png'"]
    for wrong, what in (("=b.png", "port"), ("gbuffer.depth=", "file")):
        assert said(command, *words, "--output", wrong) == [
            f"error: --output has no {what} beside its '='", f"  found:    {wrong}", "  expected: FILE, or PASS.PORT=FILE"]


@pytest.mark.parametrize("scene", ["scene.py", "scene.gltf"])
@pytest.mark.parametrize(("outputs", "message"), [
    (["a.png", "./a.png"], ["error: two outputs were given the file './a.png'", "  expected: a file for each"]),
    (["a.png", "ao.visibility=a.png"], ["error: two outputs were given the file 'a.png'", "  expected: a file for each"]),
    (["a.png", "ao.visibility"], ["error: --output 'ao.visibility' is a port, and no file", "  expected: ao.visibility=FILE",
                                  "  help:     for a file of that name write --output './ao.visibility'"]),
    (["a.png", "ao.visibility=b"], ["error: --output 'b' has no extension, which says how an image is written",
                                    "  expected: .png, .exr or another at its end"]),
    (["a.png", "b."], ["error: --output 'b.' has no extension, which says how an image is written",
                       "  expected: .png, .exr or another at its end"]),
])
def test_what_cannot_be_written_is_said_before_anything_is_rendered(command, triangle, tmp_path, scene, outputs, message):
    words = [word for output in outputs for word in ("--output", output)]
    done = subprocess.run([command, "run", str(triangle / scene), "--set", "extent=[16,16]", *words], cwd=tmp_path,
                          capture_output=True, text=True)
    assert (done.returncode, done.stderr.splitlines()) == (2, message)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("scene", ["scene.py", "scene.gltf"])
def test_an_output_that_fails_takes_no_other_one_with_it(command, triangle, tmp_path, scene):
    words = ["--output", "first.nosuch", "--output", "gbuffer.depth=%d.exr", "--output", "ao.visibility=/proc/nowhere/b.exr",
             "--output", "ao.visibility=last.png", "--frames", "2", "--stats", "stats.json"]
    done = subprocess.run([command, "run", str(triangle / scene), "--set", "extent=[16,16]", *words], cwd=tmp_path,
                          capture_output=True, text=True)
    assert done.returncode == 2, "as the first failure"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["0.exr", "1.exr", "last.png", "stats.json"]
    said = done.stderr.splitlines()
    assert [line.split(": ")[0] for line in said if ": error: " in line] == ["first.nosuch", "/proc/nowhere/b.exr"]
    assert "wrote last.png" in said and "wrote first.nosuch" not in said
    assert said.index("wrote last.png") < said.index(next(line for line in said if ": error: " in line)), "told last"
