# SPDX-License-Identifier: Apache-2.0
"""`python3 -m heddle run|view|check|compare|explain|inspect [GRAPH] SCENE ...`: the command's rendering for scenes written in
Python; `python3 -m heddle study ...`: experiments; `python3 -m heddle reproduce ...`: a point of one made again.

A scene file defines `build(scene)`, called with an empty heddle.Scene, and if things move `update(scene, time)`.
"""

import argparse
import contextlib
import importlib.util
import json
import os
import pathlib
import re
import signal
import statistics
import sys
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from time import sleep, time_ns

from . import Error, Graph, Host, Job, Scene, version
from . import compare as heddle_compare
from ._library import CANCELLED
from .arguments import frame_budget, frame_count, joined, number, Parser, whole
from .outputs import Writing, frame_file, keep_outputs, parse_outputs
from .view import FRAME_BUDGET

Update = Callable[[Scene, float], None]


def load_scene(scene: Scene, file: str, trusted: bool = False, arguments: Mapping[str, object] | None = None) -> Update:
    """Runs build(scene, **arguments) of a Python file, or loads a glTF file. Returns what moves the scene to a time: the
    Python file's update(scene, time), if it has one."""
    if not file.endswith(".py"):
        scene.load(file, trusted)
        return stays
    path = scene_path(file)
    if path is None or not path.exists():
        raise Error(2, f"error: there is no scene '{file}'\n  help: scenes that come with Heddle lie in scripts/scenes")
    folder = str(path.resolve().parent)
    if folder not in sys.path:  # as for a script of its own: it may import what lies beside it
        sys.path.insert(0, folder)
    for name in [name for name, module in sys.modules.items() if is_beside(module, folder)]:
        del sys.modules[name]  # may be another since
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None  # the name ends in .py
    module = importlib.util.module_from_spec(spec)
    try:
        with scene_code():
            spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise scene_error(path, "the file itself", error) from error
    if not hasattr(module, "build"):
        raise Error(2, f"{path}: error: the scene has no function build(scene)")
    try:
        with scene_code():
            module.build(scene, **(arguments or {}))
    except (Exception, SystemExit) as error:
        given = ", ".join(["scene", *[f"{key}={value!r}" for key, value in (arguments or {}).items()]])
        raise scene_error(path, f"build({given})", error) from error

    def update(moved: Scene, time: float) -> None:
        try:
            with scene_code():
                getattr(module, "update", stays)(moved, time)
        except (Exception, SystemExit) as error:
            raise scene_error(path, f"update(scene, {time:g})", error) from error

    return update


def scene_path(file: str | None) -> pathlib.Path | None:
    """Where a scene's file is: as it was named, or among the scenes that come with Heddle."""
    if file is None:
        return None
    path = pathlib.Path(file)
    shipped = pathlib.Path(__file__).resolve().parents[1] / "scenes" / path.name
    return shipped if not path.exists() and shipped.exists() else path


def is_beside(module: object, folder: str) -> bool:
    """Whether a module was read from a scene's folder or below, and is neither this package nor an installed one."""
    file = getattr(module, "__file__", None)
    if not file or getattr(module, "__name__", "") == "__main__":
        return False
    path = pathlib.Path(file).resolve()
    if not path.is_relative_to(folder) or path.is_relative_to(pathlib.Path(__file__).resolve().parent):
        return False
    return not {"site-packages", "dist-packages"} & set(path.parts)


def scene_error(path: pathlib.Path, where: str, error: BaseException) -> Error:
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


def write_file(file: str, contents: str | bytes) -> None:
    """Under a temporary name in the same folder, which is made, then renamed: the file is whole or not there."""
    path = pathlib.Path(file)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError:
        pass  # writing says so
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        partial.write_bytes(contents.encode() if isinstance(contents, str) else contents)
        partial.replace(path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise Error(4, f"error: cannot write '{file}'") from error


class Stopped(BaseException):
    """A signal came while a scene's own code ran, which nobody else can end."""


_is_in_scene_code = False


@contextlib.contextmanager
def scene_code() -> Iterator[None]:
    """The body is a scene's own code: a signal stops it where it is, as Stopped."""
    global _is_in_scene_code
    _is_in_scene_code = True
    try:
        yield
    finally:
        _is_in_scene_code = False


def on_signal(*_: object) -> None:
    if _is_in_scene_code:
        raise Stopped


STOPPED = 130  # exit status: 128 + SIGINT, as shells have it; also for SIGTERM
_host: Host | None = None
_is_asked = False


def open_host(arguments: argparse.Namespace, check: bool = False, tell: Callable[[int, str], None] | None = None,
              progress: Callable[[str, float], object] | None = None) -> Host:
    """tell: is told what the host says, too."""
    global _host

    def log(severity: int, text: str) -> None:
        # As the command does: information too, such as how far long work has come.
        if not arguments.quiet or severity < 2:
            print(text, file=sys.stderr)
        if tell is not None:
            tell(severity, text)

    _host = Host(arguments.device, arguments.validation, arguments.plugins, check=check, progress=progress,
                 log=None if arguments.quiet and tell is None else log,
                 remake=getattr(arguments, "remake", False), live=getattr(arguments, "live", False))
    return _host


def stop_on_signals() -> None:
    """The first SIGINT or SIGTERM stops the work where nothing is half done, and a scene's own code where it is; the
    second ends the process at once.

    Python's own handlers wait for a call of the library to return; the byte of set_wakeup_fd comes at once.
    """
    read, write = os.pipe()
    os.set_blocking(write, False)
    signal.set_wakeup_fd(write, warn_on_full_buffer=False)
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, on_signal)

    def listen() -> None:
        global _is_asked
        while number := os.read(read, 1):
            if _is_asked:
                os._exit(128 + number[0])
            _is_asked = True
            if _host is not None:
                try:
                    _host.cancel()
                except Error:
                    pass  # closed meanwhile

    threading.Thread(target=listen, daemon=True).start()


