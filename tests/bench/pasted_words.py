"""Words of running controllers as people paste them: self-made texts, each with the K, TN and TV that its numbers mean.

`python -m tests.bench.pasted_words` prints how many are read at once, after one answer, or into other numbers. The arithmetic is the
manuals' and libraries' own, written out beside each text: Marlin, Klipper and analogWrite count full power as 255, so K is 100·Kp/255 and
TN is Kp/Ki; PID_v1's window of time is full power at its length; the S7-200 has minutes and shares of the range; CONT_C integrates by
trapezoids, so TN is TI − CYCLE/2 and K is GAIN·TN/TI.
"""

from typing import NamedTuple

from heatertune.errors import HeatertuneError
from heatertune.plc import Scaling, controller_for
from heatertune.plc.dump_reader import read_machine, realised_design

RIGHT, ASKED, WRONG, STUCK = "right at once", "right after an answer", "WRONG NUMBERS", "no way on"


class Answer(NamedTuple):
    """What a person does after a question, and the part of the message that says so."""

    says: str
    text: str | None = None  # in the place of the first
    called_every: float | None = None
    heater: str | None = None


class Pasted(NamedTuple):
    """A text, what its controller is, and what it means."""

    name: str
    target: str
    text: str
    gain: float  # % per °C
    tn: float
    tv: float
    ta: float | None = None
    called_every: float | None = None
    answer: Answer | None = None


def of_255(kp, ki, kd):
    """Return K, TN, TV of parallel gains whose full output is 255."""
    return 100.0 * kp / 255.0, kp / ki, kd / kp


def of_cont_c(gain, ti_s, cycle_s, td_s=0.0):
    """Return K, TN, TV of CONT_C's trapezoids in the rectangles of the standard form."""
    tn = ti_s - cycle_s / 2.0
    return gain * tn / ti_s, tn, td_s * ti_s / tn


def _arduino():
    head = "#include <PID_v1.h>\ndouble Setpoint, Input, Output;\n"
    pid = "PID myPID(&Input, &Output, &Setpoint, 2, 5, 1, DIRECT);\n"
    analog = "void setup() { myPID.SetMode(AUTOMATIC); }\nvoid loop() { Input = analogRead(0); myPID.Compute(); analogWrite(3, Output); }\n"
    yield "basic example", head + pid + analog, *of_255(2, 5, 1), 0.1
    yield "one line of a thread", pid, *of_255(2, 5, 1), 0.1
    yield ("relay example", head + "double Kp=2, Ki=5, Kd=1;\nPID myPID(&Input, &Output, &Setpoint, Kp, Ki, Kd, DIRECT);\nint WindowSize = 5000;\n"
           "unsigned long windowStartTime;\nvoid setup()\n{\n  windowStartTime = millis();\n  Setpoint = 100;\n"
           "  myPID.SetOutputLimits(0, WindowSize);\n  myPID.SetMode(AUTOMATIC);\n}\n", 100.0 * 2 / 5000, 2 / 5, 1 / 2, 0.1)
    yield ("SetTunings in setup()", head + pid + "void setup() {\n  myPID.SetTunings(10, 0.5, 20);\n  myPID.SetSampleTime(200);\n}\n"
           "void loop() { analogWrite(5, Output); }", *of_255(10, 0.5, 20), 0.2)
    yield ("defines, P_ON_E, tabs and CRLF", "#define KP\t4.5\r\n#define KI 0.03\r\n#define KD 12.0 // was 8\r\n/* PID old(&a,&b,&c,1,1,1,DIRECT); */\r\n"
           "PID\tovenPID( &Input , &Output,&Setpoint, KP,KI , KD, P_ON_E,\r\n   DIRECT );\r\novenPID.SetOutputLimits(0,100);\r\n"
           "ovenPID.SetSampleTime(1000);\r\n", 4.5, 4.5 / 0.03, 12.0 / 4.5, 1.0)
    yield ("escaped by a forum", "PID myPID(&amp;Input, &amp;Output, &amp;Setpoint, 2.5f, 0.1, 3, DIRECT);\nmyPID.SetOutputLimits(0, 1023);\n",
           100.0 * 2.5 / 1023, 25.0, 1.2, 0.1)
    yield ("an object made by new", "PID *heater = new PID(&t, &u, &sp, 3.0, 0.2, 0.0, DIRECT);\nheater->SetOutputLimits(0, 255);", *of_255(3.0, 0.2, 0.0), 0.1)
    yield ("a limit that is no usual scale", pid + "myPID.SetOutputLimits(0, 200);\n", 100.0 * 2 / 250, 0.4, 0.5, 0.1,
           Answer("const double Full =", text=pid + "myPID.SetOutputLimits(0, 200);\nconst double Full = 250;\n"))
    other = "PID bedPID(&bIn, &bOut, &bSet, 9, 9, 9, DIRECT);\n"
    yield "two heaters", pid + other, *of_255(2, 5, 1), 0.1, Answer("2 constructors", text=pid)
    adaptive = "void loop() {\n  if (gap < 10) myPID.SetTunings(1, 0.05, 0.25);\n  else myPID.SetTunings(4, 0.2, 1);\n  analogWrite(3, Output); }\n"
    yield ("adaptive example", pid + adaptive, *of_255(1, 0.05, 0.25), 0.1, Answer("in force", text=pid.replace("2, 5, 1", "1, 0.05, 0.25") + analog))
    yield ("a gain that changes", "double Kp = 2;\n" + pid.replace("2,", "Kp,") + "void loop() { Kp = 3; }", *of_255(2, 5, 1), 0.1,
           Answer("2 and 3", text="double Kp = 2;\n" + pid.replace("2,", "Kp,")))


