"""What the page says of the tracker: its own word while it is fresh, else that it is not known, and why."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from lasso_motion_ros.geometry.frames import PLANES
from lasso_motion_ros.overlay.tracking_picture import STATE_COLOURS
from lasso_motion_ros.tracking.tracker import TrackerState
from lasso_motion_ros.web.stream_health import StreamHealth
from msg_adapters.topics import STATE_VALID_S

NO_TRACKER, TRACKER_SILENT, NO_IMAGES, NO_POSE = "NO_TRACKER", "TRACKER_SILENT", "NO_IMAGES", "NO_POSE"
_ALARMING = "#ff5c50"
_UNKNOWN = "#aaaaaa"
_APART_S = 0.5
"""What comes from the tracker and what comes from the detectors is not told apart by less than this, seconds."""


@dataclass(frozen=True)
class Headline:
    """What the page says.

    Attributes:
        state: the tracker's state, or one of the page's own: NO_TRACKER, TRACKER_SILENT, NO_IMAGES, NO_POSE.
        colour: of the state, #rrggbb.
        reason: why, in plain words; empty where the state says it all.
        alarm: what is wrong with what is on the screen; empty where nothing is.
        has_pose: whether there is a pose, and it is fresh.
    """

    state: str
    colour: str
    reason: str
    alarm: str
    has_pose: bool


class TrackerWord:
    """Follows what the tracker says, and how long ago.

    A latched state outlives the process that said it, so a state alone says nothing: a pose must have come for a state
    that tells of one, and any sign of life for any other.

    Args:
        clock: steady clock, seconds.
        health: knows whether images come.

    Attributes:
        present: whether anybody publishes `state`.
        said: the last state received; empty before the first.
    """

    def __init__(self, clock: Callable[[], float], health: StreamHealth) -> None:
        self._clock, self._health = clock, health
        self.present = True
        self.said = ""
        self._shown = ""
        self._reason = ""
        self._said_at_s = self._heard_at_s = clock()
        self._pose_at_s: float | None = None

    def take_state(self, state: str) -> None:
        """Take a `state`. One that tells of a pose is shown once its pose has come, which is a moment later."""
        self._heard_at_s = self._clock()
        if state != self.said:
            self._said_at_s = self._heard_at_s
            self._reason = ""  # that was the last state's; the diagnostics bring the new one's
        self.said = state
        if not TrackerState.tells_of_pose(state) or TrackerState.tells_of_pose(self._shown):
            self._shown = state
        if state in (TrackerState.WAITING_FOR_CALIBRATION.value, TrackerState.WAITING_FOR_SEED.value):
            self._pose_at_s = None

    def take_pose(self) -> None:
        """Take note of a `motion`."""
        self._heard_at_s = self._pose_at_s = self._clock()
        if TrackerState.tells_of_pose(self.said):
            self._shown = self.said

    def take_reason(self, state: str, reason: str) -> None:
        """Take what the diagnostics say of a state."""
        self._heard_at_s = self._clock()
        if state == self.said:
            self._reason = reason

    @property
    def pose_age_s(self) -> float | None:
        """Seconds since the last pose of this tracking; None before the first."""
        return None if self._pose_at_s is None else self._clock() - self._pose_at_s

    @property
    def has_pose(self) -> bool:
        """Whether the tracker's word is that there is a pose, and that word is fresh."""
        return self.headline().has_pose

    def headline(self) -> Headline:
        """What is true now, as far as can be known here."""
        silence_s = self._clock() - self._heard_at_s
        if not self.present or not self.said:
            alarm = "The tracker is gone. Nothing is tracked." if self.said else ""
            reason = "The tracker is not running." if not self.present else "The tracker has not said anything yet."
            return Headline(NO_TRACKER, _ALARMING if alarm else _UNKNOWN, reason, alarm, has_pose=False)
        if silence_s > STATE_VALID_S:
            reason = f"Nothing heard of the tracker for {silence_s:.0f} s: it has stopped, or hangs."
            return Headline(
                TRACKER_SILENT, _ALARMING, reason, "The tracker is silent. Nothing is tracked.", has_pose=False
            )
        if TrackerState.tells_of_pose(self.said) and (self._is_stale or self._images_ended):
            return self._without_pose()
        if not self._shown:  # a latched word of before this page: its pose is on its way, or will never come
            return Headline(NO_POSE, _UNKNOWN, "The tracker tells of a pose; waiting for it.", "", has_pose=False)
        state = self._shown
        has_pose = TrackerState.tells_of_pose(state)
        reason = self._reason if state == self.said else ""
        return Headline(state, _colour(state), reason, self._lacking(state), has_pose)

    @property
    def _is_stale(self) -> bool:
        """Whether the pose that the tracker tells of has not come, or is too old."""
        since_s = self._pose_at_s
        if not TrackerState.tells_of_pose(self._shown) or since_s is None:
            since_s = self._said_at_s  # its first pose is on its way
        return self._clock() - since_s > self._health.stopped_after_s

    @property
    def _images_ended(self) -> bool:
        """Whether neither plane has images any more, and no pose has come since either."""
        age_s, image_age_s = self.pose_age_s, self._health.image_age_s
        if age_s is None or image_age_s is None or age_s < image_age_s - _APART_S:
            return False
        return all(self._health.silence_s(plane) is not None for plane in PLANES)

    def _without_pose(self) -> Headline:
        """The tracker tells of a pose, and none comes: because no images do, or because it hangs."""
        image_age_s = self._health.image_age_s
        age_s = self.pose_age_s
        if image_age_s is None or (age_s is not None and image_age_s >= age_s - _APART_S):
            since = "" if image_age_s is None else f" for {image_age_s:.0f} s"
            if any(map(self._health.is_held, PLANES)):
                return Headline(
                    NO_IMAGES, _ALARMING, f"The picture is held: no new exposure{since}.",
                    "The picture is held. What is on the screen is old.", has_pose=False,
                )  # fmt: skip
            return Headline(
                NO_IMAGES, _ALARMING, f"No images{since}: nothing can be tracked.",
                "No images. What is on the screen is old.", has_pose=False,
            )  # fmt: skip
        if self._health.coming_s < self._health.stopped_after_s:
            return Headline(NO_POSE, _UNKNOWN, "Images come again; waiting for a pose.", "", has_pose=False)
        since = "yet" if age_s is None else f"for {age_s:.0f} s"
        reason = f"Images come, but no pose {since}: the tracker hangs, or cannot keep up."
        return Headline(NO_POSE, _ALARMING, reason, "No pose comes. Nothing is compensated.", has_pose=False)

    def _lacking(self, state: str) -> str:
        """The alarm about planes without images; empty where both have them, or never had."""
        silent = {plane: age for plane in PLANES if (age := self._health.silence_s(plane)) is not None}
        if state == TrackerState.TRACKING.value:
            # Where its last pose is as old as the images, nobody knows yet who lacks them: the next word tells.
            pose_age_s = self.pose_age_s
            silent = {plane: age for plane, age in silent.items() if pose_age_s is None or pose_age_s < age - _APART_S}
        if not silent:
            return ""
        which = "" if len(silent) == len(PLANES) else f" of plane {next(iter(silent)).upper()}"
        if state == TrackerState.TRACKING.value:  # both planes are tracked: they get lost on the way to this page alone
            return f"The tracker has images{which}, this page has not. The picture is old."
        if any(map(self._health.is_held, silent)):
            return f"The picture{which} is held: no new exposure."
        return f"No images{which}. The picture is old."


def _colour(state: str) -> str:
    try:
        red, green, blue = STATE_COLOURS[TrackerState(state)]
    except ValueError:
        return _UNKNOWN
    return f"#{red:02x}{green:02x}{blue:02x}"
