from __future__ import annotations

import dataclasses
import math
from dataclasses import replace

import numpy as np
import pytest

from navfuse.analysis.allan import StudySettings, error_model, identify, study
from navfuse.analysis.allan.precheck import check_channel, resolution, static_span
from navfuse.analysis.allan.recommend import BiasModel, bias_model
from navfuse.analysis.allan.settings import filter_settings, remarks
from navfuse.analysis.allan.spectra import autocorrelation, power_spectrum
from navfuse.analysis.allan.terms import gauss_markov_allan
from navfuse.data.logs import ImuLog
from navfuse.errors import ConfigError, InputError
from navfuse.imu.error_model import ImuErrorModel
from navfuse.io.static_record import Channel, StaticRecord
from navfuse.simulation import ImuSensorModel, measure_imu

RATE = 50.0
G = 9.80665


def still(n=20_000, seed=0, noise=(1e-3, 1e-2)):
    rng = np.random.default_rng(seed)
    channels = []
    for sensor, size in zip(("gyro", "accel"), noise, strict=True):
        for axis in "xyz":
            values = size * rng.standard_normal(n) - (G if (sensor, axis) == ("accel", "z") else 0.0)
            channels.append(Channel(f"{sensor} {axis}", sensor, values))
    return StaticRecord(tuple(channels), RATE, 100.0, "rates", None, "log.csv")


def pairs(record):
    return [(channel.sensor, channel.values) for channel in record.channels]


def test_a_record_at_rest_is_used_whole():
    record = still()
    assert static_span(pairs(record), RATE).windows == ()
    found = study(record, StudySettings(grid="octave"))
    assert found.warnings == ()
    assert found.span == 400.0
    assert found.start == 100.0
    assert found.white("gyro") == pytest.approx(1e-3 / math.sqrt(RATE), rel=0.02)
    assert found.gyro is None
    assert [axis.name for axis in found.of("accel")] == ["accel x", "accel y", "accel z"]


def test_motion_is_found_and_cut_off():
    record = still()
    record.channels[1].values[:3000] += 0.3 * np.sin(np.arange(3000) / 40.0)
    span = static_span(pairs(record), RATE)
    assert 2900 <= span.begin <= 3300
    assert span.end == 20_000
    found = study(record, StudySettings(grid="octave"))
    assert any("it moves for" in text and "only the longest part at rest" in text for text in found.warnings)
    with pytest.raises(InputError, match=r"it moves for 1\d\.\d % of the record.* cut the record with --from-s"):
        study(record, StudySettings(motion="refuse"))


def test_a_log_that_moves_is_refused():
    record = still()
    for channel in record.channels:
        channel.values[:] += 0.4 * np.sin(np.arange(20_000) / 70.0)
    with pytest.raises(InputError, match="Allan variance needs a sensor at rest"):
        study(record)
    alone = dataclasses.replace(record, channels=record.channels[:1])
    assert study(alone, StudySettings(motion="ignore", grid="octave", terms=("N",))).rest.moving == 0.0


def test_a_steady_rotation_is_motion():
    """The gyro scatters by 1e-3 rad/s / sqrt(100) in a window; eight times that, twice, is 1.1e-3 rad/s."""
    record = still()
    record.channels[2].values[:8000] += math.radians(10.0)
    span = static_span(pairs(record), RATE)
    assert 8000 <= span.begin <= 8300
    assert span.moving == pytest.approx(0.4, abs=0.02)
    assert span.windows[0][0] == 0
    longer = still()
    longer.channels[2].values[:12_000] += math.radians(10.0)
    with pytest.raises(InputError, match="it moves for 6.* Allan variance needs a sensor at rest"):
        study(longer)


def test_a_biased_sensor_that_is_touched_does_not_turn():
    record = still()
    for channel in record.channels[:3]:
        channel.values[:] += math.radians(1.0) + np.linspace(0.0, 2e-4, 20_000)
    record.channels[0].values[8000:8200] += math.radians(20.0)
    span = static_span(pairs(record), RATE)
    assert span.moving < 0.04
    assert 8200 <= span.begin <= 8500