def _simple_pid():
    yield ("attribute (0, 1)", "from simple_pid import PID\npid = PID(1, 0.1, 0.05, setpoint=1)\npid.output_limits = (0, 1)\npid.sample_time = 0.5\n",
           100.0, 10.0, 0.05, 0.5)
    yield "keywords (0, 255)", "pid = PID(Kp=5, Ki=0.01, Kd=0.1, setpoint=60, output_limits=(0, 255))\n", 100 * 5 / 255, 500.0, 0.02, 1.0, None, 1.0
    yield "positional, all of them", "PID(4, 0.02, 8, 60, 2.0, (0, 100))", 4.0, 200.0, 2.0, 2.0
    yield ("a console", ">>> from simple_pid import PID\n>>> pid = PID(2.0, 0.1, 0.0,\n...     setpoint=60)\n>>> pid.output_limits = (0, 100)\n"
           ">>> pid.sample_time = 1\n", 2.0, 20.0, 0.0, 1.0)
    yield "tunings", "pid = PID()\npid.tunings = (3.0, 0.06, 6.0)\npid.output_limits = (0, 100)\npid.sample_time = 1", 3.0, 50.0, 2.0, 1.0
    yield ("a class", "class Oven:\n    def __init__(self):\n        self.kp, self.ki, self.kd = 2.0, 0.05, 10\n        self.pid = PID(self.kp, self.ki, self.kd, "
           "setpoint=180)\n        self.pid.output_limits = (0, 100)\n        self.pid.sample_time = 2\n", 2.0, 40.0, 5.0, 2.0)
    yield ("a loop that sleeps", "pid = PID(10, 0.2, 5, setpoint=65, output_limits=(0, 1))\nwhile True:\n    heater.value = pid(read())\n"
           "    time.sleep(2)\n", 1000.0, 50.0, 0.5, 2.0)
    yield ("lines among prose", "Hi, my sous vide overshoots, this is it:\n    pid = PID(8, 0.02, 40, setpoint=56)\n    pid.output_limits = (0, 100)   # %\n"
           "    pid.sample_time = 5\nwhat's wrong?", 8.0, 400.0, 5.0, 5.0)
    yield ("README's 0 to 10", "pid = PID(1, 0.1, 0.05, output_limits=(0, 10))", 10.0, 10.0, 0.05, 1.0,
           Answer("FULL = 10", text="pid = PID(1, 0.1, 0.05, output_limits=(0, 10))\nFULL = 10"), 1.0)
    yield ("no limits", "pid = PID(1, 0.1, 0.05)", 1.0, 10.0, 0.05, 1.0,
           Answer("pid.output_limits = (0, 100)", text="pid = PID(1, 0.1, 0.05)\npid.output_limits = (0, 100)"), 1.0)
    yield "no interval", "pid = PID(1, 0.1, 0.05, output_limits=(0, 100))", 1.0, 10.0, 0.05, 3.0, Answer("--called-every", called_every=3.0)
    either = "pid = PID(1, 0.1, 0.05, output_limits=(0, 100))\nif far:\n    pid.tunings = (4, 0.2, 1)\nelse:\n    pid.tunings = (1, 0.05, 0.25)\n"
    yield "gains under a condition", either, 4.0, 20.0, 0.25, 1.0, Answer("only what is in force", text="PID(4, .2, 1, output_limits=(0, 100))"), 1.0


