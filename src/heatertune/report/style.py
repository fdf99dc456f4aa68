"""One look for all pictures: what is what keeps its colour and its line, also when printed grey."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["LOOK", "key", "label_levels", "new_figure", "power_limits", "to_png", "to_svg"]

# M. Okabe and K. Ito, "Color universal design" (2008): told apart by colour-blind eyes; darkness differs too
LOOK: Final[dict[str, dict[str, Any]]] = {
    "log": {"color": "#000000", "linewidth": 0.9},
    "model": {"color": "#0072B2", "linewidth": 1.6},
    "ideal": {"color": "#E69F00", "linewidth": 1.6, "linestyle": (0, (5, 2))},
    "realised": {"color": "#009E73", "linewidth": 1.6},
    "worst": {"color": "#D55E00", "linewidth": 1.4, "linestyle": (0, (7, 1.5, 1.5, 1.5))},  # as dark as realised
    "other": {"color": "#C0C0C0", "linewidth": 0.7},
    "limit": {"color": "#666666", "linewidth": 0.8, "linestyle": ":"},
}


def new_figure(
    rows: int, height: float, columns: int = 1, *, figure: Figure | None = None, **settings: Any
) -> tuple[Figure, list[Axes]]:
    """Return a figure of full page width and its axes, row by row.

    Args:
        rows: how many axes stand below one another.
        height: of the figure [inch].
        columns: how many stand beside one another.
        figure: an empty one to be used; None: a new one.
        settings: of `Figure.subplots`.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415 - half a second that only pictures need

    figure = Figure() if figure is None else figure
    figure.set_size_inches(9.0, height)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **settings).ravel()
    for ax in axes:
        ax.grid(color="#dddddd", linewidth=0.5)
        ax.spines[["top", "right"]].set_visible(False)
    return figure, list(axes)


def power_limits(*powers: Any) -> tuple[float, float]:
    """Return the ends of an axis of power [%], from below 0 where one of them cools."""
    return -4.0 if all(np.nanmin(power, initial=0.0) >= 0.0 for power in powers) else -104.0, 104.0


def key(ax: Axes, *names: tuple[str, str]) -> None:
    """Name lines in a row above the axes, each beside a piece of it: no curve is covered, and grey print suffices.

    Args:
        ax: where.
        names: name and look of each line.
    """
    from matplotlib.lines import Line2D  # noqa: PLC0415 - with the rest of matplotlib, only where pictures are drawn

    ax.legend(handles=[Line2D([], [], label=name, **LOOK[look]) for name, look in names], loc="lower left",
              bbox_to_anchor=(0.0, 1.0), ncols=len(names), frameon=False, fontsize=8, handlelength=3.5,
              borderaxespad=0.1)


def label_levels(ax: Axes, *levels: tuple[float, str]) -> None:
    """Write the names of at most two level lines to the right of them, outside the axes, the higher one higher."""
    places = ("center",) if len(levels) == 1 else ("top", "bottom")
    for (value, text), place in zip(sorted(levels), places, strict=True):
        ax.annotate(text, (1.0, value), xycoords=("axes fraction", "data"), xytext=(3, 0), textcoords="offset points",
                    color=LOOK["limit"]["color"], fontsize=8, va=place, annotation_clip=False)


def to_png(figure: Figure) -> bytes:
    """Return the figure as a PNG file; the same figure always gives the same bytes."""
    import io  # noqa: PLC0415

    content = io.BytesIO()
    _lay_out(figure)
    figure.savefig(content, format="png", dpi=150, metadata={"Software": None})
    return content.getvalue()


def to_svg(figure: Figure) -> str:
    """Return the figure as an SVG element; the same figure always gives the same text."""
    import io  # noqa: PLC0415

    import matplotlib as mpl  # noqa: PLC0415
    from matplotlib.backends.backend_svg import FigureCanvasSVG  # noqa: PLC0415

    text = io.StringIO()
    _lay_out(figure)
    with mpl.rc_context({"svg.hashsalt": "heatertune", "svg.fonttype": "none", "font.family": "sans-serif"}):
        # not by `savefig`, which draws a figure that had an engine a second time before
        FigureCanvasSVG(figure).print_svg(text, metadata={"Date": None, "Creator": None})
    content = text.getvalue()
    return content[content.index("<svg") :]


def _lay_out(figure: Figure) -> None:
    """Place what is in a figure once: a figure with an engine is drawn twice when it is saved, first for its layout."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine("none")
