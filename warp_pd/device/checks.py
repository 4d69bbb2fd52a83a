"""Checks of user input: each raises one line that names the argument, its value and what is expected."""

import contextlib
import difflib
import inspect
import math
import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

# Entries of an array, characters of a text that a message shows, and characters of a message.
MAX_SHOWN, MAX_TEXT, MAX_MESSAGE = 6, 90, 700
# Share of the letters that a mistyped word has in common with the one it may mean; words of half of them differ.
LIKE = 0.6
# Exit codes of the command line.
WRONG_INPUT, DIVERGED, LOST = 2, 3, 4


class InputError(ValueError):
    """Invalid input: the message names the argument, its value and what is expected.

    The message is always one line; the middle of a long value is left out. Every input check raises it, so a
    docstring mentions it only for an object that users construct, or where the caller catches it.
    """

    def __init__(self, message: object = "") -> None:
        text = " ".join(str(message).split())
        half = MAX_MESSAGE // 2
        super().__init__(text if len(text) <= MAX_MESSAGE else f"{text[:half]} ... {text[-half:]}")


class OutputError(InputError):
    """A result file could not be written; the message names the file and the reason."""


@contextlib.contextmanager
def user_code(text_of: Callable[[Exception], str]) -> Iterator[None]:
    """Context in which user code runs; `text_of` turns the errors that it raises into one line.

    Raises:
        InputError: instead of any other error.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        raise InputError(text_of(error)) from error


def show(value: Any) -> str:
    """Any value as one short line for a message."""
    if isinstance(value, np.ndarray) and value.size > MAX_SHOWN:
        return f"{value.dtype} array of shape {value.shape}"
    if isinstance(value, type):
        return f"the class {value.__name__}"
    if inspect.isroutine(value):
        return f"the function {value.__name__}"
    text = " ".join(repr(value).split())
    return text if len(text) <= MAX_TEXT else f"{text[: MAX_TEXT - 3]}..."


def kind_and_text(error: Exception) -> str:
    """Text like "ValueError: what was wrong"; the type alone where the error says nothing."""
    return f"{type(error).__name__}: {error}".removesuffix(": ")


def finite(name: str, value: Any) -> float:
    """`value` as a float. Raises InputError unless it is one finite number."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = None
    # Reject text even if it reads like a number: the first sum with it would end with a traceback. True is not 1.
    if number is None or isinstance(value, str | bool | np.bool_):
        raise InputError(f"{name} = {show(value)}: expected a number")
    if not math.isfinite(number):
        raise InputError(f"{name} = {show(value)}: expected a finite number")
    return number


def positive(name: str, value: Any) -> float:
    """`value` as a positive float. Raises InputError if it is not."""
    number = finite(name, value)
    if number <= 0.0:
        raise InputError(f"{name} = {show(value)}: expected a positive number")
    return number


def not_negative(name: str, value: Any) -> float:
    """`value` as a nonnegative float. Raises InputError if it is not."""
    number = finite(name, value)
    if number < 0.0:
        raise InputError(f"{name} = {show(value)}: expected 0 or a positive number")
    return number


def count(name: str, value: Any, least: int) -> int:
    """Return `value` as an int. Raises InputError if it is not a whole number of at least `least`."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise InputError(f"{name} = {show(value)}: expected a whole number of {least} or more")
    return int(value)


def below_one(name: str, value: Any) -> float:
    """`value` as a float between 0 and 1, exclusive. Raises InputError if it is not."""
    if positive(name, value) >= 1.0:
        raise InputError(f"{name} = {show(value)}: expected a number greater than 0 and less than 1")
    return float(value)


def counts(name: str, value: Any, least: int) -> tuple[int, int]:
    """`value` as two ints, each at least `least`. Raises InputError if it is not."""
    if not isinstance(value, tuple | list) or len(value) != 2:
        raise InputError(f"{name} = {show(value)}: expected two whole numbers")
    return count(f"{name}[0]", value[0], least), count(f"{name}[1]", value[1], least)


def positions(name: str, value: Any, least: int = 3, components: int = 2) -> np.ndarray:
    """`value` as positions [m], float64, shape (N, 2) or (N, 3), of at least `least` points."""
    found = numbers(name, value)
    if found.ndim != 2 or found.shape[1] != components or len(found) < least:
        raise InputError(f"{name}: expected shape (N, {components}) with N >= {least}, got {found.shape}")
    return found.copy()


def one_each(name: str, value: Any, points: int) -> np.ndarray:
    """`value` as one positive number per point, float64, shape (N,)."""
    found = numbers(name, value)
    if found.shape != (points,):
        raise InputError(f"{name} has shape {found.shape}: expected ({points},), one number for each point")
    if not (found > 0.0).all():
        bad = int(np.flatnonzero(found <= 0.0)[0])
        raise InputError(f"{name}[{bad}] = {found[bad]}: expected a positive number")
    return found.copy()


def by_point(name: str, value: Any, places: np.ndarray) -> float | np.ndarray:
    """`value`, a number, array or function of coordinates, as a float or a float64 array, shape (N,); all positive.

    `places` are the points [m], shape (N, 2) or (N, 3). InputError names the first number that is not positive.
    """
    if callable(value):
        name = f"{name}({', '.join('xyz'[: places.shape[1]])})"
        return one_each(name, evaluate(name, value, places.T.copy()), len(places))
    if isinstance(value, str) or not np.iterable(value):
        return positive(name, value)
    return one_each(name, value, len(places))


def evaluate(name: str, function: Callable[..., Any], arguments: Iterable[np.ndarray]) -> Any:
    """Result of a user's function of arrays. Raises InputError instead of any other error, and for None."""
    with user_code(lambda error: f"{name}: {kind_and_text(error)}; expected a function of arrays"):
        found = function(*arguments)
    if found is None:
        raise InputError(f"{name} returned None: expected a function that returns numbers")
    return found


