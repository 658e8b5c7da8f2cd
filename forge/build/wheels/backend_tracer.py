"""Run a Python program and log the files that it reads; arguments: FOLDER PROGRAM [ARGUMENT ...].

This module is imported on its own by the workspace's interpreter, which may not have forge. It has minimal
imports and supports Python 3.8. Each line of the log is a JSON array:

- ["written", PATH], ["listed", FOLDER]: a file access
- ["asked", NAME]: an environment variable was looked up
- ["started", PROGRAM]: another program
- ["missing", MODULE, OPTIONAL]: a failed import; optional if an installed package tried it
- ["interpreter", SYS_PATH]: the search path of Python

The log is FOLDER/log. Python programs that this one starts import the sitecustomize.py in FOLDER/children,
which makes them write to the same log.
"""

import atexit
import json
import os
import sys

TYPE_CHECKING = False  # importing typing would dominate the start-up time
if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC
_BATCH_SIZE = 1000
_FINDERS = tuple(
    "{0}{1}".format(os.sep, folder.replace("/", os.sep))
    for folder in ("importlib/metadata/", "importlib_metadata/", "pkg_resources/", "wheels/setup_install.py")
)


def main(argv: "list[str]") -> None:
    """Run the program in `argv` with tracing."""
    folder, program = argv[1], argv[2]
    sys.argv[:] = argv[2:]
    children = os.path.join(folder, "children")
    with open(program, "rb") as stream:
        code = compile(stream.read(), program, "exec")
    # Only for programs started from here: our own sys.path stays as it is.
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (children, os.environ.get("PYTHONPATH"))))
    trace(os.path.join(folder, "log"))
    exec(code, {"__name__": "__main__", "__file__": program})  # noqa: S102  (the purpose of this module)


def trace(log: str) -> None:
    """Log the file accesses of this process and the processes that it forks from now on."""
    tracer = Tracer(log)
    atexit.register(tracer.finish)
    os.register_at_fork(after_in_child=tracer.forked)
    _trace_variables(tracer)
    handler_of = tracer.handlers.get

    def hook(event: str, args: "tuple[object, ...]") -> None:
        handler = handler_of(event)
        if handler is not None:
            try:
                handler(args)
            except (AttributeError, IndexError, OSError, TypeError, ValueError):
                pass  # Invalid arguments: the program itself gets the error.

    sys.addaudithook(hook)


def _trace_variables(tracer: "Tracer") -> None:
    """Log the variables that are looked up by name; who copies the environment asks for none."""
    encode = os.environ.encodekey
    enumerated: "list[str]" = []

    class Environment(type(os.environ)):  # type: ignore[misc]  # the class has no public name
        def __iter__(self) -> "Iterator[str]":
            enumerated[:] = reversed(list(super().__iter__()))
            return iter(enumerated[::-1])

    def asked(name: str) -> str:
        # Whoever copies the environment looks up the names in the order in which they were enumerated.
        if enumerated and name == enumerated[-1]:
            enumerated.pop()
        else:
            tracer.ask(name)
        return encode(name)

    os.environ.__class__ = Environment
    os.environ.encodekey = asked


