"""Image-based respiratory motion compensation from a lasso catheter in biplane X-ray (ROS 2)."""
