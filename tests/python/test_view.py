# SPDX-License-Identifier: Apache-2.0
"""The window, on a screen in memory (Xvfb): pictures are read from the screen itself, mouse and keys come through the X
server (xdotool) or from scripts."""

import contextlib
import itertools
import json
import os
import pathlib
import re
import signal
import struct
import subprocess
import threading
import time

import numpy as np
import pytest
from conftest import BUILD, default_signals

SIZE = [160, 120]
SETTINGS = ["--set", f"extent={json.dumps(SIZE)}", "--set", "shadow.params.resolution=256"]
SCENE = "scripts/scenes/cornell_box.py"
WINDOW = ["--window", "760x520"]
AWAY = ["700", "450"]  # the server draws its pointer into its memory too
PATIENCE = 300  # seconds until a machine that does much else counts as hung


class Screen:
    """An X server without a screen."""

    def __init__(self, folder: pathlib.Path):
        self.folder = folder
        read, write = os.pipe()
        self.server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(write), "-screen", "0", "800x600x24", "-fbdir", str(folder), "-nolisten", "tcp"],
            pass_fds=[write], stderr=subprocess.DEVNULL)
        os.close(write)
        with os.fdopen(read) as number:
            self.display = f":{number.readline().strip()}"

    def pixels(self) -> np.ndarray:
        """uint8 (height, width, 3): what is on the screen, from the server's own memory (the format of xwd)."""
        data = (self.folder / "Xvfb_screen0").read_bytes()
        head = struct.unpack(">25I", data[:100])
        header_size, width, height, line, colors = head[0], head[4], head[5], head[12], head[19]
        assert head[11] == 32 and head[7] == 0  # bits a pixel; the least significant byte first
        start = header_size + 12 * colors
        rows = np.frombuffer(data, np.uint8, height * line, start).reshape(height, line)
        return rows[:, :4 * width].reshape(height, width, 4)[:, :, 2::-1]

    def xdotool(self, *words: str) -> None:
        subprocess.run(["xdotool", *words], env=os.environ | {"DISPLAY": self.display}, check=True)

    def close(self) -> None:
        self.server.terminate()
        self.server.wait(PATIENCE)


@pytest.fixture
def screen(tmp_path):
    folder = tmp_path / "screen"
    folder.mkdir()
    made = Screen(folder)
    yield made
    made.close()


class Viewer:
    """A `heddle view` that runs."""

    def __init__(self, command: str, root: pathlib.Path, screen: Screen, words: list[str], script: pathlib.Path | None = None):
        if script is not None:
            words = [*words, "--script", str(script)]
        self.process = subprocess.Popen([command, "view", "--quiet", *words], cwd=root, stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, text=True, preexec_fn=default_signals,
                                        env=os.environ | {"DISPLAY": screen.display, "LIBGL_ALWAYS_SOFTWARE": "1"})
        self.states: list[dict] = []
        self.has_ended = False
        self.has_state = threading.Condition()
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            with self.has_state:
                self.states.append(json.loads(line))
                self.has_state.notify_all()
        with self.has_state:
            self.has_ended = True
            self.has_state.notify_all()

    def state(self, number: int) -> dict:
        """What the script's command 'state' printed, counted from 0."""
        with self.has_state:
            self.has_state.wait_for(lambda: len(self.states) > number or self.has_ended, PATIENCE)
            assert len(self.states) > number, self.stop()
            return self.states[number]

    def wait(self) -> tuple[int, str]:
        status = self.process.wait(PATIENCE)
        self.reader.join(PATIENCE)
        assert self.process.stderr is not None
        return status, self.process.stderr.read()

    def stop(self) -> tuple[int, str]:
        self.process.send_signal(signal.SIGTERM)
        return self.wait()


@contextlib.contextmanager
def viewer(*arguments, **named):
    made = Viewer(*arguments, **named)
    try:
        yield made
    finally:
        if made.process.poll() is None:
            made.process.kill()
            made.process.wait()


def script(folder: pathlib.Path, text: str) -> pathlib.Path:
    file = folder / "view.script"
    file.write_text(text)
    return file