def stop_if_asked() -> None:
    if _is_asked:
        raise Error(CANCELLED, "stopped")


def stays(_scene: Scene, _time: float) -> None:
    """update() of scenes that have none."""


def load_all(host: Host, scene: Scene, file: str | None,
             arguments: argparse.Namespace) -> Update:
    update = stays if file is None else load_scene(scene, file, arguments.trust_files)
    for overlay in arguments.overlay:
        scene.load(overlay, arguments.trust_files)
    if arguments.environment is not None:
        scale, rotation = arguments.environment_scale, arguments.environment_rotation
        scene.set_environment(host.read_image(arguments.environment), 1.0 if scale is None else scale,
                              0.0 if rotation is None else rotation)
    return update


def sort_files(files: list[str], scene: str | None) -> tuple[str | None, str | None]:
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
    return graph, scene


def default_graph(arguments: argparse.Namespace) -> str:
    return "deferred" if arguments.environment is None else "environment"


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


def times_of(frame_ms: list[float]) -> dict:
    """Wall times of frames: the first, which compiles, apart from those after it."""
    times = {"frames": len(frame_ms), "first_ms": frame_ms[0]}
    if rest := frame_ms[1:]:
        times |= {"median_ms": statistics.median(rest), "minimum_ms": min(rest), "maximum_ms": max(rest)}
    return times


def run(arguments: argparse.Namespace) -> int:
    graph_file, scene_file = sort_files(arguments.files, arguments.scene)
    graph_file = graph_file or default_graph(arguments)
    with open_host(arguments, arguments.check) as host, host._weave(graph_file, arguments.set) as graph:
        if isinstance(graph, Job):
            return run_job(arguments, host, graph, scene_file)

        def render(scene: Scene, update: Update) -> None:
            render_frames(arguments, host, graph, scene, update, outputs)

        if arguments.check:  # what a frame leaves to the next one comes round in the third
            arguments.frames = max(arguments.frames, 3)
        outputs = parse_outputs(graph, arguments.output or ["heddle.png"])
        keep_outputs(graph, outputs)
        if arguments.watch:
            watch(arguments, host, graph, scene_file, render)
        else:
            render(*make_scene(arguments, host, scene_file))
    return 0


def view(arguments: argparse.Namespace) -> int:
    from .view import show

    graph_file, scene_file = sort_files(arguments.files, arguments.scene)
    graph_file = graph_file or default_graph(arguments)
    settings = [list(arguments.set), list(arguments.set)]
    if arguments.swap is not None:
        name, techniques = (arguments.swap.split("=", 1) + [""])[:2]
        if techniques.count(",") != 1:
            raise Error(2, f"error: --swap '{arguments.swap}' is not PASS=A,B\n  help:     --swap ao=gtao,ray_traced")
        for of, technique in zip(settings, techniques.split(",")):
            of.append(f"{name}.technique={technique}")
    settings[1] += arguments.set_b
    has_b = arguments.swap is not None or arguments.b is not None or bool(arguments.set_b)
    size = (0, 0)
    if arguments.window is not None:
        match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", arguments.window)
        size = (int(match[1]), int(match[2])) if match else size
        if not (320 <= size[0] <= 16384 and 240 <= size[1] <= 16384):
            raise Error(2, f"error: --window '{arguments.window}' is no size of a window\n  expected: WIDTHxHEIGHT in "
                           "pixels, from 320x240 to 16384x16384")

    def scene_files(scene: Scene) -> list[str]:
        named = [str(file) for file in (scene_path(scene_file), arguments.environment, *arguments.overlay) if file]
        return sorted({*named, *scene.files(), *imported_files(scene_file)})

    show(lambda tell, progress: open_host(arguments, tell=tell, progress=progress),
         lambda host: make_scene(arguments, host, scene_file), scene_files, lambda: _is_asked,
         [graph_file, (arguments.b or graph_file) if has_b else None], settings, size, arguments.time,
         arguments.time_step, arguments.seed, arguments.script, arguments.frame_budget)
    return 0