def corners(name: str, value: Any, points: int) -> np.ndarray:
    """`value` as the corners of triangles, int32, shape (F, 3)."""
    found = np.asarray(value)
    if found.ndim != 2 or found.shape[1] != 3 or not len(found) or found.dtype.kind not in "iu":
        raise InputError(f"{name} = {show(found)}: expected whole numbers of shape (F, 3) with F >= 1")
    _require_points(name, found, points)
    return found.astype(np.int32)


def resolved(name: str, length: float, spacing: float, least: float = 2.0) -> float:
    """Return `length` if the spacing resolves it. Raises InputError if it is shorter than `least` spacings."""
    if length < least * spacing:
        raise InputError(
            f"{name} = {length!r}: expected at least {least:g} spacings, {least * spacing:.3g} m; use more points"
        )
    return length


def of_kind(name: str, value: Any, kind: type) -> None:
    """Raise InputError unless `value` is an instance of `kind`."""
    if not isinstance(value, kind):
        raise InputError(f"{name} = {show(value)}: expected a {kind.__name__}")


def implements(value: Any, kind: Any) -> bool:
    """Whether a user's value is an instance of a protocol, and not the class itself."""
    return isinstance(value, kind) and not isinstance(value, type)


def one_of(name: str, value: Any, allowed: Iterable[Any]) -> Any:
    """Return `value` if it is allowed. Raises InputError, which names the nearest allowed text, if it is not."""
    choices = list(allowed)
    # Comparing an array with a choice would be ambiguous.
    if not isinstance(value, np.ndarray) and value in choices:
        return value
    hint = suggestion(str(value), [c for c in choices if isinstance(c, str)])
    raise InputError(f"{name} = {show(value)}: expected one of {', '.join(repr(c) for c in choices)}{hint}")


def suggestion(text: str, words: Iterable[str]) -> str:
    """The word that a mistyped text may mean, for the end of a message; "" if none is like it."""
    nearest = difflib.get_close_matches(text, list(words), n=1, cutoff=LIKE)
    return f" (did you mean {nearest[0]!r}?)" if nearest else ""


def device_name(value: str | None) -> str | None:
    """Return the name of a device, or None. Raises InputError if no device has such a name, here or elsewhere."""
    if value is not None and not re.fullmatch(r"cpu|cuda(:\d+)?", value):
        raise InputError(f"device = {show(value)}: expected 'cpu', 'cuda', or a CUDA device such as 'cuda:0'")
    return value


def vector(name: str, value: Any, length: int) -> tuple[float, ...]:
    """`value` as a tuple of finite floats. Raises InputError unless it has `length` finite components."""
    try:
        numbers = tuple(float(v) for v in value)
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) != length or not all(math.isfinite(n) for n in numbers):
        raise InputError(f"{name} = {show(value)}: expected {length} finite numbers")
    return numbers


def numbers(name: str, value: Any) -> np.ndarray:
    """`value`, a number or an array of numbers, as a float64 array."""
    try:
        # Neither True nor "1" is the number 1, nor has a complex number or a date its value.
        given = np.asarray(value)
        found = given.astype(np.float64) if given.dtype.kind not in "bSUcmM" else None
    except (TypeError, ValueError):
        found = None
    if found is None:
        raise InputError(f"{name} = {show(value)}: expected numbers")
    bad = np.argwhere(~np.isfinite(found))
    if len(bad):
        place = "" if found.ndim == 0 else f"[{', '.join(map(str, bad[0]))}]"
        raise InputError(f"{name}{place} = {found[tuple(bad[0])]}: expected finite numbers")
    return found


def point_indices(name: str, value: Any, points: int) -> np.ndarray:
    """`value`, indices or a mask of all points, as sorted unique point indices, int32."""
    given = np.asarray(value)
    if given.dtype == bool and given.shape == (points,):
        given = np.flatnonzero(given)
    if given.size and given.dtype.kind not in "iu":
        raise InputError(f"{name} = {show(value)}: expected point indices, or a mask of {points} booleans")
    indices = np.unique(given.astype(np.int64))
    if indices.size == 0:
        raise InputError(f"{name} = {show(value)}: expected at least one point")
    _require_points(name, indices, points)
    return indices.astype(np.int32)


def _require_points(name: str, indices: np.ndarray, points: int) -> None:
    if indices.size and not 0 <= indices.min() <= indices.max() < points:
        bad = int(indices.min() if indices.min() < 0 else indices.max())
        raise InputError(f"{name} contains point {bad}: expected 0 to {points - 1}")


def truth_values(name: str, condition: Any, *arguments: np.ndarray) -> np.ndarray:
    """Values of a condition on arrays of equal shape, one boolean per entry."""
    if not callable(condition):
        raise InputError(f"{name} = {condition!r}: expected a function")
    holds = np.asarray(evaluate(f"{name}({', '.join('xyz'[: len(arguments)])})", condition, arguments))
    shape = arguments[0].shape
    if holds.dtype != bool or holds.shape != shape:
        raise InputError(f"{name} returned {holds.dtype} of shape {holds.shape}: expected bool of shape {shape}")
    return holds