def rendered(command: str, root: pathlib.Path, folder: pathlib.Path, name: str, *settings: str,
             graph: str = "deferred") -> np.ndarray:
    """uint8 (height, width, 3) of the file that `heddle run` writes."""
    import heddle

    file = folder / f"{name}.png"
    subprocess.run([command, "run", "--quiet", graph, SCENE, *SETTINGS, *settings, "--output", str(file)], cwd=root, check=True)
    with heddle.Host() as host:
        return np.rint(host.read_image(str(file))[:, :, :3] * 255).astype(np.uint8)


def picture_of(image: np.ndarray, state: dict) -> np.ndarray:
    """The part of a window's or screen's image that shows the picture, at 1:1."""
    left, top, right, bottom = (int(number) for number in state["picture"])
    assert [right - left, bottom - top] == SIZE
    return image[top:bottom, left:right]


def middle(state: dict, widget: str, part: float = 0.5) -> list[str]:
    left, top, right, bottom = state["widgets"][widget]
    return [str(int(left + part * (right - left))), str(int((top + bottom) / 2))]


def until(condition, what: str):
    """The screen shows things when they are done, not when they are asked for."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, what
        time.sleep(0.05)


def repeat(action, condition, what: str):
    """Until the screen shows what the action is for."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, what
        action()
        soon = time.monotonic() + 10
        while not condition() and time.monotonic() < soon:
            time.sleep(0.05)


def same_but_labels(shown: np.ndarray, expected: np.ndarray, columns: slice) -> bool:
    """Below the letters, and without the columns that the wipe's handle covers, 7 pixels to both sides."""
    return np.array_equal(shown[24:, columns], expected[24:, columns])


def test_wipe_and_slider_move_under_a_real_mouse(command, root, screen, tmp_path):
    """The left half is byte for byte A's file, the right half B's, wherever the wipe is; a slider changes A alone."""
    a = rendered(command, root, tmp_path, "a", "--set", "ao.technique=gtao")
    b = rendered(command, root, tmp_path, "b", "--set", "ao.technique=none")
    assert not np.array_equal(a, b)
    commands = script(tmp_path, "wait\nclick pass/display\nwait\nstate\n")
    with viewer(command, root, screen, [SCENE, *SETTINGS, *WINDOW, "--swap", "ao=gtao,none"], commands) as view:
        state = view.state(0)
        shown = lambda: picture_of(screen.pixels(), state)  # noqa: E731
        until(lambda: same_but_labels(shown(), a, slice(0, 72)) and same_but_labels(shown(), b, slice(88, 160)), "A | B")
        assert not same_but_labels(shown(), b, slice(0, 72))
        # The wipe, from the middle to a quarter. A window that draws slowly may see a press and what follows at once, where the
        # pointer is by then: a person would try again.
        press = itertools.cycle([0.5, 0.4, 0.25])
        repeat(lambda: screen.xdotool("mousemove", *middle(state, "picture", next(press)), "sleep", "0.3", "mousedown", "1",
                                      "sleep", "0.3", "mousemove", *middle(state, "picture", 0.4), "sleep", "0.3",
                                      "mousemove", *middle(state, "picture", 0.25), "sleep", "0.3", "mouseup", "1",
                                      "mousemove", *AWAY),
               lambda: same_but_labels(shown(), a, slice(0, 32)) and same_but_labels(shown(), b, slice(49, 160)), "the wipe")
        # A slider of A.
        before = shown().copy()
        repeat(lambda: screen.xdotool("mousemove", *middle(state, "display.params.exposure", 0.5), "sleep", "0.3", "mousedown",
                                      "1", "sleep", "0.3", "mouseup", "1", "mousemove", *AWAY),
               lambda: not np.array_equal(shown()[24:, :32], before[24:, :32]), "the slider")
        assert same_but_labels(shown(), b, slice(49, 160))
        # Closed as a window manager does it.
        assert view.process.poll() is None
        assert view.stop() == (130, "stopped\n")


