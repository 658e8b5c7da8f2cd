"""Run a Python program and log which files it reads; its words are FOLDER PROGRAM [ARGUMENT ...].

This module is imported alone, by the workspace's interpreter, which has no forge: it imports what costs
least, and needs no more than Python 3.8. Each line of the log is a JSON array, a word and what it is about:

- ["read", PATH], ["written", PATH], ["made", FOLDER], ["listed", FOLDER]: what was opened, and what for
- ["started", FOLDER, PROGRAM, WORDS]: another program, with its working directory and its command line
- ["missing", MODULE, OPTIONAL]: an import that failed; optional if an installed package tried it
- ["interpreter", SYS_PATH, PROGRAMS]: the Python that ran

The log is FOLDER/log. Python programs that this one starts find the sitecustomize.py in FOLDER/children,
which lets them write to the same log.
"""

import atexit
import json
import os
import sys

TYPE_CHECKING = False  # without the import of typing, which takes longer than all else
if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType

_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC
_AT_ONCE = 1000
_INFO = "-info" + os.sep
_PLUGINS = os.sep + "entry_points.txt"
_FINDERS = tuple(
    "{0}{1}".format(os.sep, folder.replace("/", os.sep))
    for folder in ("importlib/metadata/", "importlib_metadata/", "pkg_resources/")
)


def main(argv: "list[str]") -> None:
    """Run the program that the words name as if nobody watched it."""
    folder, program = argv[1], argv[2]
    sys.argv[:] = argv[2:]
    children = os.path.join(folder, "children")
    with open(program, "rb") as stream:
        code = compile(stream.read(), program, "exec")
    # Only for programs started from here: our own sys.path stays as it is.
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (children, os.environ.get("PYTHONPATH"))))
    trace(os.path.join(folder, "log"))
    exec(code, {"__name__": "__main__", "__file__": program})  # noqa: S102  (it is what was asked for)


def trace(log: str) -> None:
    """Log what this process reads from now on, and the processes that it forks."""
    tracer = Tracer(log)
    atexit.register(tracer.finish)
    os.register_at_fork(after_in_child=tracer.forked)
    handler_of = tracer.handlers.get

    def hook(event: str, args: "tuple[object, ...]") -> None:
        handler = handler_of(event)
        if handler is not None:
            try:
                handler(args)
            except (AttributeError, IndexError, OSError, TypeError, ValueError):
                pass  # Whatever odd argument this was: the program itself is told of it.

    sys.addaudithook(hook)


