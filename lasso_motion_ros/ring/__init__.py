"""Our method (`method: appearance`): the ring's model, where it is looked for, how it is aligned, and what is believed.

A pair's way through it is `RingTracker.track` (`ring/tracker.py`). Once, from the clicks, `seed_curves` makes the curve
and `seed_template` the template. Then for each pair: `detector` (`working_image`, `search`, `alignment`: which places
look like it?), `association` (which is it?), `breathing_curve`, `slide` and `track_state` (is it in its place?),
`validation` (what else is asked, in words), `track_result` and `uncertainty` (pose and covariance).
"""
