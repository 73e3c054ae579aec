# SPDX-License-Identifier: Apache-2.0
"""A study's page in Chromium, from disk, as somebody uses it who sees, points and clicks, and as somebody who has a keyboard.

Screenshots are left in build/report-screenshots, to be looked at.
"""

import base64
import json
import os
import pathlib
import shutil

import numpy as np
import pytest
import synthetic_study
from conftest import BUILD

import heddle
from heddle import report, study_run
from heddle import study_images as images
from test_report import quick_flip

try:
    from selenium import webdriver
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.support.ui import Select, WebDriverWait
except ImportError:
    webdriver = None
CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
SHOTS = BUILD / "report-screenshots"
SIZE = (96, 54)
# Counts what the page unpacks, before any of its scripts runs.
COUNT = "window.unpacked = 0; const Real = DecompressionStream; window.DecompressionStream = class extends Real { constructor(f) { " \
        "super(f); window.unpacked++; } }; addEventListener('readystatechange', () => { if (document.readyState === 'interactive') " \
        "window.parsed = {unpacked: window.unpacked, points: document.querySelectorAll('#chart .point').length, " \
        "verdict: document.getElementById('verdict')?.textContent}; }, true);"


@pytest.fixture(scope="module")
def browser():
    if webdriver is None or CHROMIUM is None or DRIVER is None:
        if os.environ.get("HEDDLE_TEST_ALL"):
            pytest.fail("chromium, chromium-driver or python3-selenium is missing: scripts/setup --all installs them")
        pytest.skip("needs chromium, chromium-driver and python3-selenium: scripts/setup --all installs them")
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service

    wanted = Options()
    wanted.binary_location = CHROMIUM
    for word in ("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--window-size=1200,900"):
        wanted.add_argument(word)
    wanted.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(service=Service(DRIVER), options=wanted)
    driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": COUNT})
    driver.execute_cdp_cmd("Network.enable", {})
    driver.execute_cdp_cmd("Network.emulateNetworkConditions", {"offline": True, "latency": 0, "downloadThroughput": 0,
                                                                "uploadThroughput": 0})
    yield driver
    driver.quit()


class Study:
    def __init__(self, folder, kept):
        self.folder, self.kept = folder, kept
        self.path = folder / "report.html"
        self.data = report.points_of(self.path)

    def image(self, name, scene=0):
        return self.kept[scene, name]


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Six points of two variants and two scenes; images at half their size, FLIP's real maps."""
    folder = tmp_path_factory.mktemp("page")
    kept = synthetic_study.write_study(folder, synthetic_study.explained(), 2, 2, SIZE, points=3, lost=("technique01 steps=8",),
                                       title="Two techniques, <three> settings")
    report.write(folder, whole=0)
    return Study(folder, kept)


@pytest.fixture
def page(browser, study):
    browser.get_log("browser")
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": 1200, "height": 900, "deviceScaleFactor": 1, "mobile": False})
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": "light"}]})
    browser.get(study.path.as_uri())
    browser.execute_script("localStorage.clear()")
    said(browser, "A is")
    yield browser
    errors = [entry["message"] for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
    assert errors == []


def said(browser, text):
    """Waits until the viewer says so: images are unpacked in the background."""
    WebDriverWait(browser, 30).until(lambda _: text in browser.find_element(By.ID, "viewer-status").text)


def one(browser, selector):
    return browser.find_element(By.CSS_SELECTOR, selector)


def click(browser, selector):
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", one(browser, selector))
    one(browser, selector).click()


def press(browser, *keys):
    """Keys go where the focus is."""
    ActionChains(browser).send_keys(*keys).perform()


def focus_canvas(browser):
    browser.execute_script("document.getElementById('canvas').focus({preventScroll: true})")


def choose(browser, name):
    row = next(i for i, each in enumerate(browser.study_points, 1) if each == name)
    click(browser, f"[data-pick='{row}']")
    said(browser, f"A is {name}")


def canvas_pixel(browser, x, y):
    """[red, green, blue] of the canvas where pixel (x, y) of the image lies, the whole image being in view."""
    return browser.execute_script(
        "const c = document.getElementById('canvas');"
        "return [...c.getContext('2d').getImageData(Math.floor((arguments[0] + 0.5) * c.width / arguments[2]),"
        " Math.floor((arguments[1] + 0.5) * c.width / arguments[2]), 1, 1).data].slice(0, 3)", x, y, SIZE[0])


def encoded(values):
    """sRGB, 0 to 255, of linear values."""
    v = np.clip(np.asarray(values, np.float64), 0, 1)
    return 255 * np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)


