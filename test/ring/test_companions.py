"""What moves with the heart beside the ring: which of it is believed, and what it tells of the ring's place."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from support.lasso_inputs import CURVE, LOOP, VIEWS

from lasso_motion_ros.geometry.frames import Frame, FramePair
from lasso_motion_ros.ring.companion_patches import CompanionGrid, PatchTuning, find_patches, follow_patch
from lasso_motion_ros.ring.companions import Companions
from lasso_motion_ros.ring.plane_companions import CompanionTuning

PAIR_S = 0.3
MODEL = SimpleNamespace(
    centre=LOOP.centre,
    points=CURVE,
    bright=False,
    shift=lambda plane, projection: np.zeros(2),
)
# Two devices of four electrodes each, metres from the ring's centre; seen beside it in both planes.
DEVICES = {
    "sinus": np.array([[0.026 + 0.004 * i, 0.012 + 0.002 * i, -0.026 + 0.003 * (i % 2)] for i in range(4)]),
    "lead": np.array([[-0.030 - 0.003 * (i % 2), -0.016 - 0.004 * i, 0.026 + 0.004 * i] for i in range(4)]),
}


def breath(time_s, depth_m=0.010, period_s=4.0):
    """(3,) m down and a little forward."""
    return depth_m * 0.5 * (1.0 - np.cos(2.0 * np.pi * time_s / period_s)) * np.array([0.1, 0.3, -1.0])


def image(plane, places, random):
    """An X-ray image (h, w) of electrodes at world points (N, 3) m."""
    view = VIEWS[plane]
    grey = np.full((view.height, view.width), 120.0, np.float32)
    radius = 0.8 / view.millimetres_per_pixel(LOOP.centre)
    for x, y in view.project(places):
        cv2.circle(grey, (round(16 * x), round(16 * y)), round(16 * radius), 80.0, cv2.FILLED, cv2.LINE_AA, 4)
    return np.clip(cv2.GaussianBlur(grey, (0, 0), 1.0) + 3.0 * random.normal(size=grey.shape), 0, 255).astype(np.uint8)


class Stage:
    """A ring and devices that move as a test says; the ring itself need not be drawn to be followed.

    Args:
        moves: name of a device → (3,) m as a function of the time; those left out are not there.
        tuning: of the companions, if it is not the usual.
    """

    def __init__(self, moves, tuning=None):
        self.moves, self.random = moves, np.random.default_rng(1)
        self.companions = Companions(tuning or CompanionTuning())
        self.companions.find(self.pair(0.0), MODEL, dict.fromkeys("ab", LOOP.centre))

    def pair(self, time_s, views=None):
        places = np.vstack([LOOP.centre + DEVICES[name] + move(time_s) for name, move in self.moves.items()])
        stamp = round(1e9 * time_s)
        frames = {p: Frame(stamp, image(p, places, self.random), (views or VIEWS)[p]) for p in "ab"}
        return FramePair(stamp, frames["a"], frames["b"])

    def see(self, time_s, ring, *, learn=True, is_believed=True, views=None):
        """Log odds that a ring that has moved by (3,) m is in its place."""
        pair = self.pair(time_s, views)
        detection = SimpleNamespace(planes=dict.fromkeys("ab", SimpleNamespace(centre=LOOP.centre + ring)))
        foretold = LOOP.centre + breath(time_s)
        odds = self.companions.look(time_s, pair, detection, foretold, is_believed=is_believed)
        if learn:
            self.companions.accept()
            self.companions.learn(MODEL)
        return odds

    def breathe(self, until_s, start_s=0.0):
        return [self.see(t, breath(t)) for t in np.arange(start_s + PAIR_S, until_s, PAIR_S)]


def test_patches_hold_the_devices_and_not_the_ring():
    places = np.vstack([LOOP.centre + DEVICES["sinus"], CURVE[::8]])
    frame = Frame(0, image("a", places, np.random.default_rng(1)), VIEWS["a"])
    grid = CompanionGrid.of(frame, LOOP.centre, bright=False)
    ring = VIEWS["a"].project(CURVE)
    patches = find_patches(frame, grid, ring, PatchTuning(count=1))
    (patch,) = patches
    away = VIEWS["a"].project(LOOP.centre + DEVICES["sinus"]) / grid.cell_px - patch.home
    assert np.linalg.norm(away, axis=1).min() * grid.cell_mm < 4.0
    assert np.linalg.norm(ring / grid.cell_px - patch.home, axis=1).min() * grid.cell_mm >= 9.0
    assert find_patches(frame, grid, ring, PatchTuning(count=0)) == []
    tiny = Frame(0, frame.pixels[:40, :40], VIEWS["a"].cropped(0, 0, 40, 40))
    assert find_patches(tiny, grid, ring, PatchTuning()) == []


@pytest.mark.parametrize("bright", [False, True])
def test_a_patch_is_followed_to_a_tenth_of_a_millimetre(bright):
    random = np.random.default_rng(3)
    images = [
        image("a", LOOP.centre + DEVICES["sinus"] + move, random) for move in (0.0, np.array([0.0, 0.001, -0.004]))
    ]
    frames = [Frame(0, 255 - one if bright else one, VIEWS["a"]) for one in images]
    grid = CompanionGrid.of(frames[0], LOOP.centre, bright=bright)
    patch = find_patches(frames[0], grid, VIEWS["a"].project(CURVE), PatchTuning(count=1))[0]
    centre = LOOP.centre + DEVICES["sinus"].mean(axis=0)
    true = np.diff(VIEWS["a"].project(np.stack([centre, centre + np.array([0.0, 0.001, -0.004])])), axis=0)[0]
    true_mm = true * grid.cell_mm / grid.cell_px
    found_mm, likeness = follow_patch(patch, frames[1], grid, np.array([[0.0, 0.0], true_mm + 2.0]), PatchTuning())
    np.testing.assert_allclose(found_mm, true_mm, atol=0.1)
    assert likeness > 0.8
    # Nothing of it is in the image there: it is not found, and taken to be where it was likeliest.
    away, nothing = follow_patch(patch, frames[1], grid, np.array([[500.0, 0.0]]), PatchTuning())
    assert nothing == 0.0
    np.testing.assert_array_equal(away, [500.0, 0.0])


def test_what_breathes_with_the_ring_vouches_for_it_and_tells_when_a_hand_has_moved_it():
    stage = Stage({"sinus": breath})
    odds = stage.breathe(4.0)
    assert min(odds[6:]) > 3.0
    along = breath(2.0) / np.linalg.norm(breath(2.0))  # where a deeper breath would take it, too
    assert stage.see(4.2, breath(4.2) + 0.008 * along, learn=False) < -6.0
    assert stage.see(4.5, breath(4.5), learn=False) > 3.0


def test_what_lies_still_never_speaks():
    # It has agreed with the ring while that lay still, too.
    stage = Stage({"sinus": lambda t: np.zeros(3)})
    for step in range(1, 11):
        assert stage.see(PAIR_S * step, np.zeros(3)) > 0.0
    odds = [stage.see(3.0 + t, breath(t)) for t in np.arange(PAIR_S, 8.0, PAIR_S)]
    assert min(odds) > -2.0
    assert stage.companions.slide.size_m < 0.5e-3


def test_what_moves_half_as_far_is_not_in_the_heart():
    # A probe in the oesophagus moves with the breath, and by itself.
    stage = Stage({"sinus": lambda t: 0.45 * breath(t) + (0.006 if t > 6.0 else 0.0) * np.array([0.2, 0.1, -1.0])})
    odds = stage.breathe(10.0)
    assert min(odds[20:]) > -2.0
    assert stage.companions.slide.beyond(2e-3) < 0.05


@pytest.mark.parametrize("speed_mm_s", [0.3, 0.6])
def test_a_slide_along_the_breath_is_measured(speed_mm_s):
    stage = Stage({"sinus": breath, "lead": breath})
    stage.breathe(8.0)
    along = breath(2.0) / np.linalg.norm(breath(2.0))
    doubted = None
    for t in np.arange(8.1, 8.0 + 2.5 / speed_mm_s, PAIR_S):
        slid_mm = speed_mm_s * (t - 8.0)
        stage.see(t, breath(t) + 1e-3 * slid_mm * along)
        slide = stage.companions.slide
        assert slide.is_known
        assert abs(1e3 * slide.size_m - slid_mm) < 0.6
        if doubted is None and slide.beyond(2e-3) > 0.05:
            doubted = slid_mm
    assert 1.0 < doubted < 2.2


def test_places_of_one_heartbeat_are_learned_as_one():
    stage = Stage({"sinus": breath})
    for t in np.arange(0.1, 1.25, 0.1):
        stage.see(t, breath(t))
    # Of twelve places those after 0.1, 0.4, 0.7 and 1.0 s.
    assert {plane._learned for plane in stage.companions._planes.values()} == {4}


def test_a_device_that_is_moved_by_itself_is_no_slide():
    def moved(t):
        return breath(t) + 0.6e-3 * max(t - 9.0, 0.0) * np.array([0.0, 1.0, 0.2])

    stage = Stage({"sinus": breath, "lead": moved}, CompanionTuning(kept=4))  # all of them are followed on
    stage.breathe(9.0)
    odds, slid_m = [], []
    for t in np.arange(9.3, 14.0, PAIR_S):
        odds.append(stage.see(t, breath(t)))
        slid_m.append(stage.companions.slide.size_m)
    assert min(odds) > -2.0
    assert max(slid_m) < 0.3e-3


def test_a_breath_far_beyond_those_before_may_take_it_otherwise():
    # Up to 8 mm they go together, of what is deeper the device takes part in four fifths.
    def shallow(t):
        return breath(t, depth_m=0.008)

    def deep(t):
        return breath(t, depth_m=0.030)

    stage = Stage({"sinus": lambda t: shallow(t) if t < 8.0 else shallow(t) + 0.8 * (deep(t) - shallow(t))})
    for t in np.arange(PAIR_S, 8.0, PAIR_S):
        stage.see(t, shallow(t))
    odds = [stage.see(t, deep(t)) for t in np.arange(8.0, 12.0, PAIR_S)]
    assert min(odds) > -4.0
    # Within what was seen a hand is noticed as before.
    assert stage.see(12.3, shallow(12.3) + np.array([0.0, 0.010, 0.0]), learn=False) < -6.0


def test_where_it_is_not_believed_to_be_it_has_not_slid():
    stage = Stage({"sinus": breath})
    stage.breathe(6.0)
    before = stage.companions.slide
    stage.see(6.3, breath(6.3) + np.array([0.0, 0.0, 0.012]), learn=False, is_believed=False)
    assert stage.companions.slide is before


def test_in_another_view_they_are_looked_for_anew_once_it_rests():
    stage = Stage({"sinus": breath})
    stage.breathe(5.0)
    other = {p: VIEWS[p].shifted(30.0, 12.0) for p in "ab"}
    assert stage.see(5.1, breath(5.1), views=other) == 0.0
    assert stage.see(5.4, breath(5.4), views=other) == 0.0  # found here
    odds = [stage.see(t, breath(t), views=other) for t in np.arange(5.7, 9.9, PAIR_S)]
    assert min(odds[6:]) > 3.0


def test_a_ring_that_belongs_elsewhere_has_to_learn_them_again():
    stage = Stage({"sinus": breath})
    stage.breathe(5.0)
    stage.companions = stage.companions.anew(5.0)
    place = np.array([0.0, 0.012, 0.004])
    odds = [stage.see(t, breath(t) + place) for t in np.arange(5.1, 10.0, PAIR_S)]
    assert min(odds[8:]) > 3.0
    assert stage.companions.slide.size_m < 0.5e-3


def test_nothing_beside_it_says_nothing():
    stage = Stage({"sinus": breath}, CompanionTuning(patches=PatchTuning(count=0)))
    assert set(stage.breathe(6.0)) == {0.0}
    assert not stage.companions.slide.is_known