def _marlin():
    stock = of_255(22.2, 1.08, 114.0)
    yield "OctoPrint's terminal", "Send: M503\nRecv: echo:; Hotend PID:\nRecv: echo:  M301 P22.20 I1.08 D114.00\nRecv: ok\n", *stock
    yield ("OctoPrint's serial.log", "2021-03-04 12:34:56,789 - Send: N5 M503*34\n2021-03-04 12:34:56,801 - Recv: echo:  M301 P22.20 I1.08 D114.00\n"
           "2021-03-04 12:34:56,803 - Recv: ok P15 B3\n", *stock)
    cycles = (" bias: 92 d: 92 min: 196.56 max: 203.75\n bias: 95 d: 95 min: 196.5 max: 203.7 Ku: 32.59 Tu: 54.92\n Classic PID\n Kp: 19.56 Ki: 0.71 Kd: 134.26\n"
              " bias: 95 d: 95 min: 196.5 max: 203.7 Ku: 34.2 Tu: 55.0\n Classic PID\n Kp: 20.56 Ki: 0.75 Kd: 130.26\n")
    yield "pronterface, M303 of two cycles", ">>> M303 E0 S200 C8\nSENDING:M303 E0 S200 C8\n" + cycles + "PID Autotune finished!\n", *of_255(20.56, 0.75, 130.26)
    yield ("an older M303", "Recv:  Clasic PID \nRecv:  Kp: 19.56\nRecv:  Ki: 0.71\nRecv:  Kd: 134.26\nRecv:  Clasic PID \nRecv:  Kp: 20.56\nRecv:  Ki: 0.75\n"
           "Recv:  Kd: 130.26\nRecv: PID Autotune finished! Put the last Kp, Ki and Kd constants from above into Configuration.h\n", *of_255(20.56, 0.75, 130.26))
    yield "Repetier-Host", "< 17:50:26: N12 M503*32\n> 17:50:26: echo:PID settings:\n> 17:50:26: echo:   M301 P22.20 I1.08 D114.00\n", *stock
    yield "a serial monitor", "12:34:56.789 -> echo:Hotend PID:\n12:34:56.790 -> echo:  M301 P22.20 I1.08 D114.00\n", *stock
    yield "the bed alone", "[12:34:56] Recv: echo:  M304 P462.10 I85.47 D624.59\n", *of_255(462.10, 85.47, 624.59)
    yield "the answer to M301", "SENDING:M301\necho: p:22.20 i:1.08 d:114.00\nok\n", *stock
    yield "sent by a host", "Send: N3 M301 P22.20 I1.08 D114.00*83\nSend: M500\n", *stock
    yield ("Configuration.h", "#if ENABLED(PIDTEMP)\n  #define PID_K1 0.95\n  #define DEFAULT_Kp  22.20\n  #define DEFAULT_Ki   1.08\n"
           "  #define DEFAULT_Kd 114.00\n#endif\n", *stock)
    both = "echo:  M301 P22.20 I1.08 D114.00\necho:  M304 P462.10 I85.47 D624.59\n"
    yield "two heaters in one dump", both, *of_255(462.10, 85.47, 624.59), None, Answer("--assume heater=bed", heater="bed")
    two = "echo:  M301 E0 P22.20 I1.08 D114.00\necho:  M301 E1 P30.00 I2.00 D90.00\n"
    yield "two hot ends", two, *stock, None, Answer("leave out the lines of the others", text=two.splitlines()[0])
    yield "cut in a cycle", cycles.rpartition(" Ki")[0], *of_255(20.56, 0.75, 130.26), None, Answer("Ki", text=cycles)
    yield "commas", "M301 P22,20 I1,08 D114,00", *stock, None, Answer("a number", text="M301 P22.20 I1.08 D114.00")


