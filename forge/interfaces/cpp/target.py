"""The C++ target: C++17 headers with the paths and names of rosidl_generator_cpp."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping
from types import SimpleNamespace

from forge.base.errors import InterfaceError, Problem, raise_if_any
from forge.base.frozen import frozen
from forge.base.templating import render
from forge.interfaces.cpp.headers import detail_path, guard, handles, main_path, needed
from forge.interfaces.cpp.text import comment, literal, qualified, quoted, spell
from forge.interfaces.enumerations import Enumeration, enumerations
from forge.interfaces.model import (
    Action,
    Array,
    Catalog,
    Field,
    File,
    Interface,
    Message,
    Named,
    Primitive,
    Sequence,
    String,
    Type,
    TypeName,
    element_of,
    messages_of,
    services_of,
)
from forge.interfaces.wire.layout import (
    UNKNOWN,
    InlineArray,
    LayoutBuilder,
    LayoutStep,
    Length,
    Loop,
    Member,
    MessageCall,
    MessageLayout,
    Path,
    PrimitiveElements,
    Run,
    Scalar,
    StringData,
)

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

_ALLOCATED: dict[type[Type], str] = {Named: "_alloc, _init", String: "_alloc", Sequence: "_alloc"}
"""The constructor arguments of members that take an allocator."""


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
    problems = [
        Problem(
            f"the long double '{field.name}' has no portable serialization",
            field.place,
            "use double, or leave out --lang cpp",
        )
        for interface in catalog.interfaces.values()
        for message in messages_of(interface)
        for field in message.fields
        if element_of(field.type) == Primitive("long double")
    ]
    raise_if_any(problems, InterfaceError)
    path = _visibility_path(catalog.package)
    yield File(path, render("cpp/visibility_control.hpp.j2", guard=guard(path), package=catalog.package))


def interface_files(catalog: Catalog) -> Callable[[Interface], Iterator[File]]:
    """Return a function that yields the headers of one interface of the catalog."""
    wire = MembersViews(LayoutBuilder(catalog.known))

    def files_of(interface: Interface) -> Iterator[File]:
        source = catalog.sources.get(interface.name)
        return _headers(interface, wire, source.text if source else "")

    return files_of


def _headers(interface: Interface, wire: MembersViews, definition: str) -> Iterator[File]:
    name = interface.name
    messages, services = tuple(messages_of(interface)), services_of(interface)
    is_action = isinstance(interface, Action)
    others = needed(interface)
    own_struct = detail_path(name, "struct", "hpp")

    def header(part: str, path: str = "", **names: object) -> File:
        path = path or detail_path(name, part, "hpp")
        common = {"source": str(name), "package": name.package, "namespace": f"{name.package}::{name.kind}"}
        return File(path, render(f"cpp/{part}.hpp.j2", guard=guard(path), **common, **names))

    details = [detail_path(name, part, "hpp") for part in _PARTS]
    yield header("interface", main_path(name, "hpp"), headers=details)

    members = [field for message in messages for field in message.members]
    headers = ["rosidl_runtime_cpp/member_types.hpp", "rosidl_runtime_cpp/message_initialization.hpp"]
    if any(isinstance(field.type, Sequence) and field.type.bound is not None for field in members):
        headers.append("rosidl_runtime_cpp/bounded_vector.hpp")
    if is_action:
        headers += _ACTION_HEADERS
    headers += [detail_path(other, "struct", "hpp") for other in others]
    constants = [constant for message in messages for constant in message.constants]
    values = [*((field.default, field.type) for field in members), *((c.value, c.type) for c in constants)]
    named = [enumerations(message) for message in messages]
    enumerators = {member for by_field in named for each in by_field.values() for member, _ in each.members}
    yield header(
        "struct",
        headers=sorted(headers),
        numeric_limits=any(
            "std::numeric_limits" in literal(value, type_) for value, type_ in values if value is not None
        ),
        # Enumerators are derived names: 'DEBUG', 'SIGINT' or 'I' can be macros without the author's
        # knowledge.
        macros=sorted(_LIKELY_MACROS.intersection(c.name for c in constants) | enumerators),
        messages=list(map(_struct, messages, named)),
        services=[service.name.name for service in services],
        has_events=any(service.has_events for service in services),
        actions=[name.name] if is_action else [],
    )
    starts = []
    for message in messages:
        # The C++ type of a message, and that of its first builder step.
        spelled = start = qualified(message.name)
        if message.fields:
            namespace = f"::{message.name.package}::{message.name.kind}::builder"
            start = f"{namespace}::Init_{message.name.name}_{message.fields[0].name}<{spelled}>"
        starts.append((spelled, start))
    yield header(
        "builder",
        headers=[own_struct, "rosidl_runtime_cpp/builder.hpp"],
        steps=[step for message in messages for step in _builder_steps(message)],
        starts=starts,
    )
    runtime = ["rosidl_runtime_cpp/traits.hpp", "rosidl_runtime_cpp/yaml.hpp"]
    yield header(
        "traits",
        headers=[own_struct, *sorted([*(detail_path(other, "traits", "hpp") for other in others), *runtime])],
        messages=[
            (message.name.name, list(_yaml_statements(message, by_field)))
            for message, by_field in zip(messages, named, strict=True)
        ],
        types=list(_type_traits(interface)),
        whole=qualified(name),
        definition=[quoted(line) for line in definition.splitlines(keepends=True)],
    )
    type_handles = handles(interface)
    support = {f"rosidl_typesupport_cpp/{handle.kind}_type_support.hpp" for handle in type_handles}
    yield header(
        "type_support",
        headers=sorted({*support, _visibility_path(name.package), detail_path(name, "traits", "hpp")}),
        handles=type_handles,
    )
    views = [wire.of(message.name) for message in messages]
    nested = {detail_path(other, "cdr", "hpp") for view in views for other in view.needs}
    nested.discard(detail_path(name, "cdr", "hpp"))
    yield header("cdr", headers=sorted({*nested, own_struct}), messages=views)


def _visibility_path(package: str) -> str:
    return f"{package}/msg/rosidl_generator_cpp__visibility_control.hpp"


def _struct(message: Message, enumerated: Mapping[str, Enumeration]) -> SimpleNamespace:
    members = message.members
    blocks = _initializations(members)
    nested = [f"{f.name}(_init)" for f in members if isinstance(f.type, Named)]
    # Elements of arrays construct their own allocators.
    allocated = [f"{f.name}({_ALLOCATED[type(f.type)]})" for f in members if type(f.type) in _ALLOCATED]
    # Each constructor mentions unused parameters once, to avoid compiler warnings.
    used = ["_initialize(_init);"] if blocks else [] if nested else ["(void)_init;"]
    return SimpleNamespace(
        name=message.name.name,
        symbol=f"{message.name.package}__{message.name.kind}__{message.name.name}",
        doc=comment(message.doc),
        constants=[
            (
                "static inline const" if isinstance(constant.type, String) else "static constexpr",
                f"{spell(constant.type)} {constant.name} = {literal(constant.value, constant.type)}",
                comment(constant.doc),
            )
            for constant in message.constants
        ],
        members=[(f.name, spell(f.type), comment(f.doc, f.unit)) for f in members],
        settable=[f.name for f in message.fields],
        initializers=",\n    ".join(nested),
        statements=used,
        allocating_initializers=",\n    ".join(allocated),
        allocating_statements=used if allocated else ["(void)_alloc;", *used],
        blocks=blocks,
        enumerations=[
            SimpleNamespace(
                alias=each.name,
                name=f"{message.name.name}_{each.name}",
                type=spell(each.type),
                members=[(name, literal(value, each.type)) for name, value in each.members],
                distinct=[name for name, _ in each.distinct],
                fields=" and ".join(f"'{field}'" for field, other in enumerated.items() if other == each),
            )
            for each in dict.fromkeys(enumerated.values())
        ],
        comparison=" &&\n           ".join(f"{f.name} == _other.{f.name}" for f in members),
    )


def _initializations(members: Iterable[Field]) -> list[tuple[str, list[str]]]:
    """Return the statements that initialize members, by kind of rosidl_runtime_cpp::MessageInitialization."""
    cleared: list[str] = []
    defaulted: list[str] = []
    zeroed: list[str] = []  # ZERO ignores defaults, including those of array elements
    for field in members:
        match field.type:
            case Primitive():
                clear = [f"{field.name} = {literal(0, field.type)};"]
            case Array(Primitive() as of):
                clear = [f"{field.name}.fill({literal(0, of)});"]
            case _:
                clear = []  # strings and sequences are empty by construction
        if field.default is not None:
            zeroed += clear
        else:
            cleared += clear
            if isinstance(field.type, Array) and isinstance(field.type.of, Named):
                zeroed.append(f"{field.name}.fill(typename _{field.name}_type::value_type(_init));")
        if field.default not in (None, (), ""):
            defaulted.append(f"{field.name} = {literal(field.default, field.type)};")
    blocks = {
        "_init == Initialization::ALL || _init == Initialization::ZERO": cleared,
        "_init == Initialization::ALL || _init == Initialization::DEFAULTS_ONLY": defaulted,
        "_init == Initialization::ZERO": zeroed,
    }
    return [(condition, statements) for condition, statements in blocks.items() if statements]


def _builder_steps(message: Message) -> Iterator[SimpleNamespace]:
    """Yield the classes that set one member each, in reverse order, because each refers to the next one."""
    result, returned = "Message", "std::move(_message)"
    for position, field in reversed(list(enumerate(message.fields))):
        name = f"Init_{message.name.name}_{field.name}"
        yield SimpleNamespace(
            name=name,
            message=qualified(message.name),
            member=field.name,
            first=position == 0,
            result=result,
            returned=returned,
        )
        result, returned = f"{name}<Message>", f"{name}<Message>(std::move(_message))"


def _yaml_statements(message: Message, found: Mapping[str, Enumeration]) -> Iterator[str]:
    for field in message.fields:
        name, many = field.name, "s" if isinstance(field.type, Array | Sequence) else ""
        match element_of(field.type):
            case Named():
                kind = "message"
            case Primitive("octet" | "char"):
                kind = "octet"
            case _:
                kind = "scalar"
        named = ""
        if name in found and not many:
            named = f", to_string({qualified(message.name)}_{found[name].name}{{_message.{name}}})"
        yield f'_out.{kind}{many}("{name}", _message.{name}{named});'


def _type_traits(interface: Interface) -> Iterator[SimpleNamespace]:
    """Yield the specializations of rosidl's traits for all types of an interface, parts before the whole."""
    roles: dict[TypeName, str] = {}
    services = services_of(interface)
    for service in services:
        roles |= {service.request.name: "is_service_request", service.response.name: "is_service_response"}
    if isinstance(interface, Action):
        parts = {"goal": interface.goal, "result": interface.result, "feedback": interface.feedback}
        roles |= {message.name: f"is_action_{part}" for part, message in parts.items()}
    for message in messages_of(interface):
        types = [field.type for field in message.members]
        of = [element_of(type_) for type_ in types]
        strings = [type_ for type_ in of if isinstance(type_, String)]
        sequences = [type_ for type_ in types if isinstance(type_, Sequence)]
        is_bounded = None not in [*(each.bound for each in strings), *(each.bound for each in sequences)]
        nested = {element.name for element in of if isinstance(element, Named)}
        yield SimpleNamespace(
            name=qualified(message.name),
            full_name=message.name,
            fixed=_base("has_fixed_size", nested) if not strings and not sequences else "std::false_type",
            bounded=_base("has_bounded_size", nested) if is_bounded else "std::false_type",
            units=[(field.name, quoted(field.unit)) for field in message.fields if field.unit is not None],
            traits=["is_message", *([roles[message.name]] if message.name in roles else [])],
        )
    for service in services:
        nested = {service.request.name, service.response.name}
        yield SimpleNamespace(
            name=qualified(service.name),
            full_name=service.name,
            fixed=_base("has_fixed_size", nested),
            bounded=_base("has_bounded_size", nested),
            units=[],
            traits=["is_service"],
        )
    if isinstance(interface, Action):
        yield SimpleNamespace(name=qualified(interface.name), full_name=None, units=[], traits=["is_action"])


