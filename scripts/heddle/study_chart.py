# SPDX-License-Identifier: Apache-2.0
"""Error over time as a picture: a line a ladder, intervals on both axes, the points that no other one beats."""

from __future__ import annotations

import math
import pathlib
from collections.abc import Sequence

from . import metrics
from .study import Point, Study

WHY_NONE = ("matplotlib is not installed, so there is no chart; the numbers are in the tables\n"
            "  help: on Debian, apt-get install python3-matplotlib")
NOTHING = ("there is no chart: no point has both a time and an error above 0 of '{metric}' with a number; what there is, is "
           "in the tables")
# Okabe and Ito 2008, told apart by people who see colours differently as well; markers tell them apart in print.
COLORS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"]
MARKERS = "osD^vP*X"


def pyplot():
    """matplotlib for files, without a screen; None if it is not installed."""
    try:
        import matplotlib

        matplotlib.use("Agg")
        import matplotlib.pyplot as plt
    except ImportError:
        return None
    return plt


def save(plt, figure, file: pathlib.Path) -> pathlib.Path:
    """Whole or not there."""
    partial = file.with_name(f".{file.stem}.partial.png")
    figure.savefig(partial, dpi=130)
    plt.close(figure)
    partial.replace(file)
    return file


def times_of(study: Study) -> list[tuple[str, str]]:
    """(quantity of rows, what an axis calls it): the frame's time, and a pass's own."""
    times = [("frame", "frame, submission to fence [ms]")]
    if (shown := study.chart_pass or study.pass_name) is not None:
        times.append((f"pass {shown}", f"pass '{shown}' alone [ms]"))
    return times


def draw(study: Study, rows: list[dict], folder: pathlib.Path) -> pathlib.Path | None:
    """FOLDER/error_over_time.png, a row of axes for each scene: over the frame's time, and over the pass's. None without
    matplotlib, or if there is nothing that could be drawn; then an earlier run's is removed, which would not be this one's."""
    file = folder / "error_over_time.png"
    if not is_any_drawn(study, rows):
        file.unlink(missing_ok=True)
        return None
    if (plt := pyplot()) is None:
        return None
    metric = study.metrics[0]
    times = times_of(study)
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    figure, all_axes, foot = grid(plt, len(scenes), len(times), 6.2, 4.2, len(ladders_of(study)) + 3)
    labels = []
    for i, scene in enumerate(scenes):
        for j, (quantity, label) in enumerate(times):
            labels.append((all_axes[i][j], draw_scene(
                all_axes[i][j], study, [row for row in rows if row["scene"] == scene], quantity, metric)))
            all_axes[i][j].set(xlabel=label, title=scene)
        all_axes[i][0].set_ylabel(f"{metric} of {study.port} against the reference{unit_of(study, metric)}", fontsize=9)
    name_all(foot, all_axes)
    figure.suptitle(f"{study.title}\nmedians with 95 % intervals", fontsize=11)
    figure.canvas.draw()  # gives axes their size
    for axes, own in labels:
        write_values(axes, own)
    return save(plt, figure, file)


LEGEND_COLUMNS, LEGEND_LINE = 3, 0.2  # inches


def grid(plt, rows: int, columns: int, width: float, height: float, names: int):
    """(figure, axes row by row, room for one legend below all of them, where it hides no point). width, height: of axes, inches"""
    below = LEGEND_LINE * (math.ceil(names / LEGEND_COLUMNS) + 0.5)
    figure = plt.figure(layout="constrained", figsize=(width * columns, height * rows + below + 0.5))
    cells = figure.add_gridspec(rows + 1, columns, height_ratios=[height] * rows + [below])
    axes = [[figure.add_subplot(cells[row, column]) for column in range(columns)] for row in range(rows)]
    foot = figure.add_subplot(cells[rows, :])
    foot.axis("off")
    return figure, axes, foot


def name_all(foot, all_axes) -> None:
    """What lines and marks are, of all axes, each name once."""
    named: dict[str, object] = {}
    for axes in (each for row in all_axes for each in row):
        for handle, label in zip(*axes.get_legend_handles_labels()):
            named.setdefault(label, handle)
    if named:
        foot.legend(named.values(), named.keys(), loc="upper center", ncols=LEGEND_COLUMNS, fontsize=8, frameon=False)


