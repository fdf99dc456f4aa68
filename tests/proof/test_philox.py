"""Philox4x32-10 against the known answers that its authors give, and what is made of its words."""

import numpy as np
import pytest

from heatertune.proof.philox import normal, uniform, words

# Random123 (J. K. Salmon et al., SC11), file kat_vectors, lines "philox4x32 10": counter, key, answer
KNOWN = [
    ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
]


def _words(text):
    return [np.array([int(word, 16)], dtype=np.uint64) for word in text.split()]


@pytest.mark.parametrize(("counter", "key", "answer"), KNOWN)
def test_words_are_those_its_authors_know(counter, key, answer):
    assert [f"{int(word[0]):08x}" for word in words(_words(counter), _words(key))] == answer.split()


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