class Tracer:
    """The handlers of audit events, which write a log."""

    def __init__(self, log: str) -> None:
        """Remember the log, and where the standard library is, which is not worth logging."""
        self._log = log
        self._standard = tuple(folder + os.sep for folder in _standard_library())
        self._known: "set[tuple[str, object]]" = {("written", log)}
        self._waiting: "list[str]" = []
        self._at_once = _AT_ONCE
        self._imported: "dict[str, bool]" = {}
        self.handlers: "dict[str, Callable[[tuple[object, ...]], object]]" = {
            "open": self._opened,
            "import": self._importing,
            "os.listdir": self._listed,
            "os.scandir": self._listed,
            "os.mkdir": lambda args: self._note("made", args[0]),
            "os.rename": lambda args: self._note("written", args[1]),
            "os.symlink": lambda args: self._note("written", args[1]),
            "os.link": self._hard_linked,
            "ctypes.dlopen": lambda args: self._note("read", args[0]) if "/" in str(args[0]) else None,
            "subprocess.Popen": lambda args: self._started(args[0], args[1], args[2]),
            "os.posix_spawn": lambda args: self._started(args[0], args[1]),
            "os.exec": self._replaced,
            "os.system": lambda args: self._started("/bin/sh", ["sh", "-c", args[0]]),
        }

    def finish(self) -> None:
        """Write what is left to be said."""
        for name, optional in self._imported.items():
            if name not in sys.modules:
                self._say("missing", name, optional)
        programs = [sys.executable, os.path.realpath(sys.executable)]
        self._say("interpreter", [entry for entry in sys.path if isinstance(entry, str)], programs)
        self._flush()

    def forked(self) -> None:
        """Begin with nothing to write, and write at once: a forked process may end without ceremony."""
        self._waiting.clear()
        self._at_once = 0

    def _opened(self, args: "tuple[object, ...]") -> None:
        path, _, flags = args
        if isinstance(flags, int) and flags & _WRITING:
            self._note("written", path)
        elif not (isinstance(path, str) and _INFO in path and self._is_scan(path)):
            self._note("read", path)

    def _importing(self, args: "tuple[object, ...]") -> None:
        """Note an extension module, or that a module is looked for by what is not Python itself."""
        if args[1] is not None:
            self._note("read", args[1])
            return
        asking = sys._getframe(2).f_code.co_filename
        if not asking.startswith("<frozen") and not self._is_standard(asking):
            name = str(args[0]).partition(".")[0]
            self._imported[name] = _is_installed(asking) and self._imported.get(name, True)

    def _listed(self, args: "tuple[object, ...]") -> None:
        """Note a folder that was listed, unless Python looked there for modules or distributions."""
        asking = sys._getframe(2).f_code.co_filename
        if not asking.startswith("<frozen importlib") and not any(part in asking for part in _FINDERS):
            self._note("listed", "." if args[0] is None else args[0])

    def _is_scan(self, path: str) -> bool:
        """Tell if what describes a distribution is read by an installed program, which looks for plugins.

        What it finds it imports. A package's own code asks for versions, say, which count.
        """
        if path.endswith(_PLUGINS):
            return True
        frame: "FrameType | None" = sys._getframe(3)
        while frame is not None:
            asking = frame.f_code.co_filename
            if asking.startswith("<frozen importlib._bootstrap"):
                return True
            # What setup.py itself does has no file name: setuptools runs its text.
            between = asking.startswith("<frozen") or self._is_standard(asking)
            if not between and not any(part in asking for part in _FINDERS):
                return _is_installed(asking)
            frame = frame.f_back
        return False

    def _hard_linked(self, args: "tuple[object, ...]") -> None:
        self._note("read", args[0])
        self._note("written", args[1])

    def _replaced(self, args: "tuple[object, ...]") -> None:
        self._started(args[0], args[1])
        self.finish()

    def _started(self, program: object, words: object, folder: object = None) -> None:
        listed = list(words) if isinstance(words, (list, tuple)) else [words]
        texts = [os.fsdecode(word) for word in listed if isinstance(word, (str, bytes, os.PathLike))]
        name = _text(program) if program else texts[0]
        self._say("started", self._absolute(folder or os.curdir), name, texts)

    def _note(self, word: str, path: object) -> None:
        # Most events repeat an earlier one or are about the standard library.
        if path is None or isinstance(path, int) or (word, path) in self._known:
            return
        text = self._absolute(path)
        if (word, text) not in self._known and not self._is_standard(text):
            self._known.add((word, text))
            self._say(word, text)

    def _is_standard(self, path: str) -> bool:
        return path.startswith(self._standard) and not _is_installed(path)

    @staticmethod
    def _absolute(path: object) -> str:
        text = _text(path)
        return text if text.startswith(os.sep) else os.path.join(os.getcwd(), text)

    def _say(self, *words: object) -> None:
        self._waiting.append(json.dumps(words) + "\n")
        if len(self._waiting) >= self._at_once:
            self._flush()

    def _flush(self) -> None:
        batch = []
        while self._waiting:  # a pop at a time, since other threads add lines meanwhile
            batch.append(self._waiting.pop())
        # Not a descriptor that is kept: programs close those that they do not know.
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
    """Return the folders of the standard library, by every name that its files may have."""
    version = "python{0}.{1}".format(*sys.version_info)
    folders = [os.path.dirname(os.__file__)]
    for prefix in (sys.base_prefix, sys.base_exec_prefix):
        folders += [os.path.join(prefix, name, version) for name in ("lib", "lib64")]
    return {*folders, *map(os.path.realpath, folders)}
