"""The simulator: its truth against its pictures, determinism, every event."""

import dataclasses
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.geometry.transforms import apply
from lasso_motion_ros.phantom import SimulatedPair, Simulator
from lasso_motion_ros.phantom.catheters import loop_segments
from lasso_motion_ros.phantom.scenario import scenario_from_values
from lasso_motion_ros.phantom.settings import Event, LassoSettings, Scenario
from lasso_motion_ros.phantom.tubes import optical_depth

SMALL = scenario_from_values(
    {
        "pairs": 3,
        "rate_hz": 2.0,
        "plane_b_offset": 0.5,
        "geometry": {"size_px": 256},
        "lasso": {"centre_mm": [10, 0, 8], "normal": [0.27, -0.73, 0.62], "turns": 0.9},
        "breathing": {"amplitude_mm": 20.0, "period_s": 3.0, "rotation_deg": 3.0, "start": 0.1},
        "heart": {"amplitude_mm": 1.0},
        "imaging": {"bits": 8},
    }
)


def rendered(scenario: Scenario) -> list[SimulatedPair]:
    return list(Simulator(scenario).pairs())


@cache
def small() -> tuple[SimulatedPair, ...]:
    return tuple(rendered(SMALL))


def with_events(*events: Event, pairs: int = 3) -> Scenario:
    geometry = dataclasses.replace(SMALL.geometry, size_px=128)
    return dataclasses.replace(SMALL, events=events, pairs=pairs, geometry=geometry)


