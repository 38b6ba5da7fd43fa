"""The tracker's reasons in words for those who click: what was seen, and what to do. Numbers stay in the log."""

from __future__ import annotations

import re

_AGAIN = "Click anew along the dark wire, all the way round, in both planes."
_PLAIN: tuple[tuple[str, str], ...] = (
    (r"^no seed yet$", "Click along the loop in both planes to begin."),
    (
        r"plane ([AB])'s clicks wait for the image at .*; the newest is at",
        r"The clicks in plane \1 wait for their picture to come.",
    ),
    (r"plane ([AB])'s clicks wait for", r"The clicks in plane \1 wait for the next picture."),
    (r"^no calibration yet$", "The images have no valid calibration yet."),
    (r"^the model was forgotten$", "The loop was forgotten. Click along it in both planes to begin anew."),
    (r"^no pair since activation$", "Waiting for images."),
    (r"no catheter is seen along the clicks", f"No lasso is visible along the clicks. {_AGAIN}"),
    (
        r"the clicks make a loop of ([\d.]+) mm radius, expected ([\d.]+) to ([\d.]+)",
        r"The clicks make a loop of \1 mm radius; a lasso has \2 to \3 mm. " + _AGAIN,
    ),
    (
        r"plane ([AB]): the clicks span ([\d.]+) mm",
        r"The clicks in plane \1 lie within \2 mm: too close together. " + _AGAIN,
    ),
    (r"plane ([AB]): (\d+) clicks, expected at least (\d+)", r"Plane \1 has \2 clicks; it needs \3 or more."),
    (r"plane ([AB]): click .* lies outside the image", r"A click in plane \1 lies outside the image. Click anew."),
    (r"no 3-D (ellipse|loop) explains", "The clicks in the two planes do not fit one loop in space. " + _AGAIN),
    (
        r"the two planes look from ([\d.]+)° apart",
        r"The two planes look from nearly the same side (\1° apart): depth cannot be told. Turn one plane.",
    ),
    (
        r"the clicked loop would lie behind the source of plane ([AB])",
        r"The calibration of plane \1 does not fit its image: the loop would lie behind the X-ray source.",
    ),
    (
        r"the clicked image .* is not among the last",
        "The clicked picture is too old by now. Press S and click in a new one.",
    ),
    (
        r"the clicked image .* is not of the next pair|the clicks of both planes must be on one pair",
        "The two planes were clicked in pictures of different times. Press S and click in both.",
    ),
    (
        r"the clicked pair lacks plane ([AB])",
        r"The clicked picture has no image of plane \1. Press S and click where both planes have one.",
    ),
    (r"with the calibrations of A and B exchanged", "The calibrations of plane A and plane B seem to be swapped."),
    (
        r"wrong calibration, or clicks on different things\? \(at most",
        "The two planes put the loop at different places: wrong calibration, or clicks on two things? Click anew.",
    ),
    (
        r"the reference can be set in TRACKING and DISPLACED only",
        "The reference can be set only while the loop is followed, or displaced.",
    ),
    (r"there is no pair with calibrated images", "There is no picture of both planes to click in yet."),
    (r"^the node is not active$", "The tracker is switched off (inactive)."),
    (r"^\w+(Error|error|Exception): ", f"The clicks or images could not be worked with. {_AGAIN}"),
)


def in_plain_words(reason: str) -> str:
    """A reason of the tracker's as it is told to a clinician; what is plain already stays as it is."""
    for pattern, words in _PLAIN:
        match = re.search(pattern, reason)
        if match is not None:
            return match.expand(words)
    return reason[:1].upper() + reason[1:]