def unit_of(study: Study, metric: str) -> str:
    """Of a metric that has the unit of what is compared, for an axis; empty: it has none, or nobody says which."""
    has_unit = metric in ("rmse", "mean_difference", "maximum") or metric.startswith("percentile")
    return f" [{study.unit.replace('^2', '²')}]" if has_unit and study.unit not in ("", "1") else ""


def ladders_of(study: Study) -> dict[tuple[str, tuple[str, ...]], list[Point]]:
    """{(variant, knobs): points}: a line a ladder; a variant that climbs each of its ladders alone has several."""
    ladders: dict[tuple[str, tuple[str, ...]], list[Point]] = {}
    for point in study.points:
        ladders.setdefault((point.variant, tuple(knob for knob, _ in point.knobs)), []).append(point)
    return ladders


def arguments_of(study: Study) -> tuple[str, dict[str, float]] | None:
    """(name, {scene: value}) of the one number in which all scenes of a study differ: 64, 256 and 1024 lights, for instance."""
    made = [(scene.name, dict(scene.arguments)) for scene in study.scenes]
    names = {name for _, own in made for name in own if len({repr(other.get(name)) for _, other in made}) > 1}
    others = {(scene.file, scene.camera, scene.time, scene.overlays) for scene in study.scenes}
    if len(made) < 2 or len(names) != 1 or len(others) != 1:
        return None
    name = names.pop()
    values = {scene: own.get(name) for scene, own in made}
    if not all(isinstance(value, (int, float)) and not isinstance(value, bool) and value > 0 for value in values.values()):
        return None
    return name, {scene: float(value) for scene, value in values.items()}


def draw_over_scenes(study: Study, rows: list[dict], folder: pathlib.Path) -> pathlib.Path | None:
    """FOLDER/time_over_scenes.png, of a study whose scenes differ in one number: the frame's time over it, and the pass's, a line
    a point. None without matplotlib, or where there is no such number; then an earlier run's is removed."""
    file = folder / "time_over_scenes.png"
    found = arguments_of(study)
    if found is None or not any(row["quantity"] == "frame" and row.get("value") for row in rows):
        file.unlink(missing_ok=True)
        return None
    if (plt := pyplot()) is None:
        return None
    name, values = found
    times = times_of(study)
    figure, all_axes, foot = grid(plt, 1, len(times), 5.6, 4.2, len(study.points))
    for axes, (quantity, label) in zip(all_axes[0], times):
        for number, point in enumerate(study.points):
            knobs = " ".join(f"{knob}={value}" for knob, value in point.knobs)
            own = sorted(((values[row["scene"]], row) for row in rows if row["quantity"] == quantity and row.get("value")
                          and (row["variant"], row["knobs"]) == (point.variant, knobs)), key=lambda each: each[0])
            if own:
                axes.errorbar([x for x, _ in own], [row["value"] for _, row in own], yerr=reaches([row for _, row in own]), capsize=3,
                              color=COLORS[number % len(COLORS)], marker=MARKERS[number % len(MARKERS)], markersize=5,
                              linewidth=1.2, elinewidth=0.8, label=point.name)
        axes.set(xscale="log", yscale="log", xlabel=f"{name} of {pathlib.Path(study.scenes[0].file).stem}", ylabel=label)
        axes.margins(0.08)
        for axis in (axes.xaxis, axes.yaxis):
            plain_numbers(axis)
        axes.set_xticks(sorted(values.values()), minor=False)
        axes.set_xticks([], minor=True)
        axes.grid(True, which="both", alpha=0.25)
    name_all(foot, all_axes)
    figure.suptitle(f"{study.title}\nmedians with 95 % intervals", fontsize=11)
    return save(plt, figure, file)


def is_any_drawn(study: Study, rows: list[dict]) -> bool:
    """Whether a point has a place: a time and an error, both above 0 for the logarithm."""
    places = [{(row["scene"], row["variant"], row["knobs"]) for row in rows if row["quantity"] == quantity
               and (row.get("value") or 0) > 0} for quantity in ("frame", study.metrics[0])]
    return bool(places[0] & places[1])