def test_a_record_that_turns_throughout_is_asked_for_it():
    record = still()
    record.channels[2].values[:] += math.radians(10.0)
    found = study(record, StudySettings(grid="octave", terms=("N",)))
    assert any("the gyros show 10 deg/s on average: does it turn steadily" in text for text in found.warnings)


def test_shaking_is_told_but_not_cut_out():
    record = still()
    record.channels[3].values[5000:5300] += 0.1 * np.random.default_rng(1).standard_normal(300)
    found = study(record, StudySettings(grid="octave"))
    assert found.rest.end - found.rest.begin == 20_000
    assert any("noise stands out in" in text for text in found.warnings)


def test_slow_drift_is_not_motion():
    record = still()
    record.channels[0].values[:] += np.linspace(0.0, 0.02, 20_000)
    found = study(record, StudySettings(grid="octave"))
    assert found.rest.moving == 0.0
    assert any("gyro x: a straight line explains most" in text for text in found.warnings)
    assert found.of("gyro")[0].identification.term("R").present


def test_constant_channel():
    record = still()
    record.channels[2].values[:] = 0.1
    with pytest.raises(InputError, match="gyro z is constant: the channel is not connected, or stuck"):
        study(record)


def test_stuck_saturated_and_quantised():
    values = np.random.default_rng(3).standard_normal(20_000)
    plain = check_channel(values, RATE)
    assert (plain.constant, plain.step, plain.stuck, plain.saturated, plain.drifts) == (False, 0.0, None, 0, False)
    held = values.copy()
    held[4000:4200] = held[4000]
    assert check_channel(held, RATE).stuck == (4000, 4199)
    assert check_channel(np.clip(values, -2.0, 2.0), RATE).saturated > 500
    coarse = np.round(values / 0.3) * 0.3
    assert check_channel(coarse, RATE).step == pytest.approx(0.3)
    assert check_channel(coarse, RATE).saturated == 0
    assert resolution(values) == 0.0


def test_stuck_and_saturated_are_told():
    record = still()
    record.channels[0].values[4000:4200] = 1e-3
    record.channels[1].values[:] = np.clip(record.channels[1].values, -2e-3, 2e-3)
    texts = study(record, StudySettings(grid="octave")).warnings
    assert any("gyro x repeats one value 200 times, from 80 s" in text for text in texts)
    assert any(
        "gyro y" in text and "stand at the end of the range: it is saturated; its noise" in text for text in texts
    )


def test_stuck_samples_are_gaps():
    record, plain = still(), still()
    record.channels[0].values[4000:9000] = record.channels[0].values[4000]
    record.channels[0].values[12_000:12_100] = record.channels[0].values[12_000]
    plain.channels[0].values[4001:9000] = np.nan
    plain.channels[0].values[12_001:12_100] = np.nan
    found, wanted = study(record, StudySettings(grid="octave")), study(plain, StudySettings(grid="octave"))
    assert found.axes[0].check.held == ((4000, 8999), (12_000, 12_099))
    assert found.axes[0].missing == 4999 + 99
    assert found.axes[0].curves["oadev"].deviation == pytest.approx(wanted.axes[0].curves["oadev"].deviation, rel=1e-12)
    term, other = (one.axes[0].identification.term("N") for one in (found, wanted))
    assert (term.value, term.sigma) == pytest.approx((other.value, other.sigma), rel=1e-9)
    assert any("and 1 times more; repeated samples count as missing" in text for text in found.warnings)
    with pytest.raises(InputError, match="gyro x: 5098 samples are missing or stuck, the first 80.02 s"):
        study(record, StudySettings(gaps="refuse"))