def run_job(arguments: argparse.Namespace, host: Host, job: Job, scene_file: str | None) -> int:
    """What the job leaves, its outputs and reports. Answers 1 if a report has an error."""
    if arguments.profile or arguments.frames != 1:
        raise Error(2, f"error: {'--profile' if arguments.profile else '--frames'} is for graphs of frames, and "
                       f"'{job.describe()['file']}' is a job: it runs once")
    description = job.describe()
    types = {port["name"]: port["type"] for port in description["ports"]}
    left = [name for name, type in types.items() if type in ("artifact", "report") and "#" not in name]
    outputs = parse_outputs(job, arguments.output or [])
    for output in outputs:
        output[0] = output[0] or description["output"] or (left[0] if len(left) == 1 else None)
        if output[0] is None:
            raise Error(2, f"error: the job leaves {len(left)} things, and --output names none of them\n"
                           f"  expected: PASS.PORT=FILE with one of {', '.join(left)}")
        if types.get(output[0]) not in ("artifact", "report"):
            keep_outputs(job, [output])
    if arguments.watch:
        watch(arguments, host, job, scene_file,
              lambda scene, update: make_outputs(arguments, host, job, types, outputs, scene, update))
    return make_outputs(arguments, host, job, types, outputs, *make_scene(arguments, host, scene_file))


def make_outputs(arguments: argparse.Namespace, host: Host, job: Job, types: dict[str, str], outputs: list[list], scene: Scene,
                 update: Update) -> int:
    """Runs the job, writes its outputs and says what it left. Answers the exit status."""
    update(scene, arguments.time)
    result = job.run(scene, arguments.time, arguments.seed)
    reports = {report["name"]: report["rows"] for report in result["reports"]}
    writing = Writing()
    for port, file in outputs:
        stop_if_asked()
        with writing.of(file):
            if port in reports:
                write_file(file, json.dumps(reports[port], indent=2) + "\n")
            elif types[port] == "artifact":
                write_file(file, job.artifact(port))
            else:
                host.write_image(file, job.read(port))
            say(arguments, f"wrote {file}")
    for name, rows in reports.items():
        for row in rows:
            values = ", ".join(f"{key} {value if isinstance(value, str) else json.dumps(value)}"
                               for key, value in row["values"].items())
            print(f"{name}: {row['level']}: {row['message']}" + (f" ({values})" if values else ""))
    if arguments.stats == "-":
        print(json.dumps(result, indent=2))
    elif arguments.stats:
        write_file(arguments.stats, json.dumps(result, indent=2) + "\n")
    for artifact in result["artifacts"]:
        origin = "from the cache" if artifact["origin"] == "cache" else "made"
        say(arguments, f"artifact '{artifact['name']}': {origin}, {artifact['bytes'] / 2**20:.1f} MiB, "
                       f"{artifact['file'] or 'kept nowhere'}")
    writing.finish()
    return 1 if result["errors"] else 0


def make_scene(arguments: argparse.Namespace, host: Host, file: str | None) -> tuple[Scene, Update]:
    scene = host.scene()
    try:
        update = load_all(host, scene, file, arguments)
        use_camera(scene, arguments.camera)
        use_animation(scene, arguments)
    except BaseException:
        scene.close()
        raise
    return scene, update


