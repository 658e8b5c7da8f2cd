"""Events of services: messages if the ROS distribution has them, else only part of the type hash."""

from pathlib import Path

import pytest

from forge.base.errors import InterfaceError
from forge.interfaces.cpp import target as cpp
from forge.interfaces.hashing import hashes
from forge.interfaces.model import Catalog, Message, Source, TypeName, messages_of, with_events
from forge.interfaces.python import target as python
from forge.interfaces.read.parsing import parse_all
from forge.interfaces.read.sources import Library
from forge.interfaces.resolve.resolution import resolve

MOVE = TypeName("demo", "srv", "Move")
WALK = TypeName("demo", "action", "Walk")
DEFINITIONS = {
    "srv/Move.srv": "float32 distance\n---\n",
    "action/Walk.action": "---\n---\n",
    "msg/Plain.msg": "",
}


def catalog(*, events: bool) -> Catalog:
    sources = [Source("demo", path, Path(path), text) for path, text in DEFINITIONS.items()]
    return resolve("demo", parse_all(sources), Library(), events=events)


def test_event_messages_follow_the_messages_that_they_contain() -> None:
    interfaces = catalog(events=True).interfaces
    names = [message.name.name for message in messages_of(interfaces[MOVE])]
    assert names == ["Move_Request", "Move_Response", "Move_Event"]
    names = [message.name.name for message in messages_of(interfaces[WALK])]
    assert [name for name in names if name.endswith("_Event")] == [
        "Walk_SendGoal_Event",
        "Walk_GetResult_Event",
    ]


def test_disabled_events_affect_only_the_hash() -> None:
    without, with_ = catalog(events=False), catalog(events=True)
    assert not [name for name in without.known if name.name.endswith("_Event")]
    assert hashes(without) == hashes(with_)
    message = Message(TypeName("demo", "msg", "Plain"))
    assert with_events(message) is message


@pytest.mark.parametrize("events", [True, False])
def test_events_can_be_generated_in_cpp_and_python(*, events: bool) -> None:
    found = catalog(events=events)
    texts = {file.path: file.text for target in (cpp, python) for file in target.files(found)}
    expected = {
        "demo/srv/detail/move__struct.hpp": "  using Event = ::demo::srv::Move_Event;",
        "demo/action/detail/walk__struct.hpp": "  using Event = ::demo::action::Walk_SendGoal_Event;",
        "demo/srv/detail/move__traits.hpp": "service_msgs/msg/detail/service_event_info__traits.hpp",
        "demo/srv/detail/move__cdr.hpp": "struct Members<::demo::srv::Move_Event_<Allocator>>",
        "demo/srv/_move.py": "    Event = Move_Event",
        "demo/srv/_move.pyi": "    Event: _TypeAlias = Move_Event",
    }
    assert {path: text in texts[path] for path, text in expected.items()} == dict.fromkeys(expected, events)


def test_a_missing_dependency_of_a_service_is_reported() -> None:
    source = Source("demo", "srv/Move.srv", Path("Move.srv"), DEFINITIONS["srv/Move.srv"])
    with pytest.raises(InterfaceError) as caught:
        resolve("demo", parse_all([source]), Library(embedded=None), events=True)
    (problem,) = caught.value.problems
    assert (
        problem.message
        == "cannot find 'service_msgs/msg/ServiceEventInfo', which the service 'Move' requires"
    )
