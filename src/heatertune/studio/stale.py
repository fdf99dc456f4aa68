"""Grey: what is seen is not, or not yet, the truth about the settings.

The browser greys banner and words in the very event that moves a control, before anything is sent: it counts
its moves, and the server tells with every answer how many of them it has heard, and whether it still computes.
"""

from __future__ import annotations

from typing import Final

from nicegui import ui

__all__ = ["MOVE", "MOVED", "NUMBER_SEEN", "Grey"]

_CLIENT: Final = """<script>
window.studio = {
  moves: 0,
  move() { this.moves += 1; this.paint(); return this.moves; },
  seen() {
    const grey = document.documentElement.classList.contains('stale');
    return grey ? 0 : Number(document.querySelector('[data-heard]').dataset.number);
  },
  paint() {
    const told = document.querySelector('[data-heard]')?.dataset;
    const stale = !told || told.computing === 'yes' || Number(told.heard) < this.moves;
    document.documentElement.classList.toggle('stale', stale);
  },
};
new MutationObserver(() => studio.paint()).observe(
  document, {subtree: true, childList: true, attributeFilter: ['data-heard', 'data-computing']});
</script>"""
_LOOK: Final = """
html.stale :is([data-field=verdict], [data-field=words], [data-field=as-left], [data-field=drawn]) {
  background: #ececec; border-color: #767676; }
html.stale :is(.verdict, [data-field=words] :is(th, td, code),
    :is([data-field=as-left], [data-field=drawn]) :is(th, td, p, li)) {
  color: #5f5f5f; }
"""
#: what a control says when it was moved: the number of the move, and before it its value
MOVE: Final = "() => emit(studio.move())"
MOVED: Final = "(e) => emit(e.target.value, studio.move())"
#: what a download says: the number of the design that stands beside its button at that moment; grey is no design
NUMBER_SEEN: Final = "() => emit(studio.seen())"


class Grey:
    """What one page tells its browser; elements that may be grey are chosen by the style sheet."""

    def __init__(self) -> None:
        ui.add_head_html(_CLIENT)
        ui.add_css(_LOOK)
        self._heard = 0
        self._told = ui.element("div").props("hidden data-heard=0 data-computing=yes data-number=0")

    def note_moves(self, move: int) -> None:
        """Take how many moves the browser has made, all of them heard by now."""
        self._heard = max(self._heard, move)
        self._told.props(f"data-heard={self._heard}")

    def show(self, *, computing: bool, number: int) -> None:
        """Tell whether something is on its way, and the number of the design that is seen."""
        self._told.props(f"data-computing={'yes' if computing else 'no'} data-number={number}")
