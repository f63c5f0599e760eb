"""Messages of the command in the words of Python: arguments instead of options, methods instead of commands."""

from __future__ import annotations

import re
from functools import cache

from . import _native

#: The commands that are methods, and those with a name of their own.
METHODS = (
    "calibrate", "check", "equations", "excite", "export", "generate", "identify", "inspect",
    "observe", "rehearse", "report", "simulate", "validate", "view",
)  # fmt: skip
_OTHERS = {"import": "Robot()", "base": "Robot.base", "info": "Robot()", "eval": "Robot.evaluate()", "new": "regen.new()"}

#: What the parser of options adds for those who type commands.
_USAGE = re.compile(r"\n\n(?:Usage: [^\n]*|For more information, try '--help'\.)")
#: A command between quotes, with options that follow it; or with its help.
_GIVEN = r"(?: --[a-z-]+(?:[= ][^\s`'-][^\s`']*)?)"
_COMMAND = re.compile(
    rf"(`|')(?:regen ([a-z]+)({_GIVEN}*)|([a-z]+)({_GIVEN}+))\1|\bregen ([a-z]+) --help\b"
)
#: An option, with the placeholder of the parser of options or with what may be its value.
_OPTION = re.compile(
    r"(?<![\w-])--([a-z][a-z0-9-]*)(?: <[^>]*>(?:\.\.\.)?|[= ]('[^']*'|\"[^\"]*\"|[^\s`'\"()]+))?"
)
_REPEATED = re.compile(r"\b(\w+)=\{([^{}]*)\} \1=\{")
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBERS = re.compile(rf"{_NUMBER}(?:,{_NUMBER})*")
_PLACEHOLDER = re.compile(r"[A-Z][A-Z_0-9]*(?:,[A-Z][A-Z_0-9]*)*")
#: Names with a part behind a colon or an equals sign, and names of files.
_TEXT = re.compile(r"[\w.*+/-]+(?:[=:][\w.,:*+/-]+)+|[\w./-]+\.(?:json|yaml|yml|csv|urdf|xml|html)")


@cache
def _known() -> dict[str, tuple[bool, bool, frozenset[str]]]:
    """Each option of a command: takes a value, may be repeated, the words that it takes."""
    found: dict[str, tuple[bool, bool, frozenset[str]]] = {}
    for command in (*METHODS, *_OTHERS):
        for name, takes, repeated, values, _ in _native.options(command):
            before = found.get(name, (False, False, frozenset()))
            found[name] = (takes or before[0], repeated or before[1], before[2] | set(values))
    return found


def spoken(message: str) -> str:
    """A message with ``--rest-speed 0.01`` as ``rest_speed=0.01``, and `` `regen identify` `` as a method."""
    text = _OPTION.sub(_argument, _COMMAND.sub(_method, _USAGE.sub("", message)))
    # an option that is repeated with NAME=VALUE is one dict
    while (merged := _REPEATED.sub(r"\1={\2, ", text)) != text:
        text = merged
    return text


def _method(match: re.Match[str]) -> str:
    name, options = match[2] or match[4] or match[6], match[3] or match[5] or ""
    method = f"Robot.{name}()" if name in METHODS else _OTHERS.get(name)
    if method is None:
        return match[0]
    quote = match[1] or ""
    if match[6] or options == " --help":
        return f"{quote}help(regen.{method.removesuffix('()')}){quote}"
    arguments = _OPTION.sub(_argument, options).strip()
    # an option whose value is left open
    arguments = re.sub(r"`(\w+)`", r"\1=...", arguments)
    if arguments and not method.endswith("()"):
        return match[0]
    return f"{quote}{method.removesuffix(')') + arguments + ')' if arguments else method}{quote}"


def _argument(match: re.Match[str]) -> str:
    name, text = match[1], match[2] or ""
    if name not in _known():
        return match[0]
    takes, repeated, words = _known()[name]
    own = name.replace("-", "_")
    # a keyword of Python cannot be an argument
    own = {"from": "factors"}.get(own, own)
    value = text.rstrip(".,:;")
    rest = match[0][len(match[0]) - (len(text) - len(value)) :] if len(text) > len(value) else ""
    shown = _value(value, repeated, words) if takes and value else None
    if shown is not None:
        return f"{own}={shown}{rest}"
    behind = "" if match[2] is None else match[0][2 + len(name) :]
    quoted = match.string[match.start() - 1 : match.start()] in ("`", "'", '"')
    if not takes:
        return (own if quoted and not behind else f"{own}=True") + behind
    return (own if quoted else f"`{own}`") + behind


def _value(text: str, repeated: bool, words: frozenset[str]) -> str | None:
    """A value as Python writes it; None where the text is only the next word of the sentence."""
    if text[0] in "'\"":
        return repr(text[1:-1])
    if _NUMBERS.fullmatch(text):
        return f"({text.replace(',', ', ')})" if "," in text else text
    if text in words:
        return repr(text)
    if _PLACEHOLDER.fullmatch(text):
        return f"({text.replace(',', ', ')})" if "," in text else text
    if not _TEXT.fullmatch(text):
        return None
    name, equals, value = text.partition("=")
    if repeated and equals:
        is_plain = _NUMBERS.fullmatch(value) and "," not in value
        return f"{{{name!r}: {value if is_plain else repr(value)}}}"
    return repr(text)
