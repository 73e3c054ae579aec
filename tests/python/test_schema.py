# SPDX-License-Identifier: Apache-2.0
"""Schemas for editors: they take every graph that Heddle ships and whatever manifests allow, and refuse the rest."""

import copy
import json
import pathlib
import subprocess
import tomllib

import jsonschema
import pytest

import heddle

ROOT = pathlib.Path(__file__).resolve().parents[2]

# Mistakes of tests/graph/errors that no schema can tell: they need the rest of the graph or names in other files, or are
# in the line "# --set" of a file.
NEEDS_THE_GRAPH = {
    "input_of_another_type", "no_producer", "no_producer_above_but_below", "none_for_an_input_that_is_needed",
    "output_is_a_value", "output_of_a_left_out_pass", "output_of_an_unknown_port", "overlay_changes_a_role",
    "overlay_changes_an_unknown_pass", "overlay_names_a_pass_twice", "overlay_of_a_missing_file",
    "overlay_of_itself", "overlay_removes_an_unknown_pass", "overlay_stands_after_an_unknown_pass",
    "passes_that_wait_for_each_other", "preset_out_of_range", "producer_left_out", "provider_named_twice",
    "setting_of_a_name", "setting_of_an_unknown_key", "setting_of_an_unknown_pass",
    "setting_of_an_unknown_technique", "setting_out_of_range", "setting_with_half_an_array",
    "setting_without_a_value", "setting_without_an_equals_sign", "two_passes_of_one_name",
    "unknown_pass_in_an_input", "unknown_port_in_an_input", "unknown_port_of_the_scene", "unknown_preset",
    "unknown_provider", "history_changed_in_place", "history_of_an_unknown_pass", "history_of_an_unknown_version",
    "history_of_surfaces", "history_of_what_is_not_kept", "output_of_an_earlier_frame",
}
# JSON has one kind of number, and NaN is outside of no range; the tests' own technique has a narrower range.
IS_NO_MISTAKE_HERE = {"number_for_an_integer", "nan", "parameter_out_of_range"}


@pytest.fixture(scope="module")
def schemas():
    with heddle.Host() as host:
        return {kind: host.schema(kind) for kind in ("graph", "scene")}


@pytest.fixture(scope="module")
def techniques():
    with heddle.Host() as host:
        return host.list()["techniques"]


def mistakes(schema, document):
    return [error.message for error in jsonschema.Draft7Validator(schema).iter_errors(document)]


@pytest.mark.parametrize("kind", ["graph", "scene"])
def test_schemas_are_schemas(schemas, kind):
    jsonschema.Draft7Validator.check_schema(schemas[kind])


@pytest.mark.parametrize("file", sorted((ROOT / "scripts/graphs").glob("*.toml")), ids=lambda file: file.stem)
def test_shipped_graphs_are_right(schemas, file):
    assert mistakes(schemas["graph"], tomllib.loads(file.read_text())) == []


def test_broken_graphs_are_refused_where_a_schema_can_tell(schemas):
    taken = set()
    for file in sorted((ROOT / "tests/graph/errors").glob("*.toml")):
        try:
            document = tomllib.loads(file.read_text())
        except tomllib.TOMLDecodeError:
            continue
        if file.stem != "good" and not mistakes(schemas["graph"], document):
            taken.add(file.stem)
    assert taken == NEEDS_THE_GRAPH | IS_NO_MISTAKE_HERE


def graph_of(technique, params):
    role, name = technique["id"].split("/")
    return {"output": "a.b", "pass": [{"role": role, "technique": name, "params": params}]}


def default_of(parameter):
    numbers = parameter["default"]
    if parameter["type"] == "names":
        return []
    if parameter["type"] == "text":
        return ""
    if parameter["type"] == "choice":
        return parameter["choices"][int(numbers[0])]
    if parameter["type"] == "bool":
        return bool(numbers[0])
    if parameter["type"] in ("color", "float3"):
        return [float(number) for number in numbers[:3]]
    return int(numbers[0]) if parameter["type"] == "int" else float(numbers[0])


def wrong_values(parameter):
    """Values of another type, and on both sides of the range."""
    yield {"a": "table"}
    if parameter["type"] != "text":
        yield "no preset and no choice"
    if parameter["type"] not in ("names", "color", "float3"):
        yield [1.0]
    if parameter["type"] in ("float", "int"):
        yield True
        low, high = parameter["minimum"], parameter["maximum"]
        if low != high:
            step = 1 if parameter["type"] == "int" else 0.5
            if low != "-inf":
                yield low - step
            if high != "inf":
                yield high + step
    if parameter["type"] == "int":
        yield 0.5


