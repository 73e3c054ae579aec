# SPDX-License-Identifier: Apache-2.0
"""What a tab offers: the completion functions run in the shells that are here, as readline would call them."""

import pathlib
import shutil
import subprocess

import pytest

COMPLETE = r"""
source <("$1" completion bash)
COMP_WORDBREAKS=$' \t\n"\'><=;|&(:'
COMP_LINE=$2 COMP_POINT=${#2}
COMP_WORDS=($2) COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
_heddle heddle
printf '%s\n' "${COMPREPLY[@]}"
"""


@pytest.fixture
def bash(command, tmp_path):
    def offers(line):
        path = f"{pathlib.Path(command).parent}:/usr/bin:/bin"
        done = subprocess.run(["bash", "-c", COMPLETE, "bash", command, line], cwd=tmp_path, env={"PATH": path},
                              capture_output=True, text=True)
        assert done.returncode == 0 and done.stderr == "", done.stderr
        return sorted(word for word in done.stdout.splitlines() if word)

    return offers


def test_commands_and_options(bash):
    assert bash("heddle che") == ["check"]
    assert bash("heddle comp") == ["compare", "completion"]
    assert "--camera" in bash("heddle run --")
    assert bash("heddle run --se") == ["--seed", "--set"]
    assert bash("heddle explain --format ") == ["dot", "json", "text"]
    assert bash("heddle completion ") == ["bash", "fish", "zsh"]
    assert bash("heddle schema s") == ["scene"]
    assert bash("heddle study --role ao --climb ") == ["each", "together"]
    assert bash("heddle baseline ") == ["check", "record"]
    assert bash("heddle baseline check ambient") == ["ambient_occlusion"]


def test_graphs_and_files(bash, tmp_path):
    (tmp_path / "deft.glb").touch()
    (tmp_path / "a b.toml").touch()
    assert bash("heddle run def") == ["deferred", "deft.glb"]
    assert bash("heddle run deferred --scene de") == ["deft.glb"]
    assert bash("heddle view --b furn") == ["furnace"]
    assert bash("heddle run ./deft") == ["./deft.glb"]
    assert bash(r"heddle run a\ b") == ["a b.toml"]


def test_roles_and_passes(bash):
    assert bash("heddle list ambient") == ["ambient_occlusion"]
    assert bash("heddle new-technique sha") == ["shadow"]
    assert bash("heddle explain deferred --why a") == ["ao"]
    assert bash("heddle tune deferred --pass a") == ["ao"]


def test_settings_are_completed_part_by_part(bash):
    assert "ao." in bash("heddle run --set ")
    assert "ao.technique=" in bash("heddle run --set ao.")
    assert "ao.params.radius=" in bash("heddle run --set ao.params.")
    assert "ao.params.radius=" in bash("heddle view --set-b ao.params.")
    assert bash("heddle run --set params.ex") == ["params.exposure="]
    assert bash("heddle run --set=ao.tech") == ["ao.technique="], "readline replaces what follows the ="


def test_values_of_settings(bash):
    # After an = readline takes the value alone.
    assert {"gtao", "none", "ray_traced"} <= set(bash("heddle run --set ao.technique="))
    assert bash("heddle run --set ao.technique=ray") == ["ray_traced"]
    assert bash("heddle run --set=ao.technique=ray") == ["ray_traced"]
    assert "float32" in bash("heddle run --set gbuffer.params.precision=")
    assert "gbuffer.depth" in bash("heddle run --set ao.inputs.depth=")
    assert bash("heddle run --set display.params.exposure=") == ["$ao_radius", "$exposure"]
    assert bash("heddle run --set output=disp") == ["display.color"]


def test_settings_follow_the_graph_and_the_settings_of_the_line(bash, tmp_path):
    assert bash("heddle run --set ao.technique=none --set ao.params.") == []
    (tmp_path / "small.toml").write_text('extends = "deferred"\nremove = ["ao"]\n')
    assert bash("heddle run small.toml --set ao.") == []
    assert bash("heddle run small.toml --set gb") == ["gbuffer."]
    (tmp_path / "broken.toml").write_text("extends = 1\n")
    assert bash("heddle run broken.toml --set gb") == []


def test_ports_and_swaps(bash, tmp_path):
    (tmp_path / "ao.exr").touch()
    assert bash("heddle run -o ao.v") == ["ao.visibility="]
    assert bash("heddle run -o ao.visibility=ao") == ["ao.exr"]
    assert bash("heddle compare --swap a") == ["ao="]
    assert bash("heddle compare --swap ao=ray") == ["ray_traced,"]
    assert bash("heddle compare --swap ao=ray_traced,gt") == ["ray_traced,gtao"]


FISH = 'source ("$argv[1]" completion fish | psub); complete -C "$argv[2]"'


@pytest.mark.skipif(shutil.which("fish") is None, reason="fish is not installed")
def test_fish_offers_the_same(command):
    def offers(line):
        path = f"{pathlib.Path(command).parent}:/usr/bin:/bin"
        done = subprocess.run(["fish", "--no-config", "-c", FISH, command, line], env={"PATH": path, "HOME": "/tmp"},
                              capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return sorted(word.split("\t")[0] for word in done.stdout.splitlines())

    assert offers("heddle che") == ["check"]
    assert offers("heddle run --se") == ["--seed", "--set"]
    assert offers("heddle run --set ao.technique=ray") == ["ao.technique=ray_traced"]
    assert offers("heddle compare --swap ao=ray") == ["ao=ray_traced,"]
