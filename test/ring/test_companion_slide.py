"""How far the ring has slid from what moves with the heart beside it, by hand-computed numbers."""

import dataclasses

import numpy as np
import pytest

from lasso_motion_ros.ring.companion_slide import CompanionSlide, CompanionSlideTuning, SlideSight
from lasso_motion_ros.ring.slide import Slide

MM = 1e-3
# Of a ring that only stands, and of normal noise.
TUNING = CompanionSlideTuning(
    first_m=1.0 * MM, wander_m=0.0, begins_per_s=0.0, rests_per_s=0.0, speed_m_s=1.0 * MM, freedom=1e9
)
XY, XZ = np.eye(3)[[0, 1]], np.eye(3)[[0, 2]]


def shown(across, along_mm, variance_mm2=1.0, learned_mm2=0.0):
    return SlideSight(across, MM * np.array(along_mm), MM**2 * variance_mm2, MM**2 * learned_mm2)


def followed(offset_mm, until_s, tuning, *, interval_s=0.5, sigma_mm=0.45, learned_mm2=0.0, seed=1):
    """(t, slide) after each pair in which both planes show the ring offset_mm(t) along x, and noise."""
    slide, random, told = CompanionSlide.first(tuning), np.random.default_rng(seed), []
    for time_s in np.arange(interval_s, until_s + 1e-9, interval_s):
        place = np.array([offset_mm(time_s), 0.0, 0.0])
        planes = [
            shown(across, across @ place + sigma_mm * random.normal(size=2), sigma_mm**2, learned_mm2)
            for across in (XY, XZ)
        ]
        slide = slide.after(interval_s, planes)
        told.append((time_s, slide))
    return told


def test_one_plane_by_hand():
    # Half way from 0 ± 1 to 2 ± 1, in the plane's directions only.
    slide = CompanionSlide.first(TUNING).after(1.0, [shown(XY, [2.0, 0.0])])
    np.testing.assert_allclose(slide.offset, [1.0 * MM, 0.0, 0.0], rtol=1e-6)
    np.testing.assert_allclose(slide.covariance, MM**2 * np.diag([0.5, 0.5, 1.0]), rtol=1e-6)
    assert slide.size_m == pytest.approx(1.0 * MM)