def test_every_parameter_takes_its_default_and_a_preset_and_nothing_wrong(schemas, techniques):
    validator = jsonschema.Draft7Validator(schemas["graph"])
    for technique in techniques:
        params = {parameter["name"]: default_of(parameter) for parameter in technique["parameters"]}
        assert validator.is_valid(graph_of(technique, params)), technique["id"]
        assert not validator.is_valid(graph_of(technique, params | {"no_such_parameter": 1})), technique["id"]
        for parameter in technique["parameters"]:
            where = (technique["id"], parameter["name"])
            assert validator.is_valid(graph_of(technique, {parameter["name"]: "$preset"})), where
            for wrong in wrong_values(parameter):
                assert not validator.is_valid(graph_of(technique, {parameter["name"]: wrong})), (*where, wrong)


def test_knobs_offer_their_ladder_and_parameters_say_what_they_are(schemas, techniques):
    definitions = schemas["graph"]["definitions"]
    for technique in techniques:
        properties = definitions[technique["id"].replace("/", ".") + ".params"]["properties"]
        assert list(properties) == [parameter["name"] for parameter in technique["parameters"]]
        for parameter in technique["parameters"]:
            said = properties[parameter["name"]]
            assert said["description"].startswith(parameter["help"])
            assert said.get("examples", []) == parameter["ladder"]
            assert said["default"] == default_of(parameter)


def test_an_overlay_may_leave_out_what_its_base_says_and_a_whole_graph_may_not(schemas):
    overlay = {"extends": "deferred", "pass": [{"name": "ao", "technique": "ray_traced", "params": {"radius": 1.0}}]}
    assert mistakes(schemas["graph"], overlay) == []
    whole = {"output": "display.color", **{key: value for key, value in overlay.items() if key != "extends"}}
    assert mistakes(schemas["graph"], whole) == ["'role' is a required property"]
    strange = copy.deepcopy(overlay)
    strange["pass"][0]["params"] = {"slices": 1}  # of another technique
    assert mistakes(schemas["graph"], strange) != []


def add_named(scene):
    """What overlays below change."""
    paint = scene.material("paint")
    scene.instance(scene.mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], paint, [0, 1, 2]), name="part")


def expected_keys(host, tmp_path, text):
    """The keys that the reader names when it meets one that it does not know."""
    file = tmp_path / "a.scene.toml"
    file.write_text(text)
    with host.scene() as scene:
        add_named(scene)
        with pytest.raises(heddle.Error) as error:
            scene.load(file)
    (line,) = [line for line in str(error.value).splitlines() if line.startswith("  expected: one of file")
               or line.startswith("  expected: one of name")]
    return set(line.removeprefix("  expected: one of ").split(", "))


OVERLAYS = {
    "camera": {"name": "new", "position": [0, 0, 1], "target": [0, 0, 0]},
    "light": {"name": "new", "type": "point", "intensity": [1, 1, 1]},
    "material": {"name": "paint"},
    "instance": {"name": "part"},
}


def to_toml(kind, table):
    return f"[[{kind}]]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in table.items())


def test_scene_keys_are_those_that_the_reader_knows(schemas, host, tmp_path):
    properties = schemas["scene"]["properties"]
    assert expected_keys(host, tmp_path, "zzz = 1\n") == set(properties)
    for kind, table in OVERLAYS.items():
        keys = expected_keys(host, tmp_path, to_toml(kind, {**table, "zzz": 1}))
        assert keys == set(properties[kind]["items"]["properties"]), kind


def candidates(schema):
    """Values around what a schema allows."""
    if schema["type"] == "boolean":
        return [True, 1, "true"]
    if "enum" in schema:
        return [*schema["enum"], "no such word", 1]
    if schema["type"] == "number":
        edges = [schema[key] for key in ("minimum", "maximum", "exclusiveMinimum") if key in schema]
        return [0.5, 2.5, "1", True, *edges, *[edge + step for edge in edges for step in (-1, -1e-7, 1e-7, 1)]]
    if schema["type"] == "array":
        count = schema["minItems"]
        return [[value] * n for n in (count - 1, count, count + 1) for value in candidates(schema["items"])]
    return ["text", 1]


def test_scene_ranges_are_those_of_the_reader(schemas, host, tmp_path):
    """Whatever value a key is given, the schema and the reader agree about it."""
    validator = jsonschema.Draft7Validator(schemas["scene"])
    file = tmp_path / "a.scene.toml"
    for kind, base in OVERLAYS.items():
        for key, schema in schemas["scene"]["properties"][kind]["items"]["properties"].items():
            if key == "name":
                continue
            for value in candidates(schema):
                table = {**base, key: value}
                file.write_text(to_toml(kind, table))
                with host.scene() as scene:
                    add_named(scene)
                    try:
                        scene.load(file)
                        is_taken = True
                    except heddle.Error as error:
                        is_taken = False
                        # Said of two values together: no schema of one.
                        if any(said in str(error) for said in ("target is its position", "has no length", "'texture' cannot be used")):
                            continue
                assert validator.is_valid({kind: [table]}) == is_taken, (kind, key, value)


@pytest.mark.parametrize("kind", ["graph", "scene"])
def test_the_command_prints_them(command, schemas, kind):
    done = subprocess.run([command, "schema", kind], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == schemas[kind]
