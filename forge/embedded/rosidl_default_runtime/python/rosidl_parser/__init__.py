"""The part of rosidl_parser that messages need at run time: `rosidl_parser.definition`."""
