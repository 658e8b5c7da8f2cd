"""The target 'protobuf': a .proto file for each message, and a module that converts values both ways."""
