"""Names in the pictures: each can be read, covers no curve, and stands beside a piece of its own line."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.text import Annotation

from heatertune.report import plots
from heatertune.report.plots import LOOK

TIME = np.linspace(0.0, 3000.0, 301)
RISE = 20.0 + 20.0 * (1.0 - np.exp(-TIME / 300.0))


def a_run(label, temperature):
    return {"label": label, "time_s": TIME, "temperature_degC": temperature, "setpoint_degC": 40.0, "request_time_s": TIME,
            "request_pct": 50.0 + 0.01 * TIME, "edge_s": np.arange(0.0, 3000.0, 5.0), "edge_pct": np.tile([100.0, 0.0], 300)}


def a_log(power):
    """A log that the model follows exactly: where two lines are one, names beside them would be one blot."""
    log = {"time_s": TIME, "temperature_degC": RISE, "power_pct": power}
    return log, {"time_s": TIME, "measured_degC": RISE, "simulated_degC": RISE}


def curves(*peaks):
    """Loops k·e^(−s)/s, sensitivities a hump as high as told; the last one is the worst."""
    omega = np.geomspace(1e-3, 1.0, 120)
    loop = [0.3 * peak * np.exp(-1j * omega) / (1j * omega) for peak in peaks]
    return [{"label": f"model {i}", "omega": omega, "real": one.real, "imaginary": one.imag,
             "sensitivity": 1e-2 + (peak - 1e-2) * np.exp(-np.log(omega / 0.1) ** 2), "worst": i == len(peaks) - 1}
            for i, (one, peak) in enumerate(zip(loop, peaks, strict=True))]


NOMINAL, WORST = a_run("nominal model", RISE), a_run("worst model", RISE + np.sin(TIME / 60.0))
FIGURES = {
    "fit": lambda: plots.plot_fit(*a_log(None)),
    "fit with power": lambda: plots.plot_fit(*a_log(np.where(TIME > 100.0, 100.0, 0.0))),
    "loop": lambda: plots.plot_loop(NOMINAL, WORST, [a_run("other", np.full_like(TIME, 40.0))]),
    "ideal": lambda: plots.plot_wish(NOMINAL, a_run("ideal", RISE)),
    "paper": lambda: plots.plot_paper([{"label": f"PI, gain {g} %", "series": NOMINAL} for g in (20, 40, 60)]),
    "robustness": lambda: plots.plot_robustness(curves(1.2, 1.4, 1.6), 2.0, 1.6),
    "robustness, limits nearly one": lambda: plots.plot_robustness(curves(1.2, 1.98), 2.0, 1.98),
}


def names(figure):
    """What names a line: annotations, and the texts of the keys."""
    for ax in figure.axes:
        yield from (each for each in ax.texts if isinstance(each, Annotation))
        if ax.get_legend() is not None:
            yield from ax.get_legend().get_texts()


def drawn(figure):
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return {text: text.get_window_extent(canvas.get_renderer()) for text in names(figure)}


@pytest.mark.parametrize("name", FIGURES)
def test_no_name_lies_over_another_nor_is_cut(name):
    figure = FIGURES[name]()
    boxes = list(drawn(figure).items())
    assert boxes
    page = figure.bbox
    for i, (text, box) in enumerate(boxes):
        assert page.x0 <= box.x0 < box.x1 <= page.x1, text.get_text()
        assert page.y0 <= box.y0 < box.y1 <= page.y1, text.get_text()
        for other, beside in boxes[:i]:
            assert not box.overlaps(beside), (text.get_text(), other.get_text())


@pytest.mark.parametrize("name", FIGURES)
@pytest.mark.long
def test_no_name_lies_over_a_curve(name):
    figure = FIGURES[name]()
    boxes = drawn(figure)
    for ax in figure.axes:
        for line in ax.lines:
            at = ax.transData if line.get_transform() == ax.transData else line.get_transform()
            points = at.transform(np.column_stack([line.get_xdata(), line.get_ydata()]).astype(float))
            finer = np.linspace(0, len(points) - 1, 20 * len(points))
            x, y = (np.interp(finer, np.arange(len(points)), column) for column in points.T)
            seen = ax.bbox.contains  # what lies outside the axes is not drawn
            for text, box in boxes.items():
                hit = (x > box.x0) & (x < box.x1) & (y > box.y0) & (y < box.y1)
                assert not any(seen(*each) for each in zip(x[hit], y[hit], strict=True)), (text.get_text(), line.get_label())


def dashes(line):
    return getattr(line, "_unscaled_dash_pattern", (0, None))[1]


@pytest.mark.parametrize("name", FIGURES)
def test_the_key_shows_each_line_as_it_is_drawn(name):
    ax = FIGURES[name]().axes[0]
    here = {(to_hex(line.get_color()), dashes(line), line.get_linewidth()) for line in ax.lines}
    for piece in ax.get_legend().get_lines():
        assert (to_hex(piece.get_color()), dashes(piece), piece.get_linewidth()) in here, piece.get_label()


def test_the_key_names_what_is_there_and_no_more():
    keys = {name: [text.get_text() for text in make().axes[0].get_legend().get_texts()] for name, make in FIGURES.items()}
    assert keys["fit"] == keys["fit with power"] == ["log", "model"]
    assert keys["loop"] == ["nominal", "worst", "other models"]
    assert keys["ideal"] == ["realised", "ideal"]
    assert keys["paper"] == ["PI, gain 20 %", "PI, gain 40 %", "PI, gain 60 %"]
    assert keys["robustness"] == ["nominal", "worst", "other models"]
    assert keys["robustness, limits nearly one"] == ["nominal", "worst"]
    alone = plots.plot_loop(NOMINAL, WORST, []).axes[0].get_legend()
    assert [text.get_text() for text in alone.get_texts()] == ["nominal", "worst"]
    one = plots.plot_robustness(curves(1.5), 2.0).axes[0]
    assert [text.get_text() for text in one.get_legend().get_texts()] == ["nominal"]
    assert to_hex(one.lines[0].get_color()) == LOOK["realised"]["color"].lower()


def test_power_stands_below_the_temperature_on_its_own_axis_from_0_to_100():
    figure = FIGURES["fit with power"]()
    top, power, low = figure.axes
    assert [ax.get_ylabel() for ax in figure.axes] == ["temperature [°C]", "power [%]", "residual [°C]"]
    assert [line.get_label() for line in top.lines] == ["log", "model"]
    assert power.get_ylim() == (-4, 104)
    assert list(power.lines[0].get_ydata()) == list(np.where(TIME > 100.0, 100.0, 0.0))
    assert power.lines[0].get_drawstyle() == "steps-post"
    assert power.get_position().y0 > low.get_position().y1


def test_the_limit_of_the_proof_and_the_ms_of_the_design_are_both_drawn():
    left, right = FIGURES["robustness"]().axes
    # a loop with |1 + L| ≥ 1/Ms everywhere stays out of a circle of that radius around −1
    assert [patch.radius for patch in left.patches] == [1.0 / 1.6, 1.0 / 2.0]
    assert {line.get_label(): line.get_ydata()[0] for line in right.lines if len(line.get_xdata()) == 2} == {
        "limit 2": 2.0, "design 1.6": 1.6}
    assert {text.get_text() for text in left.texts} == {"Ms, design 1.6", "Ms, limit 2"}
    assert {text.get_text() for text in right.texts} == {"limit 2", "design 1.6"}


@pytest.mark.parametrize("designed", [None, 9.0, float("inf")])
def test_an_unknown_or_boundless_ms_of_the_design_leaves_the_limit_alone(designed):
    left, right = plots.plot_robustness(curves(1.2, 1.6), 2.0, designed).axes
    assert [patch.radius for patch in left.patches] == [0.5]
    assert [text.get_text() for text in right.texts] == ["limit 2"]
    assert right.get_ylim() == (0.0, 2.4)


def test_the_sensitivity_is_drawn_from_where_it_can_be_told_from_nothing():
    shown = curves(1.6)
    first = next(w for w, s in zip(shown[0]["omega"], shown[0]["sensitivity"], strict=True) if s > 0.02)
    right = plots.plot_robustness(shown, 2.0).axes[1]
    assert right.get_xlim()[0] == pytest.approx(first)
