"""A close-up shows one ring of the first pair, with the later ones laid on it, where its projection says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.lasso_inputs import CURVE, LOOP, lasso_pair, pair_of
from support.tracking_inputs import VIEWS

from lasso_motion_ros.geometry.frames import FramePair
from lasso_motion_ros.initialisation.circles import Circles
from lasso_motion_ros.initialisation.compensated_mean import motions_of
from lasso_motion_ros.initialisation.laid_pair import LaidPair
from lasso_motion_ros.initialisation.ring_closeup import RingCloseups
from lasso_motion_ros.initialisation.shaped_rings import ShapedRings

MOVES = ((0.0, 0.0, 0.0), (1e-3, -2e-3, 4e-3), (2e-3, -1e-3, 8e-3))
RADIUS = 0.5 * float(np.linalg.norm(LOOP.semi_major) + np.linalg.norm(LOOP.semi_minor))


def _ring(centre: np.ndarray = LOOP.centre) -> ShapedRings:
    circle = Circles(centre[None], LOOP.normal[None], np.array([RADIUS]), np.zeros(1), np.zeros(1))
    return ShapedRings.of(circle)


def _closeup(
    pairs: list[FramePair], ring: ShapedRings, told: np.ndarray | None = None, *, bright: bool = False, off_m: float = 0
) -> FramePair:
    """The close-up of a ring of which electrodes tell that it has moved (K, 4), blocks being mistaken by so much."""
    laid = [LaidPair.of(one, bright=bright) for one in pairs]
    motions = {
        plane: [replace(one, moved=one.moved + off_m) for one in by_pair] for plane, by_pair in motions_of(laid).items()
    }
    return RingCloseups(laid, motions).of(ring, np.zeros((len(pairs) - 1, 4)) if told is None else told)


def _contrast(pair: FramePair, plane: str) -> float:
    """How far the ring's curve stands out beside what is 3 mm outside it, in units of the noise there."""
    frame = pair.frames[plane]
    on, off = (
        np.log(frame.pixels[tuple(np.rint(frame.projection.project(points)).astype(int).T[::-1])].astype(float))
        for points in (CURVE, LOOP.centre + 1.3 * (CURVE - LOOP.centre))
    )
    return float((off.mean() - on.mean()) / np.diff(off[::4]).std())


@pytest.mark.slow
@pytest.mark.parametrize("moves", [MOVES, (MOVES[0], MOVES[0], MOVES[0])])
def test_the_ring_stays_where_it_is_and_stands_out_more(moves: tuple[tuple[float, ...], ...]) -> None:
    pairs = [lasso_pair(k, move, sigma=10.0) for k, move in enumerate(moves)]
    together, alone = _closeup(pairs, _ring()), _closeup(pairs[:1], _ring())
    for plane in "ab":
        # Three pairs have noise less by the root of three.
        assert _contrast(together, plane) > 1.4 * _contrast(alone, plane)


@pytest.mark.slow
def test_its_electrodes_tell_how_it_has_moved_where_the_blocks_about_it_are_mistaken() -> None:
    pairs = [lasso_pair(k, move, sigma=10.0) for k, move in enumerate(MOVES)]
    told = np.column_stack([np.array(MOVES[1:]), np.zeros(2)])
    by_electrodes, alone = _closeup(pairs, _ring(), told, off_m=0.02), _closeup(pairs[:1], _ring())
    by_neither = _closeup(pairs, _ring(), told + 0.02, off_m=0.02)
    for plane in "ab":
        assert _contrast(by_electrodes, plane) > 1.4 * _contrast(alone, plane)
        assert _contrast(by_neither, plane) < 1.2 * _contrast(alone, plane)


@pytest.mark.slow
def test_where_catheters_are_bright_grey_values_themselves_are_averaged() -> None:
    pairs = []
    for k, move in enumerate(MOVES):
        dark = lasso_pair(k, move, sigma=10.0)
        pairs.append(pair_of(k, {p: 255 - frame.pixels for p, frame in dark.frames.items()}, sigma=0.0))
    closeup = _closeup(pairs, _ring(), bright=True)
    assert all(_contrast(closeup, plane) < -1.0 for plane in "ab")


def test_a_ring_outside_of_the_image_has_a_close_up_of_what_is_left() -> None:
    pairs = [lasso_pair(k) for k in range(2)]
    centre = VIEWS["a"].source + 0.75 * VIEWS["a"].rays(np.array([[511.0, 511.0]]))[0]
    closeup = _closeup(pairs, _ring(centre))
    assert all(min(frame.pixels.shape) >= 1 for frame in closeup.frames.values())