def cursor_to(browser, x, y):
    """With arrow keys alone, from the middle or from where it is."""
    focus_canvas(browser)
    press(browser, Keys.ARROW_RIGHT)
    at = readout(browser)["pixel"]
    for distance, keys in ((x - at[0], (Keys.ARROW_LEFT, Keys.ARROW_RIGHT)), (y - at[1], (Keys.ARROW_UP, Keys.ARROW_DOWN))):
        key = keys[distance > 0]
        tens, ones = divmod(abs(distance), 10)
        actions = ActionChains(browser).key_down(Keys.SHIFT).send_keys(key * tens).key_up(Keys.SHIFT).send_keys(key * ones)
        actions.perform()
    assert readout(browser)["pixel"] == [x, y]


def readout(browser):
    found = {}
    for line in one(browser, "#readout").text.splitlines():
        words = line.split()
        if words[0] == "pixel":
            found["pixel"] = [int(words[1].rstrip(",")), int(words[2])]
        elif words[0] in ("A", "B"):
            key = "A - B" if words[1] == "−" else words[0]
            numbers = line.split("(")[0].split()[3 if key == "A - B" else 1:]
            found[key] = [float(word) for word in numbers]
            found[f"{key} is mean"] = "mean of" in line
        elif words[0] == "FLIP":
            found["FLIP"] = float(words[2])
    return found


def shoot(browser, name, width=1200, theme="light"):
    SHOTS.mkdir(parents=True, exist_ok=True)
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False})
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": theme}]})
    height = browser.execute_script("return document.documentElement.scrollHeight")
    shot = browser.execute_cdp_cmd("Page.captureScreenshot", {"captureBeyondViewport": True, "clip": {
        "x": 0, "y": 0, "width": width, "height": height, "scale": 1}})
    (SHOTS / f"{name}.png").write_bytes(base64.b64decode(shot["data"]))
    return SHOTS / f"{name}.png"


@pytest.fixture(autouse=True)
def names(browser, study):
    browser.study_points = [point["name"] if point["scene"] == 0 else None for point in study.data["points"]]


# ---- It opens ----

def test_it_opens_from_disk_and_says_its_verdict(page, study):
    assert one(page, "h1").text == "Two techniques, <three> settings"
    assert one(page, "#verdict").text == " ".join(study.data["verdict"])
    assert len(page.find_elements(By.CSS_SELECTOR, "#chart .point")) == 5  # one was lost
    # Nothing was asked of a server or of another file.
    assert page.execute_script("return performance.getEntriesByType('resource').length") == 0


def test_thirty_variants_of_five_scenes_unpack_only_what_is_seen(browser, tmp_path, monkeypatch, record_property):
    monkeypatch.setattr(report.Page, "flip", quick_flip)
    synthetic_study.write_study(tmp_path, synthetic_study.explained(), 30, 5, (48, 28))
    path = report.write(tmp_path, whole=0)
    path = path.rename(tmp_path / "page.html")
    data = report.points_of(path)
    assert data["level"] == {"scale": 2, "mantissa": 10}
    # A budget of fewer bytes than that: detail is given up until the page holds it.
    budget = path.stat().st_size * 9 // 10
    smaller = report.write(tmp_path, budget=budget, whole=0)
    level = report.points_of(smaller)["level"]
    assert budget // 2 < smaller.stat().st_size <= budget and (level["scale"], -level["mantissa"]) > (2, -10)
    browser.get(path.as_uri())
    said(browser, "A is")
    paints = browser.execute_script("return Object.fromEntries(performance.getEntriesByType('paint').map((e) => [e.name, e.startTime]))")
    record_property("first paint, ms", paints["first-contentful-paint"])
    # What is painted first needs no pixel: when all was parsed, chart and verdict were there and nothing was unpacked.
    assert browser.execute_script("return window.parsed") == {"unpacked": 0, "points": 30, "verdict": " ".join(data["verdict"])}
    pixels = browser.execute_script("return document.querySelectorAll('script[type=\"text/plain\"]').length")
    # Of all these: A, its map, its whole tiles, what they are compared with, and B.
    tiles = data["images"]["image0x0"]["tiles"]
    assert pixels == 150 * (2 + 2 * len(tiles)) + 5
    assert browser.execute_script("return window.unpacked") == 2 + 2 * len(tiles) + 1
    # The text is painted before the pixels are read: it comes first in the file.
    text = path.read_text()
    assert text.index('id="verdict"') < text.index('id="data"') < text.index('<script type="text/plain"')
    shoot(browser, "thirty-variants")


