"""Parse .idl files into the syntax trees that rosidl_parser makes of them, forty times as fast.

rosidl_parser reads a file in two steps: an Earley parser makes a syntax tree, and the second step makes
Structure, Member, Annotation and so on of it. Only the first is slow, so only that one is replaced: forge's
grammar parses the file by LALR(1), and the tree is rebuilt in the shapes that the second step looks at. It
takes the names and the relative depth of all nodes from the grammar of rosidl_parser, and leaves out nodes
with one child, such as those between a sum and its only operand.

Runs in the workspace's interpreter with its lark.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lark import Lark, Token, Tree
from lark.exceptions import LarkError

_BASIC = {
    "float": ("floating_pt_type", "floating_pt_type_float"),
    "double": ("floating_pt_type", "floating_pt_type_double"),
    "long double": ("floating_pt_type", "floating_pt_type_long_double"),
    "char": ("char_type",),
    "wchar": ("wide_char_type",),
    "boolean": ("boolean_type",),
    "octet": ("octet_type",),
    "int8": ("integer_type", "signed_int", "signed_tiny_int"),
    "uint8": ("integer_type", "unsigned_int", "unsigned_tiny_int"),
    "short": ("integer_type", "signed_int", "signed_short_int"),
    "long": ("integer_type", "signed_int", "signed_long_int"),
    "long long": ("integer_type", "signed_int", "signed_longlong_int"),
    "unsigned short": ("integer_type", "unsigned_int", "unsigned_short_int"),
    "unsigned long": ("integer_type", "unsigned_int", "unsigned_long_int"),
    "unsigned long long": ("integer_type", "unsigned_int", "unsigned_longlong_int"),
}
_BASIC |= {
    "int16": _BASIC["short"],
    "int32": _BASIC["long"],
    "int64": _BASIC["long long"],
    "uint16": _BASIC["unsigned short"],
    "uint32": _BASIC["unsigned long"],
    "uint64": _BASIC["unsigned long long"],
}
"""The nodes of a basic type below base_type_spec or const_type, by its words."""

_INTEGER = re.compile(r"\d|[1-9]\d+")
_FIXED = re.compile(r"(\d+\.\d*|\.\d+|\d+)[dD]")
_FLOAT = re.compile(r"\d+[eE][+-]?\d+|(?:\d+\.\d*|\.\d+)(?:[eE][+-]?\d+)?")


class UnsupportedIdlError(Exception):
    """A file has a construct that is left to rosidl_parser."""


class IdlTrees:
    """Makes syntax trees by forge's grammar."""

    errors = (UnsupportedIdlError, LarkError)
    """What parse() raises for files that are left to rosidl_parser."""

    def __init__(self, grammar: Path) -> None:
        self._lark = Lark(grammar.read_text(encoding="utf-8"), parser="lalr", maybe_placeholders=False)

    def parse(self, text: str) -> Tree[Any]:
        """Return the tree of a file; raises one of `errors`."""
        if text.startswith("\ufeff"):
            raise UnsupportedIdlError("byte order mark")
        definitions = [_definition(child) for child in self._lark.parse(text).children]
        return Tree("specification", definitions)


def _definition(tree: Any) -> Tree[Any]:
    if tree.data == "include":
        quoted = str(tree.children[0])
        kind = "h_char_sequence" if quoted.startswith("<") else "q_char_sequence"
        return _chain("definition", "include_directive", kind, Token("NAME", quoted[1:-1]))
    *annotations, content = tree.children
    convert = _DEFINITIONS.get(content.data)
    if convert is None:
        raise UnsupportedIdlError(content.data)
    return Tree("definition", [convert(content, [_annotation(child) for child in annotations])])


def _module(tree: Tree[Any], annotations: list[Tree[Any]]) -> Tree[Any]:
    name, *definitions = tree.children
    if not definitions:
        raise UnsupportedIdlError("empty module")
    return Tree("module_dcl", [*annotations, _identifier(name), *map(_definition, definitions)])


def _struct(tree: Tree[Any], annotations: list[Tree[Any]]) -> Tree[Any]:
    name, *members = tree.children
    struct = Tree("struct_def", [*annotations, _identifier(name), *map(_member, members)])
    return _chain("type_dcl", "constr_type_dcl", "struct_dcl", struct)


def _forward(tree: Tree[Any], annotations: list[Tree[Any]]) -> Tree[Any]:
    _refuse(annotations)
    name = _identifier(tree.children[0])
    return _chain("type_dcl", "constr_type_dcl", "struct_dcl", "struct_forward_dcl", name)


def _enumeration(tree: Tree[Any], annotations: list[Tree[Any]]) -> Tree[Any]:
    name, *enumerators = tree.children
    trees = []
    for enumerator in enumerators:
        *inner, word = enumerator.children
        trees.append(Tree("enumerator", [*map(_annotation, inner), _identifier(word)]))
    enum = Tree("enum_dcl", [*annotations, _identifier(name), *trees])
    return _chain("type_dcl", "constr_type_dcl", enum)


def _typedef(tree: Tree[Any], annotations: list[Tree[Any]]) -> Tree[Any]:
    _refuse(annotations)
    type_, declarator = tree.children
    declared = _chain("any_declarators", "any_declarator", _declared(declarator))
    return _chain("type_dcl", "typedef_dcl", Tree("type_declarator", [_type(type_), declared]))


def _constant(tree: Tree[Any], annotations: list[Tree[Any]]) -> Tree[Any]:
    type_, name, value = tree.children
    if type_.data == "basic":
        kind = _chain(*_BASIC[_words(type_)])
    elif type_.data == "text":
        kind = _string(type_)
    else:
        raise UnsupportedIdlError("type of a constant")
    return Tree(
        "const_dcl", [*annotations, Tree("const_type", [kind]), _identifier(name), _expression(value)]
    )


