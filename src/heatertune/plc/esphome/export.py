"""Words → YAML: the PID climate with its control_parameters, a slow_pwm output behind it."""

from __future__ import annotations

from heatertune.plc.esphome.words import FIELDS
from heatertune.plc.keyed_entry import entry_texts
from heatertune.plc.parallel.window import PwmWindow, window_of
from heatertune.plc.parallel.words import decimal
from heatertune.plc.words import Certificate, Words

__all__ = ["entries", "export_words"]

_LEAST_PERIOD_MS = 100

_YAML = """
sensor:
  - platform: template  # TODO: your sensor, in degC; each of its values calls the PID, so no filter may lose one
    id: heater_temperature
    update_interval: {update_interval}ms
    lambda: "return NAN;"

climate:
  - platform: pid
    name: "Heater"
    id: heater_climate
    sensor: heater_temperature
    default_target_temperature: {setpoint}°C
    heat_output: {output}
    control_parameters:
{parameters}
output:
  - platform: slow_pwm
    id: heater_output
    pin: GPIO5  # TODO: yours
    period: {period}ms
{boost}"""

_BOOST = """\
  - platform: template
    id: heater_level
    type: float
    write_action:
      - lambda: |-
          // far from the setpoint: full power, and no integral part; while it is off nothing is summed up, either
          static bool boosting = true;
          const bool off = id(heater_climate).mode == climate::CLIMATE_MODE_OFF;
          const float away = id(heater_climate).target_temperature - id(heater_climate).current_temperature;
          if (!std::isnan(away)) boosting = off || (away > (boosting ? {within}f : {again}f) && !std::isinf(away));
          if (off || boosting) id(heater_climate).reset_integral_term();
          id(heater_output).set_level(boosting && !off && !std::isnan(away) ? 1.0f : state);
"""


def export_words(words: Words, certificate: Certificate) -> dict[str, str]:
    """Return the file; the same words and certificate give the same bytes."""
    window = window_of(words, certificate)
    parameters = "".join(f"      {field.name}: {_text(words, field.name)}\n" for field in FIELDS
                         if field.address == "control_parameters")
    setpoint = words.scaling.low_degC if certificate.setpoint_degC is None else certificate.setpoint_degC
    head = "\n".join(f"# {line}" for line in _head(words, certificate, window))
    body = _YAML.format(update_interval=words.whole["update_interval"], setpoint=decimal(setpoint, "LREAL"),
                        parameters=parameters, period=max(window.period_ms, _LEAST_PERIOD_MS),
                        output="heater_output" if words.boost is None else "heater_level", boost=_boost(words))
    return {"esphome_pid.yaml": head + "\n" + body}


def _boost(words: Words) -> str:
    if words.boost is None:
        return ""
    within, again = (decimal(each, "REAL") for each in (words.boost.within_degC, words.boost.again_degC))
    return _BOOST.format(within=within, again=again)


def entries(words: Words, _setpoint_degC: float | None, _units: object) -> dict[str, dict[str, str]]:
    """Return each word as the exported files have it, see `heatertune.plc.keyed_entry.TypedWord`."""
    return entry_texts({field.name: _text(words, field.name) for field in FIELDS})


def _text(words: Words, name: str) -> str:
    value = words.values[name]
    return decimal(value, "REAL") if isinstance(value, float) else str(value)


def _head(words: Words, certificate: Certificate, window: PwmWindow) -> tuple[str, ...]:
    scale = words.scaling
    short = f"; slow_pwm has no period below {_LEAST_PERIOD_MS} ms" if window.period_ms < _LEAST_PERIOD_MS else ""
    least = ("; slow_pwm knows no shortest pulse or pause: the switch behind it has to"
             if window.least_on_ms or window.least_off_ms else "")
    return (
        "heater controller for ESPHome's PID climate",
        f"sensor {scale.low_degC:g}...{scale.high_degC:g} degC; TA: {words.sample_time_s:g} s; level 1 is full power",
        *certificate.head,
        f"slow_pwm: {window.summary}{short}{least}; pulses end with a round of the loop, about 16 ms",
        "remains to be done by hand: sensor and pin; a part of your own file, not a whole one",
    )
