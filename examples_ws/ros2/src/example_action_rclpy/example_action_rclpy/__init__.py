"""An action server that can be canceled, and its client, in Python."""
