"""Whole programs behind the commands: player, recorder, demonstrations, tracking and evaluating recordings."""
