"""Where the ring may be in a pair: a search near the prediction or everywhere, then alignment of the candidates."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.core.compiled import has_kernels
from lasso_motion_ros.geometry.covariance import largest_sigma
from lasso_motion_ros.geometry.frames import PLANES, Frame, FramePair, Pair, Plane
from lasso_motion_ros.motion.respiration import RespiratoryMotion
from lasso_motion_ros.ring.alignment import Alignment, RingPrior, align, align_from_afar
from lasso_motion_ros.ring.detection import Detection, DetectionTuning
from lasso_motion_ros.ring.loop_model import LoopModel
from lasso_motion_ros.ring.plane_search import PlaneSearch
from lasso_motion_ros.ring.search import Peaks, SearchCandidate, join_peaks
from lasso_motion_ros.ring.strip import HALF_WIDTH
from lasso_motion_ros.ring.template import RingTemplate
from lasso_motion_ros.ring.working_image import WholeImages, WorkingImage, working_image
from lasso_motion_ros.tracking.stages import Stages, no_stages

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class DetectorTuning:
    """Where the ring is looked for."""

    near_first: bool = True  # about the prediction, before the whole image
    from_afar: bool = True  # a ring that has turned much is aligned in blurred images first
    # Where the template shows nothing plain it is looked for drawn in and widened, too, as the heart does it: by so
    # many standard deviations of its own size (docs/constants.md).
    sizes: tuple[float, ...] = (-2.0, 2.0)
    electrodes: bool = True  # looked for by themselves, about the prediction, where the template shows nothing plain
    unforeseen_speed_m_s: float = 0.04  # of the motion between the two planes' exposures
    expectation_m: float = 0.004  # standard deviation of what is expected, besides the filter's own, in the search
    rival_score: float = 0.85  # of the best candidate's in the search: one that comes so near is aligned, too
    enough_share: float = 0.8  # of the support that is usual: then nothing else is looked for
    band_margin_mm: float = 8.0  # the working image's filters reach this far
    edge_px: float = HALF_WIDTH + 4.0  # from the border: samples beside the curve, and a step or two


@dataclass(frozen=True, eq=False)
class Expectation:
    """What is known before the pair is looked at.

    Attributes:
        motion: so far; asked for predictions and not changed.
        turn: (3,) rotation vector of the ring to start from, rad.
        stretch: logarithm of its size to start from.
        support: what is usual where the ring is seen.
        is_followed: whether the prediction is worth a look about it.
        twins: (T, 3) m from the ring to what else looks like it.
    """

    motion: RespiratoryMotion
    turn: Array
    stretch: float
    support: float
    is_followed: bool
    twins: Array = field(default_factory=lambda: np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class _Surroundings:
    """What of a pair is looked at, and where the ring may be in it.

    Attributes:
        searches: per plane that can show it.
        expected: per plane exposed, (3,) where the ring's centre is expected, world metres.
        covariance: (3, 3) m² of what is expected.
        slack_m: how far it may have moved, unforeseen, between the two exposures.
    """

    searches: dict[Plane, PlaneSearch]
    expected: dict[Plane, Array]
    covariance: Array
    slack_m: float

    @cached_property
    def images(self) -> dict[Plane, WorkingImage]:
        """Per plane that can show it."""
        return {plane: search.image for plane, search in self.searches.items()}

    def candidates(self, peaks: dict[Plane, Peaks], count: int) -> list[SearchCandidate]:
        """Places that the planes' peaks may be of, best first."""
        return join_peaks(peaks, self.expected, self.covariance, self.slack_m, count)


