# SPDX-License-Identifier: Apache-2.0
"""Python's values -> TOML, as settings of a graph and properties of a scene are given to the library."""

from __future__ import annotations

import json
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """Numbers and arrays of numpy as Python's own."""
    return value.tolist() if isinstance(value, (np.generic, np.ndarray)) else value


def toml(value: Any) -> str:
    value = plain(value)
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml(element) for element in value) + "]"
    if isinstance(value, float) and not np.isfinite(value):
        return repr(value)  # nan, inf, -inf, as TOML has them
    return json.dumps(value, ensure_ascii=False)
