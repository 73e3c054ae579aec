# SPDX-License-Identifier: Apache-2.0
"""An installed copy: a technique built against it outside of the tree, an application linked to it, a Python scene."""

import json
import os
import pathlib
import shutil
import subprocess

import pytest

SOURCE = pathlib.Path(__file__).resolve().parents[2]
BUILD = SOURCE / "build"


def run(*command, **options):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, **options)
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def prefix(tmp_path_factory):
    """Heddle in a prefix of its own, moved once, so that nothing may remember where it was installed."""
    folder = tmp_path_factory.mktemp("installed")
    run("cmake", "--install", BUILD, "--prefix", folder / "first", "--strip")
    (folder / "first").rename(folder / "prefix")
    return folder / "prefix"


@pytest.fixture
def environment():
    """Nothing of the source tree or of the tests' own settings leads to libraries or packages."""
    others = ("PYTHONPATH", "HEDDLE_LIBRARY", "HEDDLE_PLUGIN_PATH")
    return {key: value for key, value in os.environ.items() if key not in others}


def test_only_what_belongs_to_it_is_installed(prefix):
    for file in ("bin/heddle", "lib/libheddle.so", "lib/libheddle_view.so",
                 "include/heddle/pass.hpp", "lib/cmake/heddle/heddle-config.cmake",
                 "lib/heddle/graphs/deferred.toml", "lib/heddle/python/heddle/__init__.py"):
        assert (prefix / file).exists(), file
    paths = [path for path in prefix.rglob("*") if path.is_file()]
    assert not [path for path in paths if path.is_symlink() and not path.exists()]
    assert not [path for path in paths if path.suffix in (".pyc", ".checked", ".o", ".a")]
    # A library that knows the build's folder would go on using it.
    for file in (prefix / "bin/heddle", prefix / "lib/libheddle.so", prefix / "lib/libheddle_view.so"):
        paths_inside = run("readelf", "-d", file)
        assert str(BUILD) not in paths_inside


def test_every_technique_of_the_tree_is_in_it(prefix, environment):
    installed = run(prefix / "bin/heddle", "list", env=environment)
    assert installed == run(BUILD / "bin/heddle", "list", env=environment)


def test_python_scene_renders(prefix, environment, tmp_path):
    picture = tmp_path / "cornell.png"
    scene = prefix / "lib/heddle/python/scenes/cornell_box.py"
    run(prefix / "bin/heddle", "run", scene, "--set", "extent=[32,24]", "--output", picture, env=environment)
    assert picture.stat().st_size > 200


@pytest.mark.parametrize("language", ["c", "c++"])
def test_technique_outside_of_the_tree(prefix, environment, tmp_path, language):
    heddle = prefix / "bin/heddle"
    run(heddle, "new-technique", "ambient_occlusion", "mine", "--language", language, cwd=tmp_path,
        env=environment)
    run("cmake", "-B", "build", f"-DCMAKE_PREFIX_PATH={prefix}", cwd=tmp_path, env=environment)
    run("cmake", "--build", "build", cwd=tmp_path, env=environment)
    environment["HEDDLE_PLUGIN_PATH"] = str(tmp_path / "build" / "plugins")
    listed = json.loads(run(heddle, "list", "--json", env=environment))
    assert "ambient_occlusion/mine" in [technique["id"] for technique in listed["techniques"]]
    picture = tmp_path / "out.png"
    scene = prefix / "lib/heddle/python/scenes/cornell_box.py"
    run(heddle, "run", scene, "--set", "ao.technique=mine", "--set", "extent=[32,24]", "--output", picture,
        env=environment)
    assert picture.stat().st_size > 200


def test_application_in_c(prefix, environment, tmp_path):
    shutil.copy(SOURCE / "tests/abi/plain_c_application.c", tmp_path / "application.c")
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.25)\nproject(application LANGUAGES C)\nfind_package(heddle 0.1 REQUIRED)\n"
        "add_executable(application application.c)\ntarget_link_libraries(application PRIVATE heddle::heddle)\n")
    run("cmake", "-B", "build", f"-DCMAKE_PREFIX_PATH={prefix}", cwd=tmp_path, env=environment)
    run("cmake", "--build", "build", cwd=tmp_path, env=environment)
    run(tmp_path / "build/application", f"{BUILD}/tests/abi/plugins:{prefix}/lib/heddle/plugins", env=environment)