def test_a_coarse_output_that_repeats_itself_is_kept():
    values = np.round(np.random.default_rng(0).standard_normal(20_000) * 0.5)
    values[5000:5400] = 0.0
    found = check_channel(values, RATE)
    assert found.stuck is not None
    assert found.stuck[0] <= 5000 < 5399 <= found.stuck[1]
    assert found.held == ()
    record = dataclasses.replace(still(), channels=(Channel("gyro x", "gyro", 1e-3 * values),))
    texts = study(record, StudySettings(grid="octave")).warnings
    assert any("it was stuck there, or its resolution is too coarse to tell" in text for text in texts)


def test_a_saturated_axis_is_kept_out_of_the_settings():
    record = still()
    for channel in record.channels[:2]:
        channel.values[:] = np.clip(channel.values, -1e-3, 1e-3)
    found = study(record, StudySettings(grid="octave"))
    assert [axis.check.clipped for axis in found.axes] == [True, True, False, False, False, False]
    assert found.white("gyro") == found.axes[2].identification.term("N").value
    assert "gyro: gyro x, gyro y saturated, which hides its noise: not used" in remarks(found)
    record.channels[2].values[:] = np.clip(record.channels[2].values, -1e-3, 1e-3)
    found = study(record, StudySettings(grid="octave"))
    assert math.isnan(found.white("gyro"))
    assert found.gyro is None
    assert filter_settings(found)[1] == ["vrw"]
    assert any(text.startswith("gyro: every axis is saturated, which hides its noise") for text in remarks(found))
    few = still()
    few.channels[0].values[:] = np.clip(few.channels[0].values, -3.4e-3, 3.4e-3)
    assert not study(few, StudySettings(grid="octave")).axes[0].check.clipped


def test_temperature():
    record = still()
    warm = StaticRecord(
        record.channels, RATE, 0.0, "rates", np.linspace(20.0, 28.0, 20_000), "log.csv", ("log.csv: a note",)
    )
    texts = study(warm, StudySettings(grid="octave")).warnings
    assert any("the temperature changes by 8 K" in text for text in texts)
    assert "log.csv: a note" in texts


def test_missing_samples():
    record = still()
    record.channels[0].values[7000:7010] = np.nan
    found = study(record, StudySettings(grid="octave"))
    assert found.of("gyro")[0].missing == 10
    assert found.of("gyro")[0].identification.span == pytest.approx(20_000 / RATE)
    assert found.of("gyro")[0].identification.filled == 10
    (text,) = found.warnings
    assert text.startswith("log.csv: gyro x: 10 samples are missing; the deviations average over the stretches between")
    assert text.endswith("all of the record, what is missing replaced by noise like that around it")
    with pytest.raises(InputError, match="gyro x: 10 samples are missing, the first 140 s"):
        study(record, StudySettings(gaps="refuse"))
    record.channels[0].values[9000:9200] = np.nan
    found = study(record, StudySettings(grid="octave"))
    assert (found.axes[0].identification.begin, found.axes[0].identification.filled) == (9200, 0)
    assert any("the noise terms come from 184 to 400 s, the longest stretch" in text for text in found.warnings)
    record.channels[0].values[15_000] = np.nan
    found = study(record, StudySettings(grid="octave"))
    assert (found.axes[0].identification.begin, found.axes[0].identification.filled) == (9200, 1)
    assert any("the longest part with short gaps only: 1 samples are replaced" in text for text in found.warnings)
    record.channels[0].values[::10] = np.nan
    with pytest.raises(InputError, match="log.csv: gyro x: 10.9 % of the samples are missing"):
        study(record, StudySettings(grid="octave"))


@pytest.mark.parametrize(
    ("settings", "error", "message"),
    [
        ({"kinds": ("avar",)}, ConfigError, "unknown deviation avar"),
        ({"kinds": ()}, ConfigError, "unknown deviation"),
        ({"level": 0.0}, ConfigError, "level = 0.0 must be a probability"),
        ({"horizon_s": 0.0}, ConfigError, "horizon = 0.0 must be"),
        ({"from_s": 500.0}, InputError, "the part from 500 to 400 s is not in the record, which is 400 s long"),
        ({"until_s": 10.0}, InputError, "500 samples are too short a record: at least 1000"),
        ({"longest_s": 300.0}, InputError, "an averaging time of 300 s needs a record of twice that; there are 400 s"),
    ],
)
def test_what_is_asked_for_in_vain(settings, error, message):
    with pytest.raises(error, match=message):
        study(still(), StudySettings(**settings))


