"""What cards of the page are made of."""

from __future__ import annotations

from nicegui import ui

from heatertune.studio.charts import Options
from heatertune.terms import terms_in

__all__ = ["card", "chart", "draw", "explain_label", "html"]


def card(title: str, props: str = "", *, wide: bool = False) -> ui.element:
    """Return a card with its title."""
    made = ui.element("section").classes(f"card {'wide' if wide else ''}").props(f'aria-label="{title}" {props}')
    with made:
        ui.html(title, sanitize=False, tag="h2")
    return made


def explain_label(label: str) -> str:
    """Return what the terms of a label mean, "" where it has none."""
    return "; ".join(f"{term.names[0]}: {term.meaning}" for term in terms_in(label))


def html() -> ui.html:
    """Return a place for HTML; every text in it went through `report.html.text_of`."""
    return ui.html("", sanitize=False).classes("scroll")


def chart(label: str, height_px: int, described_by: str = "") -> ui.echart:
    """Return an empty chart; `described_by`: id of the element that has its numbers in words."""
    made = ui.echart({"series": []}, renderer="svg").classes("chart").style(f"height: {height_px}px; width: 100%")
    described = f" aria-describedby={described_by}" if described_by else ""
    return made.props(f'role=img aria-label="{label}"{described}')


def draw(chart: ui.echart, options: Options) -> None:
    """Draw a chart anew."""
    chart.options.clear()
    chart.options.update(options)
    chart.update()
