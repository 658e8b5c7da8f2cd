"""Compile EmPy templates to Python code objects, from the tokens that EmPy itself finds in them.

EmPy interprets a template token by token and compiles each expression again whenever it is reached. Here a
template becomes one code object, which is executed with the same two dictionaries as EmPy's expressions, so
that names behave the same. Templates with rare markups, and those of interpreters with hooks or another
prefix, are left to EmPy.

Runs in the workspace's interpreter with its EmPy, version 3 or 4.
"""

from __future__ import annotations

import ast
import builtins
import hashlib
import importlib.util
import marshal
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

_WRITE = "__forge_write__"
_SERIALIZE = "__forge_serialize__"
"""The builtins that compiled templates call to write a text, or a value unless it is None."""

_PSEUDOMODULE = "empy"
"""The name by which templates reach their interpreter and could change where output goes."""

_FORMAT = 1
"""Increase this whenever compiled templates change."""


class UncompilableError(Exception):
    """A template has a markup that is left to EmPy."""


class CompiledTemplates:
    """The compiled templates of one version of EmPy, in memory and in the files of a folder."""

    def __init__(self, em: ModuleType, folder: Path | None) -> None:
        """Store EmPy's module and the folder, which is created when it is needed; None keeps no files."""
        self._em = em
        self._folder = folder
        self._codes: dict[str, CodeType | None] = {}

    def code(self, text: str) -> CodeType | None:
        """Return the code of a template; None leaves it to EmPy."""
        if text not in self._codes:
            self._codes[text] = self._stored(text)
        return self._codes[text]

    def _stored(self, text: str) -> CodeType | None:
        identity = f"{_FORMAT} {self._em.__version__} {importlib.util.MAGIC_NUMBER.hex()}\n{text}"
        digest = hashlib.sha256(identity.encode("utf-8", "surrogatepass")).digest()
        path = self._folder / f"{digest.hex()}.empy" if self._folder else None
        if path:
            with suppress(OSError, EOFError, ValueError, TypeError):
                data = path.read_bytes()
                if data[:32] == hashlib.sha256(digest + data[32:]).digest():
                    code: CodeType | None = marshal.loads(data[32:])  # noqa: S302  (a private folder)
                    return code
        try:
            code = compile_template(self._em, text)
        except UncompilableError:
            code = None
        if path:
            data = marshal.dumps(code)
            with suppress(OSError):
                _write(path, hashlib.sha256(digest + data).digest() + data)
        return code


def install(em: ModuleType, templates: CompiledTemplates) -> None:
    """Let EmPy's interpreters run compiled templates if these behave the same."""
    interpreted = em.Interpreter.string

    def string_3(self: Any, data: str, name: str = "<string>", locals: Any = None) -> None:
        code = templates.code(data) if locals is not None and _is_plain(self, self) else None
        if code is None:
            interpreted(self, data, name, locals)
            return
        context = em.Context(name)
        self.contexts.push(context)
        context.bump()
        _execute(self, code, locals)
        self.contexts.pop()

    def string_4(self: Any, string: str, locals: Any = None, dispatcher: Any = None) -> None:
        is_plain = _is_plain(self, self.config) and self.config.noneSymbol is None and self.enabled
        code = templates.code(string) if locals is not None and is_plain else None
        if code is None:
            interpreted(self, string, locals, dispatcher)
        else:
            _execute(self, code, locals)

    em.Interpreter.string = string_3 if _is_version_3(em) else string_4


def _is_version_3(em: ModuleType) -> bool:
    return hasattr(em, "RAW_OPT")


def _is_plain(interpreter: Any, config: Any) -> bool:
    """Return whether an interpreter has no hooks, EmPy's own prefix, and one unfiltered output.

    EmPy 4 has a separate object for the configuration.
    """
    pseudomodule = config.pseudo if config is interpreter else config.pseudomoduleName
    is_usual = config.prefix == "@" and pseudomodule == _PSEUDOMODULE
    return is_usual and not interpreter.hooks and len(interpreter.streams) == 1


