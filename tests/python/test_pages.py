# SPDX-License-Identifier: Apache-2.0
"""`heddle list --markdown`: a page a role that says all of its contract and of its techniques, as tables that hold."""

import json
import subprocess

import pytest


def run(command, *words):
    return subprocess.run([command, "list", *map(str, words)], capture_output=True, text=True)


@pytest.fixture(scope="module")
def listed(command):
    return json.loads(run(command, "--json").stdout)


@pytest.fixture(scope="module")
def pages(command, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    done = run(command, "--markdown", "--output", folder)
    assert done.returncode == 0 and done.stdout == "", done.stderr
    return {file.stem: file.read_text() for file in folder.iterdir()}


def test_a_page_for_every_role(listed, pages):
    assert sorted(pages) == sorted(role["name"] for role in listed["roles"])


def cells(text):
    return text.replace("|", "\\|").replace("\n", " ")


def test_a_page_says_everything_that_contract_and_manifests_say(listed, pages):
    for role in listed["roles"]:
        page = pages[role["name"]]
        for port in role["ports"]:
            assert f"| `{port['name']}` | {port['direction']}" in page
            assert cells(port["help"]) in page
        for function in role["functions"]:
            assert function["signature"] in page and function["help"] in page
        for case in role["hard_cases"]:
            assert f"| {case['id']} | {cells(case['text'])} |" in page
        for component in role["components"]:
            for entry in component["properties"]:
                assert f"| `{entry['name']}` | {entry['type']} |" in page
    for technique in listed["techniques"]:
        page = pages[technique["role"]]
        section = page.split(f"## `{technique['id']}`\n")[1].split("\n## ")[0]
        for parameter in technique["parameters"]:
            rows = [row for row in section.splitlines() if row.startswith(f"| `{parameter['name']}` | {parameter['unit']} |")]
            assert len(rows) == 1, parameter["name"]
            assert cells(parameter["help"]) in rows[0]
            for choice in parameter["choices"]:
                assert choice in rows[0]
            for rung in parameter["ladder"]:
                word = parameter["choices"][int(rung)] if parameter["choices"] else f"{rung:.6g}"
                assert word in rows[0].split("|")[5]
        for stage in technique["stages"]:
            assert f"{stage['name']} ({stage['kind']}" in section


def test_every_row_of_a_table_has_its_columns(pages):
    for name, page in pages.items():
        columns = 0
        for line in page.splitlines():
            count = line.replace("\\|", "").count("|") if line.startswith("|") else 0
            assert count == 0 or columns in (0, count), f"{name}: {line}"
            columns = count
        assert page.count("```") % 2 == 0
        assert "\n\n\n" not in page and page.endswith("\n") and not page.endswith("\n\n")


def test_one_role_on_standard_output(command, pages):
    assert run(command, "shadow", "--markdown").stdout == pages["shadow"]


def test_mistakes(command):
    unknown = run(command, "shadwo", "--markdown")
    assert unknown.returncode == 2 and "there is no role 'shadwo'" in unknown.stderr
    assert run(command, "--output", "/tmp/x").returncode == 2
    nowhere = run(command, "--markdown", "--output", "/proc/nowhere")
    assert nowhere.returncode == 4 and "/proc/nowhere" in nowhere.stderr