def test_slider_shows_what_its_setting_renders(command, root, screen, tmp_path):
    shot = tmp_path / "shot.png"
    commands = script(tmp_path, f"wait\nclick pass/display\nslide display.params.exposure 0.6\nwait\nstate\nscreenshot {shot}\nquit\n")
    with viewer(command, root, screen, [SCENE, *SETTINGS, *WINDOW], commands) as view:
        state = view.state(0)
        assert view.wait() == (0, "")
    exposure = state["variants"][0]["parameters"]["display.params.exposure"]
    assert exposure != 15
    expected = rendered(command, root, tmp_path, "expected", "--set", f"display.params.exposure={exposure!r}")
    import heddle

    with heddle.Host() as host:
        window = np.rint(host.read_image(str(shot))[:, :, :3] * 255).astype(np.uint8)
    assert np.array_equal(picture_of(window, state), expected)


def test_nothing_is_rendered_or_drawn_while_nothing_changes(command, root, screen, tmp_path):
    commands = script(tmp_path, "wait\nstate\npause 2\nstate\nkey W 0.2\nwait\nstate\nquit\n")
    with viewer(command, root, screen, [SCENE, *SETTINGS, *WINDOW], commands) as view:
        rest, later, flown = view.state(0), view.state(1), view.state(2)
        assert view.wait() == (0, "")
    assert rest["settled"] and rest["frames"] > 0
    # 8 bits of four channels, as the device has them, and each frame's once.
    assert rest["read_bytes"] == 4 * SIZE[0] * SIZE[1] * rest["frames"]
    for counter in ("frames", "submits", "draws", "read_bytes"):
        assert later[counter] == rest[counter]
        assert flown[counter] > later[counter]
    assert flown["camera"]["position"] != rest["camera"]["position"]


def test_the_validation_layer_finds_nothing(command, root, screen, tmp_path):
    """In frames and in what is read after them: it is told with the next frame."""
    commands = script(tmp_path, "wait\nkey W 0.2\nwait\nclick pass/ao\nslide ao.params.radius 0.7\nwait\nclick step\nwait\nstate\nquit\n")
    with viewer(command, root, screen, [SCENE, *SETTINGS, *WINDOW, "--swap", "ao=gtao,none", "--validation"], commands) as view:
        state = view.state(0)
        assert view.wait() == (0, "")
    assert state["frames"] >= 8
    assert [variant["error"] + variant["refused"] for variant in state["variants"]] == ["", ""]


@pytest.mark.parametrize("budget, least, most", [("0", 10, 15), ("10000", 2, 6)])
def test_progressive_loops_go_on_within_the_budget_while_nothing_moves(command, root, screen, tmp_path, budget, least, most):
    shot = tmp_path / "shot.png"
    samples = ["--set", "aa.params.samples=15"]
    words = ["supersampled", SCENE, *SETTINGS, *WINDOW, *samples, "--set", "aa.params.mode=progressive", "--frame-budget", budget]
    commands = script(tmp_path, f"wait\nstate\npause 1\nstate\nscreenshot {shot}\nquit\n")
    with viewer(command, root, screen, words, commands) as view:
        rest, later = view.state(0), view.state(1)
        assert view.wait() == (0, "")
    assert rest["settled"] and rest["frames"] >= 15
    assert (later["frames"], later["submits"]) == (rest["frames"], rest["submits"])
    # Frames between two pictures double as long as they fit, from one on: 1 + 2 + 4 + 8. Equal pictures count once.
    assert least <= rest["variants"][0]["pictures"] <= most
    import heddle

    with heddle.Host() as host:
        window = np.rint(host.read_image(str(shot))[:, :, :3] * 255).astype(np.uint8)
    # All samples in one frame have the same bytes.
    expected = rendered(command, root, tmp_path, "expected", *samples, graph="supersampled")
    assert np.array_equal(picture_of(window, later), expected)


