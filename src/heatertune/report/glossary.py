"""The glossary of a page: what the symbols and words mean that stand on it."""

from __future__ import annotations

import html
import re
from typing import Final

from heatertune.report.html import text_of
from heatertune.terms import terms_in

__all__ = ["glossary"]

_UNREAD: Final = re.compile(r"<(script|style|svg)\b.*?</\1>|<[^>]*>", re.DOTALL)


def glossary(body: str) -> str:
    """Return the terms that a page uses as a list with their meanings, in HTML; nothing where it uses none.

    Args:
        body: HTML of the page.
    """
    found = terms_in(html.unescape(_UNREAD.sub(" ", body)))
    lines = "".join(
        f"<dt>{text_of(', '.join(term.names[:2]))}</dt><dd>{text_of(term.meaning)}</dd>" for term in found)
    return f'<h2>Terms</h2><dl class="terms">{lines}</dl>' if found else ""