def why_none(study: Study, rows: list[dict]) -> str:
    return WHY_NONE if is_any_drawn(study, rows) else NOTHING.format(metric=study.metrics[0])


def draw_scene(axes, study: Study, rows: list[dict], quantity: str, metric: str) -> list[tuple[float, float, str]]:
    """Answers where points lie and what is to be written beside them, by write_values() once the axes have their size."""
    found = {(row["variant"], row["knobs"], row["quantity"]): row for row in rows if row.get("value") is not None}
    dominated, lane, labels = [], [], []
    is_higher_better = {each["name"]: each["better"] for each in metrics()}.get(metric) == "higher"
    sign = -1.0 if is_higher_better else 1.0
    for number, ((variant, own_knobs), points) in enumerate(ladders_of(study).items()):
        drawn, exact = [], []
        style = {"capsize": 2, "color": COLORS[number % len(COLORS)], "marker": MARKERS[number % len(MARKERS)], "markersize": 5,
                 "elinewidth": 0.8}
        for point in points:
            knobs = " ".join(f"{knob}={value}" for knob, value in point.knobs)
            time, error = found.get((variant, knobs, quantity)), found.get((variant, knobs, metric))
            if time and error and time["value"] > 0 and error["value"] == 0 and not is_higher_better:
                exact.append(time)
            if time and error and time["value"] > 0 and error["value"] > 0:
                drawn.append((time, error, ", ".join(str(value) for _, value in point.knobs)))
                dominated += [drawn[-1]] if error.get("dominated_by") else []
        lane += [(exact, f"{variant}: without error", style)] if exact else []
        if not drawn:
            continue
        x, y = [t["value"] for t, _, _ in drawn], [e["value"] for _, e, _ in drawn]
        names = ", ".join(own_knobs)
        axes.errorbar(x, y, xerr=reaches([t for t, _, _ in drawn]), yerr=reaches([e for _, e, _ in drawn]), linewidth=1.2,
                      label=f"{variant} ({names})" if names else variant, **style)
        labels += [(time["value"], error["value"], values if len(values) <= 12 or k in (0, len(drawn) - 1) else "")
                   for k, (time, error, values) in enumerate(drawn)]
    if dominated:
        axes.plot([t["value"] for t, _, _ in dominated], [e["value"] for _, e, _ in dominated], "x", color="black", markersize=9,
                  label="dominated by a cheaper rung, beyond the noise")
    # Points without error are in the lane: what is slower than one of them is on no front.
    exact_times = [each["value"] for times, _, _ in lane for each in times]
    front = [(x, sign * y) for x, y in front_of([(x, sign * y) for x, y, _ in labels]) if all(x < time for time in exact_times)]
    if len(front) > 1:
        axes.step([x for x, _ in front], [y for _, y in front], where="post", color="0.5", linestyle=":", linewidth=1.5,
                  zorder=0, label="no other point beats these in this time and the error, by their middles")
    axes.set(xscale="log", yscale="log")
    axes.set_axisbelow(True)  # the grid; else it would cross the lane
    axes.margins(0.12)
    least = axes.get_ylim()[0]
    if lane:
        draw_lane(axes, lane)
    plain_numbers(axes.xaxis)
    plain_numbers(axes.yaxis, least)
    if is_higher_better:
        axes.invert_yaxis()  # down is more accurate in every chart
    axes.grid(True, which="both", alpha=0.25)
    return labels


