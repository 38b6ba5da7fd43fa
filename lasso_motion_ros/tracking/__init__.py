"""What a tracker is: its protocol, its states, its result."""
