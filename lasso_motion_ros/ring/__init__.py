"""Our method: the ring's model, where it is looked for, how it is aligned, and what is believed."""
