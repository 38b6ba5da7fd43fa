"""Thin rclpy nodes: parameters in, callbacks to the pipeline, results out."""
