from __future__ import annotations

import numpy as np

from navfuse.simulation.streams import Streams


def test_streams_are_the_children_of_the_generator_whatever_the_order_of_asking():
    spawned = dict(zip("abc", np.random.default_rng(5).spawn(3), strict=True))
    streams = Streams(np.random.default_rng(5), "abc")
    for name in "cab":
        assert np.array_equal(streams[name].standard_normal(4), spawned[name].standard_normal(4))


def test_a_stream_goes_on_and_the_generator_is_advanced_alike():
    rng, plain = np.random.default_rng(6), np.random.default_rng(6)
    streams, spawned = Streams(rng, ("x", "y")), plain.spawn(2)
    first, second = streams["x"].standard_normal(2), streams["x"].standard_normal(2)
    assert np.array_equal(np.concatenate([first, second]), spawned[0].standard_normal(4))
    assert np.array_equal(rng.spawn(1)[0].standard_normal(3), plain.spawn(1)[0].standard_normal(3))


def test_normal_draws_have_their_deviations_and_zeros_need_none():
    sd = np.array([1.0, 0.0, 3.0])
    draw = Streams(np.random.default_rng(7), ("x",)).normal("x", sd)
    assert np.array_equal(draw, sd * np.random.default_rng(7).spawn(1)[0].standard_normal(3))
    assert np.array_equal(Streams(np.random.default_rng(7), ("x",)).normal("x", np.zeros(3)), np.zeros(3))
