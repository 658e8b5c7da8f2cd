from typing import TypeAlias as _TypeAlias

from forge_rosidl import messages as _messages
from action_msgs.msg._goal_status_array import GoalStatusArray
from action_msgs.srv._cancel_goal import CancelGoal
from builtin_interfaces.msg._time import Time
from golden_msgs.msg._reading import Reading
from unique_identifier_msgs.msg._uuid import UUID

class Metaclass_Watch_Goal(_messages.MessageType): ...

class Watch_Goal(_messages.Message, metaclass=Metaclass_Watch_Goal):
    """Message class 'Watch_Goal'."""
    def __init__(
        self,
        *,
        first: Reading = ...,
        check_fields: object = ...,
    ) -> None: ...
    @property
    def first(self) -> Reading: ...
    @first.setter
    def first(self, value: Reading) -> None: ...

class Metaclass_Watch_Result(_messages.MessageType): ...

class Watch_Result(_messages.Message, metaclass=Metaclass_Watch_Result):
    """Message class 'Watch_Result'."""
    def __init__(
        self,
        *,
        check_fields: object = ...,
    ) -> None: ...

class Metaclass_Watch_Feedback(_messages.MessageType): ...

class Watch_Feedback(_messages.Message, metaclass=Metaclass_Watch_Feedback):
    """Message class 'Watch_Feedback'."""
    def __init__(
        self,
        *,
        latest: Reading = ...,
        check_fields: object = ...,
    ) -> None: ...
    @property
    def latest(self) -> Reading: ...
    @latest.setter
    def latest(self, value: Reading) -> None: ...

class Metaclass_Watch_SendGoal_Request(_messages.MessageType): ...

class Watch_SendGoal_Request(_messages.Message, metaclass=Metaclass_Watch_SendGoal_Request):
    """Message class 'Watch_SendGoal_Request'."""
    def __init__(
        self,
        *,
        goal_id: UUID = ...,
        goal: Watch_Goal = ...,
        check_fields: object = ...,
    ) -> None: ...
    @property
    def goal_id(self) -> UUID: ...
    @goal_id.setter
    def goal_id(self, value: UUID) -> None: ...
    @property
    def goal(self) -> Watch_Goal: ...
    @goal.setter
    def goal(self, value: Watch_Goal) -> None: ...

class Metaclass_Watch_SendGoal_Response(_messages.MessageType): ...

class Watch_SendGoal_Response(_messages.Message, metaclass=Metaclass_Watch_SendGoal_Response):
    """Message class 'Watch_SendGoal_Response'."""
    def __init__(
        self,
        *,
        accepted: bool = ...,
        stamp: Time = ...,
        check_fields: object = ...,
    ) -> None: ...
    @property
    def accepted(self) -> bool: ...
    @accepted.setter
    def accepted(self, value: bool) -> None: ...
    @property
    def stamp(self) -> Time: ...
    @stamp.setter
    def stamp(self, value: Time) -> None: ...

class Metaclass_Watch_GetResult_Request(_messages.MessageType): ...

class Watch_GetResult_Request(_messages.Message, metaclass=Metaclass_Watch_GetResult_Request):
    """Message class 'Watch_GetResult_Request'."""
    def __init__(
        self,
        *,
        goal_id: UUID = ...,
        check_fields: object = ...,
    ) -> None: ...
    @property
    def goal_id(self) -> UUID: ...
    @goal_id.setter
    def goal_id(self, value: UUID) -> None: ...

class Metaclass_Watch_GetResult_Response(_messages.MessageType): ...

class Watch_GetResult_Response(_messages.Message, metaclass=Metaclass_Watch_GetResult_Response):
    """Message class 'Watch_GetResult_Response'."""
    def __init__(
        self,
        *,
        status: int = ...,
        result: Watch_Result = ...,
        check_fields: object = ...,
    ) -> None: ...
    @property
    def status(self) -> int: ...
    @status.setter
    def status(self, value: int) -> None: ...
    @property
    def result(self) -> Watch_Result: ...
    @result.setter
    def result(self, value: Watch_Result) -> None: ...

class Metaclass_Watch_FeedbackMessage(_messages.MessageType): ...

class Watch_FeedbackMessage(_messages.Message, metaclass=Metaclass_Watch_FeedbackMessage):
    """Message class 'Watch_FeedbackMessage'."""
    def __init__(
        self,
        *,
        goal_id: UUID = ...,
        feedback: Watch_Feedback = ...,
        check_fields: object = ...,
    ) -> None: ...
    @property
    def goal_id(self) -> UUID: ...
    @goal_id.setter
    def goal_id(self, value: UUID) -> None: ...
    @property
    def feedback(self) -> Watch_Feedback: ...
    @feedback.setter
    def feedback(self, value: Watch_Feedback) -> None: ...

class Metaclass_Watch_SendGoal(_messages.ServiceType): ...

class Watch_SendGoal(_messages.Service, metaclass=Metaclass_Watch_SendGoal):
    Request: _TypeAlias = Watch_SendGoal_Request
    Response: _TypeAlias = Watch_SendGoal_Response

class Metaclass_Watch_GetResult(_messages.ServiceType): ...

class Watch_GetResult(_messages.Service, metaclass=Metaclass_Watch_GetResult):
    Request: _TypeAlias = Watch_GetResult_Request
    Response: _TypeAlias = Watch_GetResult_Response

class Metaclass_Watch(_messages.ActionType): ...

class Watch(_messages.Action, metaclass=Metaclass_Watch):
    Goal: _TypeAlias = Watch_Goal
    Result: _TypeAlias = Watch_Result
    Feedback: _TypeAlias = Watch_Feedback

    class Impl:
        SendGoalService: _TypeAlias = Watch_SendGoal
        GetResultService: _TypeAlias = Watch_GetResult
        FeedbackMessage: _TypeAlias = Watch_FeedbackMessage
        CancelGoalService: _TypeAlias = CancelGoal
        GoalStatusMessage: _TypeAlias = GoalStatusArray
