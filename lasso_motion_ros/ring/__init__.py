"""Our method (`method: appearance`): the ring's model, where it is looked for, how it is aligned, and what is believed.

A pair's way through it is `tracker.RingTracker.track`. Once, from the clicks, `loop_model` makes the curve.
Then for each pair: `working_image`, `search`, `alignment` and `detector` (where may it be, and where exactly?),
`association` (which of these is the ring, or none?), `breathing_curve` and `track_state` (is this breathing?),
`validation` (what else is asked of it, and the words for the state), and `uncertainty` (the covariance).
"""