_DEFINITIONS: dict[str, Callable[[Tree[Any], list[Tree[Any]]], Tree[Any]]] = {
    "module": _module,
    "struct": _struct,
    "forward": _forward,
    "enumeration": _enumeration,
    "typedef": _typedef,
    "constant": _constant,
}


def _member(tree: Tree[Any]) -> Tree[Any]:
    count = sum(child.data == "annotation" for child in tree.children)
    annotations, (type_, *declarators) = tree.children[:count], tree.children[count:]
    declared = [Tree("declarator", [_declared(declarator)]) for declarator in declarators]
    parts = [*map(_annotation, annotations), Tree("type_spec", [_type(type_)])]
    return Tree("member", [*parts, Tree("declarators", declared)])


def _declared(tree: Tree[Any]) -> Tree[Any]:
    name, *sizes = tree.children
    if not sizes:
        return Tree("simple_declarator", [_identifier(name)])
    fixed = [_chain("fixed_array_size", _positive(size.children[0])) for size in sizes]
    return Tree("array_declarator", [_identifier(name), *fixed])


def _type(tree: Tree[Any]) -> Tree[Any]:
    """Return simple_type_spec or template_type_spec."""
    match tree.data:
        case "basic":
            return _chain("simple_type_spec", "base_type_spec", *_BASIC[_words(tree)])
        case "named":
            return _chain("simple_type_spec", _scoped_name(tree.children[0]))
        case "text":
            return _chain("template_type_spec", _string(tree))
        case "sequence":
            element, *bound = tree.children
            parts = [Tree("type_spec", [_type(element)]), *map(_positive, bound)]
            return _chain("template_type_spec", Tree("sequence_type", parts))
        case other:
            raise UnsupportedIdlError(other)


def _string(tree: Tree[Any]) -> Tree[Any]:
    word, *bound = tree.children
    kind = "wide_string_type" if word == "wstring" else "string_type"
    return Tree(kind, [_positive(size) for size in bound])


def _scoped_name(tree: Tree[Any]) -> Tree[Any]:
    first, *others = tree.children
    parts: list[Any] = [_identifier(first)]
    for name in others:
        parts += [Tree("scoped_name_separator", []), _identifier(name)]
    return Tree("scoped_name", parts)


def _annotation(tree: Tree[Any]) -> Tree[Any]:
    name, *values = tree.children
    scoped = Tree("scoped_name", [_identifier(name)])
    if not values:
        return Tree("annotation_appl", [scoped])
    parameters = []
    for value in values:
        if value.data == "parameter":
            word, expression = value.children
            parameters.append(Tree("annotation_appl_param", [_identifier(word), _expression(expression)]))
        else:
            parameters.append(_expression(value))
    return Tree("annotation_appl", [scoped, Tree("annotation_appl_params", parameters)])


def _positive(tree: Tree[Any]) -> Tree[Any]:
    return _chain("positive_int_const", _expression(tree))


def _expression(tree: Tree[Any]) -> Tree[Any]:
    """Return const_expr with the primary expression and its sign."""
    if tree.data != "signed":
        return _chain("const_expr", "unary_expr", _primary(tree))
    sign, operand = tree.children
    if sign != "-":
        raise UnsupportedIdlError(f"sign {sign}")
    minus = _chain("unary_operator", "unary_operator_minus")
    return _chain("const_expr", Tree("unary_expr", [minus, _primary(operand)]))


def _primary(tree: Tree[Any]) -> Tree[Any]:
    match tree.data:
        case "identifier":
            name = _scoped_name(tree.children[0])
            if len(name.children) > 1:
                raise UnsupportedIdlError("scoped name as a value")
            return _chain("primary_expr", name)
        case "truth":
            word = "true" if tree.children[0] == "TRUE" else "false"
            return _chain("primary_expr", "literal", "boolean_literal", f"boolean_literal_{word}")
        case "number":
            return _chain("primary_expr", "literal", _number(str(tree.children[0])))
        case "texts":
            return _chain("primary_expr", "literal", _texts([str(text) for text in tree.children]))
        case other:
            raise UnsupportedIdlError(other)


def _number(text: str) -> Tree[Any]:
    if _INTEGER.fullmatch(text):
        return _chain("integer_literal", Tree("decimal_literal", [Token("DIGIT", text)]))
    if _FLOAT.fullmatch(text):
        return _chain("floating_pt_literal", Token("FLOAT", text))
    if fixed := _FIXED.fullmatch(text):
        return _chain("fixed_pt_literal", Token("DECIMAL", fixed[1]))
    raise UnsupportedIdlError(f"number {text}")


def _texts(texts: list[str]) -> Tree[Any]:
    wide = texts[0].startswith("L")
    kind, token = ("wide_string", "ESCAPED_WIDE_STRING") if wide else ("string", "ESCAPED_STRING")
    if any(text.startswith("L") != wide for text in texts):
        raise UnsupportedIdlError("strings of two kinds")
    return Tree(f"{kind}_literals", [Tree(f"{kind}_literal", [Token(token, text)]) for text in texts])


def _words(tree: Tree[Any]) -> str:
    return " ".join(map(str, tree.children))


def _identifier(token: object) -> Token:
    return Token("IDENTIFIER", str(token))


def _chain(*parts: Any) -> Tree[Any]:
    """Return nodes within each other; the last part may be a node or a token."""
    *names, last = parts
    node = Tree(last, []) if isinstance(last, str) and not isinstance(last, Token) else last
    for name in reversed(names):
        node = Tree(name, [node])
    return node


def _refuse(annotations: list[Tree[Any]]) -> None:
    if annotations:
        raise UnsupportedIdlError("annotation")