class RingDetector:
    """Finds the ring of one model and template; keeps nothing but what was worked out ahead of the next pair.

    Args:
        model: the ring at the seed pair.
        template: what it looks like; the tracker goes on learning it.
        start_ns: stamp of the seed pair, from which times are counted.
        tuning: where the ring is looked for.
        worth: what the planes' evidence is worth.
        stages: told of each stage of the work on a pair.
    """

    def __init__(
        self,
        model: LoopModel,
        template: RingTemplate,
        start_ns: int,
        tuning: DetectorTuning,
        worth: DetectionTuning,
        stages: Stages = no_stages,
    ) -> None:
        self._model, self._template, self._start_ns, self._stages = model, template, start_ns, stages
        self._tuning, self._worth = tuning, worth
        self._ahead: PlaneSearch | None = None

    def looking_for(self, model: LoopModel, template: RingTemplate) -> RingDetector:
        """The same with another model and template."""
        return RingDetector(model, template, self._start_ns, self._tuning, self._worth, self._stages)

    def seconds(self, stamp_ns: int) -> float:
        """A stamp as seconds since the seed pair."""
        return (stamp_ns - self._start_ns) * 1e-9

    def exposures(self, pair: FramePair) -> dict[Plane, float]:
        """Times of exposure since the start, seconds; B's never before A's (jitter)."""
        time_s = self.seconds(pair.stamp_ns)
        times: dict[Plane, float] = {}
        if pair.a is not None:
            times["a"] = time_s
        if pair.b is not None:
            times["b"] = max(time_s, self.seconds(pair.b.stamp_ns))
        return times

    def prepare(self, frame: Frame, expected: Expectation, config: TrackerConfig) -> None:
        """Work out what `detect` asks of plane A's frame alone.

        Args:
            frame: plane A's, of the next pair.
            expected: what is known before; where it is another with the pair, this is worked out anew.
            config: the tracker's parameters.
        """
        self._ahead = None
        near = expected.is_followed and self._tuning.near_first
        alone: FramePair = Pair(frame.stamp_ns, frame, None)
        for search in self._surroundings(alone, expected.motion, config, None, near=near).searches.values():
            self._ahead = search
            with self._stages("search"):
                _ = search.by_template
                if near:
                    break
                # Of a ring that is out of view the template mostly shows nothing plain: then all else is asked for.
                for size in self._tuning.sizes:
                    search.by_size(size * config.ring.stretch)
                if self._tuning.electrodes:
                    search.by_electrodes(expected.turn, expected.stretch)

    def detect(
        self, pair: FramePair, expected: Expectation, config: TrackerConfig, whole: WholeImages | None = None
    ) -> list[Detection]:
        """All places that show something like the ring, best supported first.

        Where the ring is followed, the surroundings of the prediction come first, and the whole of the images only if
        the ring is not plainly there.

        Args:
            pair: to look at.
            expected: what is known before.
            config: the tracker's parameters.
            whole: the pair's working images, where others ask for them, too.
        """
        prior = RingPrior(float(np.radians(config.ring.turn_deg)), config.ring.stretch)
        detections: list[Detection] = []
        tried: list[SearchCandidate] = []
        passes = (True, False) if expected.is_followed and self._tuning.near_first else (False,)
        for near in passes:
            place = self._surroundings(pair, expected.motion, config, whole, near=near)
            if not place.images:
                continue
            candidates = self._by_template(place, config, near=near)
            fresh = [candidate for candidate in candidates if not any(map(candidate.is_like, tried))]
            detections = self._aligned(fresh, place.images, expected, prior, detections)
            is_new = bool(fresh) and fresh[0] is candidates[0]
            if self._tuning.from_afar and is_new and not self._is_enough(detections, expected):
                # A ring that has turned much looks otherwise, and its peak in the search is off.
                start = candidates[0].centres
                with self._stages("alignment"):
                    turned = align_from_afar(
                        place.images, self._template, self._model.arms, start, prior, expected.turn, expected.stretch
                    )
                detections = self._joined(detections, turned)
            for size in self._tuning.sizes if near is passes[0] else ():
                if self._is_enough(detections, expected):
                    break
                sized = replace(expected, stretch=size * config.ring.stretch)
                # A quarter of a squared score is about the log likelihood of its place, half a squared size its cost.
                least = max((one.score for one in candidates), default=0.0) ** 2 + 2.0 * size**2
                likelier = [one for one in self._by_size(place, sized.stretch, config) if one.score**2 > least]
                detections = self._aligned(likelier, place.images, sized, prior, detections)
            if self._tuning.electrodes and near is passes[0] and not self._is_enough(detections, expected):
                others = self._by_electrodes(place, expected, config)
                fresh = [candidate for candidate in others if not any(map(candidate.is_like, candidates))]
                detections = self._aligned(fresh, place.images, expected, prior, detections)
                candidates = [*candidates, *fresh]
            if near is passes[-1] or self._is_enough(detections, expected):
                break
            tried = [candidate for candidate in candidates if self._is_inside(candidate, place.images)]
        if len(expected.twins) and detections:
            detections = self._with_twins(detections, place.images, expected, prior)
        return detections

    def _with_twins(
        self,
        detections: list[Detection],
        images: dict[Plane, WorkingImage],
        expected: Expectation,
        prior: RingPrior,
    ) -> list[Detection]:
        """The detections, with what lies to one of them as the ring and its twins lie to each other, either way."""
        for one in [one for one in detections if len(one.planes) == len(PLANES)]:
            for offset in np.concatenate([expected.twins, -expected.twins]):
                centres = {plane: fit.centre + offset for plane, fit in one.planes.items()}
                if not self._is_inside(SearchCandidate(0.0, centres), images):
                    continue
                with self._stages("alignment"):
                    alignment = align(
                        images, self._template, self._model.arms, centres, prior, expected.turn, expected.stretch
                    )
                detections = self._joined(detections, alignment)
        return detections

    def _is_enough(self, detections: list[Detection], expected: Expectation) -> bool:
        return bool(detections) and detections[0].support >= self._tuning.enough_share * expected.support

    def _is_inside(self, candidate: SearchCandidate, images: dict[Plane, WorkingImage]) -> bool:
        """Whether all samples of the ring would come from the images, which may be parts of the whole."""
        return all(self._is_shown(images[plane], centre) for plane, centre in candidate.centres.items())

    def _is_shown(self, image: WorkingImage, centre: Array) -> bool:
        """Whether all samples of the ring would come from an image, were its centre at a world point (3,) m."""
        height, width = image.values.shape
        if has_kernels():
            from lasso_motion_ros.ring.kernels.search import is_inside

            matrix, edge_px = image.projection.matrix, self._tuning.edge_px
            return bool(is_inside(matrix, self._model.arms, centre, edge_px, width, height))
        pixels = image.projection.project(centre + self._model.arms)
        last = np.array([width, height]) - 1.0 - self._tuning.edge_px
        return bool((pixels >= self._tuning.edge_px).all() and (pixels <= last).all())

    def _covers(self, frame: Frame, shift: Array, centre: Array) -> float:
        """Share of the ring's electrodes that lie inside an image, were its centre at a world point (3,) m."""
        if has_kernels():
            from lasso_motion_ros.ring.kernels.search import covered

            height, width = frame.pixels.shape
            share: float = covered(
                frame.projection.matrix, self._model.arms, centre, shift, self._template.weights, width, height
            )
            return share
        pixels = frame.projection.project(centre + self._model.arms) + shift
        size = np.array(frame.pixels.shape[::-1])
        inside = ((pixels >= 0.0) & (pixels <= size - 1.0)).all(axis=1)
        return float(self._template.weights @ inside)

    def _surroundings(
        self,
        pair: FramePair,
        motion: RespiratoryMotion,
        config: TrackerConfig,
        whole: WholeImages | None,
        *,
        near: bool,
    ) -> _Surroundings:
        """The images of what lies near the prediction, or the whole of them."""
        model, times = self._model, self.exposures(pair)
        time_s = self.seconds(pair.stamp_ns)
        foreseen, between = motion.foresee(time_s, times.get("b", time_s))
        expected: dict[Plane, Array] = {}
        if "a" in times:
            expected["a"] = model.centre + foreseen.displacement
        if "b" in times:
            expected["b"] = model.centre + between.displacement
        uncertainty_mm = 2e3 * largest_sigma(foreseen.covariance)
        search_mm = config.search.near_mm + min(uncertainty_mm, 20.0)
        reach_mm = model.radius_mm + self._tuning.band_margin_mm + search_mm
        searches = {}
        for plane in times:
            frame, centre = pair.frames[plane], expected[plane]
            shift = model.shift(plane, frame.projection)
            if near and self._covers(frame, shift, centre) < self._worth.smallest_coverage:
                continue  # zoomed or collimated: the ring is beside the image, and the other plane has to do
            ahead = self._ahead
            if ahead is not None and ahead.is_of(frame, self._template, centre, search_mm, is_near=near):
                searches[plane] = ahead
                continue
            with self._stages("working image"):
                if near or whole is None:
                    around_mm = reach_mm if near else None
                    image = working_image(frame, centre, bright=model.bright, shift=shift, reach_mm=around_mm)
                else:
                    image = whole.at(plane, centre, shift, bright=model.bright)
            searches[plane] = PlaneSearch(frame, image, model.arms, self._template, centre, search_mm, is_near=near)
        slack_m = self._tuning.unforeseen_speed_m_s * (times["b"] - times["a"]) if len(times) == len(PLANES) else 0.0
        covariance = foreseen.covariance + self._tuning.expectation_m**2 * np.eye(3)
        return _Surroundings(searches, expected, covariance, slack_m)

    def _by_template(self, place: _Surroundings, config: TrackerConfig, *, near: bool) -> list[SearchCandidate]:
        """Where the template fits."""
        with self._stages("search"):
            peaks = {plane: search.by_template for plane, search in place.searches.items()}
            return place.candidates(peaks, max(1, config.search.candidates // (2 if near else 1)))

    def _by_size(self, place: _Surroundings, stretch: float, config: TrackerConfig) -> list[SearchCandidate]:
        """Where the template fits on a ring of another size, given as its logarithm."""
        with self._stages("search"):
            peaks = {plane: search.by_size(stretch) for plane, search in place.searches.items()}
            return place.candidates(peaks, max(1, config.search.candidates // 2))

    def _by_electrodes(
        self, place: _Surroundings, expected: Expectation, config: TrackerConfig
    ) -> list[SearchCandidate]:
        """Where both planes show electrodes like the ring's; what one plane alone shows is a coincidence too often."""
        if len(place.searches) < len(PLANES):
            return []
        with self._stages("search"):
            turn, stretch = expected.turn, expected.stretch
            peaks = {plane: search.by_electrodes(turn, stretch) for plane, search in place.searches.items()}
            return place.candidates(peaks, config.search.candidates)

    def _aligned(
        self,
        candidates: list[SearchCandidate],
        images: dict[Plane, WorkingImage],
        expected: Expectation,
        prior: RingPrior,
        detections: list[Detection],
    ) -> list[Detection]:
        """The detections with those that the candidates lead to, until the ring is found and no rival comes near it."""
        best_score = max((candidate.score for candidate in candidates), default=0.0)
        for candidate in candidates:
            if self._is_enough(detections, expected) and candidate.score < self._tuning.rival_score * best_score:
                break
            with self._stages("alignment"):
                alignment = align(
                    images,
                    self._template,
                    self._model.arms,
                    candidate.centres,
                    prior,
                    expected.turn,
                    expected.stretch,
                )
            detections = self._joined(detections, alignment)
        return detections

    def _joined(self, detections: list[Detection], alignment: Alignment | None) -> list[Detection]:
        """The detections with one more, best supported first; of two in the same place the better one."""
        if alignment is None or alignment.is_given_up:
            return detections
        new = Detection(alignment, self._worth)
        if not new.planes:
            return detections
        same = [one for one in detections if one.is_same(new)]
        if any(one.support >= new.support for one in same):
            return detections
        others = [one for one in detections if all(one is not gone for gone in same)]
        return sorted([*others, new], key=lambda one: -one.support)
