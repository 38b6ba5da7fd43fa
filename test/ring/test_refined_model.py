"""The ring's curve and profile from many pairs, laid on each other as the ring has gone."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.lasso_inputs import CURVE, LOOP, VIEWS, curve_pair, lasso_pair, lasso_seed

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.geometry.curves import distance_to_curve
from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.ring.alignment import RingPrior, align
from lasso_motion_ros.ring.association import associate
from lasso_motion_ros.ring.looks import Look, Looks
from lasso_motion_ros.ring.refined_model import refined_model
from lasso_motion_ros.ring.ring_options import RingOptions
from lasso_motion_ros.ring.track import LOOKED_AT_AFTER
from lasso_motion_ros.ring.tracker import RingTracker
from lasso_motion_ros.ring.working_image import WholeImages

NOISE = 40.0
OPTIONS = RingOptions()


def moved(index):
    """(3,) metres, 8 mm of breathing in ten pairs."""
    return np.round(4e-3 * (1.0 - np.cos(np.pi * index / 5.0)) * np.array([0.08, -0.25, -0.965]), 6)


def seeded(start, **options):
    tracker = RingTracker(TrackerConfig(), options=dataclasses.replace(OPTIONS, **options))
    tracker.initialise(lasso_pair(start, moved(0), sigma=NOISE), lasso_seed())
    return tracker


def looks_of(start, count):
    """A noisy seed pair's model, and looks at it and at so many later pairs."""
    tracker = seeded(start)
    track = tracker.known
    looks = track.looks
    for index in range(1, count + 1):
        pair = lasso_pair(start + index, moved(index), sigma=NOISE)
        tracker.track(pair)
        seen, best = track.unlearned
        assert seen is not None
        looks = looks.after(Look.later(pair, track.model, best.detection.alignment))
        track.unlearned = None  # the model stays what it is
    return track.model, looks


def beside_mm(model):
    """Mean distance of a model's curve from the wire, as the planes see it, mm."""
    distances = []
    for plane in PLANES:
        seen = VIEWS[plane].project(model.points) + model.shift(plane, VIEWS[plane])
        unit = VIEWS[plane].millimetres_per_pixel(LOOP.centre)
        distances.append(unit * distance_to_curve(seen, VIEWS[plane].project(CURVE)).mean())
    return float(np.mean(distances))


def contrast(frame):
    """How far the wire stands out of what is beside it, in standard deviations of that."""
    pixels = frame.projection.project(CURVE)
    rows, columns = np.indices(frame.pixels.shape)
    places = np.column_stack([columns.ravel(), rows.ravel()])
    near = distance_to_curve(places, pixels).reshape(frame.pixels.shape)
    on, off = frame.pixels[near < 0.7].astype(float), frame.pixels[(near > 4.0) & (near < 8.0)].astype(float)
    return (off.mean() - on.mean()) / off.std()


def test_laid_on_each_other_pairs_show_the_ring_as_none_alone_does():
    model, looks = looks_of(0, 8)
    mean = looks.mean(model)
    for plane in PLANES:
        alone, together = looks.first.pair.frames[plane], mean.frames[plane]
        assert together.projection is alone.projection
        assert together.stamp_ns == alone.stamp_ns
        assert contrast(together) > 1.5 * contrast(alone)


@pytest.mark.parametrize(("left", "top"), [(True, True), (False, False)])
def test_at_an_images_edge_a_look_is_as_large_as_elsewhere(left, top):
    track = seeded(0).known
    pair = lasso_pair(0, moved(0), sigma=NOISE)
    frames = {}
    for plane, frame in pair.frames.items():
        seen = frame.projection.project(CURVE)
        height, width = frame.pixels.shape
        # Cut so that the ring lies three pixels from the edges.
        low, high = np.floor(seen.min(axis=0)).astype(int) - 3, np.ceil(seen.max(axis=0)).astype(int) + 3
        x, right = (low[0], width) if left else (0, high[0])
        y, bottom = (low[1], height) if top else (0, high[1])
        projection = frame.projection.cropped(x, y, right - x, bottom - y)
        frames[plane] = dataclasses.replace(frame, pixels=frame.pixels[y:bottom, x:right], projection=projection)
    look = Look.first(dataclasses.replace(pair, a=frames["a"], b=frames["b"]), track.model)
    for plane, frame in look.pair.frames.items():
        whole = Look.first(pair, track.model).pair.frames[plane]
        assert frame.pixels.shape == whole.pixels.shape
        assert frame.pixels.shape == (frame.projection.height, frame.projection.width)


def test_few_looks_are_not_laid_on_each_other():
    model, looks = looks_of(0, 3)
    assert looks.mean(model) is not None
    assert dataclasses.replace(looks, later=looks.later[:2]).mean(model) is None
    assert (
        refined_model(model, dataclasses.replace(looks, later=looks.later[:2]), OPTIONS.template, OPTIONS.detection)
        is None
    )


def test_from_another_side_a_look_shows_another_picture():
    model, looks = looks_of(0, 3)
    aside = {
        plane: dataclasses.replace(looks.first.pair.frames[plane], projection=VIEWS[other])
        for plane, other in zip(PLANES, PLANES[::-1], strict=True)
    }
    turned = dataclasses.replace(
        looks.later[0], pair=dataclasses.replace(looks.later[0].pair, a=aside["a"], b=aside["b"])
    )
    assert Looks(looks.first, (turned, *looks.later[1:])).mean(model) is None


