"""What an SVG file draws: shapes, with their transforms to the user units of the document (SVG 2, CSS Transforms 1)."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from ..device.checks import InputError, show, user_code

# Physical units of lengths in SVG [m], and a user unit of a file without a viewBox (CSS Values and Units, section 6.2).
PHYSICAL = {"mm": 1e-3, "cm": 1e-2, "in": 0.0254, "pt": 0.0254 / 72.0, "pc": 0.0254 / 6.0, "q": 0.25e-3}
PIXEL = 0.0254 / 96.0
# What is read of one file, at most: characters of style sheets, elements with copies.
MOST_STYLE, MOST_ELEMENTS = 50_000, 100_000
NAMESPACE = "{http://www.w3.org/2000/svg}"
SHAPES = ("path", "rect", "circle", "ellipse", "line", "polyline", "polygon")
GROUPS = ("svg", "g", "a", "switch", "symbol", "use")
# What shows in a drawing and is no shape.
OTHERS = ("text", "image", "foreignObject")
ANIMATIONS = ("animate", "animateTransform", "animateMotion", "set")
# Properties of style sheets that place or hide shapes.
PROPERTIES = {
    *("x", "y", "width", "height", "cx", "cy", "r", "rx", "ry", "d", "display", "visibility", "overflow", "clip-path"),
    *(
        "mask",
        "animation",
        "animation-name",
        "transform",
        "transform-origin",
        "transform-box",
        "translate",
        "rotate",
        "scale",
        "zoom",
        "offset-path",
    ),
}
NOT_READ = ("animation", "animation-name", "translate", "rotate", "scale", "zoom", "offset-path")
NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
LENGTH = re.compile(rf"({NUMBER})\s*([a-zA-Z]*|%)")
# User units of each unit; a percentage is one of the viewport.
FACTORS = {"": 1.0, "px": 1.0, "%": 0.01, **{unit: length / PIXEL for unit, length in PHYSICAL.items()}}
TRANSFORM = re.compile(r"\s*,?\s*(matrix|translate|translateX|translateY|scale|rotate|skewX|skewY)\s*\(([^()]*)\)\s*")
SELECTOR = re.compile(r"(\*|[A-Za-z][\w-]*)?((?:[.#][\w-]+)*)")


@dataclass(frozen=True, eq=False)
class Region:
    """An area that limits what is drawn.

    Attributes:
        name: Whose it is, for messages.
        shapes: Paths of svgelements, and their matrices to the user units of the document, (3, 3).
    """

    name: str
    shapes: list[tuple[Any, np.ndarray]]


@dataclass(frozen=True, eq=False)
class Drawn:
    """One element that shows.

    Attributes:
        tag: Its tag.
        id: Its id, or None.
        path: Its path, of svgelements; None if it is no shape.
        matrix: From its user units to those of the document, (3, 3).
        regions: Areas outside of which it does not show.
    """

    tag: str
    id: str | None
    path: Any
    matrix: np.ndarray
    regions: tuple[Region, ...]


@dataclass(frozen=True, eq=False)
class _Place:
    """What elements inherit.

    Attributes:
        matrix: From user units to those of the document, (3, 3).
        size: Width and height of the viewport for percentages; None where the file does not say.
        visible: Whether elements show that do not say so.
        regions: Areas outside of which nothing shows.
        clips: Whether this is part of a clip path.
    """

    matrix: np.ndarray
    size: tuple[float | None, float | None]
    visible: bool = True
    regions: tuple[Region, ...] = ()
    clips: bool = False

    def moved(self, matrix: np.ndarray) -> _Place:
        return replace(self, matrix=self.matrix @ matrix)


def tag_of(element: Any) -> str:
    """Tag of an element of SVG, with or without its namespace; "" for elements of other namespaces."""
    tag = str(element.tag).removeprefix(NAMESPACE)
    return "" if tag.startswith("{") else tag


@dataclass
class Document:
    """An SVG document.

    Attributes:
        where: The file, for messages.
        root: Its root element.
    """

    where: str
    root: Any
    _named: dict[str, Any] = field(default_factory=dict)
    _paths: dict[Any, Any] = field(default_factory=dict)
    _clipping: int = 0

    def __post_init__(self) -> None:
        if tag_of(self.root) != "svg":
            raise InputError(f"{self.where}: expected an SVG file")
        for element in self.root.iter():
            self._named.setdefault(element.get("id"), element)
        self._styles = _Styles(self.where, self.root)
        found = self._elements(self.root, {})
        if found > MOST_ELEMENTS:
            raise InputError(
                f"{self.where}: {found:.3g} elements, with the copies by <use>: expected at most {MOST_ELEMENTS}; a "
                "copy must not hold itself"
            )

    def _elements(self, element: Any, known: dict[Any, float]) -> float:
        """Number of elements that one stands for, with copies; infinite for one that holds itself."""
        if element not in known:
            known[element] = math.inf
            parts = list(element)
            if tag_of(element) == "use" and (target := self._target(element)) is not None:
                parts.append(target)
            known[element] = 1 + sum(self._elements(part, known) for part in parts)
        return known[element]

    def _target(self, element: Any) -> Any:
        """The element that <use> copies; None if it is not in this file."""
        link = _link(element)
        return self._named.get(link[1:]) if link.startswith("#") else None

    def size(self) -> tuple[str, str]:
        """Width and height, as the file gives them."""
        style = self._styles.of(self.root)
        return style.get("width", "").strip(), style.get("height", "").strip()

    def box(self) -> tuple[float, ...] | None:
        """x, y, width and height of the viewBox."""
        return self._box(self.root)

    def drawn(self) -> list[Drawn]:
        """Everything that shows, in the order of the file."""
        style, box = self._styles.of(self.root), self.box()
        if style.get("transform", "none").strip() not in ("none", ""):
            raise InputError(f"{self.where}: svg has transform = {show(style['transform'])}: expected it on a group")
        place = _Place(np.eye(3), (None, None))
        size = box[2:] if box else tuple(self._root_length(text) for text in self.size())
        inner = self._inherited(self.root, style, replace(place, size=(size[0], size[1])))
        return [] if inner is None or 0.0 in size else list(self._parts(self.root, inner))

    def _root_length(self, text: str) -> float | None:
        return None if text.endswith("%") or text in ("", "auto") else self._length("svg", "size", text, None)

    def _box(self, element: Any) -> tuple[float, ...] | None:
        text = element.get("viewBox")
        if text is None:
            return None
        numbers = _numbers(text) or []
        if len(numbers) != 4 or min(numbers[2:]) < 0.0:
            raise InputError(f"{self.where}: {_label(element)}: viewBox = {show(text)}: expected x, y, width, height")
        return tuple(numbers)

    def _length(self, name: str, of: str, text: str, whole: float | None) -> float:
        """A length in user units; `whole` is what 100 % stand for."""
        found = LENGTH.fullmatch(text.strip())
        unit = found[2].lower() if found else "?"
        if unit == "%" and whole is None:
            raise InputError(
                f"{self.where}: {name}: {of} = {show(text)}: expected a number; the drawing has no viewBox"
            )
        if found is None or unit not in FACTORS or not math.isfinite(float(found[1])):
            raise InputError(
                f"{self.where}: {name}: {of} = {show(text)}: expected a length in px, %, {', '.join(PHYSICAL)}"
            )
        return float(found[1]) * (FACTORS[unit] if whole is None or unit != "%" else whole / 100.0)

    def _lengths(self, element: Any, style: dict[str, str], place: _Place, names: dict[str, str]) -> list[float]:
        """Lengths of an element by name, with what they are if left out."""
        width, height = place.size
        diagonal = None if width is None or height is None else math.hypot(width, height) / math.sqrt(2.0)
        found = []
        for name, default in names.items():
            whole = diagonal if name == "r" else width if name in ("x", "cx", "rx", "width", "x1", "x2") else height
            found.append(self._length(_label(element), name, style.get(name, default), whole))
        return found

    def _parts(self, element: Any, place: _Place) -> Iterator[Drawn]:
        for part in element:
            if tag_of(part) != "symbol":
                yield from self._element(part, place)

    def _element(self, element: Any, place: _Place, size: dict[str, str] | None = None) -> Iterator[Drawn]:
        """What an element draws; `size` is its width and height if <use> gives them."""
        tag = tag_of(element)
        if tag in ANIMATIONS:
            raise InputError(f"{self.where}: {tag} in the drawing: expected a drawing without animations")
        if tag not in (*SHAPES, *GROUPS, *OTHERS):
            return
        style = self._styles.of(element)
        inner = self._inherited(element, style, place)
        if inner is None:
            return
        if tag in ("svg", "symbol"):
            port = self._viewport(element, {**style, **(size or {})}, inner)
            yield from () if port is None else self._parts(element, port)
        elif tag == "use":
            # Animations of the copy.
            yield from self._parts(element, inner)
            yield from self._copy(element, style, inner)
        elif tag == "switch":
            parts = (part for part in element if tag_of(part) in (*SHAPES, *GROUPS, *OTHERS))
            chosen = next((part for part in parts if self._applies(part)), None)
            yield from () if chosen is None else self._element(chosen, inner)
        elif tag in GROUPS:
            yield from self._parts(element, inner)
        elif inner.visible:
            yield from self._shape(element, style, inner)
            # Animations of a shape.
            yield from self._parts(element, inner) if tag in SHAPES else ()

    def _applies(self, element: Any) -> bool:
        """Whether an element shows without extensions of SVG."""
        if element.get("systemLanguage") is not None:
            raise InputError(f"{self.where}: {_label(element)}: systemLanguage: expected a drawing for every language")
        return element.get("requiredExtensions") is None

    def _inherited(self, element: Any, style: dict[str, str], place: _Place) -> _Place | None:
        """The place of what is in an element; None if nothing of it shows."""
        if style.get("display", "").strip().lower() == "none" or not self._applies(element):
            return None
        name = _label(element)
        for word in NOT_READ:
            if word in style:
                raise InputError(f"{self.where}: {name} has {word} = {show(style[word])}: expected transform alone")
        transform = style.get("transform", "none").strip()
        if transform not in ("none", ""):
            origin = style.get("transform-origin", "0 0").strip()
            if origin not in ("0", "0 0", "0px 0px") or "transform-box" in style:
                raise InputError(f"{self.where}: {name} has transform-origin = {show(origin)}: expected 0 0")
            matrix = self._matrix(name, transform)
            if np.linalg.det(matrix) == 0.0:
                return None
            place = place.moved(matrix)
        shown = style.get("visibility", "inherit").strip().lower()
        if shown in ("visible", "hidden", "collapse"):
            place = replace(place, visible=shown == "visible")
        if style.get("mask", "none").strip() not in ("none", ""):
            place = replace(place, regions=(*place.regions, Region(f"the mask of {name}", [])))
        clip = style.get("clip-path", "none").strip()
        if clip not in ("none", ""):
            if place.clips:
                raise InputError(f"{self.where}: {name} is clipped in a clip path: expected one that is not clipped")
            place = replace(place, regions=(*place.regions, self._clip(name, clip, place)))
        return place

    def _clip(self, name: str, text: str, place: _Place) -> Region:
        """The area of a clip path, for an element at a place."""
        found = re.fullmatch(r"""url\(\s*['"]?#([^'")]+)['"]?\s*\)""", text)
        element = self._named.get(found[1]) if found else None
        if element is None or tag_of(element) != "clipPath":
            raise InputError(f"{self.where}: {name} has clip-path = {show(text)}: expected url(#...) of a clipPath")
        style = self._styles.of(element)
        if element.get("clipPathUnits", "userSpaceOnUse") != "userSpaceOnUse":
            raise InputError(f"{self.where}: {_label(element)}: expected one in user units")
        inner = self._inherited(element, style, replace(place, visible=True, regions=(), clips=True))
        parts = [] if inner is None else list(self._parts(element, inner))
        if any(part.path is None or part.regions for part in parts):
            raise InputError(f"{self.where}: {_label(element)}: expected only shapes")
        self._clipping += len(parts)
        if self._clipping > MOST_ELEMENTS:
            raise InputError(f"{self.where}: more shapes that clip others: expected at most {MOST_ELEMENTS}")
        return Region(_label(element), [(part.path, part.matrix) for part in parts])

    def _matrix(self, name: str, text: str) -> np.ndarray:
        """The matrix of a list of transforms, (3, 3)."""
        matrix, at = np.eye(3), 0
        while at < len(text):
            found = TRANSFORM.match(text, at)
            numbers = _numbers(re.sub(r"(?<=[\d.])(px|deg)", " ", found[2])) if found else None
            made = None if found is None or numbers is None else _transform(found[1], numbers)
            if made is None:
                raise InputError(
                    f"{self.where}: {name} has transform = {show(text)}: expected matrix, translate, scale, rotate, "
                    "skewX and skewY of numbers"
                )
            matrix, at = matrix @ made, found.end() if found else at
        return matrix

    def _viewport(self, element: Any, style: dict[str, str], place: _Place) -> _Place | None:
        """The place of what is in a nested svg or a symbol (SVG 2, section 8.2); None if nothing of it shows."""
        name, box = _label(element), self._box(element)
        if element.get("refX") or element.get("refY"):
            raise InputError(f"{self.where}: {name} has refX or refY: expected x and y")
        whole = {"x": "0", "y": "0", "width": "100%", "height": "100%"}
        style = {key: value for key, value in style.items() if value.strip() != "auto"}
        if box is None and None in place.size and all(style.get(k, "100%") == "100%" for k in ("width", "height")):
            x, y = self._lengths(element, style, place, {"x": "0", "y": "0"})
            return place.moved(_shift(x, y))
        x, y, width, height = self._lengths(element, style, place, whole)
        if min(width, height) < 0.0:
            raise InputError(f"{self.where}: {name} is {width:g} x {height:g}: expected positive numbers")
        if 0.0 in (width, height) or (box and 0.0 in box[2:]):
            return None
        if style.get("overflow", "hidden").strip().lower() not in ("visible", "auto"):
            region = Region(f"the viewport of {name}", [(_rectangle(x, y, width, height), place.matrix)])
            place = replace(place, regions=(*place.regions, region))
        if box is None:
            return replace(place.moved(_shift(x, y)), size=(width, height))
        fit = _fit(width, height, box, element.get("preserveAspectRatio", ""))
        if fit is None:
            given = show(element.get("preserveAspectRatio"))
            raise InputError(f"{self.where}: {name}: preserveAspectRatio = {given}: expected such as 'xMidYMid meet'")
        return replace(place.moved(_shift(x, y) @ fit), size=(box[2], box[3]))

    def _copy(self, element: Any, style: dict[str, str], place: _Place) -> Iterator[Drawn]:
        """What <use> draws."""
        target, name = self._target(element), _label(element)
        if target is None:
            raise InputError(
                f"{self.where}: {name} has href = {show(_link(element))}: expected # and the id of an element here"
            )
        x, y = self._lengths(element, style, place, {"x": "0", "y": "0"})
        size = {key: style[key] for key in ("width", "height") if style.get(key, "auto").strip() != "auto"}
        yield from self._element(target, place.moved(_shift(x, y)), size)

    def _shape(self, element: Any, style: dict[str, str], place: _Place) -> Iterator[Drawn]:
        tag, name = tag_of(element), _label(element)
        if tag == "text" and not "".join(element.itertext()).strip():
            return
        # Copies share their path.
        key = element, place.size
        if tag in SHAPES and key not in self._paths:
            with user_code(partial(unreadable, self.where, name)):
                self._paths[key] = self._path(element, style, place)
        path = self._paths.get(key)
        if path is None and tag in SHAPES:
            return
        yield Drawn(tag, element.get("id"), path, place.matrix, place.regions)

    def _path(self, element: Any, style: dict[str, str], place: _Place) -> Any:
        """The path of a shape in its own user units; None if it has no extent and is not drawn."""
        from svgelements import Circle, Ellipse, Path, Polygon, Polyline, Rect, SimpleLine

        def lengths(**names: str) -> list[float]:
            return self._lengths(element, style, place, names)

        tag = tag_of(element)
        shape: Any
        if tag == "path":
            text = style.get("d", "none").strip()
            # The library ends at what it does not know.
            if text != "none" and _numbers(re.sub("[MZLHVCSQTA]", " ", text, flags=re.IGNORECASE)) is None:
                raise ValueError
            return None if text in ("none", "") else Path(text)
        if tag in ("polyline", "polygon"):
            numbers = _numbers(element.get("points", ""))
            if numbers is None or len(numbers) % 2:
                raise ValueError
            if not numbers:
                return None
            pairs = list(zip(numbers[::2], numbers[1::2], strict=True))
            shape = (Polygon if tag == "polygon" else Polyline)(*pairs)
        elif tag == "line":
            shape = SimpleLine(*lengths(x1="0", y1="0", x2="0", y2="0"))
        elif tag == "circle":
            cx, cy, r = lengths(cx="0", cy="0", r="0")
            self._require_size(element, r)
            shape = Circle(cx, cy, r) if r else None
        else:
            given = {key: "" for key in ("rx", "ry") if style.get(key, "auto").strip() != "auto"}
            # One radius alone is both.
            rx, ry = ((lengths(**given) or [0.0]) * 2)[:2]
            if tag == "ellipse":
                cx, cy = lengths(cx="0", cy="0")
                self._require_size(element, rx, ry)
                shape = Ellipse(cx, cy, rx, ry) if rx and ry else None
            else:
                x, y, width, height = lengths(x="0", y="0", width="0", height="0")
                self._require_size(element, width, height, rx, ry)
                shape = Rect(x, y, width, height, rx, ry) if width and height else None
        return None if shape is None else Path(shape.segments(transformed=False))

    def _require_size(self, element: Any, *sizes: float) -> None:
        if min(sizes) < 0.0:
            raise InputError(f"{self.where}: {_label(element)} has a size of {min(sizes):g}: expected positive numbers")


def _link(element: Any) -> str:
    return str(element.get("href", element.get("{http://www.w3.org/1999/xlink}href", ""))).strip()


def _label(element: Any) -> str:
    return f"{tag_of(element)} {element.get('id', '')}".rstrip()


def _numbers(text: str) -> list[float] | None:
    """The numbers of a list; None if there is something else in it, or one too large."""
    numbers = [float(word) for word in re.findall(NUMBER, text)]
    return None if re.sub(NUMBER, "", text).strip(" \t\r\n,") or not np.isfinite(numbers).all() else numbers


def unreadable(where: str, name: str, error: Exception) -> str:
    """What is said of a shape that a library cannot read."""
    return f"{where}: {name} cannot be read: expected a path of numbers and commands of SVG"


def _shift(x: float, y: float) -> np.ndarray:
    return np.array([[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]])


def _rectangle(x: float, y: float, width: float, height: float) -> Any:
    from svgelements import Path, Rect

    return Path(Rect(x, y, width, height).segments(transformed=False))


def _transform(name: str, n: list[float]) -> np.ndarray | None:
    """The matrix of a function of the attribute transform, (3, 3); None for another count of numbers."""
    if name == "rotate" and len(n) == 3:
        turn = _transform(name, n[:1])
        return None if turn is None else _shift(n[1], n[2]) @ turn @ _shift(-n[1], -n[2])
    kinds: dict[tuple[str, int], Callable[[], list[float]]] = {
        ("matrix", 6): lambda: n,
        ("translate", 1): lambda: [1.0, 0.0, 0.0, 1.0, n[0], 0.0],
        ("translate", 2): lambda: [1.0, 0.0, 0.0, 1.0, *n],
        ("translateX", 1): lambda: [1.0, 0.0, 0.0, 1.0, n[0], 0.0],
        ("translateY", 1): lambda: [1.0, 0.0, 0.0, 1.0, 0.0, n[0]],
        ("scale", 1): lambda: [n[0], 0.0, 0.0, n[0], 0.0, 0.0],
        ("scale", 2): lambda: [n[0], 0.0, 0.0, n[1], 0.0, 0.0],
        ("rotate", 1): lambda: [
            *(math.cos(math.radians(n[0])), math.sin(math.radians(n[0]))),
            *(-math.sin(math.radians(n[0])), math.cos(math.radians(n[0])), 0.0, 0.0),
        ],
        ("skewX", 1): lambda: [1.0, 0.0, math.tan(math.radians(n[0])), 1.0, 0.0, 0.0],
        ("skewY", 1): lambda: [1.0, math.tan(math.radians(n[0])), 0.0, 1.0, 0.0, 0.0],
    }
    if (name, len(n)) not in kinds:
        return None
    a, b, c, d, e, f = kinds[name, len(n)]()
    return np.array([[a, c, e], [b, d, f], [0.0, 0.0, 1.0]])


def _fit(width: float, height: float, box: tuple[float, ...], text: str) -> np.ndarray | None:
    """From the units of a viewBox to those around it, with x and y of the viewport 0; None for an unknown word."""
    found = re.fullmatch(r"(none|x(Min|Mid|Max)Y(Min|Mid|Max))(?:\s+(meet|slice))?", text.strip() or "xMidYMid")
    if found is None:
        return None
    scales = np.array([width / box[2], height / box[3]])
    if found[1] != "none":
        scales[:] = scales.max() if found[4] == "slice" else scales.min()
    part = {"Min": 0.0, "Mid": 0.5, "Max": 1.0, None: 0.0}
    free = np.array([width, height]) - scales * box[2:]
    x, y = np.array([part[found[2]], part[found[3]]]) * free - scales * box[:2]
    return np.array([[scales[0], 0.0, x], [0.0, scales[1], y], [0.0, 0.0, 1.0]])


class _Styles:
    """Properties of elements: of the style sheets, of `style`, and of their attributes (CSS Cascade, section 6)."""

    def __init__(self, where: str, root: Any) -> None:
        self._where = where
        # Rank, tag, words ".class" and "#id", and properties of each rule.
        self._rules: list[tuple[tuple[int, ...], str, set[str], dict[str, str]]] = []
        # A sheet may be an element of XHTML.
        sheets = [element for element in root.iter() if str(element.tag).rpartition("}")[2] in ("style", "link")]
        texts = ["".join(element.itertext()) for element in sheets]
        size = sum(map(len, texts))
        if size > MOST_STYLE:
            raise InputError(f"{where}: style sheets of {size} characters: expected at most {MOST_STYLE}")
        media = any(element.get("media") for element in sheets)
        text = re.sub(r"/\*.*?\*/|<!--|-->", " ", "\n".join(texts), flags=re.DOTALL)
        if "@import" in text or any(element.get("rel") == "stylesheet" for element in sheets):
            raise InputError(f"{where}: style sheets import another file: expected them whole")
        for number, (selectors, body) in enumerate(re.findall(r"([^{}]+)\{([^{}]*)\}", text)):
            properties = self._declared(body)
            for selector in selectors.split(",") if properties else ():
                found = SELECTOR.fullmatch(selector.strip())
                if found is None or not selector.strip() or media or "@media" in text:
                    raise InputError(
                        f"{where}: the style sheet sets {next(iter(properties))} of {show(selector.strip())}: expected "
                        "selectors of a tag, classes and an id"
                    )
                words = re.findall(r"[.#][\w-]+", found[2])
                ids, tag = sum(word[0] == "#" for word in words), found[1] or "*"
                rank = (ids, len(words) - ids, int(tag != "*"), number)
                self._rules.append((rank, tag, set(words), properties))
        self._rules.sort(key=lambda rule: rule[0])
        self._known: dict[Any, dict[str, str]] = {}

    def _declared(self, text: str) -> dict[str, str]:
        """Properties of a block of declarations that place or hide shapes."""
        pairs = [line.partition(":") for line in text.split(";")]
        found = {name.strip().lower(): value.strip() for name, _, value in pairs if name.strip().lower() in PROPERTIES}
        for name, value in found.items():
            if "!" in value or "var(" in value or "calc(" in value:
                raise InputError(f"{self._where}: style {name}: {value}: expected a plain value")
        return found

    def of(self, element: Any) -> dict[str, str]:
        """Attributes of an element, with the properties that styles give it."""
        if element in self._known:
            return self._known[element]
        found = self._known[element] = dict(element.attrib)
        # Words that are attributes of something else.
        for name in NOT_READ:
            found.pop(name, None)
        if self._rules:
            words = {f".{word}" for word in element.get("class", "").split()} | {f"#{element.get('id')}"}
            for _, tag, wanted, properties in self._rules:
                if tag in ("*", tag_of(element)) and wanted <= words:
                    found.update(properties)
        if "style" in found:
            found.update(self._declared(found["style"]))
        return found
