"""Types by their names, as tools get them on the command line."""

import pytest
from example_interfaces.action import Fibonacci
from example_interfaces.srv import AddTwoInts
from rosidl_runtime_py.utilities import (
    get_action,
    get_interface,
    get_message,
    get_service,
    is_action,
    is_message,
    is_service,
)
from rover.msg import Route
from std_msgs.msg import String

assert get_message("std_msgs/msg/String") is String
assert get_message("rover/Route") is Route
assert get_service("example_interfaces/srv/AddTwoInts") is AddTwoInts
assert get_action("example_interfaces/action/Fibonacci") is Fibonacci
assert get_interface("example_interfaces/srv/AddTwoInts_Request") is AddTwoInts.Request
assert get_interface("example_interfaces/action/Fibonacci_FeedbackMessage") is Fibonacci.Impl.FeedbackMessage
assert (is_message(String), is_service(AddTwoInts), is_action(Fibonacci)) == (True, True, True)
assert not is_message(AddTwoInts)

with pytest.raises(ValueError, match="Expected the full name of a message"):
    get_message("std_srvs/srv/Empty")
with pytest.raises(ModuleNotFoundError):
    get_message("no_such_msgs/msg/String")
with pytest.raises(AttributeError):
    get_message("std_msgs/msg/Strin")