def _pid_compact():
    yield "three values", "Gain = 2.5\nTi = 20.0 s\nTd = 5.0 s\n", 2.5, 20.0, 5.0, 1.0
    yield ("the parameter page", "Proportional gain: 2.5\nIntegral action time: 20.0 s\nDerivative action time: 5.0 s\nDerivative delay coefficient: 0.2\n"
           "Proportional action weighting: 1.0\nDerivative action weighting: 1.0\nSampling time of PID algorithm: 0.5 s\n", 2.5, 20.0, 5.0, 0.5)
    yield ("in German", "Meine Werte:\nProportionalverstärkung 2,5\nIntegrationszeit 20,0 s\nDifferenzierzeit 5,0 s\nAbtastzeit PID-Algorithmus 0,5 s\nDanke!", 2.5, 20.0, 5.0, 0.5)
    yield "one line", "Gain=2.5, Ti=1.5 min, Td=500ms", 2.5, 90.0, 0.5, 1.0
    yield ("whole tags", '"PID_Compact_1".Retain.CtrlParams.Gain := 2.5;\n"PID_Compact_1".Retain.CtrlParams.Ti := 20.0;\n'
           '"PID_Compact_1".Retain.CtrlParams.Td := 5.0;\n', 2.5, 20.0, 5.0, 1.0)
    yield ("a watch table", '"Oven".Retain.CtrlParams.Gain\tFloating-point number\t2.5\n"Oven".Retain.CtrlParams.Ti\tFloating-point number\t20.0\n', 2.5, 20.0, 0.0, 1.0)
    yield "inverted", "Gain 2.5\nTi 20\nInvertControl TRUE\n", -2.5, 20.0, 0.0, 1.0
    yield "a backup besides", "CtrlParamsBackUp.Gain = 9.0\nRetain.CtrlParams.Gain = 2.5\nRetain.CtrlParams.Ti = 20.0\nmore or less", 2.5, 20.0, 0.0, 1.0
    yield "no Ti", "Gain = 2.5", 2.5, 20.0, 0.0, 1.0, Answer("Ti = 20 s", text="Gain = 2.5\nTi = 20 s")
    yield "the parallel form", "Kp 2.5 Ki 0.125 Kd 12.5", 2.5, 20.0, 5.0, 1.0, Answer("Ti is Kp/Ki", text="Kp 2.5, Ti 20, Td 5")
    yield "a comma that may part thousands", "Gain 2.5\nTi 1,200 s", 2.5, 1200.0, 0.0, 1.0, Answer("fraction after a point", text="Gain 2.5\nTi 1200 s")
    yield ("names of V1", "sRet.r_Ctrl_Gain := 2.5;\nsRet.r_Ctrl_Ti := 20.0;", 2.5, 20.0, 0.0, 1.0,
           Answer("Retain.CtrlParams", text="Retain.CtrlParams.Gain := 2.5;\nRetain.CtrlParams.Ti := 20.0;"))


def _pid_temp():
    yield "whole tags", '"PID_Temp_1".Retain.CtrlParams.Heat.Gain := 2.5;\n"PID_Temp_1".Retain.CtrlParams.Heat.Ti := 20.0;', 2.5, 20.0, 0.0, 1.0
    yield "a thread", "PID_Temp: Heat.Gain = 2.5, Heat.Ti = 20 s\nCool.Gain = 7 (not used)", 2.5, 20.0, 0.0, 1.0


