"""Quality of service of the contract's topics, as rclpy profiles."""

from __future__ import annotations

from collections.abc import Iterable

from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile, QoSReliabilityPolicy

IMAGE_DEPTH = 10


def qos(*, depth: int, latched: bool = False, reliable: bool = True) -> QoSProfile:
    """Keep the last `depth`; latched means that a late subscriber still gets the last one (transient local)."""
    return QoSProfile(
        history=QoSHistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=QoSReliabilityPolicy.RELIABLE if reliable else QoSReliabilityPolicy.BEST_EFFORT,
        durability=QoSDurabilityPolicy.TRANSIENT_LOCAL if latched else QoSDurabilityPolicy.VOLATILE,
    )


def offered_reliably(offers: Iterable[QoSProfile]) -> bool | None:
    """Whether a subscriber that wants to hear all these publishers may ask for reliable delivery.

    A reliable subscription never matches a best-effort publisher; a best-effort one matches both.

    Args:
        offers: what each publisher of a topic offers.

    Returns:
        True if all are reliable, False if one is best effort, None if there is no publisher yet.
    """
    reliabilities = [offer.reliability for offer in offers]
    if not reliabilities:
        return None
    return QoSReliabilityPolicy.BEST_EFFORT not in reliabilities