def test_earth_rate_is_not_drift():
    record = still()
    before = study(record, StudySettings(grid="octave"))
    record.channels[2].values[:] += 7.292e-5
    after = study(record, StudySettings(grid="octave"))
    pair = [found.of("gyro")[2] for found in (before, after)]
    assert pair[1].mean - pair[0].mean == pytest.approx(7.292e-5)
    assert not pair[1].identification.term("R").present
    assert pair[1].curves["oadev"].deviation == pytest.approx(pair[0].curves["oadev"].deviation, rel=1e-9)


def test_a_gauss_markov_bias_is_recommended_as_it_is():
    tau = np.geomspace(1.0, 7200.0, 200)
    slow = [sd**2 * gauss_markov_allan(tau, 400.0) for sd in (1.0, 2.0, 3.0)]
    model = bias_model([*slow[:2], None], [1.0, 1.0, 1.0], tau, 3600.0)
    assert model is not None
    assert model.tau == pytest.approx(400.0, rel=0.06)
    assert model.sd == pytest.approx((1.0, 2.0, 0.0), rel=0.06)
    walk = bias_model([0.01 * tau / 3.0], [1.0], tau, 3600.0)
    assert walk is not None
    assert math.isinf(walk.tau)
    assert walk.walk[0] == pytest.approx(0.1, rel=1e-6)
    assert bias_model([None, None], [1.0, 1.0], tau, 3600.0) is None


def simulated(model, seconds, seed):
    time = np.arange(round(seconds * RATE)) / RATE
    log = ImuLog(time, np.zeros((time.size, 3)), np.tile([0.0, 0.0, -G], (time.size, 1)), "rates")
    log, _ = measure_imu(log, ImuSensorModel(model), np.random.default_rng(seed))
    channels = [Channel(f"{s} {a}", s, getattr(log, s)[:, k]) for s in ("gyro", "accel") for k, a in enumerate("xyz")]
    return StaticRecord(tuple(channels), RATE, 0.0, "rates", None, "simulated")


def test_round_trip_of_the_settings():
    """Analyse, simulate with the recommended settings, analyse again: N within 2 %, the biases within 20 % (median)."""
    truth = ImuErrorModel(arw=5e-5, vrw=1e-3, gyro_bias_walk=2e-6, accel_bias_walk=5e-5)
    first = error_model(study(simulated(truth, 4000.0, 1), StudySettings(grid="octave", terms=("N", "B", "K"))))
    assert first.arw == pytest.approx(truth.arw, rel=0.02)
    assert first.vrw == pytest.approx(truth.vrw, rel=0.02)
    assert math.isinf(first.gyro_bias_tau)
    again = error_model(study(simulated(first, 4000.0, 2), StudySettings(grid="octave", terms=("N", "B", "K"))))
    assert again.arw == pytest.approx(first.arw, rel=0.02)
    assert again.vrw == pytest.approx(first.vrw, rel=0.02)
    for name in ("gyro_bias_walk", "accel_bias_walk"):
        for model, source in ((first, truth), (again, first)):
            assert np.median(np.abs(model.axes(name) / source.axes(name) - 1.0)) < 0.2