def front_of(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """(time, error) of those that no other one beats in both, lower being better, from the fastest on."""
    found: list[tuple[float, float]] = []
    for time, error in sorted(set(points)):
        if not found or error < found[-1][1]:
            found.append((time, error))
    return found


LABEL_POINTS = 6.5  # of type
# Where beside a point, in points of type; the first that is free.
LABEL_PLACES = [(5, 4, "left", "bottom"), (5, -4, "left", "top"), (-5, 4, "right", "bottom"), (-5, -4, "right", "top"),
                (0, 7, "center", "bottom"), (0, -7, "center", "top")]


def write_values(axes, labels: list[tuple[float, float, str]]) -> None:
    """Values beside their points, none over another one or over a point: what finds no room is left to the tables."""
    scale = axes.figure.dpi / 72.0  # pixels of the screen in a point of type
    places = [axes.transData.transform((x, y)) / scale for x, y, _ in labels]
    taken = [(x - 3.5, y - 3.5, x + 3.5, y + 3.5) for x, y in places]
    for (x, y), (at_x, at_y, text) in zip(places, labels):
        width, height = 0.62 * LABEL_POINTS * len(text), 1.1 * LABEL_POINTS
        for dx, dy, side, end in LABEL_PLACES if text else []:
            left = x + dx - {"left": 0.0, "center": 0.5, "right": 1.0}[side] * width
            low = y + dy - (height if end == "top" else 0.0)
            box = (left, low, left + width, low + height)
            if not any(box[0] < b[2] and b[0] < box[2] and box[1] < b[3] and b[1] < box[3] for b in taken):
                taken.append(box)
                axes.annotate(text, (at_x, at_y), textcoords="offset points", xytext=(dx, dy), ha=side, va=end, fontsize=LABEL_POINTS)
                break


def draw_lane(axes, lane: list[tuple[list[dict], str, dict]]) -> None:
    """Times of points without error, along the lower edge and apart from the rest: a logarithm has no place for 0."""
    from matplotlib.patches import Rectangle

    low, high = axes.get_ylim()
    height = 0.09
    axes.add_artist(Rectangle((0.0, 0.0), 1.0, height, transform=axes.transAxes, color="0.93", zorder=1))
    axes.text(-0.012, 0.5 * height, "0", transform=axes.transAxes, ha="right", va="center", fontsize=8)
    for exact, label, style in lane:
        axes.errorbar([each["value"] for each in exact], [0.5 * height] * len(exact), xerr=reaches(exact), linestyle="none",
                      transform=axes.get_xaxis_transform(), label=label, **style)
    axes.set_ylim(low * (low / high) ** (1.2 * height), high)


MOST_NUMBERS = 9  # along an axis


def number_text(value: float, ticks: Sequence[float]) -> str:
    """With as many digits as put the number of each tick within a twentieth of the nearest gap, six at least: of a narrow
    view six would number several alike."""
    places = sorted({float(tick) for tick in ticks if math.isfinite(tick)})
    gap = min((high - low for low, high in zip(places, places[1:])), default=math.inf)
    digits = next((n for n in range(6, 17) if all(abs(float(f"{place:.{n}g}") - place) <= 0.05 * gap for place in places)), 17)
    return f"{value:.{digits}g}"


def plain_numbers(axis, least: float = 0.0) -> None:
    """0.02 and 50 instead of powers of ten; between these the finest even steps for which there is room, all over a view of less
    than a factor of 3. Below `least` there are none."""
    from matplotlib import ticker

    low, high = axis.get_view_interval()
    if 0 < high < 3 * low:
        axis.set_major_locator(ticker.MaxNLocator(MOST_NUMBERS - 1, steps=[1, 2, 2.5, 5, 10]))
        style_numbers(axis, least)
        return
    steps: tuple[float, ...] = ()
    for steps in (tuple(n / 5 for n in range(5, 50)), tuple(n / 2 for n in range(2, 20)), tuple(range(1, 10)), (1, 2, 5), (1,)):
        decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1) if 0 < low < high else range(0)
        if sum(low <= step * 10.0**decade <= high for decade in decades for step in steps) <= MOST_NUMBERS:
            break
    axis.set_major_locator(ticker.LogLocator(subs=steps, numticks=50))
    style_numbers(axis, least)


def style_numbers(axis, least: float) -> None:
    from matplotlib import ticker

    axis.set_minor_locator(ticker.NullLocator())
    axis.set_major_formatter(ticker.FuncFormatter(lambda value, _: number_text(value, axis.get_majorticklocs()) if value >= least else ""))
    axis.set_tick_params(which="both", labelsize=8)


def reaches(rows: list[dict]) -> list[list[float]]:
    """Lengths of error bars; on a logarithmic axis none reaches down to 0."""
    down = [min(row["value"] - row["low"], 0.95 * row["value"]) for row in rows]
    return [[max(0.0, d) for d in down], [max(0.0, row["high"] - row["value"]) for row in rows]]
