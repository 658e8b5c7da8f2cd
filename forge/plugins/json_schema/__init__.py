"""The target 'jsonschema': a JSON Schema for each message, for values as ROS's tools print them."""
