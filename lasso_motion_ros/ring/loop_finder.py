"""Finding the loop in a pair: search near the prediction and everywhere, alignment of the best candidates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.config.ring import SearchConfig
from lasso_motion_ros.config.tracker import TrackerConfig
from lasso_motion_ros.geometry.frames import PLANES, FramePair, Plane
from lasso_motion_ros.motion.respiration import RespiratoryMotion
from lasso_motion_ros.ring.alignment import RingPrior, align, align_from_afar
from lasso_motion_ros.ring.appearance import HALF_WIDTH, Appearance
from lasso_motion_ros.ring.finding import BOTH_AGREE, Finding, Look, foretold, judged, shows_nothing
from lasso_motion_ros.ring.judgement import epipolar_gap
from lasso_motion_ros.ring.loop_model import LoopModel
from lasso_motion_ros.ring.search import SearchCandidate, find_peaks, join_peaks
from lasso_motion_ros.ring.working_image import WorkingImage, working_image
from lasso_motion_ros.tracking.stages import Stages, no_stages

Array = npt.NDArray[np.float64]

# An unforeseen part of the motion between the two planes' exposures, per second.
UNFORESEEN_SPEED_M_S = 0.03
EXPECTATION_M = 0.004  # standard deviation of what is expected, besides the filter's own, in the search
RIVAL_SCORE = 0.85  # of the best candidate's: one that comes so near is looked at, too
RIVAL_DRIFT_MM = 0.5  # an alignment that finds the loop seldom ends further than this from where it starts
RIVAL_CORRELATION = 0.9  # of the best finding's: then the images alone do not tell the two apart
AFAR_CANDIDATES = 1  # looked at once more, from afar, where not all planes show the loop: each costs a millisecond
AFAR_TRIES = 4
EDGE_PX = HALF_WIDTH + 4.0  # from the border: samples beside the curve, and a step or two
BAND_MARGIN_MM = 8.0  # the working image's filters reach this far


class LoopFinder:
    """Finds one loop, known by its model and appearance, in pair after pair; it keeps no state of its own.

    Args:
        model: the loop at the reference.
        appearances: per plane, what it looks like; the tracker goes on learning them.
        start_ns: stamp of the reference pair, from which times are counted.
        stages: told of each stage of the work.
    """

    def __init__(
        self,
        model: LoopModel,
        appearances: dict[Plane, Appearance],
        start_ns: int,
        stages: Stages = no_stages,
    ) -> None:
        self._model = model
        self._appearances = appearances
        self._start_ns = start_ns
        self._stages = stages

    def seconds(self, stamp_ns: int) -> float:
        """A stamp as seconds since the reference pair."""
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

    def find(
        self,
        pair: FramePair,
        respiration: RespiratoryMotion,
        *,
        config: TrackerConfig,
        turn: Array,
        stretch: float,
        near_first: bool,
    ) -> Finding | None:
        """The best-ranked finding among the candidates; one near the prediction first, then anywhere in the images.

        Args:
            pair: the images, one or two.
            respiration: the motion so far, which is asked for a prediction and not changed.
            config: the parameters as they are now.
            turn: (3,) rotation vector of the ring to start from.
            stretch: logarithm of its size to start from.
            near_first: whether the prediction is worth a look about it.
        """
        times = self.exposures(pair)
        prior = RingPrior(float(np.radians(config.ring.turn_deg)), config.ring.stretch)
        looked: list[Finding] = []
        tried: list[SearchCandidate] = []
        best: Finding | None = None
        for number, near in enumerate((True, False) if near_first else (False,)):
            images, candidates = self._search(pair, times, respiration, config.search, near=near)
            look = Look(images, times, respiration, self._model, config.judgement, prior, turn, stretch, self._stages)
            looked += self._look_at([c for c in candidates if not any(map(c.is_like, tried))], look)
            best = max(looked, key=lambda finding: finding.rank, default=None)
            if number == 0 and not look.is_enough(best):
                # A ring that has turned much lies near the prediction, or where it has not been followed, anywhere.
                best = self._best_from_afar(candidates, look, best)
            if look.is_enough(best):
                break
            if best is not None:
                looked.append(best)
            tried = [candidate for candidate in candidates if self._is_inside(candidate, images)]
        return None if best is None else _with_rivals(best, looked)

    def _is_inside(self, candidate: SearchCandidate, images: dict[Plane, WorkingImage]) -> bool:
        """Whether all samples of the loop would come from the images, which may be parts of the whole."""
        for plane, centre in candidate.centres.items():
            pixels = images[plane].projection.project(centre + self._model.arms)
            if pixels.min() < EDGE_PX or (pixels > np.array(images[plane].values.shape[::-1]) - 1 - EDGE_PX).any():
                return False
        return True

    def _search(
        self,
        pair: FramePair,
        times: dict[Plane, float],
        respiration: RespiratoryMotion,
        config: SearchConfig,
        *,
        near: bool,
    ) -> tuple[dict[Plane, WorkingImage], list[SearchCandidate]]:
        """Images to look at, and the places where they may show the loop."""
        model = self._model
        frames = pair.frames
        expected: dict[Plane, Array] = {}
        with self._stages("filter"):
            foreseen = respiration.predict(self.seconds(pair.stamp_ns))
            if "a" in times:
                expected["a"] = model.centre + foreseen.displacement
            if "b" in times:
                expected["b"] = model.centre + respiration.expected_between(times["b"]).displacement
        uncertainty_mm = 2e3 * float(np.sqrt(np.linalg.eigvalsh(foreseen.covariance)[-1]))
        reach_mm = model.radius_mm + BAND_MARGIN_MM + config.near_mm + min(uncertainty_mm, 20.0)
        images: dict[Plane, WorkingImage] = {}
        peaks = {}
        for plane in times:
            with self._stages("working image"):
                images[plane] = working_image(
                    frames[plane],
                    expected[plane],
                    bright=model.bright,
                    shift=model.shifts[plane],
                    reach_mm=reach_mm if near else None,
                )
            with self._stages("search"):
                peaks[plane] = find_peaks(
                    images[plane], self._appearances[plane].distinctive, expected[plane], model.arms
                )
        slack_m = UNFORESEEN_SPEED_M_S * (times["b"] - times["a"]) if len(times) == 2 else 0.0
        covariance = foreseen.covariance + EXPECTATION_M**2 * np.eye(3)
        count = config.candidates // (2 if near else 1)
        with self._stages("search"):
            return images, join_peaks(peaks, expected, covariance, slack_m, max(1, count))

    def _look_at(self, candidates: list[SearchCandidate], look: Look) -> list[Finding]:
        """What the search points to, until it is found and no rival comes near it."""
        looked: list[Finding] = []
        best: Finding | None = None
        best_score = 0.0
        for candidate in candidates:
            if look.is_enough(best) and candidate.score < RIVAL_SCORE * best_score:
                break
            if best is not None and _would_disagree(candidate, best, look):
                continue
            ahead = best.alignment.correlations if best is not None and best.rank[0] == BOTH_AGREE else ()
            with self._stages("alignment"):
                alignment = align(
                    look.images,
                    self._appearances,
                    self._model.arms,
                    candidate.centres,
                    look.prior,
                    look.turn,
                    look.stretch,
                    ahead,
                )
            if alignment.is_given_up and (ahead or shows_nothing(alignment, look.judgement)):
                continue  # it can neither rival a finding on which both planes agree nor count as seen
            finding = judged(alignment, look)
            looked.append(finding)
            if best is None or finding.rank > best.rank:
                best, best_score = finding, candidate.score
        return looked

    def _best_from_afar(self, candidates: list[SearchCandidate], look: Look, best: Finding | None) -> Finding | None:
        """A better finding, if there is one, where the loop lies otherwise and elsewhere than an alignment mends.

        A ring that has turned much looks otherwise, and its peak in the search is off.
        """
        starts = [candidate.centres for candidate in candidates[:AFAR_CANDIDATES]]
        for _ in range(AFAR_TRIES):
            if not starts or look.is_enough(best):
                break
            with self._stages("alignment"):
                alignment = align_from_afar(
                    look.images, self._appearances, self._model.arms, starts.pop(0), look.prior, look.turn, look.stretch
                )
            if alignment is None:
                continue
            finding = judged(alignment, look)
            if best is not None and finding.rank <= best.rank:
                continue
            best = finding
            if len(look.times) > len(finding.seen) == 1:
                # The other plane's candidate may have been a wrong one: look where this plane foretells it.
                (clear,) = finding.seen
                other, expected = foretold(clear, alignment, look)
                there = self._model.centre + expected.displacement
                starts.insert(0, {clear: alignment.planes[clear].centre, other: there})
        return best


def _with_rivals(best: Finding, looked: list[Finding]) -> Finding:
    """The best finding with those on which both planes agree as well, and which correlate nearly as well."""
    least = RIVAL_CORRELATION * best.rank[1]
    rivals = [f for f in looked if f is not best and f.rank[0] == BOTH_AGREE and f.rank[1] >= least]
    return replace(best, rivals=tuple(sorted(rivals, key=lambda f: -f.rank[1]))) if rivals else best


def _would_disagree(candidate: SearchCandidate, best: Finding, look: Look) -> bool:
    """Whether the planes agree on the best finding, and would make the state DEGRADED on one where a candidate is.

    Where plane B is exposed later, what it should show moves with where plane A saw the loop; then only candidates of
    the same place in plane A are judged here.
    """
    if best.rank[0] < BOTH_AGREE:
        return False
    planes = best.alignment.planes
    away = {p: candidate.centres[p] - planes[p].centre for p in PLANES}
    if (
        look.times["b"] > look.times["a"]
        and 1e3 * float(np.linalg.norm(planes["a"].across @ away["a"])) > RIVAL_DRIFT_MM
    ):
        return False
    rays = {p: planes[p].centre - look.images[p].projection.source for p in PLANES}
    gap, _ = epipolar_gap(rays["a"], rays["b"], away["a"], away["b"])
    return 1e3 * abs(gap) > best.gap_mm + best.degraded_gap_mm + RIVAL_DRIFT_MM