def test_the_planes_share_a_direction():
    slide = CompanionSlide.first(TUNING).after(1.0, [shown(XY, [2.0, 0.0]), shown(XZ, [2.0, 2.0])])
    np.testing.assert_allclose(slide.offset, MM * np.array([4.0 / 3.0, 0.0, 1.0]), rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(slide.covariance, MM**2 * np.diag([1.0 / 3.0, 0.5, 0.5]), rtol=1e-6, atol=1e-12)


def test_it_wanders_where_it_is_seen_only():
    tuning = dataclasses.replace(TUNING, wander_m=2.0 * MM)
    slide = CompanionSlide.first(tuning).after(0.25, [shown(XY, [0.0, 0.0], 1e9)])
    np.testing.assert_allclose(np.diag(slide.covariance), MM**2 * np.array([2.0, 2.0, 1.0]), rtol=1e-6)
    unseen = slide.after(10.0, [])
    np.testing.assert_allclose(unseen.covariance, slide.covariance)


def test_the_odds_of_a_slide_by_hand():
    # One that stands is seen within 1 + 1 mm² of where it was, one that slides by 1 mm/s within 1 + 1 + 1 mm², of two
    # directions each. At 0 the first is likelier by 3 / 2, at 3 mm the second by exp(0.5 · 9 · (1/2 − 1/3)) besides.
    even = dataclasses.replace(CompanionSlide.first(TUNING), log_odds_of_slide=0.0)
    assert even.after(1.0, [shown(XY, [0.0, 0.0])]).log_odds_of_slide == pytest.approx(np.log(2.0 / 3.0))
    seen = even.after(1.0, [shown(XY, [3.0, 0.0])])
    assert seen.log_odds_of_slide == pytest.approx(np.log(2.0 / 3.0) + 0.75, abs=1e-6)
    # One stands half way; the other has come two thirds of it, at a third of it a second.
    np.testing.assert_allclose(seen.states[:, 0], [1.5 * MM, 2.0 * MM])
    np.testing.assert_allclose(seen.states[:, 3], [0.0, 1.0 * MM], atol=1e-15)


def test_it_begins_and_comes_to_rest_by_chance():
    tuning = dataclasses.replace(TUNING, begins_per_s=0.1, rests_per_s=0.2)
    blind = [shown(XY, [0.0, 0.0], 1e12)]
    begun = CompanionSlide.first(tuning).after(1.0, blind).probability
    assert begun == pytest.approx(1.0 - np.exp(-0.1), abs=1e-6)
    rested = dataclasses.replace(CompanionSlide.first(tuning), log_odds_of_slide=25.0).after(1.0, blind).probability
    assert rested == pytest.approx(np.exp(-0.2), abs=1e-6)


@pytest.mark.parametrize("speed_mm_s", [0.4, 0.55, 0.9])
def test_a_slide_is_doubted_before_it_is_two_millimetres_and_not_followed_late(speed_mm_s):
    doubted, late = [], []
    for seed in range(20):
        told = followed(lambda t: speed_mm_s * max(t - 5.0, 0.0), 12.0, CompanionSlideTuning(), seed=seed)
        doubted.append(next(speed_mm_s * (t - 5.0) for t, one in told if one.beyond(2.0 * MM) > 0.05))
        late += [speed_mm_s * (t - 5.0) - one.offset[0] / MM for t, one in told if 5.0 + 2.5 / speed_mm_s < t]
    assert np.median(doubted) < 1.9
    assert min(doubted) > 0.8
    assert abs(np.mean(late)) < 0.15


def test_one_that_may_only_wander_follows_it_late():
    # What the other model is worth, of companions that tell to a millimetre, as many do.
    def lateness(tuning):
        late = []
        for seed in range(20):
            told = followed(lambda t: 0.55 * max(t - 5.0, 0.0), 14.0, tuning, sigma_mm=1.0, seed=seed)
            late += [0.55 * (t - 5.0) - one.offset[0] / MM for t, one in told if t > 11.0]
        return np.mean(late)

    assert lateness(CompanionSlideTuning(begins_per_s=0.0, wander_m=3e-4)) > 0.7
    assert lateness(CompanionSlideTuning()) < 0.2


def test_what_comes_to_rest_is_where_it_is():
    told = followed(lambda t: 0.4 * np.clip(t - 5.0, 0.0, 3.0), 40.0, CompanionSlideTuning())
    _, last = told[-1]
    assert last.probability < 0.05
    assert last.offset[0] == pytest.approx(1.2 * MM, abs=0.4 * MM)
    assert last.beyond(2.0 * MM) < 0.01


def test_what_was_learned_badly_is_as_bad_for_a_part_of_a_breath():
    # Beyond where they were seen before, for a second and a half: 2 mm off, and known to 1.5 mm, in every pair.
    def offset_mm(time_s):
        return 2.0 if 6.0 < time_s < 7.5 else 0.0

    for interval_s in (0.1, 0.27, 0.5):
        known, unknown = (
            max(
                one.beyond(2.0 * MM)
                for _, one in followed(
                    offset_mm, 9.0, CompanionSlideTuning(), interval_s=interval_s, sigma_mm=0.2, learned_mm2=learned_mm2
                )
            )
            for learned_mm2 in (0.0, 2.25)
        )
        assert known > 0.3
        assert unknown < 0.05


def test_pairs_of_one_heartbeat_count_as_one():
    # Ten pairs of a quarter of a second tell as much as one: half way, and not ten elevenths of it.
    slide = CompanionSlide.first(TUNING)
    for _ in range(10):
        slide = slide.after(0.025, [shown(XY, [2.0, 0.0])])
    np.testing.assert_allclose(slide.offset, [1.0 * MM, 0.0, 0.0], rtol=1e-6)


@pytest.mark.parametrize("interval_s", [0.1, 0.27, 0.5])
def test_companions_that_breathe_a_little_otherwise_show_no_slide(interval_s):
    for seed in range(5):
        told = followed(
            lambda t: 0.6 * np.sin(0.5 * np.pi * t), 40.0, CompanionSlideTuning(), interval_s=interval_s, seed=seed
        )
        assert max(one.beyond(2.0 * MM) for _, one in told) < 0.05


def test_it_may_have_slid_while_nothing_showed():
    # Ten seconds later, 4 mm aside: where nothing has been told before, that is no slide.
    told, seen = followed(lambda t: 0.0, 5.0, CompanionSlideTuning())[-1][1], [shown(XY, [4.0, 0.0], 0.3)]
    gone = told
    for _ in range(20):
        gone = gone.after(0.5, [])
    assert gone.beyond(2.0 * MM) == told.beyond(2.0 * MM)  # nothing was told since
    assert gone.after(0.5, seen).beyond(2.0 * MM) > 0.2
    assert told.after(0.5, seen).beyond(2.0 * MM) < 0.01
    new = CompanionSlide.first(CompanionSlideTuning())
    for _ in range(20):
        new = new.after(0.5, [])
    assert new.after(0.5, seen).beyond(2.0 * MM) < 0.01


def test_with_its_own_past_by_hand():
    # 2 ± 0.4 mm across by its own past, 0 ± 0.3 mm by companions: nine parts of sixteen and the rest of 25.
    known = CompanionSlide.at(CompanionSlideTuning(), np.zeros(3), 0.09 * MM**2 * np.eye(3), 0.0)
    known = dataclasses.replace(known, log_odds_of_slide=-3.0)
    both = known.joined(Slide((0.0, 2.0 * MM, 0.0), 5.0))
    # Four standard deviations of 0.5 mm apart are less likely by exp(-8): of each other way they have told.
    assert both.log_odds_of_slide == pytest.approx(-3.0 + 5.0 - 8.0)
    np.testing.assert_allclose(both.states[1, :3], [0.0, 2.0 * MM * 9.0 / 25.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(np.diag(both.covariances[1])[:3], MM**2 * np.array([0.09, 0.0576, 0.09]))
    np.testing.assert_allclose(both.states[0], known.states[0])
    assert known.joined(Slide()) is known


def test_what_is_far_off_once_counts_for_less():
    near = CompanionSlide.first(dataclasses.replace(TUNING, freedom=4.0))
    usual = near.after(1.0, [shown(XY, [1.0, 0.0])]).offset[0]
    far = near.after(1.0, [shown(XY, [20.0, 0.0])]).offset[0]
    assert usual == pytest.approx(0.5 * MM)
    assert far < 5.0 * MM


@pytest.mark.parametrize("away_mm", [8.0, 20.0])
def test_what_a_hand_has_put_elsewhere_is_there_by_the_second_pair_and_back_likewise(away_mm):
    slide, there, here = CompanionSlide.first(CompanionSlideTuning()), [away_mm, 0.0], [0.0, 0.0]

    def seen(slide, along):
        return slide.after(0.3, [shown(XY, along, 0.09), shown(XZ, along, 0.09)])

    for _ in range(6):
        slide = seen(slide, here)
    once = seen(slide, there)
    assert once.size_m < 0.5 * away_mm * MM
    twice = seen(once, there)
    assert twice.size_m == pytest.approx(away_mm * MM, rel=0.1)
    for _ in range(30):
        twice = seen(twice, there)
    back = seen(seen(twice, here), here)
    assert back.size_m < 0.5 * MM
    assert back.beyond(2.0 * MM) < 0.01


def test_the_probability_of_more_than_a_limit_by_hand():
    # Two standard deviations within the estimate, and known as well to either side of it.
    slide = CompanionSlide.at(TUNING, MM * np.array([0.0, 3.0, 0.0]), MM**2 * 0.25 * np.eye(3))
    # As counted of a million.
    assert slide.beyond(2.0 * MM) == pytest.approx(0.9863, abs=0.005)
    assert slide.log_odds(2.0 * MM) == pytest.approx(np.log(slide.beyond(2.0 * MM) / (1.0 - slide.beyond(2.0 * MM))))
    # χ² of three degrees of freedom is more than 4 in 0.2615.
    assert CompanionSlide.first(TUNING).beyond(2.0 * MM) == pytest.approx(0.2615, abs=1e-4)
    assert CompanionSlide.first(CompanionSlideTuning()).beyond(2.0 * MM) < 1e-12
    # Of both models, each by its odds.
    states = np.zeros((2, 6))
    states[1, 0] = 4.0 * MM
    either = CompanionSlide.at(TUNING, np.zeros(3), 0.01 * MM**2 * np.eye(3))
    either = dataclasses.replace(either, states=states, log_odds_of_slide=np.log(0.25))
    assert either.beyond(2.0 * MM) == pytest.approx(0.2, abs=1e-6)
    np.testing.assert_allclose(either.offset, [0.8 * MM, 0.0, 0.0])
    np.testing.assert_allclose(np.diag(either.covariance), MM**2 * np.array([0.01 + 0.16 * 16.0, 0.01, 0.01]))


def test_it_is_known_while_both_planes_show_companions():
    first = CompanionSlide.first(TUNING)
    assert not first.is_known  # nothing was seen yet
    both = first.after(0.3, [shown(XY, [0.0, 0.0], 0.1), shown(XZ, [0.0, 0.0], 0.1)])
    assert both.is_known
    assert both.after(1.9, [shown(XY, [0.0, 0.0], 0.1)]).is_known
    assert not both.after(2.1, [shown(XY, [0.0, 0.0], 0.1)]).is_known
    assert not first.after(0.3, [shown(XY, [0.0, 0.0], 9.0), shown(XZ, [0.0, 0.0], 9.0)]).is_known


def test_it_is_told_while_one_plane_shows_companions():
    first = CompanionSlide.first(CompanionSlideTuning())
    assert not first.is_told
    assert not first.after(0.3, []).is_told
    one = first.after(0.3, [shown(XY, [0.0, 0.0], 0.1)])
    assert one.is_told
    assert not one.is_known
    assert one.after(1.9, []).is_told
    assert not one.after(2.1, []).is_told


def test_one_plane_and_its_own_past_tell_together_of_a_slide_and_of_none():
    # Its past makes 1.2 mm of it, along y. The plane sees that way, and either the like of it or nothing.
    own, told = Slide((0.0, 1.2 * MM, 0.0), 5.0), CompanionSlideTuning()
    stands = slides = CompanionSlide.first(told)
    for index in range(1, 11):
        slid_mm = 0.12 * index
        stands = stands.after(0.5, [shown(XY, [0.0, 0.0], 0.1)])
        slides = slides.after(0.5, [shown(XY, [0.0, slid_mm], 0.1)])
    assert stands.joined(own).probability < 0.05
    assert stands.joined(own).beyond(2.0 * MM) < 0.01
    assert slides.joined(own).probability > 0.9
    assert slides.joined(own).offset[1] == pytest.approx(1.2 * MM, abs=0.15 * MM)


def test_along_the_ray_of_the_plane_that_alone_shows_them_its_own_past_tells():
    own = Slide((0.5 * MM, 0.0, 2.0 * MM), 6.0)
    alone = both = CompanionSlide.first(CompanionSlideTuning())
    for _ in range(10):
        seen = shown(XY, [0.0, 0.0], 0.1)
        alone, both = alone.after(0.5, [seen]), both.after(0.5, [seen, shown(XZ, [0.0, 0.0], 0.1)])
    assert alone.hidden(own) == Slide((0.0, 0.0, 2.0 * MM), 6.0)
    assert both.hidden(own) == Slide()


def test_a_slide_may_have_gone_on_or_begun_since_their_last_word():
    known = CompanionSlide.at(CompanionSlideTuning(), np.zeros(3), 0.09 * MM**2 * np.eye(3), 0.0)
    own = Slide((0.0, 2.0 * MM, 0.0), 9.0)
    later = known
    for _ in range(4):
        later = later.after(0.5, [])
    now, then = known.joined(own), later.joined(own)
    # By 0.4 mm in each of two seconds: 0.09 + 0.64 mm2 beside the 0.16 of its own past, where it was 0.09.
    np.testing.assert_allclose(now.states[1, 1], 2.0 * MM * 0.09 / 0.25)
    np.testing.assert_allclose(then.states[1, 1], 2.0 * MM * 0.73 / 0.89)
    assert then.log_odds_of_slide > now.log_odds_of_slide


def test_what_one_plane_alone_tells_may_be_a_device_that_was_moved():
    alone = both = CompanionSlide.first(CompanionSlideTuning())
    for index in range(1, 11):
        seen = shown(XY, [0.0, 0.3 * index], 0.1)
        alone, both = alone.after(0.5, [seen]), both.after(0.5, [seen, shown(XZ, [0.0, 0.0], 0.1)])
    assert min(alone.beyond(2.0 * MM), both.beyond(2.0 * MM)) > 0.98
    doubted = alone.joined(Slide()).beyond(2.0 * MM)
    assert doubted == pytest.approx(0.5 * alone.beyond(2.0 * MM))
    assert both.joined(Slide()).beyond(2.0 * MM) == both.beyond(2.0 * MM)
    # Its own past tells that it is the ring, the more the surer it is.
    hardly, surely = (alone.joined(Slide((0.0, 3.0 * MM, 0.0), odds)).beyond(2.0 * MM) for odds in (1e-6, 5.0))
    assert hardly == pytest.approx(doubted, abs=0.01)
    assert surely > 0.98
    # When they are gone it is known as it was: by one plane, or by both.
    for _ in range(6):
        alone, both = alone.after(0.5, []), both.after(0.5, [])
    assert alone.joined(Slide()).beyond(2.0 * MM) == pytest.approx(doubted)
    assert both.joined(Slide()).beyond(2.0 * MM) > 0.98