# ---- The chart ----

def test_errors_have_the_unit_that_the_role_of_their_port_states(page):
    axis = "#chart svg text[transform]"
    assert one(page, axis).text.startswith("rmse [cd/m^2] of lighting.radiance")
    assert one(page, "[data-sort='rmse']").text == "rmse [cd/m^2]" and one(page, "[data-sort='ssim']").text == "ssim"
    Select(one(page, "#error-axis")).select_by_value("ssim")
    assert one(page, axis).text.startswith("1 − ssim of lighting.radiance")


@pytest.mark.parametrize(("metric", "unit", "expected"), [
    ("rmse", "cd/m^2", "cd/m^2"), ("mse", "cd/m^2", "(cd/m^2)^2"), ("mse", "", ""), ("percentile_99", "m", "m"), ("relmse", "m", ""),
    ("maximum", "m", "m"), ("mean_difference", "m", "m"), ("psnr", "m", ""), ("differing_pixels", "m", ""), ("hdr_flip", "cd/m^2", "")])
def test_units_of_metrics_follow_from_their_formulas(metric, unit, expected):
    assert report.metric_unit(metric, unit) == expected


def test_hovering_says_the_settings(page, study):
    point = one(page, "#chart .point[data-row='2'] .mark")
    page.execute_script("arguments[0].scrollIntoView({block: 'center'})", point)
    ActionChains(page).move_to_element(point).perform()
    tip = one(page, "#tip")
    assert tip.is_displayed()
    for part in ("technique00 steps=4", "extent=[64,36]", " ms (", "rmse: "):
        assert part in tip.text
    press(page, Keys.ESCAPE)
    assert not tip.is_displayed()


def test_clicking_a_point_shows_its_image(page, study):
    point = one(page, "#chart .point[data-row='3'] .mark")
    page.execute_script("arguments[0].scrollIntoView({block: 'center'})", point)
    ActionChains(page).move_to_element(point).click().perform()
    said(page, "A is technique00 steps=8, B is the reference")
    assert "technique00 steps=8" in one(page, "#made").text and "heddle reproduce report.html 3" in one(page, "#reproduce").text
    assert page.execute_script("return document.getElementById('viewer').getBoundingClientRect().top < innerHeight / 2")


def test_the_chart_goes_by_keyboard_in_order_of_time(page, study):
    times = {int(p["rows"]["frame"]["value"] * 1e6): i for i, p in enumerate(study.data["points"], 1) if p["scene"] == 0 and p["state"] == "ok"}
    in_order = [str(times[time]) for time in sorted(times)]
    page.execute_script("document.querySelector('#chart .point[tabindex=\"0\"]').focus()")
    press(page, Keys.HOME)
    seen = []
    for _ in in_order:
        focused = page.switch_to.active_element
        seen.append(focused.get_attribute("data-row"))
        assert "rmse" in focused.get_attribute("aria-label")
        press(page, Keys.ARROW_RIGHT)
    assert seen == in_order and page.switch_to.active_element.get_attribute("data-row") == in_order[0]
    press(page, Keys.END, Keys.ENTER)
    said(page, f"A is {study.data['points'][int(in_order[-1]) - 1]['name']}")
    assert page.switch_to.active_element.get_attribute("data-row") == in_order[-1]


def test_the_front_and_the_axes_are_those_of_the_numbers(page, study):
    def place(row):
        box = one(page, f"#chart .point[data-row='{row}'] .mark").rect
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    rows = [point["rows"] for point in study.data["points"][:3]]
    x = [np.log(row["frame"]["value"]) for row in rows]
    y = [np.log(row["rmse"]["value"]) for row in rows]
    places = [place(row) for row in (1, 2, 3)]
    for axis, values, sign in ((0, x, 1), (1, y, -1)):
        part = (places[1][axis] - places[0][axis]) / (places[2][axis] - places[0][axis])
        assert part == pytest.approx((values[1] - values[0]) / (values[2] - values[0]), abs=0.02)
        assert np.sign(places[2][axis] - places[0][axis]) == sign * np.sign(values[2] - values[0])
    # ssim is best at 1: what is better is lower all the same.
    Select(one(page, "#error-axis")).select_by_value("ssim")
    assert "1 − ssim" in one(page, "#chart svg").text
    ssim = [row["ssim"]["value"] for row in rows]
    assert (place(3)[1] > place(1)[1]) == (ssim[2] > ssim[0])
    assert page.switch_to.active_element.get_attribute("id") == "error-axis"


