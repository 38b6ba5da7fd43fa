"""The page in the browser: server, live stream, annotation. Free of ROS; `nodes/web_node.py` brings the messages."""
