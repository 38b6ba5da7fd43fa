"""How fast, how large, how well: stages, memory, live latency, and the suite of simulated sequences."""
