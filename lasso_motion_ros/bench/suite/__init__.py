"""Random simulated sequences, sweeps, traps and the ablation: the tracker on what it was not tuned on."""
