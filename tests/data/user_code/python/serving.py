"""Services: handlers get a request and a response, fill one from the other, and give it back."""

import pytest
from example_interfaces.srv import AddTwoInts
from rover.srv import Plan
from std_srvs.srv import SetBool, Trigger


def add(request: AddTwoInts.Request, response: AddTwoInts.Response) -> AddTwoInts.Response:
    response.sum = request.a + request.b
    return response


def switch(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
    response.success = True
    response.message = "on" if request.data else "off"
    return response


def plan(request: Plan.Request, response: Plan.Response) -> Plan.Response:
    blocked = request.clearance > 1.0
    response.code = Plan.Response.BLOCKED if blocked else Plan.Response.OK
    response.route.header.frame_id = response.route.FRAME
    return response


question = AddTwoInts.Request()
question.a, question.b = 41, 1
assert add(question, AddTwoInts.Response()).sum == 42
assert switch(SetBool.Request(data=True), SetBool.Response()).message == "on"
assert Trigger.Request() == Trigger.Request()
assert Trigger.Response(success=True, message="done").message == "done"
assert Plan.Request().clearance == 0.3
answer = plan(Plan.Request(clearance=2.0), Plan.Response())
assert (answer.code, answer.route.header.frame_id) == (1, "map")
assert AddTwoInts.Request.__name__ == "AddTwoInts_Request"

with pytest.raises(NotImplementedError):
    AddTwoInts()
