"""What a pair is looked at for: near the prediction first, then everywhere, until the ring is plainly there."""

import copy
from functools import cache

import numpy as np
import pytest
from support.lasso_inputs import CURVE, LOOP, PERIOD_NS, VIEWS, lasso_image, lasso_pair, lasso_seed, noisy

from lasso_motion_ros.config.ring import SearchConfig
from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.geometry.frames import Frame, FramePair
from lasso_motion_ros.ring import detector, plane_search
from lasso_motion_ros.ring.alignment import align
from lasso_motion_ros.ring.detector import DetectorTuning, Expectation
from lasso_motion_ros.ring.loop_views import LoopViews
from lasso_motion_ros.ring.search import Peaks, SearchCandidate, join_peaks
from lasso_motion_ros.ring.tracker import RingTracker
from lasso_motion_ros.ring.working_image import working_image

CONFIG = TrackerConfig()
DOWN = np.array([0.0, 0.001, -0.005])
FAR = np.array([0.0, 0.0, 0.03])  # where nothing is
ASIDE = np.array([0.0, 0.0, 0.012])  # nor there, and near


def candidates(*places):
    """The search's answer: per candidate, where each plane would show the loop, from its centre at the reference."""
    found = [{plane: LOOP.centre + place for plane, place in zip("ab", both, strict=True)} for both in places]
    return [SearchCandidate(20.0 - 0.1 * rank, centres) for rank, centres in enumerate(found)]


@pytest.fixture
def aligned(monkeypatch):
    """Where alignments started from."""
    starts = []

    def spied(images, template, arms, centres, *others):
        starts.append(centres)
        return align(images, template, arms, centres, *others)

    monkeypatch.setattr(detector, "align", spied)
    return starts


@cache
def seeded():
    tracker = RingTracker(CONFIG)
    tracker.initialise(lasso_pair(0, np.zeros(3)), lasso_seed())
    return tracker


@pytest.fixture
def track():
    """A track of which the seed pair has been seen; each test has its own."""
    return copy.deepcopy(seeded())._track


def detect(track, pair, config=CONFIG, *, tuning=None, **expected):
    values = {"turn": track.turn, "stretch": track.stretch, "support": track.usual_support, "is_followed": True}
    if tuning is not None:
        track.detector._tuning = tuning
    return track.detector.detect(pair, Expectation(track.motion, **(values | expected)), config)


def off_mm(detection, place):
    """How far both planes' fits are from a displacement, across their rays."""
    return max(
        1e3 * float(np.abs(fit.across @ (fit.centre - LOOP.centre - place)).max()) for fit in detection.planes.values()
    )


def test_the_ring_is_the_detection_with_the_most_support(track):
    found = detect(track, lasso_pair(1, DOWN))
    assert off_mm(found[0], DOWN) < 0.05
    assert found[0].support > 2.0
    assert [one.support for one in found] == sorted((one.support for one in found), reverse=True)


def test_without_a_plane_nothing_is_detected(track):
    assert detect(track, lasso_pair(1, DOWN, planes="")) == []
    (alone, *_) = detect(track, lasso_pair(1, DOWN, planes="b"))
    assert set(alone.planes) == {"b"}
    assert off_mm(alone, DOWN) < 0.05


def test_where_nothing_is_nothing_is_supported(track):
    for detection in detect(track, lasso_pair(1, None)):
        assert detection.support < 1.2


def test_far_from_the_prediction_it_is_found_all_the_same(track):
    # 40 mm along the patient: outside the part that is looked at first.
    far = np.array([0.0, 0.0, -0.04])
    found = detect(track, lasso_pair(1, far), TrackerConfig(search=SearchConfig(near_mm=2.0)))
    assert off_mm(found[0], far) < 0.05


def test_exposures_are_counted_from_the_reference_and_b_is_never_before_a(track):
    frame = lasso_pair(3, DOWN).a
    early = Frame(3 * PERIOD_NS - 2_000_000, frame.pixels, VIEWS["b"])
    times = track.detector.exposures(FramePair(3 * PERIOD_NS, frame, early))
    assert times == {"a": pytest.approx(3e-9 * PERIOD_NS), "b": pytest.approx(3e-9 * PERIOD_NS)}
    late = Frame(3 * PERIOD_NS + 50_000_000, frame.pixels, VIEWS["b"])
    assert track.detector.exposures(FramePair(3 * PERIOD_NS, frame, late))["b"] - times["a"] == pytest.approx(0.05)
    assert track.detector.exposures(FramePair(3 * PERIOD_NS, frame, None)).keys() == {"a"}


@pytest.fixture
def looked_at(monkeypatch):
    """The frames of which a working image was made."""
    frames = []

    def spied(frame, *others, **named):
        frames.append(frame)
        return working_image(frame, *others, **named)

    monkeypatch.setattr(detector, "working_image", spied)
    return frames


