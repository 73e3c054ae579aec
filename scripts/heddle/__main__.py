# SPDX-License-Identifier: Apache-2.0
"""`python3 -m heddle run|compare [GRAPH] SCENE ...`: the command's rendering for scenes written in Python.

A scene file defines `build(scene)`, called with an empty heddle.Scene, and if things move `update(scene, time)`.
"""

import argparse
import importlib.util
import json
import pathlib
import re
import statistics
import sys
import traceback
from collections.abc import Callable

from . import Error, Host, Scene, version


def load_scene(scene: Scene, file: str, trusted: bool = False) -> Callable[[Scene, float], None]:
    """Runs build(scene) of a Python file, or loads a glTF file. Returns what moves the scene to a time: the Python
    file's update(scene, time), if it has one."""
    if not file.endswith(".py"):
        scene.load(file, trusted)
        return stays
    path = pathlib.Path(file)
    shipped = pathlib.Path(__file__).resolve().parents[1] / "scenes" / path.name
    if not path.exists() and shipped.exists():
        path = shipped
    if not path.exists():
        raise Error(2, f"error: there is no scene '{file}'\n  help: scenes that come with Heddle lie in scripts/scenes")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None  # the name ends in .py
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise scene_error(path, "the file itself", error) from error
    if not hasattr(module, "build"):
        raise Error(2, f"{path}: error: the scene has no function build(scene)")
    try:
        module.build(scene)
    except Exception as error:
        raise scene_error(path, "build(scene)", error) from error

    def update(moved: Scene, time: float) -> None:
        try:
            getattr(module, "update", stays)(moved, time)
        except Exception as error:
            raise scene_error(path, f"update(scene, {time:g})", error) from error

    return update


def scene_error(path: pathlib.Path, where: str, error: Exception) -> Error:
    """What a scene's own code raised, at its line of the file, with the calls that led there from the file on."""
    calls = traceback.extract_tb(error.__traceback__)
    own = [i for i, call in enumerate(calls) if pathlib.Path(call.filename) == path]
    line = calls[own[-1]].lineno if own else getattr(error, "lineno", None)
    place = f"{path}:{line}" if line else str(path)
    what = str(error).removeprefix("error: ") if isinstance(error, Error) else "".join(
        traceback.format_exception_only(type(error), error)).strip()
    if isinstance(error, SyntaxError):
        what = f"SyntaxError: {error.msg}\n    {(error.text or '').strip()}"
    text = f"{place}: error: in {where}: {what}"
    if own:
        text += "\n  calls:\n" + "".join(traceback.format_list(calls[own[0]:])).rstrip()
    return Error(error.status if isinstance(error, Error) else 2, text)


def stays(_scene: Scene, _time: float) -> None:
    """update() of scenes that have none."""


def frame_file(file: str, frame: int) -> str:
    """The file of one frame: "frame_%04d.png" names one for each."""
    return re.sub(r"%(\d{0,2})d", lambda match: f"{frame:0{int(match.group(1) or 0)}d}", file, count=1)


def load_all(scene: Scene, file: str | None, arguments: argparse.Namespace) -> Callable[[Scene, float], None]:
    update = stays if file is None else load_scene(scene, file, arguments.trust_files)
    for overlay in arguments.overlay:
        scene.load(overlay, arguments.trust_files)
    return update


def sort_files(files: list[str], scene: str | None) -> tuple[str, str | None]:
    graph = None
    for file in files:
        if file.endswith((".py", ".glb", ".gltf", ".scene.toml")):
            if scene is not None:
                raise Error(2, f"error: two scenes were given: '{scene}' and '{file}'")
            scene = file
        elif graph is not None:
            raise Error(2, f"error: two graphs were given: '{graph}' and '{file}'")
        else:
            graph = file
    return graph or "deferred", scene


def use_camera(scene: Scene, wanted: str | None) -> None:
    if wanted is None:
        return
    names = scene.describe().get("cameras", [])
    if wanted in names:
        scene.use_camera(names.index(wanted))
    elif wanted.isdigit() and int(wanted) < len(names):
        scene.use_camera(int(wanted))
    else:
        raise Error(2, f"error: the scene has no camera '{wanted}'\n  expected: one of {', '.join(names)}")