def _execute(interpreter: Any, code: CodeType, locals_: dict[str, Any]) -> None:
    """Run a compiled template; text that it prints is also output."""
    write: Callable[[str], object] = interpreter.write
    before = getattr(builtins, _WRITE, None), getattr(builtins, _SERIALIZE, None)

    def serialize(value: object) -> None:
        if value is not None:
            write(str(value))

    setattr(builtins, _WRITE, write)
    setattr(builtins, _SERIALIZE, serialize)
    interpreter.push()
    try:
        exec(code, interpreter.globals, locals_)  # noqa: S102  (the purpose of templates)
    finally:
        interpreter.pop()
        setattr(builtins, _WRITE, before[0])
        setattr(builtins, _SERIALIZE, before[1])


def compile_template(em: ModuleType, text: str) -> CodeType:
    """Return the code object of a template; raises UncompilableError for markups that are left to EmPy."""
    try:
        tokens = _tokens(em, text)
        module = ast.Module(list(_Compiler(em).block(tokens)), [])
        _check_names(module)
        return compile(ast.fix_missing_locations(module), "<template>", "exec")
    except UncompilableError:
        raise
    except Exception as error:  # (EmPy reports its own errors when it runs the template)
        raise UncompilableError(str(error)) from error


def _tokens(em: ModuleType, text: str) -> list[Any]:
    """Return the tokens that EmPy finds, without running them."""
    tokens: list[Any] = []

    class Recorder(em.Interpreter):  # type: ignore[misc, name-defined]
        def parse(self, scanner: Any, locals: object = None) -> bool:
            while (token := scanner.one()) is not None:
                tokens.append(token)
                if not version_3:
                    scanner.accumulate()
            return True

        def shutdown(self) -> None:
            """Do not change the output."""

    version_3 = _is_version_3(em)
    recorder = Recorder.__new__(Recorder)  # without an output, because it would replace sys.stdout
    if version_3:
        recorder.prefix = "@"
        scanner = em.Scanner("@", text)
    else:
        recorder.config = em.Configuration()
        recorder.dispatcher = None
        context = recorder.newContext("<string>")
        scanner = em.Scanner(
            recorder.config, context, em.Stack([recorder.config.renderContext(context)]), text
        )
    recorder.safe(scanner, True)
    return tokens


