"""Parameters: a type code says which of many fields holds the value."""

from __future__ import annotations

from rcl_interfaces.msg import (
    FloatingPointRange,
    Log,
    Parameter,
    ParameterDescriptor,
    ParameterType,
    ParameterValue,
    SetParametersResult,
)
from rcl_interfaces.srv import SetParameters


def value_of(value: bool | float | str) -> ParameterValue:
    match value:
        case bool():
            return ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=value)
        case int():
            return ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=value)
        case float():
            return ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
        case str():
            return ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=value)


def show(parameter: Parameter) -> str:
    match parameter:
        case Parameter(name=name, value=ParameterValue(type=1, bool_value=flag)):
            return f"{name} is {'on' if flag else 'off'}"
        case Parameter(name=name, value=ParameterValue(type=3, double_value=number)):
            return f"{name} = {number}"
    return "?"


request = SetParameters.Request()
for name, value in {"fast": True, "speed": 1.5}.items():
    request.parameters.append(Parameter(name=name, value=value_of(value)))
assert [show(parameter) for parameter in request.parameters] == ["fast is on", "speed = 1.5"]

limits = ParameterDescriptor(
    name="speed",
    type=ParameterType.PARAMETER_DOUBLE,
    floating_point_range=[FloatingPointRange(from_value=0.0, to_value=2.0, step=0.1)],
)
inside = [span.from_value <= 1.5 <= span.to_value for span in limits.floating_point_range]
response = SetParameters.Response(results=[SetParametersResult(successful=ok) for ok in inside])
assert response.results[0].successful
assert Log(level=Log.WARN[0]).level == 30
