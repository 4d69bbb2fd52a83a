"""Conversion of command-line text to the argument types of a scene's `build`."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Mapping
from typing import Any

from ..device.checks import InputError, one_of, suggestion

TRUTH = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


def converted(key: str, value: Any, parameters: Mapping[str, inspect.Parameter]) -> Any:
    """Convert `value` to the type of the default of argument `key`.

    Without a default, or if that is None and the annotation names no number, parse it as a Python literal.
    """
    if key not in parameters:
        hint = suggestion(key, parameters)
        if key == "duration" and {"speed", "travel"} <= set(parameters):
            hint = " (the duration is travel / speed)"
        raise InputError(f"{key} is not an argument of this scene; expected one of {', '.join(parameters)}{hint}")
    default = parameters[key].default
    if isinstance(default, tuple | list) and isinstance(value, str | list):
        return type(default)(_sequence(key, value, default))
    if not isinstance(value, str) or isinstance(default, str):
        return value
    if default is inspect.Parameter.empty:
        return _python_value(value)
    if isinstance(default, bool):
        return TRUTH[one_of(f"--set {key}", value.lower(), TRUTH)]
    types = set(re.findall(r"\w+", str(parameters[key].annotation)))
    if default is None and not types & {"int", "float"}:
        return value if "str" in types and value.lower() != "none" else _python_value(value)
    return _as_number(key, value, default, types)


def plain(value: Any) -> Any:
    """A setting that `is_plain` as JSON keeps it: tuples become lists."""
    return [plain(item) for item in value] if isinstance(value, tuple | list) else value


def is_plain(value: Any) -> bool:
    """Whether JSON preserves a setting exactly."""
    if isinstance(value, tuple | list):
        return all(is_plain(item) for item in value)
    return isinstance(value, str | int | float | bool | None)


def split_values(text: str) -> list[str]:
    """Split text at commas, except at commas inside brackets."""
    found, depth = [""], 0
    for letter in text:
        depth += (letter in "([") - (letter in ")]")
        if letter == "," and depth == 0:
            found.append("")
        else:
            found[-1] += letter
    return [value.strip() for value in found]


def _as_number(key: str, text: str, default: Any, types: set[str]) -> int | float | None:
    """Convert to int or float, depending on the default or, if it is None, on the annotated types and the text."""
    number = _number(text)
    if isinstance(default, int):
        if not isinstance(number, int):
            raise InputError(f"--set {key} = {text!r}: expected a whole number")
        return number
    if default is None and text.lower() == "none":
        return None
    if number is None:
        raise InputError(f"--set {key} = {text!r}: expected a number")
    return number if default is None and "float" not in types else float(number)


def _number(text: str) -> int | float | None:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return None


def _python_value(text: str) -> Any:
    """Parse text as a number, bool, None or tuple; return the text itself if it is none of these."""
    number = _number(text)
    if number is not None:
        return number
    known = {"true": True, "false": False, "none": None}
    if text.lower() in known:
        return known[text.lower()]
    if text[:1] in "([":
        return _tuples(ast.literal_eval(text)) if _is_literal(text) else text
    return text


def _sequence(key: str, value: Any, default: Any) -> Any:
    """Convert to a sequence of the same kind as the default: numbers, tuples of numbers, or texts."""
    example = ",".join(str(item) for item in default) or "0.1,0.2"
    error = InputError(f"--set {key} = {value!r}: expected values separated by commas, such as {example}")
    if isinstance(value, str):
        text = value.strip()
        texts = all(isinstance(item, str) for item in default) and bool(default)
        if texts:
            return split_values(text.strip("()[]"))
        if text[:1] not in ("(", "[") or len(split_values(text)) > 1:
            text = f"({text},)"
        if not _is_literal(text):
            raise error
        value = ast.literal_eval(text)
    if not isinstance(value, tuple | list) or not _fits(value, default):
        raise error
    return _tuples(value)


def _is_literal(text: str) -> bool:
    try:
        ast.literal_eval(text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return False
    return True


def _fits(value: Any, default: Any) -> bool:
    """Whether the items are of the same kind as those of the default: numbers, texts or sequences."""
    if not default:
        return True
    nested = isinstance(default[0], tuple | list)
    if nested:
        return all(isinstance(item, tuple | list) and _fits(item, default[0]) for item in value)
    kinds = str if isinstance(default[0], str) else int | float
    return all(isinstance(item, kinds) for item in value)


def _tuples(value: Any) -> Any:
    return tuple(_tuples(item) for item in value) if isinstance(value, tuple | list) else value
