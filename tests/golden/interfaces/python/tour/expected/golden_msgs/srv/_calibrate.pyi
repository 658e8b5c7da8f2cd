from typing import TypeAlias as _TypeAlias

from forge_rosidl import messages as _messages

class Metaclass_Calibrate_Request(_messages.MessageType): ...

class Calibrate_Request(_messages.Message, metaclass=Metaclass_Calibrate_Request):
    """Message class 'Calibrate_Request'."""
    def __init__(
        self,
        *,
        force: bool = ...,
        check_fields: object = ...,
    ) -> None: ...
    @property
    def force(self) -> bool: ...
    @force.setter
    def force(self, value: bool) -> None: ...

class Metaclass_Calibrate_Response(_messages.MessageType): ...

class Calibrate_Response(_messages.Message, metaclass=Metaclass_Calibrate_Response):
    """Message class 'Calibrate_Response'."""
    def __init__(
        self,
        *,
        success: bool = ...,
        check_fields: object = ...,
    ) -> None: ...
    @property
    def success(self) -> bool: ...
    @success.setter
    def success(self, value: bool) -> None: ...

class Metaclass_Calibrate(_messages.ServiceType): ...

class Calibrate(_messages.Service, metaclass=Metaclass_Calibrate):
    Request: _TypeAlias = Calibrate_Request
    Response: _TypeAlias = Calibrate_Response
