"""A proposed experiment: what is known before and after it, and how to carry it out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from heatertune.report.layout import table
from heatertune.report.text import figure
from heatertune.units import NOMENCLATURE

__all__ = ["plan_csv", "plan_lines"]

Document = Mapping[str, Any]


def plan_lines(plan: Document) -> str:
    """Return the experiment, the table of before and after, and whether it is worth heating."""
    parts = [
        f"== {plan['kind']}, {figure(plan['duration_s'])} s, at most {figure(plan['highest_degC'])} °C "
        f"(limit {figure(plan['conditions']['limit_degC'])} °C) on {len(plan['heaters'])} plausible heaters",
        _relay(plan["relay"]) if "relay" in plan else _schedule(plan["schedule"]),
        _before_and_after(plan["quantities"]),
        *(f"- {line}" for line in _words(plan)),
    ]
    return "\n".join(parts)


def plan_csv(plan: Document) -> str:
    """Return what is to be set, as CSV: instants and powers, or the relay's settings."""
    if "relay" in plan:
        names = ("rest_s", "on_degC", "off_degC", "high_pct", "low_pct")
        values = [plan["relay"][name] for name in names] + [plan["duration_s"]]
        return f"{','.join(names)},duration_s\n{','.join(f'{value:.10g}' for value in values)}\n"
    schedule = plan["schedule"]
    rows = [(0.0, schedule["base_pct"]), *zip(schedule["time_s"], schedule["power_pct"], strict=True)]
    return "time_s,power_pct\n" + "".join(f"{time:.10g},{power:.10g}\n" for time, power in rows)


def _schedule(schedule: Document) -> str:
    rows = [("from s", "power %"), ("0", figure(schedule["base_pct"]))]
    rows += [(figure(t, 6), figure(p)) for t, p in zip(schedule["time_s"], schedule["power_pct"], strict=True)]
    return table(rows, right=(0, 1))


def _relay(relay: Document) -> str:
    shortest, longest = relay["period_s"]
    return (
        f"log {figure(relay['rest_s'])} s at rest; then {figure(relay['high_pct'])} % until "
        f"{figure(relay['off_degC'])} °C, {figure(relay['low_pct'])} % until {figure(relay['on_degC'])} °C, and so on\n"
        f"(setpoint {figure(relay['setpoint_degC'])} °C, hysteresis ±{figure(relay['hysteresis_degC'])} °C); expected "
        f"period {figure(shortest, 3)} to {figure(longest, 3)} s"
    )


def _before_and_after(quantities: Document) -> str:
    rows = [("", "before", "after, 95 %", "worst ±", "unit", "worst on")]
    for name, quantity in quantities.items():
        _, called, unit = NOMENCLATURE[name]
        share = quantity["worst_share"]
        worst = _share(share) if share is not None else f"±{figure(quantity['worst_half_width'], 2)}"
        rows.append((called, _range(quantity["before"]), _range(quantity["after"]), worst, unit, quantity["worst_on"]))
    return table(rows)


def _words(plan: Document) -> list[str]:
    """Return whether it is worth heating, and what the figures rest on."""
    conditions, noise = plan["conditions"], plan["conditions"]["noise"]
    aim = _share(conditions["aim"])
    worth = [f"worth it: every interval is expected within {aim} on every heater"]
    if not plan["reached"]:
        worth = [f"the aim of {aim} is not reached: a longer test, a higher limit or less noise would help"]
    for name, quantity in plan["quantities"].items():
        low, high = quantity["before"]
        half = quantity["worst_half_width"]
        if high > low and (half is None or half >= 0.5 * (high - low)):
            worth.append(f"it would not tell the {NOMENCLATURE[name][1]} better than it is known before")
    tried = [f"{_share(test['worst_share'])} in {figure(test['duration_s'])} s" for test in plan["durations"]]
    step = f"a plain step of {figure(plan['duration_s'])} s: {_share(plan['step_worst_share'])}"
    return [
        *worth,
        f"worst interval: {', '.join(tried)}; {step}",
        f"readings every {figure(noise['sample_time_s'])} s, noise {figure(noise['std_degC'], 2)} °C with correlation "
        f"{figure(noise['correlation'], 2)}, resolution {figure(noise['resolution_degC'], 2)} °C",
        "the time constant is the sum of both where there are two lags",
    ]


def _share(value: float | None) -> str:
    return "no end" if value is None else f"±{100.0 * value:.2g} %"


def _range(pair: Any) -> str:
    low, high = (figure(end, 3) for end in pair)
    return f"{low} … {high}"
