"""The measures: tracking against truth, on numpy inputs.

Truth is the atrium's motion, the loop's centreline in both images at plane A's exposure, and points on the atrium.
The reference pair is the identity by definition: it gives the model error and is left out of every mean.
Errors are millimetres; everything that goes in is metres, pixels and nanoseconds.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from lasso_motion_ros.evaluation.same_pair import is_same_pair, of_pair
from lasso_motion_ros.geometry.covariance import squared_mahalanobis
from lasso_motion_ros.geometry.curves import distance_to_curve, resample
from lasso_motion_ros.geometry.frames import PLANES, Plane
from lasso_motion_ros.geometry.projection import Projection
from lasso_motion_ros.geometry.transforms import apply, inverse

Array = npt.NDArray[np.float64]

SILENT_LOSS_MM = 2.0  # a published pose with a larger error misleads
DISPLACED_MM = 3.0  # a true loop further than this from where the atrium's motion carries it has been moved
DETECTOR_M = 1.2  # source–detector distance assumed for millimetres on the detector
SAMPLES = 256  # points spaced evenly along a curve, so that their mean is a mean over its length


@dataclass(frozen=True, eq=False)
class PairTruth:
    """What is known of one pair.

    Attributes:
        stamp_ns: plane A's exposure.
        motion: (4, 4) the atrium's motion since the truth's reference, world metres, heartbeat included; None
            where there is no 3-D truth.
        respiratory: (4, 4) the breathing alone, or None.
        centrelines: per plane (N, 2) pixels, the loop at A's exposure; a plane is absent while it shows no lasso.
        projections: per plane the published geometry of this pair; absent where none was published.
        displaced: whether the lasso has left its place; None: the images decide (`is_displaced`).
        due: False where no pose is due though the images show the lasso in its place: it has slid a little, the
            patient has moved on the table, the C-arm unsaid. None: nothing of the kind is known.
        evidence: per plane how plainly its image shows the lasso's true electrodes, about −1 to 2; empty if unknown.
    """

    stamp_ns: int
    motion: Array | None = None
    respiratory: Array | None = None
    centrelines: Mapping[Plane, Array] = field(default_factory=dict)
    projections: Mapping[Plane, Projection] = field(default_factory=dict)
    displaced: bool | None = None
    due: bool | None = None
    evidence: Mapping[Plane, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Truth:
    """What is known of a recording.

    Attributes:
        pairs: every pair that has truth, in order of time.
        loop: (N, 3) the loop at the truth's reference, world metres, or None.
        targets: (M, 3) points on the atrium at the truth's reference, world metres, or None.
    """

    pairs: Sequence[PairTruth]
    loop: Array | None = None
    targets: Array | None = None


@dataclass(frozen=True, eq=False)
class PairEstimate:
    """What the tracker published for one pair.

    Attributes:
        stamp_ns: plane A's stamp.
        state: the state published before it.
        motion_raw: (4, 4) the pose that is scored, world metres, or None.
        motion: (4, 4) the pose after gating or filtering, or None.
        covariance: (6, 6) of `motion`: x, y, z, then rotation about the fixed axes at the world origin; m, rad.
        loop: (N, 3) the catheter's curve, world metres, or None.
        reference_ns: stamp of the reference pair in force, or None where none was published.
    """

    stamp_ns: int
    state: str = ""
    motion_raw: Array | None = None
    motion: Array | None = None
    covariance: Array | None = None
    loop: Array | None = None
    reference_ns: int | None = None


@dataclass(frozen=True, eq=False)
class PairScore:
    """The measures of one pair; None where truth or estimate leaves one undefined.

    Attributes:
        index: number of the pair in the truth.
        stamp_ns: plane A's exposure.
        is_reference: the pair is the reference, whose motion is the identity by definition.
        expected: a pose is due: the pair comes after the reference and shows the lasso in its place.
        hidden: no plane shows the lasso.
        displaced: the lasso was moved to another place and no longer moves with the atrium.
        has_pose: a pose was published.
        state: the state published with it.
        error_2d_mm: per plane, symmetric mean distance of the curves at the loop's depth.
        error_detector_mm: the same on the detector.
        centre_error_m: (3,) T·c − T_true·c in the world frame, metres.
        respiratory_error_mm: distance of the centre under `motion` from where breathing alone carries it.
        target_error_mm: target registration error, mean over the targets.
        static_error_mm: the same with T = identity; known for pairs without a pose too.
        true_centre_m: (3,) where the loop's centre is by the truth.
        centre_m: (3,) where the published motion puts it.
        nees: normalised estimation error squared of the centre: squared Mahalanobis distance, 3 degrees of freedom.
        centre_sigma_mm: square root of the trace of the centre's covariance.
    """

    index: int
    stamp_ns: int
    is_reference: bool
    expected: bool
    hidden: bool
    displaced: bool
    has_pose: bool
    state: str
    error_2d_mm: dict[Plane, float] = field(default_factory=dict)
    error_detector_mm: dict[Plane, float] = field(default_factory=dict)
    centre_error_m: Array | None = None
    respiratory_error_mm: float | None = None
    target_error_mm: float | None = None
    static_error_mm: float | None = None
    true_centre_m: Array | None = None
    centre_m: Array | None = None
    nees: float | None = None
    centre_sigma_mm: float | None = None

    @property
    def centre_error_mm(self) -> float | None:
        """Length of the centre's error."""
        return None if self.centre_error_m is None else 1e3 * float(np.linalg.norm(self.centre_error_m))

    @property
    def missing(self) -> bool:
        """No pose although the pair shows the lasso in its place."""
        return self.expected and not self.has_pose

    @property
    def false_pose(self) -> bool:
        """A pose while the lasso is hidden, gone or displaced."""
        return self.has_pose and not self.is_reference and (self.hidden or self.displaced)

    @property
    def lost_in_silence(self) -> bool:
        """A pose that misleads: more than 2 mm off, or published without a lasso to follow."""
        if self.is_reference or not self.has_pose:
            return False
        error = self.centre_error_mm
        return self.false_pose or (error is not None and error > SILENT_LOSS_MM)


