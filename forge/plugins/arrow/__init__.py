"""The target 'arrow': a module that converts lists of messages to Apache Arrow and back."""
