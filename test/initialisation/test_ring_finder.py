"""Rings are found without clicks; nothing is where there is none; two are both proposed, and none is started with."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.breathing_lasso import moved, pair
from support.lasso_inputs import CURVE, lasso_image, lasso_pair, pair_of
from support.message_inputs import projection
from support.tracking_inputs import LOOP, VIEWS

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.frames import Frame, FramePair
from lasso_motion_ros.geometry.transforms import rotation_from_vector
from lasso_motion_ros.initialisation import ring_finder
from lasso_motion_ros.initialisation.laid_pair import LaidPair
from lasso_motion_ros.initialisation.ring_finder import Look, OvertakenError, find_rings
from lasso_motion_ros.ring.track import Track
from lasso_motion_ros.ring.tracker import RingTracker
from lasso_motion_ros.stream.automatic_start import only_ring

CONFIG = TrackerConfig(polarity="dark")


@pytest.mark.slow
def test_without_a_ring_nothing_is_proposed() -> None:
    assert find_rings([lasso_pair(index, None) for index in range(3)], CONFIG).proposed == []


@pytest.mark.slow
def test_of_two_lassos_both_are_proposed_and_none_is_started_with() -> None:
    other = CURVE + np.array([0.004, 0.006, 0.034])
    images = {plane: np.minimum(lasso_image(CURVE, view), lasso_image(other, view)) for plane, view in VIEWS.items()}
    rings = find_rings([pair_of(index, images) for index in range(3)], CONFIG).proposed
    nearest = min(distance_to_curve(CURVE, ring.points).mean() for ring in rings)
    assert nearest < 0.5e-3
    middles = sorted(float(ring.centre[2]) for ring in rings)
    expected = [float(curve.mean(axis=0)[2]) for curve in (CURVE, other)]
    assert middles == pytest.approx(sorted(expected), abs=0.7e-3)
    assert all(ring.rivals for ring in rings)
    assert only_ring(rings) is None


@pytest.mark.slow
def test_a_ring_is_judged_by_what_all_pairs_show(monkeypatch: pytest.MonkeyPatch) -> None:
    tracks = []

    def begin(tracker: RingTracker, *ring: Any, **asked: Any) -> Track:
        tracks.append(begun(tracker, *ring, **asked))
        return tracks[-1]

    begun = RingTracker.begin
    monkeypatch.setattr(RingTracker, "begin", begin)
    assert find_rings([pair(index) for index in range(3)], CONFIG).proposed
    assert max(track.template.count for track in tracks) == 3


def test_where_the_first_pair_shows_none_the_last_is_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[list[FramePair], list[FramePair]]] = []
    rivals: list[Any] = []
    seen_first = Look([], ["followed"], ["tried"], 1.0)  # type: ignore[list-item]
    seen_last = Look(["ring"], ["followed back"])  # type: ignore[list-item]

    def look(pairs: list[FramePair], laid: list[LaidPair], *others: Any) -> Look:
        asked.append((pairs, [one.pair for one in laid]))
        rivals.append(others[3:])
        return (seen_first, seen_last)[len(asked) - 1]

    monkeypatch.setattr(ring_finder, "_look", look)
    pairs = [pair(index) for index in range(3)]
    found = find_rings(pairs, CONFIG)
    assert (found.proposed, found.followed) == (["ring"], ["followed"])
    assert rivals == [(), (["tried"],)]  # what came near being a ring in the first pair is its rival
    (first, laid_first), (back, laid_back) = asked
    assert first == laid_first == pairs
    assert laid_back == pairs[::-1]
    # What is proposed is of the last pair as it is; the others come later than it, as far apart as they are.
    assert back[0] is pairs[2]
    for k, other in enumerate(reversed(pairs[:2]), 1):
        by_ns = 2 * (pairs[2].stamp_ns - other.stamp_ns)
        assert back[k].stamp_ns == other.stamp_ns + by_ns > back[k - 1].stamp_ns
        for plane, frame in other.frames.items():
            later = back[k].frames[plane]
            assert later.stamp_ns == frame.stamp_ns + by_ns
            assert later.pixels is frame.pixels
            assert later.projection is frame.projection
    for seen_first in (Look(["ring"], ["followed"]), Look([], ["followed"], [], 0.1)):  # type: ignore[list-item]
        asked.clear()
        assert find_rings(pairs, CONFIG) is seen_first
        assert len(asked) == 1


@pytest.mark.slow
def test_backwards_no_r_peaks_are_heard() -> None:
    pairs = [replace(pair(index), r_peaks_ns=(0, 800_000_000)) for index in range(3)]
    assert [one.r_peaks_ns for one in ring_finder._backwards(pairs)] == [(), (), ()]


def test_a_ring_that_goes_on_backwards_is_one() -> None:
    pairs = [pair(index) for index in range(3)]
    (ring,), (back,) = (find_rings(some, CONFIG).proposed for some in (pairs, ring_finder._backwards(pairs)))
    assert back.pair is pairs[2]
    assert distance_to_curve(CURVE + moved(2), back.points).mean() < 0.6e-3
    assert back.judgement.evidence == pytest.approx(ring.judgement.evidence, abs=4.0)


@pytest.mark.slow
def test_what_a_look_says_of_a_ring_adds_to_a_later_one_that_shares_no_pair_with_it() -> None:
    first = find_rings([pair(index) for index in range(3)], CONFIG)
    (ring,) = first.proposed
    assert ring.judgement.before == 0.0
    overlapping = find_rings([pair(index) for index in range(2, 5)], CONFIG, known=first.followed)
    assert overlapping.proposed[0].judgement.before == 0.0
    assert len(overlapping.followed[0].looks) == 2
    later = find_rings([pair(index) for index in range(5, 8)], CONFIG, known=overlapping.followed)
    assert later.proposed[0].judgement.before > 1.0


@pytest.mark.slow
def test_a_ring_that_a_plane_sees_edge_on_is_proposed_and_a_look_asks_often_whether_to_go_on() -> None:
    normal = np.cross(VIEWS["b"].source - LOOP.centre, [0.2, 0.1, 1.0])
    normal /= np.linalg.norm(normal)
    axis = np.cross(LOOP.normal, normal)
    turn = rotation_from_vector(axis / np.linalg.norm(axis) * np.arccos(LOOP.normal @ normal))
    curve = LOOP.centre + (CURVE - LOOP.centre) @ turn.T
    images = {plane: lasso_image(curve, view) for plane, view in VIEWS.items()}
    asked = [time.thread_time()]

    def go_on() -> bool:
        asked.append(time.thread_time())
        return True

    (ring,) = find_rings([pair_of(index, images) for index in range(3)], CONFIG, go_on=go_on).proposed
    assert np.linalg.norm(ring.centre - curve.mean(axis=0)) < 1e-3
    assert distance_to_curve(curve, ring.points).mean() < 0.6e-3
    # Whoever clicks waits for none of it: so much of a look goes on at most.
    assert max(np.diff([*asked, time.thread_time()])) < 0.25 * (time.thread_time() - asked[0])


def test_one_plane_alone_proposes_nothing() -> None:
    assert find_rings([pair(index, planes="a") for index in range(3)], CONFIG).proposed == []


def test_a_look_that_is_overtaken_gives_up() -> None:
    with pytest.raises(OvertakenError):
        find_rings([pair(index) for index in range(3)], CONFIG, go_on=lambda: False)


@pytest.mark.slow
def test_images_too_small_or_blank_propose_nothing() -> None:
    small = {plane: Frame(0, np.full((32, 32), 100, np.uint8), projection(plane)) for plane in ("a", "b")}
    assert find_rings([FramePair(0, small["a"], small["b"])] * 3, CONFIG).proposed == []
    blank = {plane: Frame(0, np.zeros((view.height, view.width), np.uint16), view) for plane, view in VIEWS.items()}
    assert find_rings([FramePair(0, blank["a"], blank["b"])] * 3, CONFIG).proposed == []
    strips = {plane: view.read_out(200, 200, 24, 300, 1, 1) for plane, view in VIEWS.items()}
    narrow = {plane: Frame(0, np.zeros((300, 24), np.uint8), view) for plane, view in strips.items()}
    assert find_rings([FramePair(0, narrow["a"], narrow["b"])] * 3, CONFIG).proposed == []
