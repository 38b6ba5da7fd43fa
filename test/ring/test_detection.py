import dataclasses

import numpy as np
import pytest
from support.ring_fits import VIEWS, WORTH, detection_at, detection_of, plane_fit

HERE = np.array([0.010, -0.020, 0.015])


def seen(a=None, b=None):
    """A detection by the planes' evidence and coverage."""
    given = {"a": a, "b": b}
    return detection_of(
        {
            plane: plane_fit(plane, HERE, evidence=of_plane[0], coverage=of_plane[1])
            for plane, of_plane in given.items()
            if of_plane is not None
        }
    )


@pytest.mark.parametrize(
    ("a", "b", "support"),
    [
        ((1.8, 1.0), (1.6, 1.0), 1.6 + 0.3 * 1.8),
        ((1.6, 1.0), (1.8, 1.0), 1.6 + 0.3 * 1.8),
        ((2.0, 1.0), (0.1, 1.0), 0.1 + 0.3 * 2.0),  # no plane may contradict
        ((2.0, 1.0), (-0.5, 1.0), -0.5 + 0.3 * 2.0),
        ((2.0, 1.0), (2.0, 1.0), 2.6),
        ((1.5, 1.0), None, 1.3 * 1.5 - 0.15),  # one plane alone: less than two that show as much
        ((1.5, 1.0), (0.1, 0.49), 1.3 * 1.5 - 0.15),  # nor does a plane count whose image does not reach so far
        ((1.5, 1.0), (0.1, 0.5), 0.1 + 0.3 * 1.5),
        ((1.5, 0.4), (1.5, 0.4), -1.0),
    ],
)
def test_support_by_hand(a, b, support):
    assert seen(a, b).support == pytest.approx(support)


def test_a_plane_that_could_not_show_the_ring_is_no_witness():
    assert set(seen((1.5, 0.3), (1.5, 1.0)).planes) == {"b"}
    assert set(seen((1.5, 0.6), (1.5, 1.0)).planes) == {"a", "b"}


def test_the_gap_is_what_lifts_one_planes_centre_off_the_others_by_hand():
    # The planes turn about the patient's long axis: a lift of plane B along it is all gap.
    for lift_mm in (-2.0, 0.0, 0.7):
        lifted = HERE + np.array([0.0, 0.0, 1e-3 * lift_mm])
        pair = detection_of({"a": plane_fit("a", HERE), "b": plane_fit("b", lifted)})
        gap, across = pair.gap(HERE)
        assert 1e3 * abs(gap) == pytest.approx(abs(lift_mm), rel=1e-3, abs=1e-9)
        assert np.linalg.norm(across) == pytest.approx(1.0)
        for fit in pair.planes.values():
            assert across @ fit.ray == pytest.approx(0.0, abs=1e-12)


def test_the_gap_does_not_depend_on_the_depth_along_the_rays():
    lifted = HERE + np.array([0.0, 0.0, 0.0012])
    gaps = []
    for depth_a, depth_b in ((-0.03, 0.02), (0.01, -0.05)):
        fits = {"a": plane_fit("a", HERE), "b": plane_fit("b", lifted)}
        for plane, depth in (("a", depth_a), ("b", depth_b)):
            fits[plane] = dataclasses.replace(fits[plane], centre=fits[plane].centre + depth * fits[plane].ray)
        pair = detection_of(fits)
        # Where plane A's ray passes is where B is expected.
        gaps.append(pair.gap(fits["a"].centre)[0])
    np.testing.assert_allclose(np.abs(gaps), 0.0012, rtol=1e-3)
    assert gaps[0] == pytest.approx(gaps[1])


def test_what_moved_between_the_exposures_is_no_gap():
    moved = np.array([0.001, -0.002, -0.006])
    pair = detection_of({"a": plane_fit("a", HERE), "b": plane_fit("b", HERE + moved)})
    assert pair.gap(HERE + moved)[0] == pytest.approx(0.0, abs=1e-12)
    assert abs(pair.gap(HERE)[0]) > 0.005


def test_detections_are_the_same_where_all_planes_see_them_alike():
    here = detection_at(HERE)
    side = here.planes["a"].across[0]
    assert here.is_same(detection_at(HERE + 2e-4 * side))
    assert not here.is_same(detection_at(HERE + 4e-4 * side))
    # Along a plane's ray that plane tells nothing, but the other does.
    ray = here.planes["a"].ray
    assert not here.is_same(detection_at(HERE + 1e-3 * ray))
    alone = detection_at(HERE, planes="a")
    assert alone.is_same(detection_at(HERE + 1e-3 * ray, planes="a"))
    assert not here.is_same(alone)
    assert not alone.is_same(here)


def test_an_observation_is_the_displacement_across_the_ray_and_its_covariance():
    # Support 1.7 · 1.3 = 2.21: as much as there is where the noise tells all.
    clear = detection_at(HERE, evidence=WORTH.clear_support / 1.3, sigma_m=4e-5)
    moved = np.array([0.002, 0.001, -0.004])
    for plane in "ab":
        observed = clear.observation(plane, HERE - moved)
        np.testing.assert_allclose(observed.value, observed.across @ moved, atol=1e-12)
        np.testing.assert_allclose(observed.covariance, (4e-5**2 + 2e-5**2) * np.eye(2), rtol=1e-9)
        source = VIEWS[plane].source
        np.testing.assert_allclose(observed.across @ (HERE - source) / np.linalg.norm(HERE - source), 0.0, atol=1e-12)


def test_where_the_support_is_weak_something_pulls_and_less_is_known():
    # Support 1.3 · 1.2 = 1.56: 0.64 short of clear, the variance is e to the power of 1.09 · 0.64; and 0.39 short of
    # what nothing pulls at, 0.45 mm for each unit of that.
    weak = detection_at(HERE, evidence=1.2, sigma_m=4e-5).observation("a", HERE)
    np.testing.assert_allclose(
        weak.covariance, (2.009 * 4e-5**2 + 2e-5**2 + (0.39 * 4.5e-4) ** 2) * np.eye(2), rtol=1e-3
    )
    # More than that, and it is known better than by the noise of a usual place.
    strong = detection_at(HERE, evidence=1.9, sigma_m=4e-5).observation("a", HERE)
    np.testing.assert_allclose(strong.covariance, (0.745 * 4e-5**2 + 2e-5**2) * np.eye(2), rtol=1e-3)