def _base(trait: str, nested: Iterable[TypeName]) -> str:
    """Return the base class of a trait that holds if it holds for all nested messages."""
    parts = " &&\n    ".join(f"{trait}<{qualified(name)}>::value" for name in sorted(nested))
    return f"std::integral_constant<bool,\n    {parts}>" if parts else "std::true_type"


_WIDTH = 100
_NEVER_COPIED = frozenset({"boolean", "wchar"})
"""Not every byte is a valid bool, and a wchar is serialized with twice its size in memory."""


@frozen
class _Shape:
    """The layout of a message; `size` and `alignment` are 0 unless it is copied in one piece."""

    layout: MessageLayout
    min_size: int
    size: int
    alignment: int


@frozen
class MembersViews:
    """Creates the specializations of forge_cdr::Members for the messages of a catalog."""

    layouts: LayoutBuilder
    _shapes: dict[TypeName, _Shape] = dataclasses.field(default_factory=dict)

    def of(self, name: TypeName) -> SimpleNamespace:
        """Return the specialization for a message, which is valid at any start offset.

        `needs` are the messages whose specializations it uses.
        """
        shape = self._shape(name)
        layout, size = shape.layout, shape.size
        constants = (f"least = {shape.min_size};", f"packed = {size};", f"alignment = {shape.alignment};")
        wholes: dict[Path, TypeName] = {}  # the outermost nested messages that are copied in one piece
        for path, inner in layout.inlined:
            if self._shape(inner).size and _outermost(path, wholes) is None:
                wholes[path] = inner
        needs = set(wholes.values())
        for step in layout.steps:
            match step:
                case MessageCall(_, needed) | Loop(_, Array(Named(needed)) | Sequence(Named(needed))):
                    needs.add(needed)
        return SimpleNamespace(
            type=f"{qualified(name)}_",
            constants=constants if size else constants[:2],
            storage="static" if self.layouts.is_large(name) else "[[gnu::always_inline]] static",
            statements=[line for step in layout.steps for line in self._statements(step, wholes)],
            needs=needs,
        )

    def _shape(self, name: TypeName) -> _Shape:
        if name not in self._shapes:
            layout = self.layouts.of(name, UNKNOWN)
            min_size = layout.min_size + sum(map(self._nested_size, layout.steps))
            self._shapes[name] = _Shape(layout, min_size, *_packed(layout))
        return self._shapes[name]

    def _nested_size(self, step: LayoutStep) -> int:
        """Return the size to add to the minimum size of a step, which counts a MessageCall as one byte.

        The reader limits memory in proportion to the minimum size, so it must be accurate.
        """
        match step:
            case MessageCall(_, name):
                return self._shape(name).min_size - 1
            case Loop(_, Array(_, count), body):
                return count * sum(map(self._nested_size, body.steps))
            case _:
                return 0

    def _statements(self, step: LayoutStep, wholes: Mapping[Path, TypeName]) -> Iterator[str]:
        match step:
            case Run(members):
                # The padding between the members of a statement is known for any offset of the first one.
                group: list[Path] = []
                first = 0
                for path, alignment in self._leaves(members, wholes):
                    if group and alignment > first:
                        yield _call("fixed", *group)
                        group = []
                    first = first if group else alignment
                    group.append(path)
                if group:
                    yield _call("fixed", *group)
            case StringData(path, type_):
                yield _call("text", path, bound=type_.bound)
            case PrimitiveElements(path, Array()):
                yield _call("fixed", path)
            case PrimitiveElements(path):
                yield _call("sequence", path)
            case Loop(path, type_):
                word = "array" if isinstance(type_, Array) else "sequence"
                bound = type_.of.bound if isinstance(type_.of, String) else None
                yield _call(word, path, bound=bound)
            case MessageCall(path):
                yield _call("message", path)

    def _leaves(
        self, members: Iterable[Member], wholes: Mapping[Path, TypeName]
    ) -> Iterator[tuple[Path, int]]:
        """Yield path and alignment of members copied in one piece; lengths belong to their data."""
        visited: set[Path] = set()
        for member in members:
            outermost = _outermost(member.path, wholes)
            if outermost is None and not isinstance(member, Length):
                yield member.path, member.alignment
            elif outermost is not None and outermost not in visited:
                visited.add(outermost)
                yield outermost, self._shape(wholes[outermost]).alignment


