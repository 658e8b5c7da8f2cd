"""ROS domains of tests: concurrent tests receive no messages from each other or the user's nodes."""