def test_fewer_samples_than_are_taken_are_answered(command, root, screen, tmp_path):
    """All of them stay, byte for byte, and the window says so, until something else is done."""
    words = ["path_traced", SCENE, "--set", "extent=[48,36]", "--set", "path_tracer.params.samples=8", *WINDOW]
    shots = [tmp_path / f"{i}.png" for i in range(3)]
    commands = script(tmp_path, "wait\nclick pass/path_tracer\n"
                      f"screenshot {shots[0]}\ntype path_tracer.params.samples/field 2\nwait\nstate\nscreenshot {shots[1]}\n"
                      f"type path_tracer.params.samples/field 9\nwait\nstate\nscreenshot {shots[2]}\nquit\n")
    with viewer(command, root, screen, words, commands) as view:
        fewer, more = view.state(0), view.state(1)
        status, said = view.wait()
    assert status == 0 and said.count("`samples` asks for 2") == 1
    assert "`samples` asks for 2 paths a pixel and 8 are taken: all of them stay in the picture" in fewer["warnings"]
    assert more["warnings"] == ""
    import heddle

    with heddle.Host() as host:
        left, top, right, bottom = (int(number) for number in fewer["picture"])
        first, second, third = (host.read_image(str(shot))[top:bottom, left:right] for shot in shots)
    assert np.array_equal(first, second)
    assert not np.array_equal(first, third)


def test_a_first_frame_that_fails_is_said_and_waited_for(command, root, screen, tmp_path):
    foreign = tmp_path / "foreign"
    foreign.write_text("no checkpoint")
    words = ["path_traced", SCENE, "--set", "extent=[48,36]", "--set", f"path_tracer.params.checkpoint={json.dumps(str(foreign))}",
             *WINDOW]
    with viewer(command, root, screen, words, script(tmp_path, "wait\nstate\nquit\n")) as view:
        state = view.state(0)
        assert view.wait() == (0, "")
    assert state["settled"] and state["read_bytes"] == 0
    assert "is no checkpoint of this technique" in state["variants"][0]["error"]


def test_measured_costs_stand_beside_the_knob(command, root, screen, tmp_path):
    shot = tmp_path / "costs.png"
    commands = script(tmp_path, f"wait\nclick pass/ao\nclick ao.params.steps/time\nwait\nstate\nscreenshot {shot}\nquit\n")
    with viewer(command, root, screen, [SCENE, *SETTINGS, *WINDOW], commands) as view:
        state = view.state(0)
        assert view.wait() == (0, "")
    costs = state["variants"][0]["costs"]["ao.params.steps"]
    assert [cost["value"] for cost in costs] == [2, 4, 8, 16, 32, 64]
    for cost in costs:
        assert 0 < cost["low_ms"] <= cost["median_ms"] <= cost["high_ms"]
        assert re.fullmatch(rf"{cost['value']}: [0-9.]+ ms", cost["shown"])
    # No interval strikes through the numbers, its own or another's.
    for cost in costs:
        top, bottom = state["widgets"][f"ao.params.steps/cost {cost['value']}/interval"][1::2]
        for each in costs:
            _, above, _, below = state["widgets"][f"ao.params.steps/cost {each['value']}"]
            assert above < below and (bottom <= above or top >= below)


def test_what_cannot_be_set_is_said_and_leaves_the_picture(command, root, screen, tmp_path):
    commands = script(tmp_path, "wait\nclick pass/display\ntype display.params.exposure/field 99\nwait\nstate\nquit\n")
    with viewer(command, root, screen, [SCENE, *SETTINGS, *WINDOW], commands) as view:
        state = view.state(0)
        assert view.wait() == (0, "")
    variant = state["variants"][0]
    assert "display.params.exposure" in variant["refused"] or "exposure" in variant["refused"]
    assert variant["error"] == "" and variant["parameters"]["display.params.exposure"] == 15


def test_technique_is_chosen_from_a_menu(command, root, screen, tmp_path):
    commands = script(tmp_path, "wait\nclick pass/ao\nclick ao.technique\nclick ao.technique/ssao\nwait\nstate\nquit\n")
    with viewer(command, root, screen, [SCENE, *SETTINGS, *WINDOW], commands) as view:
        state = view.state(0)
        assert view.wait() == (0, "")
    assert state["variants"][0]["parameters"]["ao.technique"] == "ssao"