def _s7_200():
    yield "the wizard's page", "Loop Gain: 2.00\nSample Time: 1.00 s\nIntegral Time: 10.00 min\nDerivative Time: 0.50 min", 2.0, 600.0, 30.0, 1.0
    yield "its page without units", "Gain 2.0\nSample Time 1.0\nIntegral Time 10.0\nDerivative Time 0.0\n", 2.0, 600.0, 0.0, 1.0
    yield ("its symbols in a chart", "PID0_Gain\tFloating Point\t2.0\nPID0_SampleTime\tFloating Point\t1.0\nPID0_I_Time\tFloating Point\t10.0\n"
           "PID0_D_Time\tFloating Point\t0.0\n", 2.0, 600.0, 0.0, 1.0)
    yield ("its data block", "//PID0_DATA\nVD0 0.0 //Process Variable\nVD4 0.5 //Loop Setpoint\nVD12 2.0 //Loop Gain\nVD16 1.0 //Sample Time\n"
           "VD20 10.0 //Integral Time\nVD24 0.25 //Derivative Time\n", 2.0, 600.0, 15.0, 1.0)
    yield "seconds", "Gain = 2, sample time = 500 ms, integral time = 600 s, derivative time = 0 s", 2.0, 600.0, 0.0, 0.5
    yield "commas, in German", "Verstärkung 2,0\nAbtastzeit 1,0 s\nNachstellzeit 10,0 min\nVorhaltezeit 0,0 min", 2.0, 600.0, 0.0, 1.0
    yield "no I part", "Gain 2.0\nSample Time 1.0 s\nIntegral Time INF\nDerivative Time 0.0 min", 2.0, float("inf"), 0.0, 1.0
    yield "the loop table", "VD112 2.0\nVD116 1.0\nVD120 10.0\nVD124 0.0\n", 2.0, 600.0, 0.0, 1.0, None, 1.0
    yield ("no sample time", "Gain 2.0\nIntegral Time 10 min\nDerivative Time 0 min", 2.0, 600.0, 0.0, 2.0, Answer("--called-every", called_every=2.0))


def _fb41():
    call = ('CALL  "CONT_C" , DB41\n COM_RST :=\n MAN_ON  :=M0.0\n PVPER_ON:=FALSE\n P_SEL   :=TRUE\n I_SEL   :=TRUE\n INT_HOLD:=\n D_SEL   :=FALSE\n'
            " CYCLE   :=T#500MS\n SP_INT  :=MD20\n PV_IN   :=MD24\n PV_PER  :=\n GAIN    :=2.500000e+000\n TI      :=T#1M30S\n TD      :=\n LMN     :=MD28\n")
    yield "a call that reads PV_IN", call, *of_cont_c(2.5, 90.0, 0.5), 0.5, None, 0.5
    yield "a call in SCL", "CONT_C.DB41(GAIN := 2.5, SP_INT := 60.0, TI := T#20s, TD := T#5s, D_SEL := TRUE, CYCLE := T#1s);", *of_cont_c(2.5, 20.0, 1.0, 5.0), 1.0, None, 1.0
    yield "a list", "GAIN 2.5\nTI 20 s\nTD 5 s\nD_SEL TRUE\nCYCLE 1 s", *of_cont_c(2.5, 20.0, 1.0, 5.0), 1.0, None, 1.0
    # 2 °C per percent: 0…200 °C on 0…100 %, of a sensor of 0…100 °C: K is GAIN·2·100/100
    yield "PV_PER with PV_FAC", "GAIN = 2.5\nTI = T#20s\nPVPER_ON = TRUE\nPV_FAC = 2.0\nD_SEL = FALSE", *of_cont_c(2 * 2.5, 20.0, 1.0), 1.0, None, 1.0
    yield ("no word on D", "GAIN = 2.5\nTI = T#20s\nTD = T#5s", *of_cont_c(2.5, 20.0, 1.0), 1.0,
           Answer("D_SEL := FALSE", text="GAIN = 2.5\nTI = T#20s\nTD = T#5s\nD_SEL := FALSE"), 1.0)
    yield "a time without a unit", "GAIN = 2.5\nTI = 20", *of_cont_c(2.5, 20.0, 1.0), 1.0, Answer("such as 20 s", text="GAIN = 2.5\nTI = 20 s"), 1.0
    yield ("PV_PER wired, the switch unsaid", "GAIN := 2.5, TI := T#20s, PV_PER := PIW256", *of_cont_c(2.5, 20.0, 1.0), 1.0,
           Answer("PVPER_ON := TRUE", text="GAIN := 2.5, TI := T#20s\nPVPER_ON := TRUE"), 1.0)
    yield "no interval", "GAIN = 2.5\nTI = T#20s\nCYCLE = T#1s", *of_cont_c(2.5, 20.0, 1.0), 1.0, Answer("--called-every", called_every=1.0)