def across_the_line(image: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Mean profile of an image along the normals of a curve, at −6…6 px."""
    tangent = np.gradient(line, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    points = line[:, None] + np.arange(-6, 7)[None, :, None] * normal[:, None]
    return map_coordinates(image.astype(float), [points[..., 1], points[..., 0]], order=1).mean(axis=0)


def test_the_truth_is_the_dark_line_of_the_picture() -> None:
    simulator = Simulator(SMALL)
    for pair in small():
        for plane in PLANES:
            frame = pair.images.frames[plane]
            # B is exposed half a frame later: its line lies where the loop is then.
            loop = simulator._loop_at(simulator.time_s(pair.index, plane), pair.index)
            profile = across_the_line(frame.pixels, pair.rendered[plane].project(loop))
            assert np.argmin(profile) == 6
            assert profile[6] < 0.965 * profile[[0, 12]].mean()


def test_centrelines_are_at_plane_as_exposure_in_both_planes() -> None:
    for pair in small():
        assert pair.loop is not None
        for plane in PLANES:
            projection = pair.rendered[plane]
            assert pair.centrelines[plane] == pytest.approx(projection.project(pair.loop))
            depth = optical_depth(projection, loop_segments(pair.loop, LassoSettings(electrodes=0)), supersampling=3)
            profile = across_the_line(depth, pair.centrelines[plane][4:-4])
            centroid = (profile[3:10] * np.arange(-3, 4)).sum() / profile[3:10].sum()
            assert abs(centroid) < 0.1
    stamps = small()[1].images.frames
    assert stamps["b"].stamp_ns - stamps["a"].stamp_ns == 250_000_000
    assert small()[1].images.stamp_ns == stamps["a"].stamp_ns


def test_motion_carries_the_reference_loop() -> None:
    reference = Simulator(SMALL).reference_loop
    assert small()[0].motion == pytest.approx(np.eye(4), abs=1e-12)
    assert small()[0].loop == pytest.approx(reference)
    for pair in small()[1:]:
        assert pair.loop == pytest.approx(apply(pair.motion, reference), abs=1e-12)
        assert np.linalg.norm(pair.motion[:3, 3]) > 2e-3
    assert reference.mean(axis=0) == pytest.approx([0.010, 0.0, 0.008], abs=1e-9)


@pytest.mark.parametrize("change", [{"tilt_deg": 4.0}, {"stretch": 0.03}])
def test_the_rings_own_tilt_and_stretch_are_not_the_atriums(change: dict) -> None:
    simulator = Simulator(dataclasses.replace(SMALL, lasso=dataclasses.replace(SMALL.lasso, **change)))
    differences = []
    for time_s in (0.3, 0.5, 0.9):
        loop = simulator._loop_at(time_s, 0)
        carried = apply(simulator.motion.atrium(time_s), simulator.reference_loop)
        assert loop.mean(axis=0) == pytest.approx(carried.mean(axis=0), abs=1e-9)
        differences.append(np.abs(loop - carried).max())
    assert max(differences) > 1e-4


def test_same_seed_same_pictures_whatever_the_length() -> None:
    scenario = with_events(pairs=2)
    first, longer = rendered(scenario), rendered(dataclasses.replace(scenario, pairs=3))
    other = rendered(dataclasses.replace(scenario, seed=9))
    for plane in PLANES:
        assert np.array_equal(first[1].images.frames[plane].pixels, longer[1].images.frames[plane].pixels)
        assert not np.array_equal(first[1].images.frames[plane].pixels, other[1].images.frames[plane].pixels)
    assert not np.array_equal(first[1].images.frames["a"].pixels, first[1].images.frames["b"].pixels)


def test_pictures_are_like_fluoroscopy() -> None:
    for plane in PLANES:
        pixels = small()[0].images.frames[plane].pixels
        assert pixels.shape == (256, 256)
        assert pixels.dtype == np.uint8
        low, middle, high = np.percentile(pixels, [2, 50, 98])
        assert low > 20
        assert middle > 1.3 * low
        assert 180 < high <= 255


def test_targets_lie_on_the_atrium() -> None:
    targets = Simulator(SMALL).targets
    assert targets.shape == (200, 3)
    assert np.ptp(targets, axis=0) == pytest.approx([0.066, 0.042, 0.052], rel=0.1)


def test_seeds_are_on_the_first_pictures() -> None:
    simulator = Simulator(SMALL)
    seeds = simulator.seeds()
    for plane in PLANES:
        loop = simulator._loop_at(simulator.time_s(0, plane), 0)
        line = small()[0].rendered[plane].project(loop)
        distance = [np.linalg.norm(line - click, axis=1).min() for click in seeds[plane]]
        assert max(distance) < 6.0


def test_hidden_and_back() -> None:
    pairs = rendered(with_events(Event(kind="hide", first=1, last=1)))
    assert [sorted(pair.centrelines) for pair in pairs] == [["a", "b"], [], ["a", "b"]]
    assert pairs[1].loop is None
    assert np.linalg.norm(pairs[1].motion[:3, 3]) > 1e-3  # the atrium goes on


def test_hiding_takes_the_line_out_of_the_picture() -> None:
    simulator = Simulator(with_events(Event(kind="hide", first=1, last=1)))
    projection = rendered(with_events())[0].rendered["a"]
    contrast = []
    for index in (0, 1):
        line = projection.project(simulator._loop_at(0.5, 0))
        profile = across_the_line(optical_depth(projection, simulator.catheters(0.5, index)), line)
        contrast.append(profile[6])
    assert contrast[1] < 0.2 * contrast[0]


def test_removed_for_good() -> None:
    simulator = Simulator(with_events(Event(kind="remove", first=1)))
    pairs = list(simulator.pairs())
    assert [sorted(pair.centrelines) for pair in pairs] == [["a", "b"], [], []]
    assert len(simulator.catheters(0.5, 1)) < len(simulator.catheters(0.5, 0))


def test_moved_to_another_place() -> None:
    pairs = rendered(with_events(Event(kind="move", first=1, last=2, shift_mm=(8.0, 0.0, 0.0))))
    still = rendered(with_events())
    for index, part in ((0, 0.0), (1, 0.5), (2, 1.0)):
        assert pairs[index].motion == pytest.approx(still[index].motion)
        assert pairs[index].loop is not None
        assert still[index].loop is not None
        shift = pairs[index].loop - still[index].loop
        assert np.linalg.norm(shift, axis=1) == pytest.approx(8e-3 * part, abs=1e-9)


def test_a_dropped_picture_keeps_its_truth() -> None:
    pairs = rendered(with_events(Event(kind="drop", first=1, plane="b")))
    assert [sorted(pair.images.frames) for pair in pairs] == [["a", "b"], ["a"], ["a", "b"]]
    assert sorted(pairs[1].centrelines) == ["a", "b"]


def test_gantry_events_reach_picture_and_calibration() -> None:
    pan = Event(kind="table_pan", first=1, shift_mm=(0.0, 0.0, 10.0))
    told, silent = rendered(with_events(pan)), rendered(with_events(dataclasses.replace(pan, calibrated=False)))
    assert np.array_equal(told[1].images.frames["a"].pixels, silent[1].images.frames["a"].pixels)
    assert told[1].images.frames["a"].projection.matrix == pytest.approx(told[1].rendered["a"].matrix)
    assert silent[1].images.frames["a"].projection.matrix == pytest.approx(silent[0].rendered["a"].matrix)
    # The patient goes up by 10 mm: the loop in the picture too.
    rise = told[1].centrelines["a"] - rendered(with_events())[1].centrelines["a"]
    pixel_mm = told[0].rendered["a"].millimetres_per_pixel(np.zeros(3))
    assert rise[:, 1] == pytest.approx(-10.0 / pixel_mm, rel=0.08)


def test_breathing_moves_the_diaphragm_in_the_picture() -> None:
    deep = scenario_from_values(
        {
            "pairs": 1,
            "geometry": {"size_px": 128, "plane_a": {"lao_deg": 0}},
            "breathing": {"amplitude_mm": 30, "start": 0.5},
        }
    )
    still = dataclasses.replace(deep, breathing=dataclasses.replace(deep.breathing, amplitude_mm=0.0))
    low, high = (rendered(scenario)[0].images.frames["a"].pixels.astype(float) for scenario in (deep, still))
    # Breathed in, lung lies where the diaphragm was: the field's lower corner, over the right dome, is brighter.
    assert low[-20:, :20].mean() / low.mean() > 1.3 * high[-20:, :20].mean() / high.mean()
