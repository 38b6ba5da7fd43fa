"""How far a ring stands out is told by the same curve laid elsewhere: at any dose, and among whatever else is dark."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from support.lasso_inputs import CURVE, LOOP, VIEWS, lasso_image, noisy

from lasso_motion_ros.geometry.frames import Frame, Plane
from lasso_motion_ros.initialisation.distinctness import CurveElsewhere, Distinctness
from lasso_motion_ros.ring.electrodes import likeliest_comb
from lasso_motion_ros.ring.working_image import WorkingImage, working_image

NOWHERE = CURVE + 10.0
POINTS = CURVE[::4]


def images_of(change: Callable[[np.ndarray, str], np.ndarray]) -> dict[Plane, WorkingImage]:
    """Per plane, what is made of nothing but the drawn ring's background."""
    seen: dict[Plane, WorkingImage] = {}
    for plane, view in VIEWS.items():
        drawn = change(lasso_image(NOWHERE, view).astype(float), plane)
        frame = Frame(0, noisy(drawn, [3, ord(plane)], 0.0), view)
        seen[plane] = working_image(frame, LOOP.centre, bright=False, shift=np.zeros(2))
    return seen


def of_images(change: Callable[[np.ndarray, str], np.ndarray]) -> Distinctness:
    """Of the drawn ring's place there."""
    seen = images_of(change)
    along = {plane: image.projection.project(POINTS) for plane, image in seen.items()}
    comb = likeliest_comb(POINTS, {plane: image.evidence_at(along[plane]) for plane, image in seen.items()})
    return CurveElsewhere(seen, along).with_poles(POINTS, comb.places_mm)


def ring(plane: str) -> np.ndarray:
    """What the ring takes from an image's grey values."""
    view = VIEWS[plane]
    return lasso_image(NOWHERE, view).astype(float) - lasso_image(CURVE, view)


def noise(plane: str, sigma: float, seed: int = 0) -> np.ndarray:
    view = VIEWS[plane]
    return np.random.default_rng([seed, ord(plane)]).normal(0.0, sigma, (view.height, view.width))


@pytest.fixture(scope="module")
def drawn() -> Distinctness:
    return of_images(lambda grey, plane: grey - ring(plane) + noise(plane, 8.0))


def test_a_ring_stands_out_and_noise_does_not(drawn: Distinctness) -> None:
    assert drawn.curve > 12.0
    assert drawn.poles > 12.0
    assert drawn.lead > 0.5
    for seed in range(4):
        nothing = of_images(lambda grey, plane, seed=seed: grey + noise(plane, 8.0, seed))  # type: ignore[misc]
        assert nothing.curve < 6.0
        assert nothing.poles < 9.0  # those of the likeliest comb
        assert nothing.lead < 0.3


def test_chance_goes_as_far_at_every_dose() -> None:
    """Where nothing is its unit is the noise's own: along curves of noise alone, however much, it is one."""
    for sigma in (2.0, 8.0, 24.0):
        away = []
        for seed in range(3):
            seen = images_of(lambda grey, plane, sigma=sigma, seed=seed: grey + noise(plane, sigma, seed))  # type: ignore[misc]
            for aside in np.array([[0, 0, 0], [0, 0, 0.02], [0, 0.015, 0], [0, 0, -0.02], [0.015, 0, 0]]):
                along = {plane: image.projection.project(POINTS + aside) for plane, image in seen.items()}
                away.append(CurveElsewhere(seen, along).curve / np.sqrt(2.0))  # the sum of two planes
        assert abs(np.mean(away)) < 0.7
        assert 0.6 < np.std(away) < 1.5


def test_it_is_by_means_along_the_curve_laid_aside_both_ways() -> None:
    seen = images_of(lambda grey, plane: grey - 0.2 * ring(plane) + noise(plane, 8.0))
    along = {plane: image.projection.project(POINTS) for plane, image in seen.items()}
    expected = 0.0
    for plane, image in seen.items():
        beside = 2.0 * np.arange(-16, 17)  # 8 mm either way, every half millimetre
        aside = np.stack(np.meshgrid(beside, beside), axis=2).reshape(-1, 2)
        means = np.array([image.evidence_at(along[plane] + one).mean() for one in aside])
        others = means[np.hypot(*aside.T) >= 6.0]
        expected += (float(image.evidence_at(along[plane]).mean()) - others.mean()) / others.std()
    assert CurveElsewhere(seen, along).curve == pytest.approx(expected, abs=0.01)


def test_less_noise_shows_more_of_a_ring(drawn: Distinctness) -> None:
    clearer, fainter = (
        of_images(lambda grey, plane, sigma=sigma: grey - 0.2 * ring(plane) + noise(plane, sigma))  # type: ignore[misc]
        for sigma in (3.0, 24.0)
    )
    assert fainter.poles < 0.8 * clearer.poles < drawn.poles


def test_a_picture_that_ends_beside_a_ring_does_not_make_it_stand_out() -> None:
    def with_wires(grey: np.ndarray, plane: str) -> np.ndarray:
        """Dark stripes all about the ring: what lies beside it is darker than nothing on average."""
        x = np.arange(grey.shape[1])
        return grey - 25.0 * np.maximum(np.cos(2.0 * np.pi * x / 18.0), 0.0) - ring(plane) + noise(plane, 8.0)

    def stands_out(cut_px: int | None) -> float:
        seen = {}
        for plane, view in VIEWS.items():
            grey = with_wires(lasso_image(NOWHERE, view).astype(float), plane)
            edge = view.width if cut_px is None else int(view.project(CURVE)[:, 0].max()) + cut_px
            frame = Frame(0, noisy(grey, [3, ord(plane)], 0.0)[:, :edge], view.cropped(0, 0, edge, view.height))
            seen[plane] = working_image(frame, LOOP.centre, bright=False, shift=np.zeros(2))
        along = {plane: image.projection.project(POINTS) for plane, image in seen.items()}
        return CurveElsewhere(seen, along).curve

    assert stands_out(8) < 1.01 * stands_out(None)


def test_where_much_else_is_as_dark_it_stands_out_less(drawn: Distinctness) -> None:
    def with_spots(grey: np.ndarray, plane: str) -> np.ndarray:
        # As many spots as electrodes about the ring, and as dark.
        random = np.random.default_rng([5, ord(plane)])
        places = VIEWS[plane].project(LOOP.centre) + random.uniform(-90.0, 90.0, (160, 2))
        y, x = np.mgrid[: grey.shape[0], : grey.shape[1]]
        for at in places:
            grey = grey - 50.0 * np.exp(-0.5 * ((x - at[0]) ** 2 + (y - at[1]) ** 2) / 4.0**2)
        return grey - ring(plane) + noise(plane, 8.0)

    among = of_images(with_spots)
    assert among.poles < 0.8 * drawn.poles
    assert among.lead < drawn.lead


def test_beyond_the_picture_there_is_nothing_to_stand_out() -> None:
    seen = {
        plane: working_image(
            Frame(0, noisy(lasso_image(CURVE, view), 1, 5.0), view), LOOP.centre, bright=False, shift=np.zeros(2)
        )
        for plane, view in VIEWS.items()
    }
    along = {plane: image.projection.project(NOWHERE[::4]) for plane, image in seen.items()}
    found = CurveElsewhere(seen, along).with_poles(NOWHERE[::4], (4.0, 8.0))
    assert found == Distinctness(0.0, 0.0, 0.0)
    assert CurveElsewhere(seen, along).with_poles(NOWHERE[::4], ()).poles == 0.0
