"""What the tracker node says on /diagnostics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lasso_motion_ros.tracker import TrackerState

OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"
_LEVELS = {
    TrackerState.TRACKING: OK,
    TrackerState.INACTIVE: OK,
    TrackerState.LOST: ERROR,
    TrackerState.DISPLACED: ERROR,
}


def tracker_status(node_name: str, state: TrackerState, reason: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of the status `<node>: tracker`.

    Args:
        node_name: the node's full name.
        state: what it publishes on `state`.
        reason: why, in a few words.
        values: what else is worth showing, by name.
    """
    level = _LEVELS.get(state, WARN)
    return _status(f"{node_name}: tracker", level, f"{state.value}: {reason}" if reason else state.value, values)


def plane_status(node_name: str, plane: str, counts: Mapping[str, int], reliable: bool | None) -> dict[str, Any]:
    """Fields of the status `<node>: plane_x`.

    Args:
        node_name: the node's full name.
        plane: `a` or `b`.
        counts: received, paired, dropped and the like.
        reliable: how the images are subscribed; None while no publisher is known.
    """
    if reliable is None:
        return _status(f"{node_name}: plane_{plane}", WARN, "nobody publishes images", counts)
    values = {**counts, "subscribed": "reliable" if reliable else "best effort"}
    return _status(f"{node_name}: plane_{plane}", OK, "images", values)


def _status(name: str, level: bytes, message: str, values: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "name": name,
        "level": level,
        "message": message,
        "hardware_id": "",
        "values": [{"key": key, "value": str(value)} for key, value in values.items()],
    }