class _Compiler:
    """Converts tokens to statements."""

    def __init__(self, em: ModuleType) -> None:
        self._em = em
        self._version_3 = _is_version_3(em)

    def block(self, tokens: list[Any]) -> Iterator[ast.stmt]:
        for token in tokens:
            yield from self._convert(token)

    def _convert(self, token: Any) -> list[ast.stmt]:
        match type(token).__name__:
            case "NullToken" | "TextToken":
                return _call(_WRITE, ast.Constant(token.data))
            case "LiteralToken":
                return _call(_WRITE, ast.Constant(token.first))
            case "PrefixToken":
                return _call(_WRITE, ast.Constant("@"))
            case "EscapeToken" if self._version_3:
                return _call(_WRITE, ast.Constant(token.code))
            case "WhitespaceToken" | "CommentToken" | "LineCommentToken" | "InlineCommentToken":
                return []
            case "ExpressionToken":
                return self._expression(token)
            case "SimpleExpressionToken" if not getattr(token, "subtokens", None):
                return _call(_SERIALIZE, self._evaluated(token.code))
            case "StatementToken":
                return self._statements(token.code)
            case "ControlToken":
                return self._control(token)
            case name:
                raise UncompilableError(name)

    def _expression(self, token: Any) -> list[ast.stmt]:
        if self._version_3:
            rarer = token.thenCode or token.elseCode or token.exceptCode
            code = token.testCode
        else:
            (code, then), *others = token.ifThenCodes
            rarer = then is not None or others or token.exceptCode
        if rarer:
            raise UncompilableError("conditional expression")
        return _call(_SERIALIZE, self._evaluated(code))

    def _evaluated(self, code: str) -> ast.expr:
        """Return an expression as EmPy evaluates it."""
        if self._version_3:
            if code in {"1", "True"}:
                return ast.Constant(value=True)
            if code in {"0", "False"}:
                return ast.Constant(value=False)
        else:
            code = code.replace("\n", " ")
        return ast.parse(code.lstrip(" \t"), mode="eval").body

    def _statements(self, code: str) -> list[ast.stmt]:
        code = code.replace("\r", "")
        statements = ast.parse(code if "\n" in code else code.strip()).body
        first = statements[:1]
        if first and isinstance(first[0], ast.Expr) and isinstance(first[0].value, ast.Constant):
            raise UncompilableError("docstring")  # it would be assigned to __doc__
        # Compile it separately, as EmPy does: 'continue' is invalid here, even within a loop of the template.
        compile(ast.Module(statements, []), "<statements>", "exec")
        return statements

    def _control(self, token: Any) -> list[ast.stmt]:
        match token.type:
            case "if":
                return self._if(token)
            case "for":
                return self._for(token)
            case "while":
                return self._while(token)
            case "continue":
                return [ast.Continue()]
            case "break":
                return [ast.Break()]
            case other:
                raise UncompilableError(other)

    def _chains(self, token: Any, *allowed: str) -> list[tuple[Any, list[ast.stmt]]]:
        """Return the control tokens of a construct, each with the statements that follow it."""
        chains = token.build(list(allowed))
        if not self._version_3:
            chains = [(chain.head, chain.tail) for chain in chains]
        return [(head, list(self.block(tail)) or [ast.Pass()]) for head, tail in chains]

    def _if(self, token: Any) -> list[ast.stmt]:
        chains = self._chains(token, "elif", "else")
        rest: list[ast.stmt] = []
        if chains[-1][0].type == "else":
            rest = chains.pop()[1]
        for head, body in reversed(chains):
            if head.type == "else":
                raise UncompilableError("two else")
            rest = [ast.If(self._evaluated(head.rest), body, rest)]
        return rest

    def _for(self, token: Any) -> list[ast.stmt]:
        (head, body), *others = self._chains(token, "else")
        parts = self._em.ControlToken.IN_RE.split(head.rest, 1)
        if len(parts) != 2 or len(others) > 1:
            raise UncompilableError("for")
        loop = ast.parse(f"for {parts[0].strip()} in (): pass").body[0]
        if not isinstance(loop, ast.For) or not _are_names(loop.target):
            raise UncompilableError("for")
        orelse = others[0][1] if others else []
        return [ast.For(loop.target, self._evaluated(parts[1]), body, orelse)]

    def _while(self, token: Any) -> list[ast.stmt]:
        (head, body), *others = self._chains(token, "else")
        if others:
            raise UncompilableError("while with else")  # which EmPy 3 interprets differently from Python
        return [ast.While(self._evaluated(head.rest), body, [])]


def _check_names(module: ast.Module) -> None:
    """Raise UncompilableError for statements that would affect other parts of the template."""
    for node in ast.walk(module):
        match node:
            case ast.Global() | ast.Nonlocal() | ast.AnnAssign():
                raise UncompilableError("scope")
            case ast.ImportFrom(module="__future__"):
                raise UncompilableError("future")
            case ast.Name(id=name) if name == _PSEUDOMODULE:
                raise UncompilableError(name)
            case _:
                pass


def _are_names(target: ast.expr) -> bool:
    if isinstance(target, ast.Tuple):
        return all(map(_are_names, target.elts))
    return isinstance(target, ast.Name)


def _call(function: str, argument: ast.expr) -> list[ast.stmt]:
    call = ast.Call(ast.Name(function, ast.Load()), [argument], [])
    return [ast.Expr(call)]


def _write(path: Path, data: bytes) -> None:
    """Write a file atomically: readers see the complete file or none."""
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    descriptor, name = tempfile.mkstemp(dir=path.parent)
    with os.fdopen(descriptor, "wb") as stream:
        stream.write(data)
    Path(name).replace(path)