def test_every_point_has_its_knob_s_value_beside_it(browser, study, tmp_path, monkeypatch):
    """Over no other value and no mark; where the upper right is taken, in another corner."""
    monkeypatch.setattr(report.Page, "flip", quick_flip)
    shutil.copytree(study.folder, tmp_path / "copy")
    results = json.loads((tmp_path / "copy" / "results.json").read_text())
    rows = {(each["knobs"], each["quantity"]): each for each in results["rows"]
            if (each["scene"], each["variant"]) == ("cornell_box view0", "technique00")}
    first, second = sorted({knobs for knobs, _ in rows})[:2]
    for quantity, ratio in (("frame", 0.993), (study.data["study"]["metrics"][0], 0.97)):  # to the lower left of the other
        factor = ratio * rows[second, quantity]["value"] / rows[first, quantity]["value"]
        for number in ("value", "low", "high"):
            rows[first, quantity][number] *= factor
    (tmp_path / "copy" / "results.json").write_text(json.dumps(results))
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": 1200, "height": 900, "deviceScaleFactor": 1, "mobile": False})
    browser.get(report.write(tmp_path / "copy").as_uri())
    said(browser, "A is")
    found = browser.execute_script(
        "const box = (each) => { const b = each.getBoundingClientRect(); return [b.left, b.top, b.right, b.bottom]; };"
        "return [...document.querySelectorAll('#chart .point')].map((each) => "
        "[[...each.querySelectorAll('text')].map(box), box(each.querySelector('.mark'))])")
    assert len(found) == 5 and all(len(values) == 1 for values, _ in found)  # one is lost
    slack = 3  # pixels: the box of a text is that of its line
    apart = lambda a, b: (a[2] < b[0] + slack or b[2] < a[0] + slack or a[3] < b[1] + slack or b[3] < a[1] + slack)  # noqa: E731
    values = [value for (value,), _ in found]
    assert all(apart(a, b) for i, a in enumerate(values) for b in values[:i])
    assert all(apart(value, mark) for value in values for _, mark in found)


def test_a_variant_can_be_left_out(page):
    click(page, "#variant-1")
    assert len(page.find_elements(By.CSS_SELECTOR, "#chart .point")) == 3
    assert page.switch_to.active_element.get_attribute("id") == "variant-1"


# ---- The viewer ----