def use_animation(scene: Scene, arguments: argparse.Namespace) -> None:
    if arguments.animation == "none":
        scene.use_animation(None)
    elif arguments.animation is not None or (arguments.loop and scene.describe()["animations"]):
        scene.use_animation(arguments.animation or 0, arguments.loop)


def run(arguments: argparse.Namespace) -> int:
    graph_file, scene_file = sort_files(arguments.files, arguments.scene)
    if arguments.check:  # what a frame leaves to the next one comes round in the third
        arguments.frames = max(arguments.frames, 3)
    with Host(arguments.device, arguments.validation, check=arguments.check) as host:
        with host.graph(graph_file, arguments.set) as graph, host.scene() as scene:
            outputs = [text.split("=", 1) if "=" in text else [None, text] for text in arguments.output or ["heddle.png"]]
            for port, _ in outputs:
                if port is not None:
                    graph.keep(port)
            update = load_all(scene, scene_file, arguments)
            use_camera(scene, arguments.camera)
            use_animation(scene, arguments)
            for frame in range(arguments.frames):
                is_last = frame + 1 == arguments.frames
                time = arguments.time + frame * arguments.time_step
                update(scene, time)
                graph.render(scene, time=time, time_step=arguments.time_step, seed=arguments.seed,
                             profile=arguments.profile and is_last)
                for port, file in outputs:
                    if is_last or frame_file(file, frame) != file:
                        file = frame_file(file, frame)
                        pathlib.Path(file).parent.mkdir(parents=True, exist_ok=True)
                        host.write_image(file, graph.read(port))
                        say(arguments, f"wrote {file}")
            if arguments.check:
                say(arguments, f"checked {arguments.frames} frames: every hazard and layout is covered, and every pass "
                               "keeps to its role's numbers")
            stats = graph.stats()
            if arguments.profile:
                for stage in stats["stages"]:
                    print(f"{stage['pass']:<16} {stage['stage']:<16} {stage['wall_ms']:10.3f} ms wall "
                          f"{stage['cpu_ms']:10.3f} ms CPU")
            say(arguments, f"frame {arguments.frames} on {stats['device']['name']}: {stats['wall_ms']:.1f} ms")
    return 0


def check(arguments: argparse.Namespace) -> int:
    graph_file, scene_file = sort_files(arguments.files, arguments.scene)
    with Host(arguments.device, arguments.validation, check=True) as host:
        with host.graph(graph_file, arguments.set) as graph, host.scene() as scene:
            for port in arguments.port:
                graph.keep(port)
            load_all(scene, scene_file, arguments)(scene, arguments.time)
            use_camera(scene, arguments.camera)
            report = graph.check(scene, max(arguments.frames, 3), arguments.time, 0.0, arguments.seed)
            print(json.dumps(report, indent=2))
    return 0


def compare(arguments: argparse.Namespace) -> int:
    graph_file, scene_file = sort_files(arguments.files, arguments.scene)
    pass_name, techniques = (arguments.swap.split("=", 1) + [""])[:2]
    names = techniques.split(",")
    if len(names) != 2:
        raise Error(2, f"error: --swap '{arguments.swap}' is not PASS=A,B\n  help:     --swap ao=gtao,ray_traced")
    folder = pathlib.Path(arguments.folder)
    folder.mkdir(parents=True, exist_ok=True)
    with Host(arguments.device, arguments.validation) as host, host.scene() as scene:
        load_all(scene, scene_file, arguments)(scene, arguments.time)
        use_camera(scene, arguments.camera)
        use_animation(scene, arguments)
        graphs = [host.graph(graph_file, [*arguments.set, f"{pass_name}.technique={name}"]) for name in names]
        try:
            times: list[list[float]] = [[], []]
            say(arguments, f"rendering {names[0]} and {names[1]}")
            for graph in graphs:
                if arguments.port:
                    graph.keep(arguments.port)
                graph.render(scene, time=arguments.time, seed=arguments.seed)  # compiles: not timed
            for repeat in range(arguments.repeats):
                for index in ((0, 1) if repeat % 2 == 0 else (1, 0)):
                    graphs[index].render(scene, time=arguments.time, seed=arguments.seed)
                    times[index].append(graphs[index].stats()["submit_ms"])
            images = [graph.read(arguments.port) for graph in graphs]
            for name, graph, image in zip(names, graphs, images):
                host.write_image(folder / f"{pass_name}_{name}.png", graph.read())
                print(f"wrote {folder / f'{pass_name}_{name}.png'}")
                if arguments.port:
                    host.write_image(folder / f"{pass_name}_{name}_port.png", image)
                    print(f"wrote {folder / f'{pass_name}_{name}_port.png'}")
            difference = folder / f"{pass_name}_difference.png"
            metrics = host.compare(images[0], images[1], difference)
            print(f"wrote {difference}")
            print(f"{arguments.port or 'output'}: {names[0]} against {names[1]}")
            for key, formula in METRICS.items():
                value = metrics[key]
                print(f"  {key:<16} {'infinite' if value is None else format(value, '.6g'):>12}   {formula}")
            print(f"median frame time of {arguments.repeats} interleaved frames each:")
            for name, values in zip(names, times):
                print(f"  {name:<16} {statistics.median(values):10.2f} ms   ({min(values):.2f} to {max(values):.2f})")
        finally:
            for graph in graphs:
                graph.close()
    return 0


