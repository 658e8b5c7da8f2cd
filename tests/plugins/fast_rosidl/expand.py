"""Expand templates with one EmPy, as it is and with compiled templates: `python expand.py EM.PY`.

Reads a JSON list of templates from stdin; prints a list of pairs of results, and how many were compiled. A
result is the output and the names that the template has set, or the type of the error.
"""

import importlib.util
import io
import json
import sys
from typing import Any

from forge.plugins.fast_rosidl.empy import CompiledTemplates, install

VALUES: dict[str, Any] = {
    "one": 1,
    "none": None,
    "text": "te@xt",
    "items": [1, 2, 3],
    "pairs": [("a", 1), ("b", 2)],
    "table": {"key": "value"},
    "empty": "",
}


def load(path: str) -> Any:
    """Import EmPy once more, under a name of its own."""
    spec = importlib.util.spec_from_file_location("em", path)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules["em"] = module
    sys.stdout = sys.__stdout__
    spec.loader.exec_module(module)
    return module


def interpreter(em: Any, output: io.StringIO) -> Any:
    """Make an interpreter as rosidl does."""
    if hasattr(em, "RAW_OPT"):
        return em.Interpreter(output=output, options={em.BUFFERED_OPT: True, em.RAW_OPT: True})
    config = em.Configuration(
        defaultRoot="a.em", defaultStdout=output, deleteOnError=True, rawErrors=True, useProxy=True
    )
    return em.Interpreter(config=config, dispatcher=False)


def expanded(em: Any, template: str) -> object:
    output = io.StringIO()
    running = interpreter(em, output)
    values = {**VALUES, "items": list(VALUES["items"]), "TEMPLATE": None}

    def expand(inner: str, **more: object) -> None:
        if hasattr(em, "RAW_OPT"):
            running.string(inner, "inner", more)
        else:
            running.string(inner, locals=more)

    values["TEMPLATE"] = expand
    try:
        if hasattr(em, "RAW_OPT"):
            running.string(template, "a.em", locals=values)
        else:
            running.string(template, locals=values)
    except Exception as error:
        return type(error).__name__
    finally:
        result = output.getvalue()
        running.shutdown()
    names = {name: repr(value) for name, value in values.items() if not callable(value)}
    return [result, names, sorted(running.globals.keys() - {"__builtins__"})]


def main(path: str) -> None:
    """Expand the templates of stdin."""
    templates = json.load(sys.stdin)
    plain = load(path)
    expected = [expanded(plain, template) for template in templates]
    patched = load(path)
    compiled = CompiledTemplates(patched, None)
    install(patched, compiled)
    actual = [expanded(patched, template) for template in templates]
    count = sum(compiled.code(template) is not None for template in templates)
    assert sys.__stdout__
    json.dump({"pairs": list(zip(expected, actual, strict=True)), "compiled": count}, sys.__stdout__)


if __name__ == "__main__":
    main(*sys.argv[1:])