def instability_round_trip(seconds, seeds):
    """Ratios of N, B and K of both sensors: found again over found first, medians over axes and seeds."""
    size = round(seconds * RATE)
    time = np.arange(size) / RATE
    level = ImuLog(time, np.zeros((size, 3)), np.tile([0.0, 0.0, -G], (size, 1)), "rates")
    ratios: dict[tuple[str, str], list[float]] = {}

    def rms(values):
        return float(np.sqrt(np.mean(np.square(values))))

    def measure(terms, seed):
        model = ImuSensorModel(
            ImuErrorModel(arw=rms(terms["gyro"]["N"]), vrw=rms(terms["accel"]["N"])),
            gyro_bias_instability=terms["gyro"]["B"],
            accel_bias_instability=terms["accel"]["B"],
            gyro_rate_walk=terms["gyro"]["K"],
            accel_rate_walk=terms["accel"]["K"],
        )
        log, _ = measure_imu(level, model, np.random.default_rng(seed))
        found: dict[str, dict[str, np.ndarray]] = {}
        for sensor in ("gyro", "accel"):
            axes = [
                identify(np.ascontiguousarray(getattr(log, sensor)[:, k]), RATE, terms=tuple("NBK")) for k in range(3)
            ]
            found[sensor] = {n: np.array([axis.term(n).value for axis in axes]) for n in "NBK"}
        return found

    truth = {
        "gyro": {"N": np.full(3, 5e-5), "B": np.full(3, 1.5e-4), "K": np.full(3, 3e-5)},
        "accel": {"N": np.full(3, 1e-3), "B": np.full(3, 3e-3), "K": np.full(3, 6e-4)},
    }
    for seed in range(seeds):
        first = measure(truth, 2 * seed)
        again = measure(first, 2 * seed + 1)
        for sensor in first:
            for name in "NBK":
                ratios.setdefault((sensor, name), []).extend(again[sensor][name] / first[sensor][name])
    return {key: float(np.median(np.abs(np.array(values) - 1.0))) for key, values in ratios.items()}


def test_round_trip_of_the_instability():
    """Analyse, simulate with what was found, analyse again: N within 2 %, B within 15 %, K within 20 % (medians)."""
    for (_, name), error in instability_round_trip(4000.0, 1).items():
        assert error < {"N": 0.02, "B": 0.15, "K": 0.20}[name]


@pytest.mark.slow
def test_round_trip_of_the_instability_of_several_records():
    for (_, name), error in instability_round_trip(7200.0, 4).items():
        assert error < {"N": 0.02, "B": 0.15, "K": 0.20}[name]


def test_turn_on_makes_a_walk():
    truth = ImuErrorModel(arw=5e-5, vrw=1e-3, gyro_bias_sd=1e-4, gyro_bias_tau=30.0)
    found = study(simulated(truth, 2000.0, 3), StudySettings(grid="octave", terms=("N", "GM"), horizon_s=200.0))
    plain, started = error_model(found), error_model(found, turn_on_gyro=1e-2)
    assert plain.gyro_bias_tau == pytest.approx(30.0, rel=0.3)
    assert np.median(plain.axes("gyro_bias_sd")) == pytest.approx(1e-4, rel=0.25)
    assert math.isinf(started.gyro_bias_tau)
    assert started.axes("gyro_bias_sd") == pytest.approx(np.hypot(1e-2, plain.axes("gyro_bias_sd")))
    assert found.gyro is not None
    assert started.axes("gyro_bias_walk") == pytest.approx(found.gyro.free_walk)
    drive = plain.axes("gyro_bias_sd") * (2.0 / plain.gyro_bias_tau) ** 0.5
    assert np.all(started.axes("gyro_bias_walk") < drive)
    assert any("gyro_bias_sd: left to the grade" in text for text in remarks(found))
    assert not any("gyro_bias_sd: left to the grade" in text for text in remarks(found, (1e-2, None)))
    left, fields = filter_settings(found)
    assert fields[:2] == ["arw", "gyro_bias_walk"]
    assert left.axes("gyro_bias_walk") == pytest.approx(found.gyro.free_walk)
    known, fields = filter_settings(found, 1e-2)
    assert fields[:4] == ["arw", "gyro_bias_sd", "gyro_bias_tau", "gyro_bias_walk"]
    assert known.axes("gyro_bias_sd") == pytest.approx(started.axes("gyro_bias_sd"))