def test_pixels_are_those_of_the_image_to_the_bit(page, study):
    choose(page, "technique00 steps=2")
    head = study.data["images"]["image0x0"]
    tile = head["tiles"][0]
    x, y = tile["x"] + 1, tile["y"] + 2
    cursor_to(page, x, y)
    image, reference = study.image("technique00 steps=2"), study.image(study_run.REFERENCE)
    found = readout(page)
    assert not found["A is mean"] and not found["B is mean"]
    assert found["A"] == pytest.approx(image[y, x].tolist(), rel=1e-5)
    assert found["B"] == pytest.approx(reference[y, x].tolist(), rel=1e-5)
    assert found["A - B"] == pytest.approx((image[y, x].astype(float) - reference[y, x]).tolist(), rel=1e-4, abs=1e-6)
    map = heddle.error_image(image, reference, "hdr_flip")[..., 0]
    half = images.halved(map[..., None])[y // 2, x // 2, 0]
    assert found["FLIP"] == pytest.approx(half, abs=1.1 / 255 + 0.001)
    # Elsewhere the page has means of four pixels, and says so.
    x, y = next((x, y) for x in range(4, SIZE[0] - 1) for y in range(4, SIZE[1] - 1) if not any(
        t["x"] <= x < t["x"] + 8 and t["y"] <= y < t["y"] + 8 for t in head["tiles"]))
    cursor_to(page, x, y)
    found = readout(page)
    assert found["A is mean"]
    assert found["A"] == pytest.approx(images.halved(image)[y // 2, x // 2].tolist(), rel=2**-10)


def test_the_whole_image_comes_from_beside_the_page(page, study):
    choose(page, "technique00 steps=4")
    x, y = 21, 43
    cursor_to(page, x, y)
    before = readout(page)
    click(page, "#whole")
    said(page, "whole images, to the bit")
    found = readout(page)
    assert before["A"] != found["A"] and not found["A is mean"] and not found["B is mean"]
    assert found["A"] == pytest.approx(study.image("technique00 steps=4")[y, x].tolist(), rel=1e-5)
    assert found["B"] == pytest.approx(study.image(study_run.REFERENCE)[y, x].tolist(), rel=1e-5)


def test_a_page_without_its_folder_says_what_is_missing(browser, study, tmp_path):
    moved = tmp_path / "report.html"
    shutil.copy(study.path, moved)
    browser.get(moved.as_uri())
    said(browser, "A is")
    click(browser, "#whole")
    said(browser, "should lie beside this page")
    browser.get_log("browser")


def test_the_slider_parts_a_from_b(page, study):
    choose(page, "technique00 steps=2")
    click(page, "[data-mode='slider']")
    image, reference = (images.halved(study.image(name)) for name in ("technique00 steps=2", study_run.REFERENCE))
    x, y = 40, 50
    tiles = study.data["images"]["image0x0"]["tiles"]
    assert not any(t["x"] <= x < t["x"] + 8 and t["y"] <= y < t["y"] + 8 for t in tiles)
    a, b = encoded(image[y // 2, x // 2]), encoded(reference[y // 2, x // 2])
    assert np.abs(a - b).max() > 4
    canvas = one(page, "#canvas")
    page.execute_script("arguments[0].scrollIntoView({block: 'center'})", canvas)
    width = canvas.rect["width"]
    assert np.abs(a - canvas_pixel(page, x, y)).max() <= 1.5  # left of the middle
    ActionChains(page).move_to_element(canvas).click_and_hold().move_by_offset(int(-0.4 * width), 0).release().perform()
    assert int(one(page, "#split").get_attribute("value")) == pytest.approx(10, abs=2)
    ActionChains(page).move_to_element_with_offset(canvas, 0, int(-0.45 * canvas.rect["height"])).perform()
    assert np.abs(b - canvas_pixel(page, x, y)).max() <= 1.5
    focus_canvas(page)
    press(page, "]" * 40)
    assert np.abs(a - canvas_pixel(page, x, y)).max() <= 1.5
    press(page, "x")
    said(page, "A is the reference, B is technique00 steps=2")
    assert np.abs(b - canvas_pixel(page, x, y)).max() <= 1.5


def test_flicker_shows_one_then_the_other_and_never_fast(page, study):
    choose(page, "technique00 steps=2")
    focus_canvas(page)
    press(page, " ")  # stopped, one step
    images_ = [images.halved(study.image(name)) for name in ("technique00 steps=2", study_run.REFERENCE)]
    x, y = 40, 50
    a, b = (encoded(image[y // 2, x // 2]) for image in images_)
    seen = [canvas_pixel(page, x, y)]
    press(page, " ")
    seen.append(canvas_pixel(page, x, y))
    assert np.abs(np.array(seen) - [b, a]).max() <= 1.5
    assert one(page, "[data-mode='flicker']").get_attribute("aria-pressed") == "true"
    assert max(float(each.get_attribute("value")) for each in Select(one(page, "#rate")).options) <= 3
    # It goes on by itself.
    page.execute_script("const c = document.getElementById('canvas'), seen = window.seen = new Set(), real = c.getContext('2d').drawImage;"
                        "c.getContext('2d').drawImage = function (...w) { seen.add(w[0]); return real.apply(this, w); }")
    click(page, "#flicker-pause")
    WebDriverWait(page, 20).until(lambda _: page.execute_script("return window.seen.size") >= 2)


def test_flicker_waits_for_those_who_want_no_motion(browser, study):
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-reduced-motion", "value": "reduce"}]})
    browser.get(study.path.as_uri())
    said(browser, "A is")
    click(browser, "[data-mode='flicker']")
    assert one(browser, "#flicker-pause").text == "Go on"


def test_exposure_is_a_factor_of_two_a_stop(page, study):
    choose(page, "technique00 steps=2")
    focus_canvas(page)
    press(page, "1")
    x, y = 40, 50
    value = images.halved(study.image("technique00 steps=2"))[y // 2, x // 2]
    for keys, stops in (("dddd", -2), ("eeeeeee", 1.5)):
        press(page, keys)
        assert np.abs(encoded(value * 2.0**stops) - canvas_pixel(page, x, y)).max() <= 1.5
    assert one(page, "#exposure-value").text == "1.5 stops"


def test_maps_show_the_difference_and_flip(page, study):
    choose(page, "technique00 steps=2")
    focus_canvas(page)
    press(page, "6")
    legend = one(page, "#ramp").text
    a, b = (study.image(name) for name in ("technique00 steps=2", study_run.REFERENCE))
    shown = [np.kron(images.halved(each), np.ones((2, 2, 1))) for each in (a, b)]
    tiles = study.data["images"]["image0x0"]["tiles"]
    for tile in tiles:
        place = np.s_[tile["y"]:tile["y"] + 8, tile["x"]:tile["x"] + 8]
        shown[0][place], shown[1][place] = a[place], b[place]
    difference = np.abs(shown[0] - shown[1]).mean(axis=2)
    assert float(legend.split()[1]) == pytest.approx(difference.max(), rel=0.01)
    y, x = np.unravel_index(np.argmax(difference), difference.shape)
    assert np.abs(np.subtract(canvas_pixel(page, int(x), int(y)), [252, 253, 191])).max() <= 2
    press(page, "8")
    assert "hdr_flip" in one(page, "#ramp").text
    assert canvas_pixel(page, 40, 50) != canvas_pixel(page, int(x), int(y))
    press(page, "7", "e")
    assert "−" in one(page, "#ramp").text


def test_zoom_and_place_are_shared_by_both_images(page, study):
    choose(page, "technique00 steps=2")
    canvas = one(page, "#canvas")
    page.execute_script("arguments[0].scrollIntoView({block: 'center'})", canvas)
    click(page, "[data-mode='side']")
    focus_canvas(page)
    press(page, "+++")
    rect = canvas.rect
    places = []
    for side in (-0.25, 0.25):  # the same place of each half
        ActionChains(page).move_to_element_with_offset(canvas, int(side * rect["width"]), 20).perform()
        places.append(readout(page)["pixel"])
    assert places[0] == places[1]
    ActionChains(page).move_to_element_with_offset(canvas, 40, 0).click_and_hold().move_by_offset(-120, -40).release().perform()
    moved = readout(page)["pixel"]
    press(page, "0")
    ActionChains(page).move_to_element_with_offset(canvas, int(0.25 * rect["width"]), 19).perform()
    assert moved != places[0] and readout(page)["pixel"] != places[0]


def test_a_worst_tile_is_a_click_away(page, study):
    choose(page, "technique00 steps=2")
    tile = study.data["images"]["image0x0"]["tiles"][2]
    click(page, "[data-tile='2']")
    assert readout(page)["pixel"] == [tile["x"] + 4, tile["y"] + 4]
    assert "worst tile 3 of" in one(page, "#viewer-status").text
    press(page, "w")  # the next one
    tile = study.data["images"]["image0x0"]["tiles"][3]
    assert readout(page)["pixel"] == [tile["x"] + 4, tile["y"] + 4]


def test_the_next_point_is_a_key_away(page):
    choose(page, "technique00 steps=2")
    focus_canvas(page)
    press(page, "n")
    said(page, "A is technique00 steps=4")
    press(page, "p")
    said(page, "A is technique00 steps=2")


# ---- The rest ----

def test_tables_say_what_made_each_number(page, study):
    choose(page, "technique01 steps=4")
    click(page, "#made details summary")
    text = one(page, "#made table").text
    for part in ("sqrt(mean (a-b)^2)", "median over turns, submission to last fence", "counted by the host", "pass lighting"):
        assert part in text
    assert "ao.params.steps=3" in one(page, "#made").text


def test_the_table_is_sorted_by_what_is_clicked(page):
    def order():
        return [each.text for each in page.find_elements(By.CSS_SELECTOR, "#points tbody tr td:first-child")]

    assert order() == ["1", "2", "3", "4", "5", "6"]
    click(page, "[data-sort='rmse']")
    up = order()
    assert one(page, "#points th[aria-sort='ascending']").text.startswith("rmse")
    click(page, "[data-sort='rmse']")
    assert order()[:-1] == up[:-1][::-1] and order()[-1] == up[-1] == "6"  # what was lost has no number


def test_passes_graph_and_memory_are_those_of_the_point(page, study):
    choose(page, "technique00 steps=2")
    graph = study.data["graphs"][0]
    assert len(page.find_elements(By.CSS_SELECTOR, "#graph .node")) == len(graph["passes"])
    dropped = [each for each in graph["passes"] if each["is_pruned"]]
    grey = page.find_elements(By.CSS_SELECTOR, "#graph .node.pruned")
    assert len(grey) == len(dropped)
    for each in dropped:
        assert each["reason"] in one(page, "#graph").text
    boxes = [each.rect for each in page.find_elements(By.CSS_SELECTOR, "#graph .node rect")]
    for i, a in enumerate(boxes):  # no two lie over each other
        assert not any(a["x"] < b["x"] + b["width"] and b["x"] < a["x"] + a["width"] and a["y"] < b["y"] + b["height"] and
                       b["y"] < a["y"] + a["height"] for b in boxes[:i])
    spills = page.execute_script(
        "return [...document.querySelectorAll('#graph .node')].flatMap((node) => { const box = node.querySelector('rect').getBBox();"
        "return [...node.querySelectorAll('text')].filter((text) => text.getBBox().x < box.x + 4 || text.getBBox().x + text.getBBox().width >"
        " box.x + box.width - 4).map((text) => text.textContent); })")
    assert spills == []
    technique = max((each["technique"] for each in graph["passes"]), key=len)
    assert len(technique) > 22 and technique in one(page, "#graph svg").text  # whole
    assert "without sharing" in one(page, "#memory").text and "lighting" in one(page, "#passes svg").text
    assert "not measured for this point" in one(page, "#passes").text
    choose_lost = next(i for i, each in enumerate(study.data["points"], 1) if each["state"] != "ok")
    click(page, f"[data-pick='{choose_lost}']")
    said(page, "the study keeps no image of technique01 steps=8")
    assert "no passes were timed (the process ended by SIGSEGV)" in one(page, "#passes").text


def test_what_leaving_out_saves_stands_beside_a_pass(browser, study, tmp_path):
    shutil.copytree(study.folder, tmp_path / "copy")
    results = json.loads((tmp_path / "copy" / "results.json").read_text())
    results["leave_one_out"] = [{"scene": "cornell_box view0", "variant": "technique00", "knobs": "steps=2", "pass": "lighting",
                                 "cost_ms": [0.41, 0.47, 0.52], "own_ms": 0.4}]
    (tmp_path / "copy" / "results.json").write_text(json.dumps(results))
    browser.get(report.write(tmp_path / "copy").as_uri())
    said(browser, "A is")
    choose(browser, "technique00 steps=2")
    click(browser, "#passes summary")
    assert "0.47 ms (0.41 to 0.52)" in one(browser, "#passes table").text
    shoot(browser, "leave-one-out")


@pytest.mark.parametrize("width", [1200, 400])
@pytest.mark.parametrize(("quantity", "numbers"), [
    ("pass display", {"high": 200.0}), ("pass sky", {"high": 90.0}), ("frame", {"value": 50.0}), ("frame", {"value": 0.5})])
def test_passes_lie_within_their_axis(browser, study, tmp_path, monkeypatch, width, quantity, numbers):
    """Intervals that reach far beyond the sum of the medians, and frames far longer and shorter than it."""
    monkeypatch.setattr(report.Page, "flip", quick_flip)
    shutil.copytree(study.folder, tmp_path / "copy")
    results = json.loads((tmp_path / "copy" / "results.json").read_text())
    row = next(each for each in results["rows"] if (each["scene"], each["variant"], each["knobs"], each["quantity"]) ==
               ("cornell_box view0", "technique00", "steps=2", quantity))
    row |= numbers
    (tmp_path / "copy" / "results.json").write_text(json.dumps(results))
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False})
    browser.get(report.write(tmp_path / "copy").as_uri())
    said(browser, "A is")
    choose(browser, "technique00 steps=2")
    outside = browser.execute_script(
        "const svg = document.querySelector('#passes svg'), box = svg.viewBox.baseVal;"
        "return [...svg.querySelectorAll('rect, path, text')].map((e) => [e.textContent || e.getAttribute('d') || 'rect', e.getBBox()])"
        ".filter(([, b]) => b.x < 0 || b.y < 0 || b.x + b.width > box.width || b.y + b.height > box.height).map(([what]) => what)")
    assert outside == []
    texts = [each.text for each in browser.find_elements(By.CSS_SELECTOR, "#passes svg text")]
    rows = {each["quantity"]: each for each in results["rows"] if (each["scene"], each["variant"], each["knobs"]) ==
            ("cornell_box view0", "technique00", "steps=2")}
    numbers_shown = sorted(float(text.split()[0]) for text in texts if text.endswith(" ms") and not text.startswith("frame"))
    assert numbers_shown == pytest.approx(sorted(each["value"] for name, each in rows.items() if name.startswith("pass ")), rel=5e-3)
    assert float(next(text for text in texts if text.startswith("frame")).split()[1]) == pytest.approx(rows["frame"]["value"], rel=5e-3)
    shoot(browser, f"passes-{quantity.split()[-1]}-{width}", width)


def test_another_scene_has_its_own_points_and_images(page, study):
    Select(one(page, "#scene")).select_by_value("1")
    said(page, "A is")
    assert [each.text for each in page.find_elements(By.CSS_SELECTOR, "#points tbody tr td:first-child")][0] == "7"
    chosen = one(page, "#points [aria-pressed='true']").text
    x, y = 40, 50
    cursor_to(page, x, y)
    assert readout(page)["A"] == pytest.approx(images.halved(study.image(chosen, 1))[y // 2, x // 2].tolist(), rel=2**-10) or not readout(
        page)["A is mean"]


def test_everything_that_does_something_has_a_name_and_a_place_in_order(page):
    """What a screen reader is told, by Chromium's own account."""
    nodes = page.execute_cdp_cmd("Accessibility.getFullAXTree", {})["nodes"]
    nameless = []
    for node in nodes:
        role = node.get("role", {}).get("value")
        if not node.get("ignored") and role in ("button", "slider", "combobox", "checkbox", "link", "table", "img", "image", "application"):
            if not node.get("name", {}).get("value", "").strip() and role != "table":
                nameless.append((role, node.get("properties")))
    assert nameless == []
    headings = [node["name"]["value"] for node in nodes if node.get("role", {}).get("value") == "heading"]
    assert headings[0].startswith("Two techniques") and "Error against time" in headings and "Frame graph" in headings
    tables = page.execute_script("return [...document.querySelectorAll('table')].every((t) => t.caption && t.querySelector('th[scope=col]'))")
    assert tables
    # By Tab alone from the top through everything, without a trap.
    page.execute_script("document.activeElement.blur()")
    seen = []
    for _ in range(120):
        press(page, Keys.TAB)
        element = page.switch_to.active_element
        if element.tag_name == "body":
            break
        seen.append(element.get_attribute("id") or element.get_attribute("class") or element.tag_name)
    for wanted in ("skip", "scene", "time-axis", "error-axis", "choose-a", "canvas", "split", "exposure"):
        assert wanted in seen, seen
    assert seen.index("time-axis") < seen.index("choose-a") < seen.index("canvas")
    assert sum(each.startswith("point") for each in seen) == 1  # the chart is one stop


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("width", [1200, 400])
def test_dark_and_light_wide_and_narrow(page, theme, width):
    shoot(page, f"{theme}-{width}", width, theme)
    assert page.execute_script("return document.documentElement.scrollWidth") <= width
    colors = page.execute_script(
        "const s = getComputedStyle(document.body);"
        "const seen = (e) => getComputedStyle(e).color;"
        "return [s.backgroundColor, s.color, seen(document.querySelector('.note')), seen(document.querySelector('.range'))]")
    back, *texts = ([float(v) for v in each[each.index("(") + 1:-1].split(",")[:3]] for each in colors)
    assert (luminance(back) < 0.1) == (theme == "dark")
    assert all(contrast(back, text) >= 4.5 for text in texts)
    fills = page.execute_script("return [...new Set([...document.querySelectorAll('#chart .mark')].map((e) => getComputedStyle(e).fill))]")
    assert all(contrast(back, [float(v) for v in each[4:-1].split(",")]) >= 3 for each in fills)


def luminance(color):
    linear = [c / 255 / 12.92 if c <= 10.3 else ((c / 255 + 0.055) / 1.055) ** 2.4 for c in color]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(a, b):
    low, high = sorted((luminance(a), luminance(b)))
    return (high + 0.05) / (low + 0.05)


def test_the_theme_can_be_chosen(page):
    def is_dark():
        return page.execute_script("return getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"

    assert not is_dark()
    click(page, "[data-theme-choice='dark']")
    assert is_dark() and one(page, "[data-theme-choice='dark']").get_attribute("aria-pressed") == "true"
    page.refresh()
    assert is_dark()
    click(page, "[data-theme-choice='light']")
    assert not is_dark()