def render_frames(arguments: argparse.Namespace, host: Host, graph: Graph, scene: Scene, update: Update,
                  outputs: list[list]) -> None:
    """All frames of the arguments, with their outputs and what is said of them."""
    frame_ms, writing = [], Writing()
    for frame in range(arguments.frames):
        stop_if_asked()
        is_last = frame + 1 == arguments.frames
        time = arguments.time + frame * arguments.time_step
        update(scene, time)
        graph.render(scene, time=time, time_step=arguments.time_step, seed=arguments.seed,
                     profile=arguments.profile and is_last)
        frame_ms.append(graph.stats()["wall_ms"])
        for port, file in outputs:
            if is_last or frame_file(file, frame) != file:
                stop_if_asked()
                file = frame_file(file, frame)
                with writing.of(file):
                    host.write_image(file, graph.read(port))
                    say(arguments, f"wrote {file}")
        if not is_last:
            writing.finish()
    if arguments.check:
        say(arguments, f"checked {arguments.frames} frames: every hazard and layout is covered, and every pass keeps to "
                       "its role's numbers")
    stats = graph.stats()
    stats["run"] = times_of(frame_ms)
    if arguments.stats == "-":
        print(json.dumps(stats, indent=2))
    elif arguments.stats:
        write_file(arguments.stats, json.dumps(stats, indent=2) + "\n")
    if arguments.profile:
        for stage in stats["stages"]:
            print(f"{stage['pass']:<16} {stage['stage']:<16} {stage['wall_ms']:10.3f} ms wall "
                  f"{stage['cpu_ms']:10.3f} ms CPU")
    for loop in stats["loops"]:
        is_complete = loop["done"] == loop["total"]
        say(arguments, f"loop of pass '{loop['pass']}': {loop['done']} of {loop['total']} iterations" +
            ("" if is_complete else "; more --frames go on where nothing changes, as with --time-step 0"))
    for artifact in stats["artifacts"]:
        name = (f"'{artifact['job']}#{artifact['pass']}.{artifact['port']}'" if "job" in artifact
                else f"of pass '{artifact['pass']}', {artifact['stage']}")
        say(arguments, f"artifact {name}: {'from the cache' if artifact['origin'] == 'cache' else 'made'}, "
                       f"{artifact['bytes'] / 2**20:.1f} MiB")
    memory = stats["memory"]
    say(arguments, f"frame {arguments.frames - 1} on {stats['device']['name']}: {stats['wall_ms']:.1f} ms; transient memory "
                   f"{memory['transient_bytes'] / 2**20:.1f} MiB "
                   f"({memory['transient_bytes_without_aliasing'] / 2**20:.1f} MiB without aliasing)")
    if arguments.live:
        total = stats["late"]["total"]
        say(arguments, f"live: {total['stale']} of {total['reads']} late reads were stale; the host waited for the GPU "
                       f"{total['waits']} times")
    if len(frame_ms) > 1:
        say(arguments, "{frames} frames: first {first_ms:.1f} ms; then median {median_ms:.1f} ms "
                       "({minimum_ms:.1f} to {maximum_ms:.1f})".format(**stats["run"]))
    if arguments.watch:
        say(arguments, "planned in {wall_ms:.0f} ms: {passes_made} passes and {pipelines_made} pipelines made, "
                       "{passes_kept} and {there} kept".format(
                           **stats["plan"], there=stats["plan"]["pipelines_kept"] + stats["plan"]["pipelines_shared"]))
    writing.finish()


def watch(arguments: argparse.Namespace, host: Host, graph: Graph | Job, scene_file: str | None,
          render: Callable[[Scene, Update], object]) -> None:
    """Renders, and again whenever a file changes that the picture was made of, until it is stopped. What fails is said,
    and what was written before stays."""
    made: tuple[Scene, Update] | None = None
    graph_files = set(graph.files())
    scene_files = {str(file) for file in (scene_path(scene_file), arguments.environment, *arguments.overlay) if file}
    # What failed to be read is read again at the next change, whichever file that is.
    is_graph_due, is_scene_due = False, True
    before = stamps(graph_files | scene_files)
    say(arguments, f"watching {len(before)} files; Ctrl-C ends")
    while True:
        began = time_ns()
        try:
            if is_scene_due:
                fresh = make_scene(arguments, host, scene_file)
                if made is not None:
                    made[0].close()
                made, is_scene_due = fresh, False
            if is_graph_due:
                graph.reload()
                is_graph_due = False
            assert made is not None  # is_scene_due began true
            render(*made)
            graph_files = set(graph.files())
            scene_files |= set(made[0].files()) | imported_files(scene_file)
        except Error as error:
            if error.status == CANCELLED:
                raise
            scene_files |= imported_files(scene_file)
            print(error, file=sys.stderr)
            say(arguments, "waiting for the next change; what was written before stays")
        # Known files are as they were when the waiting ended. Of those that came into the lists just now nobody knows
        # whether they were read before or after a change since this began: they count as changed.
        before = {file: before.get(file, stamp if stamp[0] < began else (0, 0))
                  for file, stamp in stamps(graph_files | scene_files).items()}
        last = before
        while True:  # until something differs and nothing moves any more
            sleep(0.2)
            stop_if_asked()
            now = stamps(before)
            if now != before and now == last:
                break
            last = now
        for file in sorted(file for file in now if now[file] != before[file]):
            say(arguments, f"changed: {file}")
            is_graph_due = is_graph_due or file in graph_files
            is_scene_due = is_scene_due or file in scene_files
        before = now


def imported_files(scene_file: str | None) -> set[str]:
    """Python files beside a scene that it imported."""
    path = scene_path(scene_file)
    if path is None or path.suffix != ".py":
        return set()
    folder = str(path.resolve().parent)
    return {str(module.__file__) for module in list(sys.modules.values()) if is_beside(module, folder)}


def stamps(files: Iterable[str]) -> dict[str, tuple[int, int]]:
    """Times and sizes; (0, 0) for a file that is not there."""
    found = {}
    for file in files:
        try:
            status = os.stat(file)
            found[file] = (status.st_mtime_ns, status.st_size)
        except OSError:
            found[file] = (0, 0)
    return found


