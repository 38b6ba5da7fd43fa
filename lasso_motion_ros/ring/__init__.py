"""Our method (`method: appearance`): the ring's model, where it is looked for, how it is aligned, and what is believed.

A pair's way through it is `tracker.RingTracker.track`. Once, from the clicks, `loop_model` makes the curve.
Then for each pair: `working_image`, `search` and `loop_finder` (where may it be?), `alignment` (where is it
exactly?), `finding` (do the planes show it, and agree?), `foresight` and `judgement` (is this breathing?), `verdict`
(the state and its words), and `uncertainty` (the covariance).
"""