@pytest.mark.parametrize("is_as_expected", [True, False])
def test_what_was_worked_out_ahead_is_taken_if_all_is_as_expected_then(track, looked_at, is_as_expected):
    pair = lasso_pair(1, DOWN)
    expected = Expectation(track.motion, track.turn, track.stretch, track.usual_support, is_followed=True)
    track.detector.prepare(pair.a, expected, CONFIG)
    assert looked_at == [pair.a]
    config = CONFIG if is_as_expected else TrackerConfig(search=SearchConfig(near_mm=CONFIG.search.near_mm + 1.0))
    found = detect(track, pair, config)
    assert looked_at == ([pair.a, pair.b] if is_as_expected else [pair.a, pair.a, pair.b])
    assert off_mm(found[0], DOWN) < 0.05


def test_what_was_worked_out_ahead_about_the_prediction_is_not_taken_for_the_whole(track, looked_at):
    pair = lasso_pair(1, FAR)
    expected = Expectation(track.motion, track.turn, track.stretch, track.usual_support, is_followed=True)
    track.detector.prepare(pair.a, expected, CONFIG)
    found = detect(track, pair)
    assert looked_at == [pair.a, pair.b, pair.a, pair.b]
    assert off_mm(found[0], FAR) < 0.1


@pytest.mark.parametrize("moved", [DOWN, None], ids=["there", "out of view"])
@pytest.mark.parametrize("turned", [0.0, 0.1])
def test_of_a_ring_that_is_not_followed_all_that_may_be_asked_for_is_worked_out_ahead(
    monkeypatch, track, looked_at, moved, turned
):
    pair, searched = lasso_pair(1, moved), []
    for name in ("find_peaks", "find_electrodes"):
        look = getattr(plane_search, name)
        monkeypatch.setattr(
            plane_search,
            name,
            lambda image, *args, _look=look, **kind: searched.append(image) or _look(image, *args, **kind),
        )
    ahead = Expectation(track.motion, track.turn + turned, track.stretch, track.usual_support, is_followed=False)
    track.detector.prepare(pair.a, ahead, CONFIG)
    assert looked_at == [pair.a]
    assert len(searched) == 4  # by the template in three sizes, and by electrodes
    begun, searched[:] = searched[0], []
    found = detect(track, pair, is_followed=False)
    assert looked_at == [pair.a, pair.b]
    # Electrodes are looked for anew where the ring lies otherwise by now.
    assert searched.count(begun) == (1 if moved is None and turned else 0)
    alone = detect(track, pair, is_followed=False)
    assert [one.support for one in found] == [one.support for one in alone]


def test_plainly_there_nothing_else_is_looked_for(monkeypatch, track, aligned):
    monkeypatch.setattr(
        detector,
        "join_peaks",
        lambda *_: [*candidates((DOWN, DOWN)), SearchCandidate(10.0, candidates((FAR, FAR))[0].centres)],
    )
    detect(track, lasso_pair(1, DOWN))
    assert len(aligned) == 1


def test_a_rival_in_the_search_is_aligned_though_the_ring_is_found(monkeypatch, track, aligned):
    monkeypatch.setattr(detector, "join_peaks", lambda *_: candidates((DOWN, DOWN), (ASIDE, ASIDE)))
    found = detect(track, lasso_pair(1, DOWN))
    assert len(aligned) == 2
    assert off_mm(found[0], DOWN) < 0.05


def test_what_was_tried_is_not_tried_again(monkeypatch, track, aligned):
    nowhere = [(DOWN - ASIDE, DOWN + side * ASIDE) for side in (-1.0, -0.7, 0.7, 1.0)]
    monkeypatch.setattr(detector, "join_peaks", lambda *_: candidates(*nowhere))
    detect(track, lasso_pair(1, DOWN), tuning=DetectorTuning(from_afar=False))
    assert len(aligned) == 4  # near the prediction; in the whole picture they are known


def test_not_followed_only_the_whole_is_looked_at(monkeypatch, track):
    asked = []
    search = track.detector._by_template
    monkeypatch.setattr(
        track.detector, "_by_template", lambda *args, near: asked.append(near) or search(*args, near=near)
    )
    detect(track, lasso_pair(1, None), is_followed=False)
    assert asked == [False]
    detect(track, lasso_pair(1, None))
    assert asked == [False, True, False]
    detect(track, lasso_pair(1, None), tuning=DetectorTuning(near_first=False))
    assert asked == [False, True, False, False]


def test_where_the_template_shows_nothing_plain_the_electrodes_are_looked_for(monkeypatch, track):
    nothing = Peaks(np.zeros(0), np.zeros((0, 2)), None)
    monkeypatch.setattr(plane_search, "find_peaks", lambda *_, **__: nothing)
    monkeypatch.setattr(detector, "join_peaks", lambda peaks, *known: join_peaks(peaks, *known) if shown(peaks) else [])
    found = detect(track, lasso_pair(1, DOWN))
    assert off_mm(found[0], DOWN) < 0.05
    assert detect(track, lasso_pair(1, DOWN), is_followed=False)
    # What one plane alone shows is a coincidence too often; and the tuning's word.
    assert detect(track, lasso_pair(1, DOWN, planes="a")) == []
    assert detect(track, lasso_pair(1, DOWN), tuning=DetectorTuning(electrodes=False)) == []