def symmetric_mean_distance(first: Array, second: Array) -> float:
    """Mean distance between two curves (N, D) and (M, D), in their unit: the mean of both directions."""
    there = distance_to_curve(resample(first, SAMPLES), second).mean()
    back = distance_to_curve(resample(second, SAMPLES), first).mean()
    return float((there + back) / 2.0)


def centre_covariance(covariance: Array, centre: Array) -> Array:
    """(3, 3) covariance in m² of a moved point (3,) m, from a pose's (6, 6) about the world origin.

    A small motion (v, ω) about fixed axes at the origin shifts the point p by v + ω × p. Written out here, and not
    taken from `geometry.covariance`, so that a mistake in the tracker's transport shows.
    """
    x, y, z = centre
    jacobian = np.hstack([np.eye(3), np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])])
    return np.asarray(jacobian @ covariance @ jacobian.T)


def is_displaced(pair: PairTruth, loop: Array) -> bool:
    """Whether the true loop in the images has left the place where the atrium's motion carries `loop` (N, 3).

    Compared by the curves' centres, which neither the ring's own tilt nor the 0.6 mm of a usual calibration error
    moves by as much as 3 mm.
    """
    if pair.motion is None:
        return False
    carried = apply(pair.motion, loop)
    for plane, centreline in pair.centrelines.items():
        projection = pair.projections.get(plane)
        if projection is not None:
            shift = _middle(projection.project(carried)) - _middle(centreline)
            if np.linalg.norm(shift) * projection.millimetres_per_pixel(carried.mean(axis=0)) > DISPLACED_MM:
                return True
    return False


def score_pairs(
    truth: Truth, estimates: Iterable[PairEstimate], *, source_detector_m: float = DETECTOR_M
) -> tuple[PairScore, ...]:
    """Score every pair of a recording.

    Args:
        truth: what is known.
        estimates: what was published, in any order; the estimate within 5 ms of a pair's stamp is that pair's.
        source_detector_m: assumed for millimetres on the detector, whose pixel pitch no message tells.
    """
    by_stamp = {estimate.stamp_ns: estimate for estimate in estimates}
    stamps = np.array(sorted(by_stamp), dtype=np.int64)
    first_reference = min((e.reference_ns for e in by_stamp.values() if e.reference_ns is not None), default=None)
    if first_reference is None:
        first_reference = truth.pairs[0].stamp_ns if truth.pairs else 0
    centreless = not any(pair.centrelines for pair in truth.pairs)
    scores = []
    for index, pair in enumerate(truth.pairs):
        estimate = PairEstimate(pair.stamp_ns)
        if stamps.size:
            nearest = int(stamps[np.argmin(np.abs(stamps - pair.stamp_ns))])
            if is_same_pair(nearest, pair.stamp_ns):
                estimate = by_stamp[nearest]
        reference_ns = first_reference if estimate.reference_ns is None else estimate.reference_ns
        is_reference = is_same_pair(pair.stamp_ns, reference_ns)
        hidden = not pair.centrelines and not centreless
        displaced = pair.displaced
        if displaced is None:
            displaced = truth.loop is not None and is_displaced(pair, truth.loop)
        shown_fully = centreless or len(pair.centrelines) == len(PLANES)
        after = pair.stamp_ns > first_reference and not is_same_pair(pair.stamp_ns, first_reference)
        has_pose = estimate.motion_raw is not None
        in_place = not (hidden or displaced)
        score = PairScore(
            index,
            pair.stamp_ns,
            is_reference,
            expected=after and not is_reference and in_place and shown_fully and pair.due is not False,
            hidden=hidden,
            displaced=displaced,
            has_pose=has_pose,
            state=estimate.state,
        )
        if has_pose and in_place:
            score = _with_curve_errors(score, truth, pair, estimate, source_detector_m)
        scores.append(_with_motion_errors(score, truth, pair, estimate, reference_ns))
    return tuple(scores)


