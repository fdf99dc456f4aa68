"""Philox4x32-10 against the known answers that its authors give, and what is made of its words."""

import numpy as np
import pytest

from heatertune.compiled import dispatch as machine
from heatertune.proof.monte_carlo.draw import BLOCK, STREAM, block_of, normal, normals, uniform, words

# Random123 (J. K. Salmon et al., SC11), file kat_vectors, lines "philox4x32 10": counter, key, answer
KNOWN = [
    ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
]


@pytest.mark.parametrize(("counter", "key", "answer"), KNOWN)
def test_words_are_those_its_authors_know(counter, key, answer):
    for kind in (int, lambda word: np.array([word])):
        given = [tuple(kind(int(word, 16)) for word in text.split()) for text in (counter, key)]
        assert [f"{int(np.ravel(word)[0]):08x}" for word in words(*given)] == answer.split()


@pytest.mark.parametrize("seed", [0, 2**64 + 2**33 + 5])
def test_noise_is_box_and_mullers_of_the_words_compiled_and_plain(seed, monkeypatch):
    """√(−2·ln u) by cos and sin of the angle by NumPy's own functions, u and the angle of the words known above."""
    call = np.arange(96)
    key = [np.array([seed >> shift & 0xFFFFFFFF]) for shift in (0, 32, 64, 96)]
    even = [(word + 0.5) / 2.0**32 for word in words((call, np.array([STREAM]), *key[2:]), tuple(key[:2]))]
    radius, angle = np.sqrt(-2.0 * np.log(even[::2])), 2.0 * np.pi * np.array(even[1::2]) - np.pi / 4.0
    expected = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1).reshape(4, 3, 32).transpose(1, 0, 2)
    found = []
    for way in (False, True):
        monkeypatch.setattr(machine, "_decided", [way])
        found.append(normals([seed + 1, seed], 300)[1])
    assert np.array_equal(*found)
    assert found[0][BLOCK:2 * BLOCK].tolist() == block_of(seed, 1), "as a served PLC takes it"
    assert found[0] == pytest.approx(expected.ravel()[:300], abs=1e-12)


def test_noise_is_normal_and_of_each_scan_its_own():
    drawn = normals(range(100), 2000)
    moments = [np.mean(drawn**power) for power in (1, 2, 3, 4)]
    assert moments == pytest.approx([0.0, 1.0, 0.0, 3.0], abs=0.03)
    assert np.mean(np.abs(drawn) < 1.959964) == pytest.approx(0.95, abs=0.002)
    assert np.abs(np.corrcoef(drawn) - np.eye(100)).max() < 0.12
    for apart in (1, 32, 64, 96, 128):
        assert abs(np.mean(drawn[:, apart:] * drawn[:, :-apart])) < 0.01


def test_numbers_are_uniform_and_normal():
    even = uniform(range(20_000), 6)
    assert even.shape == (20_000, 6)
    assert 0.0 < even.min() < even.max() < 1.0
    for drawn, mean, deviation in ((even, 0.5, 12.0**-0.5), (normal(even), 0.0, 1.0)):
        assert np.mean(drawn, axis=0) == pytest.approx(np.full(6, mean), abs=0.025)
        assert np.std(drawn, axis=0) == pytest.approx(np.full(6, deviation), rel=0.02)
        assert np.abs(np.corrcoef(drawn.T) - np.eye(6)).max() < 0.03
    assert np.mean(np.abs(normal(even)) < 1.959964) == pytest.approx(0.95, abs=0.003)


def test_a_number_depends_on_its_seed_and_place_alone():
    assert np.array_equal(uniform([5], 7)[0], uniform(range(9), 7)[5])
    assert np.array_equal(uniform([5], 7)[0, :3], uniform([5], 3)[0])
    assert len(set(uniform([1, 1 + 2**32, 1 + 2**64, 1 + 2**96], 1)[:, 0])) == 4