def _packed(layout: MessageLayout) -> tuple[int, int]:
    """Return size and alignment of a message whose serialized bytes equal those in memory, else zeros.

    Consecutive messages of this kind have no padding between them if the first one is aligned.
    """
    match layout.steps:
        case (Run(members) as run,) if all(map(_is_copied, members)):
            size = sum(member.size for member in members)
            gaps = any(map(sum, (piece.paddings for piece in run.segments)))
            if len(run.segments) == 1 and not gaps and not size % run.alignment:
                return size, run.alignment
    return 0, 0


def _is_copied(member: Member) -> bool:
    match member:
        case Scalar(_, of) | InlineArray(_, _, of):
            return of.name not in _NEVER_COPIED
        case Length():
            return False


def _outermost(path: Path, wholes: Mapping[Path, TypeName]) -> Path | None:
    """Return the path of the message in `wholes` that contains a member, or None."""
    return next((path[:length] for length in range(1, len(path) + 1) if path[:length] in wholes), None)


def _call(word: str, *paths: Path, bound: int | None = None) -> str:
    arguments = [".".join(("message", *path)) for path in paths]
    if bound is not None:
        arguments.append(f"{bound}u")
    line = f"cdr.{word}({', '.join(arguments)});"
    if len(line) <= _WIDTH - 4:
        return line
    lines = [""]
    for argument in arguments:
        if lines[-1] and len(lines[-1]) + len(argument) > _WIDTH - 9:
            lines.append("")
        lines[-1] += f" {argument}," if lines[-1] else f"{argument},"
    joined = "\n      ".join(lines)
    return f"cdr.{word}(\n      {joined[:-1]});"