def _middle(curve: Array) -> Array:
    return np.asarray(resample(curve, SAMPLES).mean(axis=0))


def _with_curve_errors(
    score: PairScore, truth: Truth, pair: PairTruth, estimate: PairEstimate, source_detector_m: float
) -> PairScore:
    at_loop: dict[Plane, float] = {}
    on_detector: dict[Plane, float] = {}
    for plane in PLANES:
        projection = pair.projections.get(plane)
        if estimate.loop is None or projection is None or plane not in pair.centrelines:
            continue
        pixels = symmetric_mean_distance(projection.project(estimate.loop), pair.centrelines[plane])
        curve = estimate.loop
        if truth.loop is not None and pair.motion is not None:
            # The depth of a model that is lost would scale its error.
            curve = apply(pair.motion, truth.loop)
        at_loop[plane] = pixels * projection.millimetres_per_pixel(curve.mean(axis=0))
        on_detector[plane] = pixels * 1e3 * source_detector_m / projection.focal_length_px
    return replace(score, error_2d_mm=at_loop, error_detector_mm=on_detector)


def _with_motion_errors(
    score: PairScore, truth: Truth, pair: PairTruth, estimate: PairEstimate, reference_ns: int
) -> PairScore:
    reference = of_pair(truth.pairs, reference_ns)
    if truth.loop is None or pair.motion is None or reference is None or reference.motion is None:
        return score
    # The published motion starts at the tracker's reference, the true one at the recording's.
    since_reference = pair.motion @ inverse(reference.motion)
    centre = apply(reference.motion, truth.loop.mean(axis=0))
    true_centre = apply(since_reference, centre)
    score = replace(score, true_centre_m=true_centre)
    targets = np.empty((0, 3)) if truth.targets is None else apply(reference.motion, truth.targets)
    true_targets = apply(since_reference, targets)
    if len(targets):
        score = replace(score, static_error_mm=_mean_length_mm(targets - true_targets))
    if estimate.motion_raw is None:
        return score
    found_centre = apply(estimate.motion_raw, centre)
    score = replace(score, centre_m=found_centre)
    if score.hidden or score.displaced:
        return score
    score = replace(score, centre_error_m=found_centre - true_centre)
    if len(targets):
        moved = apply(estimate.motion_raw, targets)
        score = replace(score, target_error_mm=_mean_length_mm(moved - true_targets))
    if estimate.motion is None:
        return score
    published = apply(estimate.motion, centre)
    if pair.respiratory is not None and reference.respiratory is not None:
        breathing = pair.respiratory @ inverse(reference.respiratory)
        score = replace(score, respiratory_error_mm=_mean_length_mm((published - apply(breathing, centre))[None]))
    if estimate.covariance is not None:
        spread = centre_covariance(estimate.covariance, published)
        error = published - true_centre
        score = replace(
            score,
            nees=_nees(error, spread),
            centre_sigma_mm=1e3 * float(np.sqrt(np.trace(spread))),
        )
    return score


def _nees(error: Array, covariance: Array) -> float:
    """NEES of an error (3,) m under a covariance (3, 3) m²; infinite where the covariance claims to be exact."""
    try:
        np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        return float("inf")
    return squared_mahalanobis(error, covariance)


def _mean_length_mm(vectors: Array) -> float:
    return 1e3 * float(np.linalg.norm(vectors, axis=-1).mean())