class Tracer:
    """The handlers of audit events, which write a log."""

    def __init__(self, log: str) -> None:
        """Store the path of the log, and the folders of the standard library, which are not logged."""
        self._log = log
        self._standard = tuple(folder + os.sep for folder in _standard_library())
        self._known: "set[tuple[str, object]]" = {("written", log)}
        self._waiting: "list[str]" = []
        self._batch_size = _BATCH_SIZE
        self._imported: "dict[str, bool]" = {}
        self.handlers: "dict[str, Callable[[tuple[object, ...]], object]]" = {
            "open": self._opened,
            "import": self._importing,
            "os.listdir": self._listed,
            "os.scandir": self._listed,
            "os.rename": lambda args: self._log_path("written", args[1]),
            "os.symlink": lambda args: self._log_path("written", args[1]),
            "os.link": lambda args: self._log_path("written", args[1]),
            "subprocess.Popen": lambda args: self._started(args[0], args[1]),
            "os.posix_spawn": lambda args: self._started(args[0], args[1]),
            "os.exec": self._replaced,
            "os.system": lambda args: self._started("/bin/sh", ()),
        }

    def finish(self) -> None:
        """Write missing modules and the interpreter, and flush the log."""
        for name, optional in self._imported.items():
            if name not in sys.modules:
                self._log_event("missing", name, optional)
        self._log_event("interpreter", [entry for entry in sys.path if isinstance(entry, str)])
        self._flush()

    def forked(self) -> None:
        """Discard buffered lines and write unbuffered: a forked process may exit without atexit handlers."""
        self._waiting.clear()
        self._batch_size = 0

    def _opened(self, args: "tuple[object, ...]") -> None:
        path, _, flags = args
        if isinstance(flags, int) and flags & _WRITING:
            self._log_path("written", path)

    def ask(self, name: str) -> None:
        """Log the name of a variable."""
        if ("asked", name) not in self._known:
            self._known.add(("asked", name))
            self._log_event("asked", str(name))

    def _importing(self, args: "tuple[object, ...]") -> None:
        """Record that code outside the standard library imports a module."""
        if args[1] is not None:
            return
        caller = sys._getframe(2).f_code.co_filename
        if not caller.startswith("<frozen") and not self._is_standard(caller):
            name = str(args[0]).partition(".")[0]
            self._imported[name] = _is_installed(caller) and self._imported.get(name, True)

    def _listed(self, args: "tuple[object, ...]") -> None:
        """Log a listed folder, unless Python searched it for modules or distributions."""
        caller = sys._getframe(2).f_code.co_filename
        if not caller.startswith("<frozen importlib") and not any(part in caller for part in _FINDERS):
            self._log_path("listed", "." if args[0] is None else args[0])

    def _replaced(self, args: "tuple[object, ...]") -> None:
        self._started(args[0], args[1])
        self.finish()

    def _started(self, program: object, words: object) -> None:
        first = words[0] if isinstance(words, (list, tuple)) and words else words
        self._log_event("started", _text(program or first))

    def _log_path(self, word: str, path: object) -> None:
        # Most events are repeated or concern the standard library.
        if path is None or isinstance(path, int) or (word, path) in self._known:
            return
        text = self._absolute(path)
        if (word, text) not in self._known and not self._is_standard(text):
            self._known.add((word, text))
            self._log_event(word, text)

    def _is_standard(self, path: str) -> bool:
        return path.startswith(self._standard) and not _is_installed(path)

    @staticmethod
    def _absolute(path: object) -> str:
        text = _text(path)
        return text if text.startswith(os.sep) else os.path.join(os.getcwd(), text)

    def _log_event(self, *words: object) -> None:
        self._waiting.append(json.dumps(words) + "\n")
        if len(self._waiting) >= self._batch_size:
            self._flush()

    def _flush(self) -> None:
        batch = []
        while self._waiting:  # a pop at a time, since other threads add lines meanwhile
            batch.append(self._waiting.pop())
        # Open the log each time: programs close descriptors that they do not know.
        descriptor = os.open(self._log, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
        try:
            os.write(descriptor, "".join(batch).encode("ascii"))
        finally:
            os.close(descriptor)


def _is_installed(path: str) -> bool:
    return "-packages" + os.sep in path


def _text(path: object) -> str:
    return os.fsdecode(path) if isinstance(path, (bytes, os.PathLike)) else str(path)


def _standard_library() -> "set[str]":
    version = "python{0}.{1}".format(*sys.version_info)
    folders = [os.path.dirname(os.__file__)]
    for prefix in (sys.base_prefix, sys.base_exec_prefix):
        folders += [os.path.join(prefix, name, version) for name in ("lib", "lib64")]
    return {*folders, *map(os.path.realpath, folders)}
