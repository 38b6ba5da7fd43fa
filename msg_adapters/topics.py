"""The topics of the contract in one table: name, type, durability, queue depth."""

from __future__ import annotations

from dataclasses import dataclass

from lasso_motion_ros.geometry.frames import PLANES, Plane

IMAGE_TYPE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE_TYPE = "sensor_msgs/msg/CompressedImage"


@dataclass(frozen=True)
class Topic:
    """One topic.

    Attributes:
        name: relative name, as a node uses it (namespaces and remapping then work).
        type_name: message type, `package/msg/Name`.
        latched: transient-local durability: a late joiner gets the last message.
        depth: queue depth of the publisher.
    """

    name: str
    type_name: str
    latched: bool = False
    depth: int = 10

    @property
    def recorded_name(self) -> str:
        """The name in a recording: absolute, in the root namespace."""
        return self.name if self.name.startswith("/") else "/" + self.name


def image_topic(plane: Plane) -> Topic:
    """The X-ray images of one plane."""
    return Topic(f"plane_{plane}/image_raw", IMAGE_TYPE)


def compressed_image_topic(plane: Plane) -> Topic:
    """The same images as image_transport's `compressed` plugin publishes them; taken where there are no raw ones."""
    return Topic(f"plane_{plane}/image_raw/compressed", COMPRESSED_IMAGE_TYPE)


def camera_info_topic(plane: Plane) -> Topic:
    """The calibration of one plane, per frame or latched."""
    return Topic(f"plane_{plane}/camera_info", "sensor_msgs/msg/CameraInfo")


def seed_topic(plane: Plane) -> Topic:
    """The user's clicks in one plane."""
    return Topic(f"plane_{plane}/seed", "geometry_msgs/msg/PolygonStamped")


def tracking_topic(plane: Plane) -> Topic:
    """One plane's picture with what is tracked drawn in."""
    return Topic(f"plane_{plane}/tracking", IMAGE_TYPE)


def click_topic(plane: Plane) -> Topic:
    """Clicks on the picture of `tracking_topic`, pixels without a stamp, as rqt_image_view publishes them."""
    return Topic(f"plane_{plane}/tracking_mouse_left", "geometry_msgs/msg/Point")


def overlay_topic(plane: Plane) -> Topic:
    """One plane's picture with the compensated volume drawn in."""
    return Topic(f"plane_{plane}/overlay", IMAGE_TYPE)


def overlay_drawn_topic(plane: Plane) -> Topic:
    """What each picture of `overlay_topic` is, ahead of it and under its stamp.

    `frame_id` is the frame of the motion with which it is drawn; empty where nothing is compensated.
    """
    return Topic(f"plane_{plane}/overlay/drawn", "std_msgs/msg/Header")


def standard_image_topic(plane: Plane) -> Topic:
    """One plane's film as a plain camera sees it: not mirrored."""
    return Topic(f"plane_{plane}/standard/image_raw", IMAGE_TYPE)


def standard_camera_info_topic(plane: Plane) -> Topic:
    """The plain camera of `standard_image_topic`; its pose is in TF."""
    return Topic(f"plane_{plane}/standard/camera_info", "sensor_msgs/msg/CameraInfo")


R_PEAK = Topic("ecg/r_peak", "std_msgs/msg/Header")

MOTION = Topic("motion", "geometry_msgs/msg/PoseStamped")
MOTION_RAW = Topic("motion_raw", "geometry_msgs/msg/PoseStamped")
MOTION_WITH_COVARIANCE = Topic("motion_with_covariance", "geometry_msgs/msg/PoseWithCovarianceStamped")
REFERENCE = Topic("reference", "std_msgs/msg/Header", latched=True, depth=1)
CATHETER = Topic("catheter", "visualization_msgs/msg/Marker")
PROPOSAL = Topic("proposal", "visualization_msgs/msg/Marker")
"""The ring that was found without clicks, until somebody says yes."""
STATE = Topic("state", "std_msgs/msg/String", latched=True, depth=1)
STATE_RENEWED_S = 1.0
"""A running tracker says its state at least this often, and with every pair."""
STATE_VALID_S = 2.5
"""A state that nobody has renewed for so long (steady clock) is no state: its tracker is gone, or hangs."""
DIAGNOSTICS = Topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
LAST_POSE_WORDS = "; last good pose "
"""Behind these, where there is no pose, the tracker's diagnostics say how old the last one is."""
LAST_LATENCY_KEY = "latency of the last pair (ms)"
"""Under which the tracker's diagnostics say it, and the evaluation finds it."""
POSTURE_KEY = "posture"
"""How the patient lies, as the tracker was told."""
CLICKS_TAKEN_KEY, CLICKS_REFUSED_KEY, LAST_REFUSAL_KEY = "clicks taken", "clicks refused", "clicks refused because"
"""How often clicks made a model, how often they were refused, and why they were the last time."""
TF = Topic("/tf", "tf2_msgs/msg/TFMessage", depth=100)
OVERLAY_SURFACE = Topic("overlay/surface", "visualization_msgs/msg/Marker")

TRUE_MOTION = Topic("/ground_truth/motion", "geometry_msgs/msg/PoseStamped")
TRUE_RESPIRATORY_MOTION = Topic("/ground_truth/motion_respiratory", "geometry_msgs/msg/PoseStamped")
TRUE_CATHETER = Topic("/ground_truth/catheter", "visualization_msgs/msg/Marker", latched=True, depth=1)
TRUE_TARGETS = Topic("/ground_truth/targets", "visualization_msgs/msg/Marker", latched=True, depth=1)


def true_centreline_topic(plane: Plane) -> Topic:
    """The loop's true centreline in one plane's pixels, at plane A's exposure."""
    return Topic(f"/ground_truth/plane_{plane}/catheter", "geometry_msgs/msg/PolygonStamped")


INPUTS: tuple[Topic, ...] = (
    *(image_topic(plane) for plane in PLANES),
    *(camera_info_topic(plane) for plane in PLANES),
    *(seed_topic(plane) for plane in PLANES),
    R_PEAK,
)
OUTPUTS: tuple[Topic, ...] = (MOTION, MOTION_RAW, MOTION_WITH_COVARIANCE, REFERENCE, CATHETER, STATE)
GROUND_TRUTH: tuple[Topic, ...] = (
    TRUE_MOTION,
    TRUE_RESPIRATORY_MOTION,
    *(true_centreline_topic(plane) for plane in PLANES),
    TRUE_CATHETER,
    TRUE_TARGETS,
)
