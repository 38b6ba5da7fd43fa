"""What lies beside a benchmark's files for people: the card and the licence."""

from __future__ import annotations

from collections import Counter

from lasso_motion_ros.bench.benchmark.manifest import Manifest
from lasso_motion_ros.bench.suite.clinic_classes import CLASSES

LICENCE_TEXT = """CC0 1.0 Universal: public domain dedication

SPDX-License-Identifier: CC0-1.0

The images, calibrations, clicks and truth in this directory are computed: a procedural body and procedural catheters,
rendered by the simulator of lasso_motion_ros. No patient, no phantom and no recorded image went into them.

To the extent possible under law, the makers of this benchmark have waived all copyright and related or neighbouring
rights to it. The legal text: https://creativecommons.org/publicdomain/zero/1.0/legalcode

The simulator itself, the scorer and their documentation are under the Apache License 2.0. If you publish figures,
please name the benchmark's identity, which is in README.md.
"""

_CARD = """# {identity}

Simulated biplane X-ray sequences of a lasso (circumferential mapping) catheter that breathes with the left atrium, to
measure how well a tracker follows it, and whether it says when it does not. {sequences} sequences, {pairs} pairs.

- Identity: `{identity}`. Figures of another version or seed do not compare.
- Licence: CC0 1.0 (`LICENSE.txt`).
- Made with: {made_with}.

## What is in it

- `recordings/NNN.mcap`: what a tracker gets. MCAP, profile `ros2`: `/plane_a/image_raw`, `/plane_b/image_raw`
  (sensor_msgs/Image, 8 or 16 bits), `/plane_a/camera_info`, `/plane_b/camera_info` (`p` is the 3×4 projection from
  world **metres** to pixels, of any scale and sign), `/plane_a/seed`, `/plane_b/seed` (a user's clicks along the loop
  in the first pair), `/ecg/r_peak`.
- `truth/NNN.mcap` and `truth/NNN.json`: what it is scored against. A tracker that has seen them is no entry.
- `manifest.json`: version, seed, SHA-256 of every file; of each sequence the event classes, the pair from which on each
  holds, and the stamps of its pairs.

Every sequence has one event class or two:

{classes}

## What is asked

For each pair after the first: the rigid motion T of the atrium since the first pair, p_now = T · p_first in world
metres, under the stamp of plane A's image (where plane A is missing: the stamp it would have had, as in the manifest),
or nothing. The motion includes the heartbeat. Nothing is the right answer where the ring is hidden, has left its place
or has been drawn into its sheath; an answer all the same is counted as wrong if it is more than 2 mm off, or if there
is no ring to follow.
The format of results: `docs/benchmark.md` of lasso_motion_ros; the score:

    lasso-motion benchmark score DIR --result FILES

## What it is not

- Not X-ray film of patients. The body is procedural, scatter and noise are models, and no real system's processing is
  copied. A tracker that is good here may fail in the clinic; one that fails here has a reason to.
- Not a blind test. The truth is in the directory, and whoever has the simulator and the seed can render it. For a blind
  test draw a seed of your own, keep `truth/` and hand out the rest.
- Not a set to train or tune on: draw other seeds for that, as many as you like.
- Not a measure of overlay quality, of dose, or of clinical benefit. This is no medical device.
"""


def card(manifest: Manifest) -> str:
    """The card, Markdown."""
    counts = Counter(name for one in manifest.sequences for name in one.since)
    classes = [
        f"- `{name}` ({counts[name]} sequence{'s' * (counts[name] > 1)}): {one.label}"
        for name, one in CLASSES.items()
        if name in counts
    ]
    return _CARD.format(
        identity=manifest.identity,
        sequences=len(manifest.sequences),
        pairs=manifest.pairs,
        made_with=", ".join(f"{name} {version}" for name, version in manifest.made_with.items() if name != "machine"),
        classes="\n".join(classes),
    )
