"""Stage documents → tables for the terminal, pictures, and one self-contained HTML page; nothing is computed here.

Names are imported on first use, because the help of a command needs none of them.
"""

from typing import TYPE_CHECKING

from heatertune.lazy import lazy_attributes

if TYPE_CHECKING:
    from heatertune.report.as_left_section import writes_brief
    from heatertune.report.controller_comparison import render_targets, targets_brief, targets_table
    from heatertune.report.health_page import loops_lines, loops_page
    from heatertune.report.page import render, sections
    from heatertune.report.report_text import (
        advice_table,
        alternatives_table,
        criteria_table,
        design_lines,
        difference_lines,
        feed_forward_lines,
        forms_lines,
        hypothesis_table,
        model_lines,
        outcome_lines,
        pareto_table,
        plan_csv,
        plan_lines,
        ramp_note,
        samples_table,
        summary,
        validation_lines,
        words_table,
    )
    from heatertune.report.supervision import supervision_html, supervision_page
    from heatertune.report.verdict_summary import design_brief, model_brief, tune_brief, verify_brief

__all__ = [
    "advice_table", "alternatives_table", "criteria_table", "design_brief", "design_lines", "difference_lines",
    "feed_forward_lines", "forms_lines", "hypothesis_table", "loops_lines", "loops_page", "model_brief",
    "model_lines", "outcome_lines", "pareto_table", "plan_csv", "plan_lines", "ramp_note", "render",
    "render_targets", "samples_table", "sections", "summary", "supervision_html", "supervision_page",
    "targets_brief", "targets_table", "tune_brief", "validation_lines", "verify_brief", "words_table",
    "writes_brief",
]

__getattr__, __dir__ = lazy_attributes(__name__, {
    "report.report_text": (
        "difference_lines", "plan_csv", "plan_lines", "advice_table", "alternatives_table", "criteria_table",
        "design_lines", "feed_forward_lines", "forms_lines", "hypothesis_table", "model_lines", "outcome_lines",
        "pareto_table", "ramp_note", "samples_table", "summary", "validation_lines", "words_table"),
    "report.health_page": ("loops_lines", "loops_page"),
    "report.page": ("render", "sections"),
    "report.supervision": ("supervision_html", "supervision_page"),
    "report.controller_comparison": ("render_targets", "targets_brief", "targets_table"),
    "report.verdict_summary": ("design_brief", "model_brief", "tune_brief", "verify_brief"),
    "report.as_left_section": ("writes_brief",),
})