def check(arguments: argparse.Namespace) -> int:
    graph_file, scene_file = sort_files(arguments.files, arguments.scene)
    graph_file = graph_file or default_graph(arguments)
    with open_host(arguments, True) as host:
        with host._weave(graph_file, arguments.set) as graph, host.scene() as scene:
            for port in arguments.port:
                graph.keep(port)
            load_all(host, scene, scene_file, arguments)(scene, arguments.time)
            use_camera(scene, arguments.camera)
            report = graph.check(scene, max(arguments.frames, 3), arguments.time, 0.0, arguments.seed)
            print(json.dumps(report, indent=2) if arguments.json else check_text(report))
    return 0


def check_text(report: dict) -> str:
    """As the command prints it for other scenes."""
    poisons, lists, overflowed = ", ".join(report["poisons"]), ", ".join(report["lists"]), report["overflowed"]
    rows = [f"{report['runs']} runs of {report['frames']} frames, nothing found",
            "  hazards  every read-after-write, write-after-read, write-after-write and layout is covered",
            "  numbers  no pass makes NaN, nor Inf or values out of range where its role forbids them",
            f"  orders   {report['orders']}; of {report['unordered_pairs']} pairs of stages that nothing puts in order, "
            f"{report['seen_both_ways']} were seen both ways",
            "  memory   " + (f"filled before its first and after its last use with {poisons}" if poisons else
                             "left as it is: on this device nobody can fill the bytes of an image")]
    if lists:
        rows.append(f"  lists    {lists}: what a stage appends was seen in two orders" +
                    (f"; {overflowed} of {report['frames']} frames are not compared, a list had no room in them"
                     if overflowed else ""))
    return "\n".join([*rows, f"  bytes    {', '.join(report['compared'])} agree in all runs"])


def explain(arguments: argparse.Namespace) -> int:
    graph_file, scene_file = sort_files(arguments.files, arguments.scene)
    graph_file = graph_file or default_graph(arguments)
    with open_host(arguments) as host, host._weave(graph_file, arguments.set) as graph:
        if isinstance(graph, Graph):  # a job may take its time: it is explained as it would run if nothing were there
            with host.scene() as scene:
                load_all(host, scene, scene_file, arguments)(scene, arguments.time)
                use_camera(scene, arguments.camera)
                use_animation(scene, arguments)
                graph.render(scene, time=arguments.time, seed=arguments.seed)
        print(graph.explain(arguments.format, arguments.why))
    return 0


def inspect(arguments: argparse.Namespace) -> int:
    pixels = [word.split(",") for word in arguments.files if re.fullmatch(r"\d+,\d+", word)]
    if not pixels:
        raise Error(2, "error: no pixel was named\n  expected: X,Y in pixels of the frame from its top left, for instance "
                       "320,180")
    files = [word for word in arguments.files if not re.fullmatch(r"\d+,\d+", word)]
    graph_file, scene_file = sort_files(files, arguments.scene)
    graph_file = graph_file or default_graph(arguments)
    with open_host(arguments) as host, host.graph(graph_file, arguments.set) as graph, host.scene() as scene:
        for port in arguments.port:
            graph.keep(port)
        update = load_all(host, scene, scene_file, arguments)
        use_camera(scene, arguments.camera)
        use_animation(scene, arguments)
        for frame in range(arguments.frames):
            stop_if_asked()
            time = arguments.time + frame * arguments.time_step
            update(scene, time)
            if frame + 1 < arguments.frames:
                graph.render(scene, time=time, time_step=arguments.time_step, seed=arguments.seed)
        format = "json" if arguments.json else "text"
        seen = graph._inspect([(int(x), int(y)) for x, y in pixels], scene, time, arguments.time_step, arguments.seed, format)
        print(seen, end="\n" if arguments.json else "")
    return 0


