"""Which colour a door has."""

DOOR = "green"