METRICS = {
    "rmse": "sqrt(mean (a-b)^2)", "mse": "mean (a-b)^2", "relmse": "mean (a-b)^2 / (b^2 + 0.01)",
    "psnr": "10 log10(1 / mse), dB", "mean_difference": "mean (a-b)", "maximum": "max |a-b|",
    "percentile_99": "99th percentile of |a-b|",
}


def say(arguments: argparse.Namespace, text: str) -> None:
    if not arguments.quiet:
        print(text, file=sys.stderr)


def main() -> int:
    parser = argparse.ArgumentParser(prog="heddle", description=__doc__.splitlines()[0])
    parser.add_argument("--version", action="version", version=f"heddle {version()}")
    commands = parser.add_subparsers(dest="command", required=True)
    for name, body, text in (("run", run, "render a scene through a graph and write images"),
                             ("check", check, "prove that a graph does what it declares"),
                             ("compare", compare, "compare two techniques of one pass on a scene")):
        command = commands.add_parser(name, help=text)
        command.set_defaults(body=body)
        command.add_argument("files", nargs="*", help="a graph and a scene (.py, .glb, .gltf, .scene.toml), in any order")
        command.add_argument("--scene")
        command.add_argument("--overlay", action="append", default=[], help="a .scene.toml with changes to the scene")
        command.add_argument("--trust-files", action="store_true", help="load files without limits")
        command.add_argument("--camera", help="name or number of a camera")
        command.add_argument("--set", action="append", default=[], help="change the graph: ao.technique=gtao")
        command.add_argument("--device", help="part of a device's name, or its index")
        command.add_argument("--validation", action="store_true")
        command.add_argument("--time", type=float, default=0.0, help="scene time of the first frame, seconds")
        command.add_argument("--animation", help="name or number of the animation to play, or none")
        command.add_argument("--loop", action="store_true", help="begin the animation again after its end")
        command.add_argument("--seed", type=int, default=0)
        command.add_argument("--quiet", "-q", action="store_true")
        if name == "run":
            command.add_argument("--output", "-o", action="append", help="FILE, or PASS.PORT=FILE, for each frame if it has %%04d (default: heddle.png)")
            command.add_argument("--frames", type=int, default=1)
            command.add_argument("--time-step", type=float, default=1 / 60, help="seconds from frame to frame")
            command.add_argument("--profile", action="store_true")
            command.add_argument("--check", action="store_true",
                                 help="prove barriers and search outputs for NaN, Inf and values out of range")
        elif name == "check":
            command.add_argument("--port", action="append", default=[], help="compare this port too, PASS.PORT")
            command.add_argument("--frames", type=int, default=3)
            command.add_argument("--json", action="store_true", help="always so here")
        else:
            command.add_argument("--swap", required=True, help="PASS=A,B; B is the reference")
            command.add_argument("--port", help="compare this port, PASS.PORT, not the output")
            command.add_argument("--folder", default="out")
            command.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    try:
        return arguments.body(arguments)
    except Error as error:
        print(error, file=sys.stderr)
        return error.status
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