def test_files_that_change_are_read_again(command, root, screen, tmp_path):
    """A mistake is said and the picture stays; its correction is rendered."""
    graph = tmp_path / "mine.toml"
    right = f'extends = "deferred"\nextent = {json.dumps(SIZE)}\n'
    graph.write_text(right)
    with viewer(command, root, screen, [str(graph), SCENE, *WINDOW], script(tmp_path, "wait\nstate\n")) as view:
        state = view.state(0)
        before = picture_of(screen.pixels(), state).copy()
        graph.write_text(right + "mistake = 1\n")
        until(lambda: (screen.pixels() == (90, 16, 16)).all(2).sum() > 2000 or
              ((screen.pixels().astype(int) - (84, 18, 18)) ** 2).sum(2).min() < 200, "the error")
        graph.write_text(right + "[params]\nexposure = 13.0\n")
        until(lambda: picture_of(screen.pixels(), state).mean() > before.mean() + 10, "the brighter picture")
        assert view.stop() == (130, "stopped\n")


@pytest.mark.parametrize("words, status, message", [
    (["deffered", SCENE], 2, "deffered"),
    ([SCENE, "--set", "ao.technique=gtoa"], 2, "did you mean 'gtao'?"),
    ([SCENE, "--swap", "ao=gtao"], 2, "error: --swap 'ao=gtao' is not PASS=A,B"),
    ([SCENE, "--window", "9x9"], 2, "error: --window '9x9' is no size of a window"),
    ([SCENE, "--camera", "nobody"], 2, "error: the scene has no camera 'nobody'"),
])
def test_mistakes_are_said_before_a_window_opens(command, root, screen, words, status, message):
    with viewer(command, root, screen, words) as view:
        found, said = view.wait()
    assert found == status and message in said


def test_script_that_names_no_widget_ends_with_its_line(command, root, screen, tmp_path):
    commands = script(tmp_path, "wait\nclick pass/oa\n")
    with viewer(command, root, screen, [SCENE, *SETTINGS, *WINDOW], commands) as view:
        status, said = view.wait()
    assert status == 2
    assert said == (f"{commands}:2:1: error: the window shows no widget of that name\n  found:    pass/oa\n"
                    "  expected: a name that the command 'state' prints; open its tab or its pass with 'click' first\n"
                    "  help:     did you mean 'pass/ao'?\n")


def test_screenshot_that_cannot_be_written_ends_the_script(command, root, screen, tmp_path):
    commands = script(tmp_path, "wait\nscreenshot /proc/none/shot.png\nquit\n")
    with viewer(command, root, screen, [SCENE, *SETTINGS, *WINDOW], commands) as view:
        status, said = view.wait()
    assert status == 4 and said.startswith(f"{commands}:2:1: error: the screenshot was not written\n  found:    ")
    assert "/proc/none/shot.png" in said


def test_without_a_display_it_says_what_to_do(command, root):
    environment = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
    for words in ([SCENE], []):
        ended = subprocess.run([command, "view", *words], cwd=root, env=environment, capture_output=True, text=True)
        assert ended.returncode == 3
        assert ended.stderr.startswith("error: no window can be opened") and "xvfb-run" in ended.stderr


def test_without_its_module_it_says_what_to_install(command, root, tmp_path):
    environment = os.environ | {"HEDDLE_VIEW_MODULE": str(tmp_path / "none.so")}
    for words in ([SCENE], []):
        ended = subprocess.run([command, "view", *words], cwd=root, env=environment, capture_output=True, text=True)
        assert ended.returncode == 3
        assert "error: the window's module cannot be opened" in ended.stderr and "libimgui-dev" in ended.stderr


def test_other_commands_start_without_glfw_and_opengl():
    """Nor does the library: only the module links them."""
    for file in ("bin/heddle", "lib/libheddle.so"):
        linked = subprocess.run(["ldd", str(BUILD / file)], capture_output=True, text=True, check=True).stdout
        assert "glfw" not in linked and "libGL" not in linked
    linked = subprocess.run(["ldd", str(BUILD / "lib" / "libheddle_view.so")], capture_output=True, text=True, check=True).stdout
    assert "libglfw" in linked and "libheddle.so" in linked