def compare(arguments: argparse.Namespace) -> int:
    graph_file, scene_file = sort_files(arguments.files, arguments.scene)
    graph_file = graph_file or default_graph(arguments)
    pass_name, techniques = (arguments.swap.split("=", 1) + [""])[:2]
    names = techniques.split(",")
    if len(names) != 2:
        raise Error(2, f"error: --swap '{arguments.swap}' is not PASS=A,B\n  help:     --swap ao=gtao,ray_traced")
    folder = pathlib.Path(arguments.folder)
    folder.mkdir(parents=True, exist_ok=True)
    with open_host(arguments) as host, host.scene() as scene:
        load_all(host, scene, scene_file, arguments)(scene, arguments.time)
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
                    stop_if_asked()
                    graphs[index].render(scene, time=arguments.time, seed=arguments.seed, anew=True)
                    times[index].append(graphs[index].stats()["submit_ms"])
            images = [graph.read(arguments.port) for graph in graphs]
            for name, graph, image in zip(names, graphs, images):
                host.write_image(folder / f"{pass_name}_{name}.png", graph.read())
                print(f"wrote {folder / f'{pass_name}_{name}.png'}")
                if arguments.port:
                    host.write_image(folder / f"{pass_name}_{name}_port.png", image)
                    print(f"wrote {folder / f'{pass_name}_{name}_port.png'}")
            difference = folder / f"{pass_name}_difference.png"
            host.compare(images[0], images[1], difference)
            print(f"wrote {difference}")
            print(f"{arguments.port or 'output'}: {names[0]} against {names[1]}")
            for key, metric in heddle_compare(images[0], images[1], arguments.metric or None).items():
                value = metric["value"]
                print(f"  {key:<16} {'infinite' if value is None else format(value, '.6g'):>12}   {metric['formula']}")
            print(f"median frame time of {arguments.repeats} interleaved frames each:")
            for name, values in zip(names, times):
                print(f"  {name:<16} {statistics.median(values):10.2f} ms   ({min(values):.2f} to {max(values):.2f})")
        finally:
            for graph in graphs:
                graph.close()
    return 0


def study(arguments: argparse.Namespace) -> int:
    from .study_run import run_study

    return run_study(arguments, stop_if_asked)


def tune(arguments: argparse.Namespace) -> int:
    from .tune import tune as tune_graph

    return tune_graph(arguments, stop_if_asked)


def baseline(arguments: argparse.Namespace) -> int:
    from .baseline import baseline as keep_or_check

    return keep_or_check(arguments, stop_if_asked)


def reproduce(arguments: argparse.Namespace) -> int:
    from .reproduce import reproduce as body

    return body(arguments, stop_if_asked)


def say(arguments: argparse.Namespace, text: str) -> None:
    if not arguments.quiet:
        print(text, file=sys.stderr)