@pytest.mark.parametrize(("score", "is_better"), [(19.0, False), (20.1, False), (21.0, True)])  # 20 as it was
def test_a_ring_of_another_size_is_aligned_where_it_fits_better_than_as_it_was(monkeypatch, track, score, is_better):
    asked, starts = [], []

    def by_size(image, template, centre, arms, reach_mm=None):
        asked.append(float(np.log(np.linalg.norm(arms) / np.linalg.norm(track.model.arms))))
        return Peaks(np.array([score if asked[-1] < -0.01 else 20.0]), np.zeros((1, 2)), image)

    def join(peaks, *_):
        return [SearchCandidate(float(peaks["a"].scores[0]), dict.fromkeys("ab", LOOP.centre + FAR))]

    def spied(images, template, arms, centres, prior, turn, stretch):
        starts.append(stretch)
        return align(images, template, arms, centres, prior, turn, stretch)

    monkeypatch.setattr(plane_search, "find_peaks", by_size)
    monkeypatch.setattr(detector, "join_peaks", join)
    monkeypatch.setattr(detector, "align", spied)
    detect(track, lasso_pair(1, None), tuning=DetectorTuning(from_afar=False, electrodes=False))
    own = CONFIG.ring.stretch
    assert {-2.0 * own, 2.0 * own} <= {round(size, 6) for size in asked}
    assert (-2.0 * own in starts) == is_better
    assert 2.0 * own not in starts


def test_plainly_there_it_is_looked_for_in_no_other_size(monkeypatch, track):
    monkeypatch.setattr(track.detector, "_by_size", lambda *_: pytest.fail("nobody needs to know"))
    assert detect(track, lasso_pair(1, DOWN))


def shown(peaks):
    return all(len(found.scores) for found in peaks.values())


def test_what_lay_outside_the_first_look_is_tried_again(monkeypatch):
    """Cut by the edge of the part about the prediction a loop shows as a peak there, too, but cannot be aligned."""
    config = TrackerConfig(search=SearchConfig(near_mm=2.0))
    tracker = RingTracker(config)
    tracker.initialise(lasso_pair(0, np.zeros(3)), lasso_seed())
    for index in range(1, 5):  # so that little is looked at about the prediction
        tracker.track(lasso_pair(index, np.zeros(3)))
    monkeypatch.setattr(detector, "join_peaks", lambda *_: candidates((FAR, FAR)))
    found = detect(tracker._track, lasso_pair(5, FAR), config, tuning=DetectorTuning(from_afar=False))
    assert off_mm(found[0], FAR) < 0.1
    assert found[0].support > 2.0


def test_two_alignments_that_end_in_one_place_are_one_detection(monkeypatch, track, aligned):
    beside = DOWN + np.array([0.0, 0.0, 0.0004])
    monkeypatch.setattr(detector, "join_peaks", lambda *_: candidates((DOWN, DOWN), (beside, beside)))
    found = detect(track, lasso_pair(1, DOWN))
    assert len(aligned) == 2
    assert len(found) == 1


def test_two_rings_are_two_detections(track):
    aside = np.array([0.020, 0.012, 0.009])
    images = {}
    for plane in "ab":
        empty = lasso_image(CURVE + 10.0, VIEWS[plane]).astype(float)
        images[plane] = empty + sum(lasso_image(CURVE + at, VIEWS[plane]) - empty for at in (DOWN, DOWN + aside))
    frames = {plane: Frame(PERIOD_NS, noisy(images[plane], [1, ord(plane)]), VIEWS[plane]) for plane in "ab"}
    found = detect(track, FramePair(PERIOD_NS, frames["a"], frames["b"]), is_followed=False)
    for place in (DOWN, DOWN + aside):
        plain = [one for one in found if off_mm(one, place) < 0.1]
        assert len(plain) == 1
        assert plain[0].support > 1.8


def test_where_a_twin_tells_that_the_ring_would_be_it_is_looked_for(track, aligned):
    away = np.array([0.002, 0.009, 0.018])
    found = detect(track, lasso_pair(1, DOWN), twins=away[None])
    assert len(aligned) == 3  # the ring, and either way from it
    for centres, place in zip(aligned[1:], (DOWN + away, DOWN - away), strict=True):
        for plane, centre in centres.items():
            across = found[0].planes[plane].across
            np.testing.assert_allclose(across @ (centre - LOOP.centre - place), 0.0, atol=2e-4)
    assert off_mm(found[0], DOWN) < 0.05


def test_what_is_given_up_is_no_detection(monkeypatch, track, aligned):
    def fits(*_):
        raise AssertionError("nobody needs to know")

    monkeypatch.setattr(LoopViews, "fits", fits)
    monkeypatch.setattr(detector, "join_peaks", lambda *_: candidates((DOWN, DOWN), (FAR, FAR)))
    assert detect(track, lasso_pair(1, None), tuning=DetectorTuning(from_afar=False)) == []
    assert len(aligned) == 2
