"""What every page demands of itself: it can be used with a keyboard and a screen reader."""

from importlib import resources


def demand_accessible(page):
    """axe-core's rules find nothing (WCAG 2.1 A and AA, and its best practices)."""
    page.evaluate((resources.files("axe_playwright_python") / "axe.min.js").read_text(encoding="utf-8"))
    found = page.evaluate("() => axe.run(document, {resultTypes: ['violations']})")["violations"]
    assert [(one["id"], [node["html"][:120] for node in one["nodes"]]) for one in found] == []
