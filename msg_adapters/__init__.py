"""Converts between messages or files and the method's own types; imports no rclpy."""
