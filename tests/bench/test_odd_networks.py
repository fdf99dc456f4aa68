"""Kinds of zones and logs beyond `networks`: identified whole, and no PASS that the judge breaks."""

import shutil

import numpy as np
import pytest

from heatertune.zones import fit_network
from tests.bench.odd_networks import KINDS, case, heaters, log_of


def drawn_case(kind, seed):
    """Return the true heaters of a case and their log."""
    random = np.random.default_rng([seed, KINDS.index(kind)])
    network = heaters(kind, random)
    return network, log_of(kind, network, random)


@pytest.mark.long(seconds=15)
def test_a_ring_of_zones_in_any_order_is_identified_from_all_couplings_at_once():
    # a chain in the order of the list, widened by one coupling at a time, ended with "the log does not show the heater"
    network, log = drawn_case("ring", 1)
    fitted = fit_network(log)
    assert not fitted.findings
    assert set(zip(*map(tuple, np.nonzero(network.exchange)), strict=True)) <= set(fitted.layout.pairs)
    intervals = [fitted.ci95[f"exchange {log.zones[i]}-{log.zones[j]}"] for i, j in fitted.layout.pairs]
    inside = sum(each.low <= network.exchange[pair] <= each.high for each, pair in zip(intervals, fitted.layout.pairs, strict=True))
    assert inside >= 0.9 * len(intervals)  # 95 % intervals


@pytest.mark.long(seconds=40)
def test_the_shares_of_five_heaters_on_one_supply_are_found():
    network, log = drawn_case("five-on-supply", 2)
    fitted = fit_network(log)
    assert {each.name for each in fitted.findings} == {"shared-supply"}
    assert np.abs(np.array(fitted.network.supply_shares) - network.supply_shares).max() < 1e-3
    assert np.abs(fitted.network.exchange - network.exchange).max() < 0.01


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler, cc")
@pytest.mark.parametrize("kind", ["shield", "together"])
@pytest.mark.long(seconds=25)
def test_no_pass_of_an_odd_kind_is_false(kind):
    found = case(kind, 2)
    assert (found.verdict, found.complaint) == ("PASS", ""), found.summary
