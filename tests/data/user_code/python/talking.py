"""A publisher and a subscriber that meet in one process, as in every first tutorial."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, Any, TypeVar

from std_msgs.msg import Int32, String

if TYPE_CHECKING:
    from collections.abc import Callable

M = TypeVar("M")


class Topics:
    """What carries messages from one to the other."""

    def __init__(self) -> None:
        self.listeners: dict[str, list[tuple[type[Any], Callable[[Any], None]]]] = defaultdict(list)

    def subscribe(self, type_: type[M], name: str, callback: Callable[[M], None]) -> None:
        self.listeners[name].append((type_, callback))

    def publish(self, name: str, message: object) -> None:
        for type_, callback in self.listeners[name]:
            assert isinstance(message, type_)
            callback(message)


class Listener:
    """Keeps what it heard."""

    def __init__(self, topics: Topics) -> None:
        self.heard: list[str] = []
        self.sum = 0
        topics.subscribe(String, "chatter", self.on_text)
        topics.subscribe(Int32, "count", self.on_count)

    def on_text(self, message: String) -> None:
        self.heard.append(message.data)

    def on_count(self, message: Int32) -> None:
        self.sum += message.data


topics = Topics()
listener = Listener(topics)
for number in range(3):
    text = String()
    text.data = f"Hello World: {number}"
    topics.publish("chatter", text)
    topics.publish("count", Int32(data=number))
assert listener.heard == ["Hello World: 0", "Hello World: 1", "Hello World: 2"]
assert listener.sum == 3
