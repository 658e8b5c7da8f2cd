"""The target 'typescript': an interface for each message, for values as ROS's tools convert them to JSON."""
