"""The lab in the simulator: its truth, its pictures, and that the same seed gives the same ones."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest

from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.phantom import SimulatedPair, Simulator
from lasso_motion_ros.phantom.gantry import published_projection, true_projection
from lasso_motion_ros.phantom.imaging import Exposure, ImagingChain
from lasso_motion_ros.phantom.lab_settings import BystanderSettings, Incident, WorkSettings
from lasso_motion_ros.phantom.motion import Heartbeat
from lasso_motion_ros.phantom.scenario import scenario_from_values
from lasso_motion_ros.phantom.settings import (
    CalibrationSettings,
    Event,
    HeartSettings,
    ImagingSettings,
    LassoSettings,
    Scenario,
)

SMALL = scenario_from_values(
    {
        "pairs": 4,
        "rate_hz": 2.0,
        "plane_b_offset": 0.25,
        "geometry": {"size_px": 128},
        "lasso": {"centre_mm": [10, 0, 8], "normal": [0.27, -0.73, 0.62], "turns": 0.98, "electrodes": 8},
        "breathing": {"amplitude_mm": 12.0, "period_s": 3.0, "start": 0.1},
        "imaging": {"bits": 8, "lag": 0.0},
    }
)


def rendered(**changes: object) -> list[SimulatedPair]:
    return list(Simulator(dataclasses.replace(SMALL, **changes)).pairs())  # type: ignore[arg-type]


def everything() -> Scenario:
    return dataclasses.replace(
        SMALL,
        pairs=3,
        ablation_work=WorkSettings(works=True),
        bystanders=BystanderSettings(tee_probe=True, star=True, twin=True, ecg_discs=3, pacing=True),
        incidents=(
            Incident("contrast", 0.0, 1.0, amount=60.0),
            Incident("cough", 0.3, 0.9, amount=8.0),
            Incident("dose", 0.4, 0.8, amount=4.0),
            Incident("shutter", 0.2, 0.5, covered=(0.1, 0.1, 0.1, 0.1)),
        ),
    )


@pytest.mark.slow
def test_the_same_seed_gives_the_same_lab_whatever_the_length() -> None:
    first, longer = (list(Simulator(dataclasses.replace(everything(), pairs=pairs)).pairs()) for pairs in (2, 3))
    other = list(Simulator(dataclasses.replace(everything(), seed=9, pairs=2)).pairs())
    for plane in PLANES:
        pixels = [pairs[1].images.frames[plane].pixels for pairs in (first, longer, other)]
        assert np.array_equal(pixels[0], pixels[1])
        assert not np.array_equal(pixels[0], pixels[2])


def test_a_lab_is_a_scenario_that_a_file_could_hold() -> None:
    assert scenario_from_values(_plain(dataclasses.asdict(everything()))) == everything()


def _plain(value: object) -> object:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, tuple) else value


def test_a_slide_is_in_the_truth_of_the_ring_and_not_of_the_atrium() -> None:
    still, sliding = rendered(), rendered(incidents=(Incident("slide", 0.5, 0.0, amount=1.0),))
    out = Simulator(SMALL).loop.normal
    for index, slid_m in enumerate((0.0, 0.0, 0.5e-3, 1.0e-3)):
        assert sliding[index].motion == pytest.approx(still[index].motion)
        assert sliding[index].from_place_m == pytest.approx(slid_m, abs=1e-12)
        shift = sliding[index].loop - still[index].loop  # type: ignore[operator]
        assert shift == pytest.approx(np.tile(slid_m * out, (90, 1)), abs=1e-9)


def test_a_patients_shift_is_motion_of_the_atrium_but_not_of_breathing() -> None:
    shift = Incident("shift", 0.6, 0.3, amount=10.0, direction=(1.0, 0.0, 0.0))
    still, shifted = rendered(), rendered(incidents=(shift,))
    assert shifted[1].motion == pytest.approx(still[1].motion)
    assert shifted[1].shifted_m == 0.0
    for index in (2, 3):
        assert shifted[index].motion[:3, 3] - still[index].motion[:3, 3] == pytest.approx([0.01, 0.0, 0.0])
        assert shifted[index].respiratory == pytest.approx(still[index].respiratory)
        assert shifted[index].from_place_m == pytest.approx(0.0, abs=1e-12)
        assert shifted[index].shifted_m == pytest.approx(0.01)


def test_a_patients_shift_is_seen_as_a_move_of_the_c_arm_the_other_way() -> None:
    shift = Incident("shift", 0.6, 0.3, amount=10.0, direction=(0.0, 0.0, 1.0))
    pan = Event("table_pan", 2, shift_mm=(0.0, 0.0, 10.0))
    by_patient, by_table = rendered(incidents=(shift,))[3], rendered(events=(pan,))[3]
    for plane in PLANES:
        assert by_patient.images.frames[plane].pixels == pytest.approx(by_table.images.frames[plane].pixels, abs=1)
        assert by_patient.centrelines[plane] == pytest.approx(by_table.centrelines[plane])
        assert by_patient.poles[plane] == pytest.approx(by_table.poles[plane])


def test_a_withdrawn_ring_goes_pole_by_pole() -> None:
    pairs = rendered(incidents=(Incident("withdraw", 0.0, 1.5),))
    assert [pair.withdrawn for pair in pairs] == pytest.approx([0.0, 0.259, 0.741, 1.0], abs=1e-3)
    assert [len(pair.poles.get("a", ())) for pair in pairs] == [8, 6, 2, 0]
    assert pairs[3].loop is None
    assert not pairs[3].centrelines
    whole = np.linalg.norm(np.diff(pairs[0].loop, axis=0), axis=1).sum()  # type: ignore[arg-type]
    left = np.linalg.norm(np.diff(pairs[2].loop, axis=0), axis=1).sum()  # type: ignore[arg-type]
    assert left == pytest.approx((1.0 - 0.741) * whole, rel=0.02)


def test_poles_are_at_each_planes_own_exposure() -> None:
    simulator = Simulator(SMALL)
    (pair, *_) = simulator.pairs()
    loop_b = simulator._loop_at(simulator.time_s(0, "b"), 0)
    expected = true_projection(SMALL, "b", 0).project(simulator.lab.poles(loop_b, 0.0))
    assert pair.poles["b"] == pytest.approx(expected)
    assert pair.poles["b"].shape == (8, 2)


def test_a_variable_loop_keeps_its_length_and_its_place() -> None:
    simulator = Simulator(dataclasses.replace(SMALL, incidents=(Incident("resize", 0.0, 1.0, amount=0.8),)))
    before, after = simulator.lab.shape(0.0), simulator.lab.shape(2.0)

    def size(loop: np.ndarray) -> float:
        return float(np.linalg.norm(loop - loop.mean(axis=0), axis=1).mean())

    assert size(after.points) == pytest.approx(0.8 * size(before.points), rel=0.06)
    assert after.centre == pytest.approx(before.centre)
    lengths = [np.linalg.norm(np.diff(loop.points, axis=0), axis=1).sum() for loop in (before, after)]
    assert lengths[1] == pytest.approx(lengths[0], rel=0.06)


def test_a_plane_that_is_off_shows_nothing() -> None:
    pairs = rendered(incidents=(Incident("off", 0.4, 1.0, plane="a"),))
    assert [sorted(pair.images.frames) for pair in pairs] == [["a", "b"], ["b"], ["b"], ["a", "b"]]
    assert all(sorted(pair.centrelines) == ["a", "b"] for pair in pairs)


def test_swapped_matrices() -> None:
    swapped = dataclasses.replace(SMALL, calibration_error=CalibrationSettings(swapped=True))
    for plane, other in (("a", "b"), ("b", "a")):
        assert published_projection(swapped, plane, 0).matrix == pytest.approx(true_projection(SMALL, other, 0).matrix)


def test_a_filter_keeps_its_share_of_the_last_picture() -> None:
    settings = ImagingSettings(lag=0.5, scatter=0.0, electronic_noise=0.0, detector_blur_px=0.0, gamma=1.0, bits=12)
    chain = ImagingChain(settings, 0.0)
    clear, covered = np.zeros((64, 64)), np.zeros((64, 64))
    covered[20:44, 20:44] = 1.0
    means = []
    for depth in (clear, covered, covered, covered):
        pixels = chain.expose(depth, 1.0, np.random.default_rng(1))
        means.append(float(pixels[24:40, 24:40].mean()) / float(pixels[:16].mean()))
    # It falls to exp(−1), half of the rest of the way with every picture.
    left = (np.array(means[1:]) - np.exp(-1.0)) / (1.0 - np.exp(-1.0))
    assert left == pytest.approx([0.5, 0.25, 0.125], abs=0.03)


def test_cine_has_less_noise_at_the_same_grey_level_and_a_window_another_grey_level() -> None:
    settings = ImagingSettings(lag=0.0, scatter=0.0, electronic_noise=0.0, detector_blur_px=0.0, gamma=1.0, quanta=40.0)
    depth = np.ones((96, 96))
    depth[:8] = 0.0  # the display's white

    def taken(exposure: Exposure) -> np.ndarray:
        chain = ImagingChain(settings, 0.0)
        chain.expose(depth, 1.0, np.random.default_rng(1))
        return chain.expose(depth, 1.0, np.random.default_rng(2), exposure)[8:].astype(float)

    plain, cine, dim = taken(Exposure()), taken(Exposure(dose=4.0)), taken(Exposure(window=0.75))
    assert cine.mean() == pytest.approx(plain.mean(), rel=0.02)
    assert cine.std() == pytest.approx(0.5 * plain.std(), rel=0.1)
    assert dim.mean() == pytest.approx(0.75 * plain.mean(), rel=0.02)


def test_shutters_move_in_and_stay() -> None:
    shutter = Incident("shutter", 0.5, 0.5, covered=(0.3, 0.0, 0.0, 0.2))
    pairs, open_field = rendered(incidents=(shutter,)), rendered()
    for index, dark in ((0, False), (1, False), (2, True), (3, True)):
        left, free = (sequence[index].images.frames["a"].pixels[:, :30].mean() for sequence in (pairs, open_field))
        assert (left < 0.5 * free) == dark
    assert pairs[3].images.frames["a"].pixels[60, 60:].mean() > 60.0


def test_electrodes_come_in_pairs_and_loops_bulge() -> None:
    scenario = dataclasses.replace(
        SMALL, lasso=LassoSettings(electrodes=20, pair_spacing=0.25, diameter_mm=25.0, turns=0.98, helix_mm=0.0)
    )
    simulator = Simulator(scenario)
    poles = simulator.lab.poles(simulator.reference_loop, 0.0)
    gaps = 1e3 * np.linalg.norm(np.diff(poles, axis=0), axis=1)
    assert poles.shape == (20, 3)
    assert gaps[::2].mean() / (gaps[::2].mean() + gaps[1::2].mean()) == pytest.approx(0.25, abs=0.01)
    bulging = Simulator(
        dataclasses.replace(scenario, lasso=dataclasses.replace(scenario.lasso, bulge=0.1, saddle_mm=2.0))
    )
    radii = np.linalg.norm(bulging.loop.points - bulging.loop.centre, axis=1)
    assert np.ptp(radii) > 2e-3
    assert np.ptp((bulging.loop.points - bulging.loop.centre) @ bulging.loop.normal) == pytest.approx(4e-3, rel=0.1)


def test_fibrillation_pulls_every_beat_otherwise() -> None:
    beats = HeartSettings(amplitude_mm=4.0, rate_bpm=90.0, variability=0.3, strength_spread=0.35)
    heart = Heartbeat(beats, np.random.default_rng(1), 60.0)
    peaks = heart.r_peaks(55.0)
    pulls = [
        1e3 * max(np.linalg.norm(heart.displacement(start + part * (end - start))) for part in np.linspace(0, 0.45, 19))
        for start, end in pairwise(peaks)
    ]
    assert np.mean(pulls) == pytest.approx(4.0, abs=0.5)
    assert np.std(pulls) == pytest.approx(0.35 * 4.0, rel=0.35)
    # One beat tells nothing of the next.
    assert abs(np.corrcoef(pulls[:-1], pulls[1:])[0, 1]) < 0.3
