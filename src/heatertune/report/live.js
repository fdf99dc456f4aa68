"use strict";
// Each figure with data gets panels that can be zoomed; its SVG stays for paper. Nothing is asked of any network.
for (const figure of document.querySelectorAll("figure[data-live]")) {
  const panels = JSON.parse(figure.querySelector("script").textContent);
  const box = document.createElement("div");
  const cursor = { sync: { key: figure.id, setSeries: false }, drag: { x: true, y: false } };
  const drawn = [];
  box.className = "live";
  figure.prepend(box);
  for (const panel of panels) {
    // one x for all lines; where a line has no value of its own it is drawn on
    const data = uPlot.join(panel.lines.map((line) => [line.x, line.y]));
    const told = (u, value) => (value == null ? "—" : Number(value.toPrecision(5)));
    const series = panel.lines.map((line) => ({
      label: line.label, stroke: line.color, width: line.width, dash: line.dash, spanGaps: true, value: told,
      points: { show: false },
      paths: line.step ? uPlot.paths.stepped({ align: 1 }) : undefined,
    }));
    const last = panel === panels[panels.length - 1]; // the others read its axis of time
    const named = { labelFont: "12px system-ui, sans-serif" };
    const axes = [last ? { ...named, label: panel.x } : {}, { ...named, label: panel.y, size: 60 }];
    const scales = { x: { time: false, distr: panel.log ? 3 : 1 } };
    // the ends of x are kept: zoomed or not, panels of one figure show the same stretch
    const together = (u) => {
      for (const other of drawn)
        if (other !== u && (other.scales.x.min !== u.scales.x.min || other.scales.x.max !== u.scales.x.max))
          other.setScale("x", { min: u.scales.x.min, max: u.scales.x.max });
    };
    drawn.push(new uPlot({
      width: box.clientWidth, height: Math.max(190, 620 * panel.height) + (last ? 30 : 0), pxAlign: 0, cursor, scales, axes,
      series: [{ label: panel.x, value: told }, ...series], hooks: { setScale: [(u, key) => key === "x" && drawn.includes(u) && together(u)] },
    }, data, box));
  }
  window.addEventListener("resize", () => {
    if (box.clientWidth) for (const each of drawn) each.setSize({ width: box.clientWidth, height: each.height });
  });
  figure.classList.add("moves");
}
// A table wider than its page is scrolled with the keyboard, too.
const reach = () => {
  for (const table of document.querySelectorAll("table"))
    if (table.scrollWidth > table.clientWidth) table.tabIndex = 0; else table.removeAttribute("tabindex");
};
reach();
window.addEventListener("resize", reach);
// Ticks are kept by the browser under the words they belong to; where it keeps nothing, they last as long as the page.
const kept = "heatertune:" + document.documentElement.dataset.words;
const ticks = [...document.querySelectorAll("input[type=checkbox]")];
try {
  const before = JSON.parse(localStorage.getItem(kept) || "[]");
  for (const tick of ticks) tick.checked = before.includes(tick.id);
  const keep = () => localStorage.setItem(kept, JSON.stringify(ticks.filter((tick) => tick.checked).map((tick) => tick.id)));
  for (const tick of ticks) tick.addEventListener("change", keep);
} catch { /* a browser may forbid it */ }
// On paper everything is open.
window.addEventListener("beforeprint", () => {
  for (const closed of document.querySelectorAll("details:not([open])")) closed.open = true;
});
