"""Words → a whole sketch: PID_v1's constructor line, and a loop that switches the heater in windows of time."""

from __future__ import annotations

from heatertune.plc.arduino_pid.words import FIELDS, ON_ERROR
from heatertune.plc.parallel.window import PwmWindow, window_of
from heatertune.plc.parallel.words import decimal
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words"]

_LOOP = """
double Setpoint = {setpoint};  // degC
double Input = 0.0;            // degC
double Output = 0.0;
PID heaterPid(&Input, &Output, &Setpoint, {kp}, {ki}, {kd}, {pon}, DIRECT);

unsigned long windowBegan = 0;
unsigned long onMs = 0;
bool heating = false;          // whether there is a reading
{boost_state}
// TODO: return your sensor's temperature in degC, NAN where it is broken
double readTemperature() {{
  return NAN;
}}

unsigned long pulse(double output) {{
  if (!(output > 0.0)) return 0;  // what is no number is off, too
  const double wanted = output / Full * WINDOW_MS;
  unsigned long on = STEP_MS * (unsigned long)(wanted / STEP_MS + 0.5);
  if (wanted < LEAST_ON_MS || on < LEAST_ON_MS) return 0;
  if (wanted > WINDOW_MS - LEAST_OFF_MS || on > WINDOW_MS - LEAST_OFF_MS) return WINDOW_MS;
  return on;
}}

void setup() {{
  pinMode(HEATER_PIN, OUTPUT);
  digitalWrite(HEATER_PIN, LOW);
  heaterPid.SetOutputLimits(0.0, {outmax});
  heaterPid.SetSampleTime({sample});
}}

void loop() {{
  const unsigned long now = millis();
  const double reading = readTemperature();
  if (isnan(reading)) {{            // a broken sensor: off, and from cold when it is back
    heaterPid.SetMode(MANUAL);
    Output = 0.0;
    heating = false;
    digitalWrite(HEATER_PIN, LOW);
    return;
  }}
  Input = reading;
{who}  heaterPid.Compute();
  if (!heating || now - windowBegan >= WINDOW_MS) {{
    windowBegan = heating ? windowBegan + WINDOW_MS : now;
    onMs = pulse({asked});
  }}
  heating = true;
  digitalWrite(HEATER_PIN, now - windowBegan < onMs ? HIGH : LOW);
}}
"""

_AUTOMATIC = """\
  if (!heating) heaterPid.SetMode(AUTOMATIC);
"""

_STATE = """\
bool boosting = true;
unsigned long decided = 0;
"""

_BOOST = """\
  if (!heating) boosting = true;
  if (!heating || now - decided >= SAMPLE_MS) {  // far from the setpoint: full power, and the PID by hand at 0
    decided = heating ? decided + SAMPLE_MS : now;
    const double away = Setpoint - Input;
    boosting = away > (boosting ? BOOST_WITHIN : BOOST_AGAIN) && !isinf(away);
    heaterPid.SetMode(boosting ? MANUAL : AUTOMATIC);
    if (boosting) Output = 0.0;
  }
"""


def export_words(words: Words, certificate: Certificate) -> dict[str, str]:
    """Return the sketch; the same words and certificate give the same bytes."""
    window = window_of(words, certificate)
    text = {name: decimal(words.values[name], "LREAL") for name in ("Kp", "Ki", "Kd", "OutMax", "Full")}
    setpoint = words.scaling.low_degC if certificate.setpoint_degC is None else certificate.setpoint_degC
    head = "\n".join(f"// {line}" for line in _head(words, certificate, window))
    body = _LOOP.format(
        setpoint=decimal(setpoint, "LREAL"), kp=text["Kp"], ki=text["Ki"], kd=text["Kd"], outmax=text["OutMax"],
        pon="P_ON_E" if words.values["POn"] == ON_ERROR else "P_ON_M", sample=words.whole["SampleTime"],
        boost_state=_STATE if words.boost else "", who=_BOOST if words.boost else _AUTOMATIC,
        asked=f"boosting ? {text['OutMax']} : Output" if words.boost else "Output")
    return {"arduino_pid.ino": f"{head}\n\n#include <PID_v1.h>\n\n{_constants(words, text['Full'], window)}{body}"}


def _constants(words: Words, full: str, window: PwmWindow) -> str:
    numbers = {"WINDOW_MS": window.period_ms, "STEP_MS": window.step_ms, "LEAST_ON_MS": window.least_on_ms,
               "LEAST_OFF_MS": window.least_off_ms}
    times = "".join(f"const unsigned long {name} = {number};\n" for name, number in numbers.items())
    if words.boost is not None:
        times += (f"const unsigned long SAMPLE_MS = {words.whole['SampleTime']};\n"
                  f"const double BOOST_WITHIN = {decimal(words.boost.within_degC, 'LREAL')};  // degC\n"
                  f"const double BOOST_AGAIN = {decimal(words.boost.again_degC, 'LREAL')};\n")
    return f"const int HEATER_PIN = 5;  // TODO: yours\nconst double Full = {full};\n{times}"


def _head(words: Words, certificate: Certificate, window: PwmWindow) -> tuple[str, ...]:
    scale = words.scaling
    return (
        "heater controller for Arduino, library PID by Brett Beauregard, 1.2.1 (PID_v1.h)",
        f"sensor {scale.low_degC:g}...{scale.high_degC:g} degC; TA: {words.sample_time_s:g} s; {len(FIELDS)} words",
        *certificate.head,
        window.summary,
        "remains to be done by hand: HEATER_PIN and readTemperature(); loop() must come round well within STEP_MS,",
        "  for Compute() and pulses are late by up to one round; nothing that waits (delay) belongs in it",
    )
