"""The namelist that a result file carries, as dictionaries.

It reads what Rodyn writes (`resolved_input`): groups, scalars, arrays with repeat counts, texts, logicals, comments.
"""

from __future__ import annotations

import re
from typing import Any

Group = dict[str, Any]

TOKEN = re.compile(
    r"""(?P<comment>![^\n]*)
      | (?P<text>'(?:[^']|'')*'|"(?:[^"]|"")*")
      | (?P<group>&\w+)
      | (?P<end>/)
      | (?P<key>[A-Za-z_]\w*)\s*(?P<index>\(\s*\d+\s*\))?\s*=
      | (?P<repeat>\d+)\*
      | (?P<value>[^\s,/!'"=*&]+)
      | (?P<space>[\s,]+)""",
    re.VERBOSE,
)


def read_namelist(text: str) -> dict[str, list[Group]]:
    """Groups by name, each as often as it occurs."""
    groups: dict[str, list[Group]] = {}
    group: Group | None = None
    key, repeat = "", 1
    for token in TOKEN.finditer(text):
        kind = token.lastgroup if token.lastgroup != "index" else "key"
        if kind == "group":
            group = {}
            groups.setdefault(token[0][1:].lower(), []).append(group)
        elif kind == "end":
            group = None
        elif group is None:
            continue
        elif kind == "key":
            key = token["key"].lower()
            group[key] = []
        elif kind == "repeat":
            repeat = int(token["repeat"])
        elif kind in ("text", "value") and key:
            group[key].extend([_value(token[0])] * repeat)
            repeat = 1
    return {name: [_scalars(g) for g in found] for name, found in groups.items()}


def _scalars(group: Group) -> Group:
    return {key: values[0] if len(values) == 1 else values for key, values in group.items()}


def _value(text: str) -> Any:
    if text[0] in "'\"":
        return text[1:-1].replace(text[0] * 2, text[0])
    if text.strip(".").lower() in ("true", "t", "false", "f"):
        return text.strip(".").lower()[0] == "t"
    try:
        return int(text)
    except ValueError:
        pass
    try:
        return float(re.sub("[dD]", "E", text))
    except ValueError:
        return text