def _klipper():
    extruder = "[extruder]\nheater_pin: PB4\ncontrol: pid\npid_Kp: 22.2\npid_Ki: 1.08\npid_Kd: 114\nmin_temp: 0\n"
    yield "printer.cfg", extruder, *of_255(22.2, 1.08, 114.0), 0.3
    yield "PID_CALIBRATE in OctoPrint", "Recv: // PID parameters: pid_Kp=22.200 pid_Ki=1.080 pid_Kd=114.000\n", *of_255(22.2, 1.08, 114.0), 0.3
    bed = "[heater_bed]\ncontrol = pid\npid_Kp = 54.027\npid_Ki = 0.770\npid_Kd = 948.182\n"
    yield "two heaters", extruder + bed, *of_255(54.027, 0.77, 948.182), 0.3, Answer("--assume heater=heater_bed", heater="heater_bed")


def _esphome():
    yaml = "climate:\n  - platform: pid\n    control_parameters:\n      kp: 0.5\n      ki: 0.005\n      kd: 12.5\n"
    yield "YAML", yaml + "sensor:\n  - platform: dallas_temp\n    update_interval: 5s\n", 50.0, 100.0, 25.0, 5.0
    yield "YAML without the sensor", yaml, 50.0, 100.0, 25.0, 5.0, Answer("--called-every", called_every=5.0)


MAKERS = {"arduino-pid": _arduino, "simple-pid": _simple_pid, "marlin": _marlin, "pid-compact": _pid_compact, "pid-temp": _pid_temp,
          "s7-200-pid": _s7_200, "fb41": _fb41, "klipper": _klipper, "esphome": _esphome}


def _case(target, name, text, gain, tn, tv, ta=None, answer=None, called_every=None):
    return Pasted(name, target, text, gain, tn, tv, ta, called_every, answer)


CASES = [_case(target, *row) for target, maker in MAKERS.items() for row in maker()]


def decoded(case, text=None, called_every=None, heater=None):
    """Return the machine and its design; raise HeatertuneError for a question."""
    controller = controller_for(case.target)
    machine = read_machine(
        controller, (case.text if text is None else text).encode(), sample_time_s=called_every or case.called_every, scaling=Scaling(),
        source="paste.txt", stated={} if heater is None else {"heater": heater})
    return machine, realised_design(controller, machine.words)


def is_right(case, machine, design):
    """Return whether the numbers are those of the text, in single precision at the worst."""
    if design is None:
        return False
    pairs = [(design.gain_pct_per_degC, case.gain), (design.integral_time_s, case.tn), (design.derivative_time_s, case.tv),
             (machine.words.sample_time_s, case.ta or machine.words.sample_time_s)]
    return all(a == b or abs(a - b) <= 1e-6 * abs(b) for a, b in pairs)


def judge(case):
    """Return how a text is read, and what was said."""
    try:
        machine, design = decoded(case)
    except HeatertuneError as question:
        if case.answer is None or case.answer.says not in str(question):
            return STUCK, str(question)
        try:
            answered = decoded(case, case.answer.text, case.answer.called_every, case.answer.heater)
        except HeatertuneError as second:
            return STUCK, f"{question}; then {second}"
        return (ASKED if is_right(case, *answered) else WRONG), str(question)
    return (RIGHT if is_right(case, machine, design) else WRONG), f"{design}"


def lines_left_out(case):
    """Yield the text without one of its lines each."""
    lines = case.text.splitlines(keepends=True)
    for number in range(len(lines)):
        yield "".join(lines[:number] + lines[number + 1 :])


def main():
    """Print the table."""
    results = [(case, *judge(case)) for case in CASES]
    for case, found, said in results:
        print(f"{case.target:12s} {case.name:34s} {found}" + ("" if found == RIGHT else f"  {said}"))
    print({kind: sum(found == kind for _, found, _ in results) for kind in (RIGHT, ASKED, WRONG, STUCK)}, "of", len(results))


if __name__ == "__main__":
    main()
