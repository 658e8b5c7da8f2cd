"""The C++ target: C++17 headers with the paths and names of rosidl_generator_cpp."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from forge.base.errors import InterfaceError, Problem, raise_if_any
from forge.base.frozen import frozen
from forge.base.templating import render
from forge.interfaces.cpp.cdr import MembersViews
from forge.interfaces.cpp.headers import detail_path, guard, handles, main_path, needed
from forge.interfaces.cpp.struct import struct_needs_numeric_limits, struct_view
from forge.interfaces.cpp.text import qualified
from forge.interfaces.cpp.traits import type_traits, yaml_view
from forge.interfaces.model import Action, File, Primitive, Sequence, element_of, messages_of, services_of
from forge.interfaces.wire.flattening import LayoutBuilder

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from forge.interfaces.model import Catalog, Interface, Message, TypeName

_PARTS = ("struct", "builder", "traits", "type_support", "cdr")
_ACTION_HEADERS = (
    "action_msgs/msg/goal_info.hpp",
    "action_msgs/msg/goal_status_array.hpp",
    "action_msgs/srv/cancel_goal.hpp",
)
_LIKELY_MACROS = frozenset(
    {
        *("DELETE", "ERROR", "NO_ERROR"),  # windows.h
        *("DOMAIN", "EOF", "FALSE", "INFINITY", "NAN", "NULL", "OVERFLOW", "TRUE", "UNDERFLOW"),  # C
    }
)


@frozen
class BuilderStep:
    """A step of a builder: the class that sets one member and moves the message to the next step."""

    name: str
    message: str
    member: str
    first: bool
    result: str
    returned: str


@frozen
class BuilderStart:
    """The first step of build()."""

    message: str
    step: str


@dataclass(frozen=True)
class Headers:
    """The headers of one interface."""

    interface: Interface
    wire: MembersViews

    @property
    def name(self) -> TypeName:
        return self.interface.name

    @cached_property
    def messages(self) -> tuple[Message, ...]:
        """All messages of the interface, including derived ones."""
        return tuple(messages_of(self.interface))

    @cached_property
    def needed(self) -> tuple[TypeName, ...]:
        """The other interfaces with types of members, sorted."""
        return needed(self.interface)

    def main(self) -> File:
        return self._file(
            main_path(self.name, "hpp"),
            "interface",
            headers=[_detail(self.name, part) for part in _PARTS],
        )

    def struct(self) -> File:
        headers = ["rosidl_runtime_cpp/member_types.hpp", "rosidl_runtime_cpp/message_initialization.hpp"]
        members = (field for message in self.messages for field in message.members)
        bounded = any(isinstance(f.type, Sequence) and f.type.bound is not None for f in members)
        if bounded:
            headers.append("rosidl_runtime_cpp/bounded_vector.hpp")
        if isinstance(self.interface, Action):
            headers += _ACTION_HEADERS
        headers += [_detail(name, "struct") for name in self.needed]
        services = services_of(self.interface)
        constants = {constant.name for message in self.messages for constant in message.constants}
        return self._detail_file(
            "struct",
            headers=sorted(headers),
            numeric_limits=any(map(struct_needs_numeric_limits, self.messages)),
            macros=sorted(constants & _LIKELY_MACROS),
            messages=[struct_view(message) for message in self.messages],
            services=[service.name.name for service in services],
            has_events=any(service.has_events for service in services),
            actions=[self.name.name] if isinstance(self.interface, Action) else [],
        )

    def builder(self) -> File:
        return self._detail_file(
            "builder",
            headers=[_detail(self.name, "struct"), "rosidl_runtime_cpp/builder.hpp"],
            package=self.name.package,
            steps=[step for message in self.messages for step in _steps(message)],
            starts=[_start(message) for message in self.messages],
        )

    def traits(self) -> File:
        needed = [_detail(name, "traits") for name in self.needed]
        runtime = ["rosidl_runtime_cpp/traits.hpp", "rosidl_runtime_cpp/yaml.hpp"]
        return self._detail_file(
            "traits",
            headers=[_detail(self.name, "struct"), *sorted([*needed, *runtime])],
            messages=[yaml_view(message) for message in self.messages],
            types=list(type_traits(self.interface)),
        )

    def type_support(self) -> File:
        type_handles = handles(self.interface)
        kinds = {handle.kind for handle in type_handles}
        return self._detail_file(
            "type_support",
            headers=sorted(
                [_visibility_path(self.name.package), _detail(self.name, "traits")]
                + [f"rosidl_typesupport_cpp/{kind}_type_support.hpp" for kind in kinds]
            ),
            package=self.name.package,
            handles=type_handles,
        )

    def cdr(self) -> File:
        """Return the header that describes the serialized layout of messages."""
        views = [self.wire.of(message.name) for message in self.messages]
        own = _detail(self.name, "cdr")
        needed = {_detail(name, "cdr") for view in views for name in view.needs} - {own}
        headers = sorted({*needed, _detail(self.name, "struct")})
        return self._detail_file("cdr", headers=headers, messages=views)

    def _detail_file(self, part: str, **names: object) -> File:
        namespace = f"{self.name.package}::{self.name.kind}"
        return self._file(_detail(self.name, part), part, namespace=namespace, **names)

    def _file(self, path: str, template: str, **names: object) -> File:
        text = render(f"cpp/{template}.hpp.j2", source=str(self.name), guard=guard(path), **names)
        return File(path, text)


def files(catalog: Catalog) -> Iterator[File]:
    """Yield the headers of all interfaces; paths are relative to the include folder."""
    yield from package_files(catalog)
    headers_of = interface_files(catalog)
    for interface in catalog.interfaces.values():
        yield from headers_of(interface)


def package_files(catalog: Catalog) -> Iterator[File]:
    """Yield the header that all interfaces of a package share.

    Raises InterfaceError for a long double, whose serialized form depends on the platform.
    """
    raise_if_any(_unsupported(catalog), InterfaceError)
    path = _visibility_path(catalog.package)
    text = render("cpp/visibility_control.hpp.j2", guard=guard(path), package=catalog.package)
    yield File(path, text)


def interface_files(catalog: Catalog) -> Callable[[Interface], Iterator[File]]:
    """Return a function that yields the headers of one interface of the catalog."""
    wire = MembersViews(LayoutBuilder(catalog.known))

    def headers_of(interface: Interface) -> Iterator[File]:
        headers = Headers(interface, wire)
        yield headers.main()
        yield headers.struct()
        yield headers.builder()
        yield headers.traits()
        yield headers.type_support()
        yield headers.cdr()

    return headers_of


def _unsupported(catalog: Catalog) -> Iterator[Problem]:
    for interface in catalog.interfaces.values():
        for message in messages_of(interface):
            for field in message.fields:
                if element_of(field.type) == Primitive("long double"):
                    text = f"the long double '{field.name}' has no portable serialization"
                    yield Problem(text, field.place, "use double, or leave out --lang cpp")


def _visibility_path(package: str) -> str:
    return f"{package}/msg/rosidl_generator_cpp__visibility_control.hpp"


def _detail(name: TypeName, part: str) -> str:
    return detail_path(name, part, "hpp")


def _steps(message: Message) -> Iterable[BuilderStep]:
    """Return the steps in reverse order, because each refers to the next one."""
    names = [f"Init_{message.name.name}_{field.name}" for field in message.fields]
    steps = []
    for position, field in enumerate(message.fields):
        last = position == len(names) - 1
        result = "Message" if last else f"{names[position + 1]}<Message>"
        returned = "std::move(_message)" if last else f"{result}(std::move(_message))"
        steps.append(
            BuilderStep(names[position], qualified(message.name), field.name, position == 0, result, returned)
        )
    return reversed(steps)


def _start(message: Message) -> BuilderStart:
    spelled = qualified(message.name)
    if not message.fields:
        return BuilderStart(spelled, spelled)
    namespace = f"::{message.name.package}::{message.name.kind}::builder"
    return BuilderStart(spelled, f"{namespace}::Init_{message.name.name}_{message.fields[0].name}<{spelled}>")
