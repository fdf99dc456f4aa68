"""The witness of Marlin's PID against arithmetic on paper, from its stock values Kp 22.20, Ki 1.08, Kd 114."""

import pytest
from tests.witness.marlin import MarlinPid, SoftPwm, interval

STOCK = {"Kp": 22.20, "Ki": 1.08, "Kd": 114.0}


def test_the_interval_is_sixteen_samples_of_all_states():
    assert float(interval()) == pytest.approx(0.16)
    assert float(interval(states=16)) == pytest.approx(0.256)
    assert float(interval(timer_hz=976.5625)) == pytest.approx(0.16384)


def test_beyond_ten_degrees_it_is_all_or_nothing_and_without_a_target_nothing():
    pid = MarlinPid(**STOCK)
    assert [pid.amount(200, t) for t in (20, 189.5, 210.5)] == [127, 127, 0]
    assert pid.amount(0, 5) == 0
    assert pid.reset


def test_the_first_scan_inside_the_window_takes_the_rise_since_the_last_scan():
    pid = MarlinPid(**STOCK)
    assert pid.amount(200, 189.9) == 127
    assert float(pid.output(200, 190.1)) == pytest.approx(22.2 * 9.9 + 1.08 * 0.16 * 9.9 - 0.05 * 114 / 0.16 * 0.2, rel=1e-5)


def test_in_releases_of_two_years_the_first_scan_inside_takes_it_since_the_last_one_inside():
    pid = MarlinPid(**STOCK, inside=True)
    pid.output(200, 100)
    assert pid.output(200, 195) == 0.0  # p 111, i 0.864; d = 0.05·114/0.16·(0 − 195) = −6947: from zero at power on
    assert float(pid.d) == pytest.approx(-0.05 * 114 / 0.16 * 195, rel=1e-6)
    outputs = [float(pid.output(200, 195)) for _ in range(100)]
    first = next(k for k, each in enumerate(outputs, start=1) if each > 0)
    # off until 0.95ⁿ·6947 < 111 + 0.864·(n + 1): 0.95⁷⁰·6947 = 191.7 > 172.3, 0.95⁷³·6947 = 164.4 < 174.9
    assert 70 < first <= 73  # 11 s
    assert 6946.9 * 0.95**first < 111 + 0.8640 * (first + 1)
    assert 6946.9 * 0.95 ** (first - 1) >= 111 + 0.8640 * first


def test_inside_the_window_it_is_the_sum_of_three_parts():
    pid = MarlinPid(**STOCK)
    pid.last, pid.reset = pid.last + 195, False
    assert float(pid.output(200, 195.2)) == pytest.approx(22.2 * 4.8 + 1.08 * 0.16 * 4.8 - 0.05 * 114 / 0.16 * 0.2, rel=1e-5)
    d = -0.05 * 114 / 0.16 * 0.2
    assert float(pid.output(200, 195.2)) == pytest.approx(22.2 * 4.8 + 1.08 * 0.16 * 9.6 + 0.95 * d, rel=1e-5)


def test_the_sum_stays_between_nothing_and_full_power():
    pid = MarlinPid(Kp=0.0, Ki=1.0, Kd=0.0)
    assert [pid.amount(200, 191) for _ in range(1000)][-1] == 127  # (int) 255 >> 1
    assert float(pid.sum) == pytest.approx(255 / 0.16, rel=1e-6)
    for _ in range(2000):
        pid.amount(200, 209)
    assert pid.sum == 0.0


def test_half_of_the_whole_number_is_the_amount_and_a_window_reset_takes_the_sum_away():
    pid = MarlinPid(Kp=25.0, Ki=0.0, Kd=0.0)
    assert [pid.amount(200, 200 - e) for e in (0.03, 0.04, 0.07, 0.08, 0.12)] == [0, 0, 0, 1, 1]  # 0.75, 1, 1.75, 2, 3
    pid = MarlinPid(Kp=0.0, Ki=1.0, Kd=0.0)
    for _ in range(10):
        pid.output(200, 195)
    pid.output(200, 100)
    assert float(pid.output(200, 195)) == pytest.approx(0.8, rel=1e-6)


@pytest.mark.parametrize("amount", [0, 1, 64, 126, 127])
def test_a_period_of_127_ticks_is_on_for_the_amount(amount):
    pwm = SoftPwm()
    ticks = [pwm.tick(amount) for _ in range(127 * 6)][126:-1]
    assert ticks[:127] == [k < amount for k in range(127)]
    assert sum(ticks[: 127 * 5]) == 5 * amount
