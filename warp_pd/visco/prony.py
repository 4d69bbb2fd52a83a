"""Prony terms of the viscous laws on a device."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..context import Context
from ..device.checks import InputError
from ..device.fields import Array
from .viscous import Maxwell, Prony

# Relaxation time [s] for the step to the initial displacement: so long that nothing relaxes.
AT_ONCE = 1e30


def store_terms(law: Any, name: str, kind: type[Prony | Maxwell]) -> None:
    """Store the sequence of Prony terms or Maxwell elements in the attribute `name` of a frozen law as a tuple.

    Raises:
        InputError: if the attribute is anything else.
    """
    terms = getattr(law, name)
    if not isinstance(terms, Sequence) or not all(isinstance(term, kind) for term in terms):
        raise InputError(f"{name} = {terms!r}: expected a sequence of {kind.__name__}")
    object.__setattr__(law, name, tuple(terms))


def prony_array(prony: Sequence[Prony | Maxwell], context: Context, name: str = "prony") -> Array:
    """Copy the constants of the terms to the device."""
    values = np.array([term.constants for term in prony])
    return context.array(name, "Visco", context.types.parameters, values, per="table")


def at_once(prony: Sequence[Prony], context: Context) -> tuple[Array, Array]:
    """A time step of 1 s, and the Prony terms with relaxation times so long that nothing relaxes in that step."""
    slow = tuple(replace(term, time=AT_ONCE, exponent=0.0) for term in prony)
    one_second = context.array("one_second", "Visco", context.types.real, np.ones(1), per="table")
    return one_second, prony_array(slow, context, "prony_at_once")