def test_a_term_that_needs_a_longer_record_is_told_and_kept_out():
    rng = np.random.default_rng(5)
    walk = 1e-4 * np.cumsum(rng.standard_normal(20_000)) / math.sqrt(RATE)
    values = 1e-3 * rng.standard_normal(20_000)
    record = dataclasses.replace(still(), channels=(Channel("gyro x", "gyro", values + walk),))
    found = study(record, StudySettings(grid="octave", terms=("N", "K")))
    assert found.gyro is not None
    axis = found.axes[0]
    assert axis.identification.term("K").least_span < found.span
    assert not any("[imu]" in text for text in found.warnings)
    short = study(record.between(0, 1500), StudySettings(grid="octave", terms=("N", "K")))
    term = short.axes[0].identification.term("K")
    assert term.present
    assert term.least_span > short.span
    (text,) = [text for text in short.warnings if "[imu]" in text]
    assert text.startswith("log.csv: gyro x: K is uncertain by more than a quarter: the record of 30 s is shorter than")
    assert short.gyro is None
    assert filter_settings(short)[1] == ["arw"]


def test_an_axis_without_a_visible_bias_takes_the_largest_of_the_others():
    found = study(still(), StudySettings(grid="octave", terms=("N",)))
    model = BiasModel(
        (1e-5, 0.0, 2e-5), math.inf, (1e-6, 0.0, 2e-6), 0.1, (1.0, 100.0), (1e-6, 0.0, 2e-6), 0.1, (False,) * 3
    )
    settings, fields = filter_settings(replace(found, gyro=model), 1e-4)
    assert settings.axes("gyro_bias_walk") == pytest.approx([1e-6, 2e-6, 2e-6])
    assert fields == ["arw", "gyro_bias_sd", "gyro_bias_tau", "gyro_bias_walk", "vrw"]
    assert any("takes the largest of the others" in text for text in remarks(replace(found, gyro=model)))


def test_a_model_that_the_curve_does_not_follow_is_told():
    """A line at 0.5 Hz is left out of the fit; the curve has its hump at a second."""
    record = dataclasses.replace(still(), channels=still(100_000).channels[:1])
    record.channels[0].values[:] += 2e-4 * np.sin(2.0 * np.pi * np.arange(100_000) / RATE * 0.5)
    texts = study(record, StudySettings(terms=("N",))).warnings
    (text,) = [text for text in texts if "the fitted model is" in text]
    assert text.startswith("log.csv: gyro x: the fitted model is 0.")
    assert "times the measured deviation between" in text
    assert not any("fitted model" in text for text in study(still(), StudySettings(terms=("N",))).warnings)


@pytest.mark.parametrize(("share", "most"), [(0.0, 2.0), (0.01, 3.0)])
def test_memory_of_a_study(share, most):
    """Vectors of the length of the record beside it: two, and three where samples are missing."""
    import tracemalloc

    whole = still(1_000_000)
    record = dataclasses.replace(whole, channels=whole.channels[:1])
    values = record.channels[0].values
    values[np.random.default_rng(1).random(values.size) < share] = np.nan
    study(record.between(0, 2000))
    tracemalloc.start()
    study(record)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < most * values.nbytes


def test_spectrum_and_autocorrelation():
    values = 0.5 * math.sqrt(RATE) * np.random.default_rng(4).standard_normal(40_000)
    spectrum = power_spectrum(values, RATE)
    level = 2.0 * 0.5**2
    assert np.average(spectrum.density, weights=spectrum.frequency) == pytest.approx(level, rel=0.03)
    inside = (spectrum.low < level) & (level < spectrum.high)
    assert 0.55 < inside.mean() < 0.85
    found = autocorrelation(values, RATE)
    assert found.correlation[0] == 1.0
    assert found.variance == pytest.approx(0.25 * RATE, rel=0.03)
    assert np.mean(np.abs(found.correlation[1:]) < found.bound) > 0.9
    assert autocorrelation(values, RATE, average=2.0).average == 2.0
