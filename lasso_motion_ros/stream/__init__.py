"""From messages to the tracker and back: pairs, clicks, warm-up; shared by the nodes and the offline commands."""
