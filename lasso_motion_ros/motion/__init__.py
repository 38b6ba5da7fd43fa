"""How a heart moves: breathing as a filter in time, its direction and rotation, the heartbeat."""
