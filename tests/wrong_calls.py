"""Forty calls that a type checker has to refuse, one in each line that ends in `# wrong`; no test runs them."""

import heatertune as ht

model = ht.model_by_hand(ht.Fopdt(gain_degC_per_pct=0.4, time_constant_s=170.0, dead_time_s=15.0, ambient_degC=20.0))
design = ht.tune(model, structure="PI", ms=1.4, sample_time_s="auto", range_degC=(0.0, 200.0), target="s5-ob251")
words = ht.encode(design, "s5-ob251", model, range_degC=(0.0, 200.0), words_by="optimum")
proof = ht.prove(words, model, setpoint_degC=(50.0, 60.0), pwm_rule="burst", limit="overshoot=3degC")
log = ht.read_log("table3", temperature_unit="degC", errata=True)
ht.fit("table3", ambient_degC=22.0, time_unit="s", thorough=True)
ht.design("table3", target="s5-ob251", structure="pid", setpoint_ramp="auto", switch_kind="ssr", refined=True, out="out")

ht.read_log("table3", temperature_units="degC")  # wrong
ht.read_log("table3", temperature_unit="C")  # wrong
ht.read_log("table3", time_unit="seconds")  # wrong
ht.read_log("table3", skip_rows="3")  # wrong
ht.read_log("table3", power_levels=4.0)  # wrong
ht.fit("table3", ambient=22.0)  # wrong
ht.fit("table3", ambient_degC="22")  # wrong
ht.fit("table3", dead_time_at_most=30.0)  # wrong
ht.fit("table3", cooler="yes")  # wrong
ht.fit("table3", until_s="10 min")  # wrong
ht.fit("table3", thorough="no")  # wrong
ht.fit_together([log], power_before="0")  # wrong
ht.fit_known(log, words, setpoint="50")  # wrong
ht.validate(model, log, least_fit=80.0)  # wrong
ht.validate(model, log, least_fit_pct="80 %")  # wrong
ht.tune(model, structur="pi")  # wrong
ht.tune(model, structure="ip")  # wrong
ht.tune(model, structure=3)  # wrong
ht.tune(model, objective="speed")  # wrong
ht.tune(model, ms="1.4")  # wrong
ht.tune(model, robust="p99")  # wrong
ht.tune(model, setpoint_degC=50.0)  # wrong
ht.tune(model, sample_time_s="1 s")  # wrong
ht.tune(model, target=5)  # wrong
ht.tune(design)  # wrong
ht.encode(model, "s5-ob251")  # wrong
ht.encode(design, "s5-ob251", model, words_by="best")  # wrong
ht.encode(design, "s5-ob251", model, range=(0.0, 200.0))  # wrong
ht.encode(design, "s5-ob251", model, input="4-20 mA")  # wrong
ht.prove(design, model)  # wrong
ht.prove(words, model, setpoint="50")  # wrong
ht.prove(words, model, setpoint_degC="50 °C")  # wrong
ht.prove(words, model, pwm_rule="pulse-gen")  # wrong
ht.prove(words, model, noise=0.1)  # wrong
ht.prove(words, model, accept=1)  # wrong
ht.prove(words, model, switches=["heater"])  # wrong
ht.prove(words, model, interlock="fan")  # wrong
ht.design("table3", targt="weg")  # wrong
ht.design("table3", target="weg", switch_kind="triac")  # wrong
ht.design("table3", target="weg", boost="yes")  # wrong