def test_another_exposure_changes_nothing():
    model, looks = looks_of(0, 4)
    look = looks.later[-1]
    frames = {plane: dataclasses.replace(frame, pixels=frame.pixels // 2) for plane, frame in look.pair.frames.items()}
    darker = dataclasses.replace(look, pair=dataclasses.replace(look.pair, a=frames["a"], b=frames["b"]))
    mean, other = looks.mean(model), dataclasses.replace(looks, later=(*looks.later[:-1], darker)).mean(model)
    for plane in PLANES:
        one, two = (np.asarray(pair.frames[plane].pixels, float) for pair in (mean, other))
        assert np.abs(one - two).mean() < 0.01 * one.mean()


@pytest.mark.slow
def test_many_pairs_tell_the_curve_better_than_clicks_and_one_pair():
    before, after = [], []
    for start in (0, 100, 200, 300):
        model, looks = looks_of(start, 9)
        view, template = refined_model(model, looks, OPTIONS.template, OPTIONS.detection)
        assert template.count == 10
        before.append(beside_mm(model))
        after.append(beside_mm(view.model))
    assert np.mean(after) < 0.85 * np.mean(before)


def test_a_tracker_makes_its_model_anew_and_goes_on_from_the_same_reference():
    refining, keeping = seeded(0), seeded(0, refined=False)
    first = refining.known.model
    for index in range(1, LOOKED_AT_AFTER[1] + 2):
        pair = lasso_pair(index, moved(index), sigma=NOISE)
        here, there = refining.track(pair), keeping.track(pair)
        assert here.motion is not None
        at = np.append(LOOP.centre, 1.0)
        np.testing.assert_allclose(here.motion @ at, there.motion @ at, atol=1.5e-4)
    track = refining.known
    assert keeping.known.model is not track.model
    assert track.model is not first
    assert track.electrodes.points is track.model.points
    assert here.reference_stamp_ns == there.reference_stamp_ns
    # All that looks for the ring, or tells where it was, has the new model.
    assert (track.detector._model, track.detector._template) == (track.model, track.template)
    assert track.seed.model is track.model
    np.testing.assert_array_equal(track.companions._planes["a"]._home, track.model.centre)


def test_as_the_model_is_made_anew_the_seed_pair_is_looked_at_with_it():
    tracker = seeded(0)
    for index in range(1, LOOKED_AT_AFTER[1]):
        tracker.track(lasso_pair(index, moved(index), sigma=NOISE))
    tracker.learn()
    track = tracker.known
    assert track.template.count == LOOKED_AT_AFTER[1]
    again = track.seed.displacement(track.template)
    np.testing.assert_allclose(track.reference, again.displacement, atol=1e-9)
    assert np.linalg.norm(track.reference) > 0.0


def test_a_ring_that_turns_is_laid_on_itself():
    tracker = seeded(0)
    track, looks, plain = tracker.known, tracker.known.looks, tracker.known.looks
    for index, turn in enumerate([(0.0, 6.0, 0.0), (5.0, 0.0, 0.0), (0.0, -6.0, 0.0), (-5.0, 0.0, 0.0)], 1):
        curve = LOOP.centre + (CURVE - LOOP.centre) @ Rotation.from_euler("xyz", turn, degrees=True).as_matrix().T
        pair = curve_pair(index, curve)
        images = WholeImages(pair.frames)
        seen = {
            plane: images.at(plane, LOOP.centre, track.model.shift(plane, frame.projection), bright=False)
            for plane, frame in pair.frames.items()
        }
        found = align(
            seen, track.template, track.model.arms, dict.fromkeys(PLANES, track.model.centre), RingPrior(0.15, 0.02)
        )
        look = Look.later(pair, track.model, found)
        looks, plain = looks.after(look), plain.after(dataclasses.replace(look, shape=np.eye(3)))
    laid, unturned = looks.mean(track.model), plain.mean(track.model)
    for plane in PLANES:
        assert contrast(laid.frames[plane]) > 1.05 * contrast(unturned.frames[plane])


def test_where_the_looks_show_no_lasso_the_model_is_kept():
    model, looks = looks_of(0, 4)
    bare = {
        plane: dataclasses.replace(frame, pixels=np.full_like(frame.pixels, 120))
        for plane, frame in looks.first.pair.frames.items()
    }
    nothing = dataclasses.replace(looks.first, pair=dataclasses.replace(looks.first.pair, a=bare["a"], b=bare["b"]))
    assert refined_model(model, Looks(nothing, (nothing,) * 4), OPTIONS.template, OPTIONS.detection) is None


def test_what_is_only_probable_is_learned_too_and_what_is_not_is_not(monkeypatch):
    for believed, count in ((0.75, 2), (0.65, 1)):
        tracker = seeded(0)

        def doubted(*arguments, believed=believed):
            found = associate(*arguments)
            return dataclasses.replace(
                found, hypotheses=tuple(dataclasses.replace(one, believed=believed) for one in found.hypotheses)
            )

        monkeypatch.setattr("lasso_motion_ros.ring.tracker.associate", doubted)
        assert tracker.track(lasso_pair(1, moved(1), sigma=NOISE)).motion is None
        tracker.learn()
        assert tracker.known.template.count == count
        monkeypatch.undo()