def main() -> int:
    parser = Parser(prog="heddle", description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("--version", action="version", version=f"heddle {version()}")
    commands = parser.add_subparsers(dest="command", required=True)
    for name, body, text in (("run", run, "render a scene through a graph and write images"),
                             ("view", view, "a window: fly, compare two variants, move every parameter"),
                             ("check", check, "prove that a graph does what it declares"),
                             ("explain", explain, "say what the graph compiler decided for a scene and why"),
                             ("inspect", inspect, "say what every image port holds at a pixel"),
                             ("compare", compare, "compare two techniques of one pass on a scene")):
        command = commands.add_parser(name, help=text, allow_abbrev=False)
        command.set_defaults(body=body)
        command.add_argument("files", nargs="*", help="a graph and a scene (.py, .glb, .gltf, .scene.toml), in any order")
        command.add_argument("--scene")
        command.add_argument("--overlay", action="append", default=[], help="a .scene.toml with changes to the scene")
        command.add_argument("--trust-files", action="store_true", help="load files without limits")
        command.add_argument("--camera", help="name or number of a camera")
        command.add_argument("--environment", help="equirectangular image that lights the scene; without a graph: the "
                                                   "graph 'environment'")
        command.add_argument("--environment-scale", type=number, help="cd/m^2 of the image's 1 (default: 1)")
        command.add_argument("--environment-rotation", type=number, help="radians about the vertical axis (default: 0)")
        command.add_argument("--set", action="append", default=[], help="change the graph: ao.technique=gtao")
        command.add_argument("--device", help="part of a device's name, or its index")
        command.add_argument("--plugins", help="folders with plugins, separated by ':'")
        command.add_argument("--validation", action="store_true")
        command.add_argument("--time", type=number, default=0.0, help="scene time of the first frame, seconds")
        command.add_argument("--animation", help="name or number of the animation to play, or none")
        command.add_argument("--loop", action="store_true", help="begin the animation again after its end")
        command.add_argument("--seed", type=whole, default=0)
        command.add_argument("--quiet", "-q", action="store_true")
        if name == "run":
            command.add_argument("--output", "-o", action="append", help="FILE, or PASS.PORT=FILE, for each frame if it has %%04d (default: heddle.png)")
            command.add_argument("--frames", type=frame_count, default=1)
            command.add_argument("--time-step", type=number, default=1 / 60, help="seconds from frame to frame")
            command.add_argument("--stats", help="write counters, memory and times as JSON; - for standard output")
            command.add_argument("--profile", action="store_true")
            command.add_argument("--watch", action="store_true",
                                 help="stay, and render again when a file changes that the picture was made of")
            command.add_argument("--live", action="store_true",
                                 help="wait for no frame before the next one; bytes may differ from run to run")
            command.add_argument("--remake", action="store_true", help="make artifacts that the cache holds again")
            command.add_argument("--check", action="store_true",
                                 help="prove barriers and search outputs for NaN, Inf and values out of range")
        elif name == "view":
            command.add_argument("--swap", help="PASS=A,B: show technique A against technique B")
            command.add_argument("--b", help="show this graph against the first")
            command.add_argument("--set-b", action="append", default=[],
                                 help="show the graph against itself with this setting, as of --set")
            command.add_argument("--time-step", type=number, default=1 / 60, help="seconds from frame to frame, while it plays")
            command.add_argument("--frame-budget", type=frame_budget, default=FRAME_BUDGET,
                                 help="while nothing changes, milliseconds in which loops render on before the picture is shown "
                                      "again (default: 33; 0: after each frame)")
            command.add_argument("--window", help="WIDTHxHEIGHT in pixels (default: the picture in its own size, beside the panel)")
            command.add_argument("--script", help="file with what mouse and keys do, a command a line: wait, pause, click, "
                                                  "slide, type, key, drag, screenshot, state, quit")
            command.add_argument("--live", action="store_true",
                                 help="wait for no frame before the next one; bytes may differ from run to run")
        elif name == "check":
            command.add_argument("--port", action="append", default=[], help="compare this port too, PASS.PORT")
            command.add_argument("--frames", type=frame_count, default=3)
            command.add_argument("--json", action="store_true", help="print what was done as JSON")
        elif name == "explain":
            command.add_argument("--format", choices=("text", "json", "dot"), default="text")
            command.add_argument("--why", help="explain one PASS; text or json")
            command.add_argument("--live", action="store_true", help="as heddle run --live does it")
        elif name == "inspect":
            command.add_argument("--port", action="append", default=[], help="PASS.PORT: run this pass too")
            command.add_argument("--frames", type=frame_count, default=1)
            command.add_argument("--time-step", type=number, default=1 / 60, help="seconds from frame to frame")
            command.add_argument("--json", action="store_true")
        else:
            command.add_argument("--swap", required=True, help="PASS=A,B; B is the reference")
            command.add_argument("--port", help="compare this port, PASS.PORT, not the output")
            command.add_argument("--metric", action="append", default=[], help="only this one, repeatable")
            command.add_argument("--folder", default="out")
            command.add_argument("--repeats", type=whole, default=3)
    command = commands.add_parser("study", allow_abbrev=False, help="measure error and time of techniques over their knobs")
    command.set_defaults(body=study)
    command.add_argument("files", nargs="*", help="a study (.toml), or the name of a shipped one; with --role: scenes")
    command.add_argument("--role", help="study all techniques of this role over all their knobs, without a file")
    command.add_argument("--graph", help="with --role: in this graph (default: the first shipped one with a pass of the role)")
    command.add_argument("--set", action="append", default=[], help="with --role: change the graph: extent=[320,180]")
    command.add_argument("--climb", choices=("together", "each"), default="together",
                         help="with --role: a technique's ladders together, or each on its own (default: together)")
    command.add_argument("--scene", action="append", default=[], help="instead of the file's scenes: a model of your own, "
                                                                      "for instance; repeatable")
    command.add_argument("--folder", help="where results go (default: out/NAME of the study)")
    command.add_argument("--device", help="part of a device's name, or its index")
    command.add_argument("--rounds", type=whole, help="instead of the file's: more rounds see smaller differences")
    command.add_argument("--reference", choices=("same_model", "physical"), help="with --role: which truth of its contract")
    command.add_argument("--budget", type=number, help="minutes; a study that would take longer ends before it times anything")
    command.add_argument("--cluster", metavar="ADDRESS", help="of a Dask scheduler, whose workers work; local: of this machine")
    command.add_argument("--timeout", type=number, default=300, help="seconds after which a variant that does not answer "
                                                                    "counts as hung")
    command.add_argument("--dry-run", action="store_true", help="check the file, say what would be measured, render nothing")
    command.add_argument("--gate", action="store_true", help="exit status 1 if anything is worse than the first variant or was "
                                                             "lost, 2 if undecided, else 0; 4 if there are no verdicts, "
                                                             "because of a mistake in the file, for instance")
    command.add_argument("--quiet", "-q", action="store_true")
    command = commands.add_parser("tune", allow_abbrev=False, help="choose knobs within a budget of time or of error, and write "
                                                                   "them as a graph that extends this one")
    command.set_defaults(body=tune)
    command.add_argument("files", nargs="*", help="a graph and a scene (.py, .glb, .gltf, .scene.toml), in any order")
    command.add_argument("--budget", help="frame time with its unit, 4ms: the least error within it")
    command.add_argument("--error", help="METRIC=NUMBER, flip=0.02: the least time within it")
    command.add_argument("--metric", help="with --budget: which error is least (default: flip)")
    command.add_argument("--port", help="the image that is compared (default: the graph's output)")
    command.add_argument("--pass", dest="passes", action="append", default=[], help="tune this pass alone; repeatable (default: "
                                                                                    "all that have knobs)")
    command.add_argument("--techniques", action="store_true", help="other techniques of the passes' roles too")
    command.add_argument("--set", action="append", default=[], help="change the graph, and what is written: extent=[320,180]")
    command.add_argument("--reference-set", action="append", default=[], help="change what is taken for true: "
                                                                              "ao.technique=ray_traced")
    command.add_argument("--parts", type=whole, default=1, help="renderings of what is true, with seeds of their own (default: 1)")
    command.add_argument("--overlay", action="append", default=[], help="a .scene.toml with changes to the scene")
    command.add_argument("--camera", action="append", default=[], help="choose in this camera; repeatable (default: the scene's)")
    command.add_argument("--time", type=number, action="append", default=[], help="choose at this time, seconds; repeatable")
    command.add_argument("--check-camera", action="append", default=[], help="check in this camera; repeatable (default: all others)")
    command.add_argument("--check-time", type=number, action="append", default=[], help="check at this time, seconds; repeatable")
    command.add_argument("--output", "-o", help="the graph that is written (default: FOLDER/tuned.toml)")
    command.add_argument("--folder", help="where measurements are kept (default: out/tune)")
    command.add_argument("--rounds", type=whole, default=9, help="of turns; more see smaller differences (default: 9)")
    command.add_argument("--frames", type=frame_count, default=2, help="timed in a turn (default: 2)")
    command.add_argument("--settle", type=whole, default=1, help="frames before an image is read (default: 1)")
    command.add_argument("--minutes", type=number, default=30, help="what would take longer says so and ends (default: 30)")
    command.add_argument("--timeout", type=number, default=300, help="seconds after which a process that does not answer is hung")
    command.add_argument("--device", help="part of a device's name, or its index")
    command.add_argument("--dry-run", action="store_true", help="say which settings would be measured")
    command.add_argument("--quiet", "-q", action="store_true")
    command = commands.add_parser("baseline", allow_abbrev=False, help="keep error, counters and bytes of every technique, or "
                                                                       "say what has changed since")
    command.set_defaults(body=baseline)
    command.add_argument("action", choices=("record", "check"), help="keep what is now; or compare with what was kept: exit "
                                                                     "status 1 if anything differs")
    command.add_argument("files", nargs="*", help="ROLE or ROLE/TECHNIQUE (default: all)")
    command.add_argument("--folder", help="where baselines are kept, a folder a machine and driver (default: tests/baselines of "
                                          "the repository, else baselines)")
    command.add_argument("--tolerance", type=number, default=0.0, help="relative difference of errors that is none (default: 0, "
                                                                      "equal bytes make equal errors)")
    command.add_argument("--timeout", type=number, default=300, help="seconds after which a process that does not answer is hung")
    command.add_argument("--device", help="part of a device's name, or its index")
    command.add_argument("--quiet", "-q", action="store_true")
    command = commands.add_parser("reproduce", allow_abbrev=False, help="make a point of a study's report again, and say whether it "
                                                                       "is the same")
    command.set_defaults(body=reproduce)
    command.add_argument("file", help="report.html of a study")
    command.add_argument("row", nargs="+", help="a row's number in the page, or a point's name and, where it is not clear, the "
                                                "scene's")
    command.add_argument("--output", "-o", help="write the image, too")
    command.add_argument("--no-times", action="store_true", help="compare the image alone")
    command.add_argument("--rounds", type=whole, help="instead of the study's: more rounds see smaller differences")
    command.add_argument("--device", help="part of a device's name, or its index; else the study's")
    command.add_argument("--timeout", type=number, default=300, help="seconds after which a renderer that does not answer counts "
                                                                    "as hung")
    command.add_argument("--quiet", "-q", action="store_true")
    # Files and pixels may stand behind options too, where argparse leaves them over.
    try:
        arguments, words = parser.parse_known_args(joined(sys.argv[1:]))
        own = commands.choices[arguments.command]
        if unknown := [word for word in words if word.startswith("-")]:
            own.refuse_option(unknown[0])
    except SystemExit as ended:
        # argparse's 2 would be a gate's "undecided".
        if ended.code == 2 and "--gate" in sys.argv[2:] and sys.argv[1] == "study":
            return 4
        raise
    if words and not hasattr(arguments, "files"):
        own.error(f"{' '.join(words)!r}: there is nothing more to say than this command takes")
    if words:
        arguments.files += words
    for option in ("environment_scale", "environment_rotation"):
        if getattr(arguments, option, None) is not None and arguments.environment is None:
            own.error(f"--{option.replace('_', '-')} requires --environment")
    stop_on_signals()
    try:
        return arguments.body(arguments)
    except Error as error:
        if error.status == CANCELLED:
            print("stopped", file=sys.stderr)
            return STOPPED
        print(error, file=sys.stderr)
        return error.status
    except Stopped:
        print("stopped", file=sys.stderr)
        return STOPPED
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
