"""Runs a tracker over a phantom sequence in memory and scores it against the truth."""

from __future__ import annotations

from dataclasses import dataclass

from lasso_motion_ros.bench.suite.place_truth import with_place
from lasso_motion_ros.core.errors import LassoMotionError
from lasso_motion_ros.evaluation.measures import PairEstimate, PairScore, PairTruth, Truth, score_pairs
from lasso_motion_ros.geometry.frames import FramePair, Seed
from lasso_motion_ros.phantom import Scenario, Simulator
from lasso_motion_ros.tracking.tracker import Tracker, TrackerState, TrackResult


@dataclass(frozen=True, eq=False)
class RenderedSequence:
    """A rendered sequence.

    Attributes:
        scenario: what was rendered.
        pairs: what the tracker sees.
        seed: the clicks on the first pair.
        truth: what it is scored against.
    """

    scenario: Scenario
    pairs: tuple[FramePair, ...]
    seed: Seed
    truth: Truth


@dataclass(frozen=True, eq=False)
class SequenceResult:
    """What a tracker made of a sequence.

    Attributes:
        scenario: the sequence.
        scores: of its pairs, in order.
        halves: numbers of the pairs of which one plane is missing.
        reasons: per pair, why it was not TRACKING; empty where it was.
        refused: why the seed was refused; empty if it was not.
    """

    scenario: Scenario
    scores: tuple[PairScore, ...]
    halves: frozenset[int]
    reasons: tuple[str, ...]
    refused: str


def render_sequence(scenario: Scenario) -> RenderedSequence:
    """Render a scenario."""
    simulator = Simulator(scenario)
    clicks = simulator.seeds()
    pairs, truths = [], []
    for pair in simulator.pairs():
        pairs.append(pair.images)
        published = {plane: frame.projection for plane, frame in pair.images.frames.items()}
        true = PairTruth(pair.images.stamp_ns, pair.motion, pair.respiratory, pair.centrelines, published)
        truths.append(with_place(true, simulator, pair) if scenario.exact_place else true)
    truth = Truth(tuple(truths), simulator.reference_loop, simulator.targets)
    return RenderedSequence(scenario, tuple(pairs), Seed(clicks["a"], clicks["b"]), truth)


def run_sequence(sequence: RenderedSequence, tracker: Tracker) -> SequenceResult:
    """Track a sequence from its seed on and score every pair."""
    results: list[TrackResult] = []
    refused = ""
    try:
        results.append(tracker.initialise(sequence.pairs[0], sequence.seed))
    except LassoMotionError as error:
        refused = str(error)
    else:
        results += [_tracked(tracker, pair, results[0]) for pair in sequence.pairs[1:]]
    scores = score_pairs(sequence.truth, [_estimate(result) for result in results])
    halves = frozenset(number for number, pair in enumerate(sequence.pairs) if not pair.is_whole)
    return SequenceResult(sequence.scenario, scores, halves, tuple(result.reason for result in results), refused)


def _tracked(tracker: Tracker, pair: FramePair, first: TrackResult) -> TrackResult:
    """The tracker's answer; a pair that it cannot work with is one where the lasso is lost."""
    try:
        return tracker.track(pair)
    except LassoMotionError as error:
        lost = TrackerState.LOST
        return TrackResult(pair.stamp_ns, lost, str(error), None, None, None, first.reference_stamp_ns)


def _estimate(result: TrackResult) -> PairEstimate:
    return PairEstimate(
        result.stamp_ns,
        result.state.value,
        result.motion,
        result.motion,
        result.covariance,
        result.loop,
        result.reference_stamp_ns,
    )
