"""Names that become C symbols: identifiers of C and C++ that are keywords of neither."""

from __future__ import annotations

import re
from collections.abc import Iterable

from lie_codegen.errors import IdentifierError

_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*", re.ASCII)

#: C99, C11 and C23 keywords, C++20 keywords and alternative tokens, and main.
KEYWORDS = frozenset(
    """
    alignas alignof and and_eq asm atomic_cancel atomic_commit atomic_noexcept auto bitand bitor bool break case
    catch char char8_t char16_t char32_t class co_await co_return co_yield compl concept const const_cast consteval
    constexpr constinit continue decltype default delete do double dynamic_cast else enum explicit export extern
    false float for friend goto if inline int long main mutable namespace new noexcept not not_eq nullptr operator or
    or_eq private protected public reflexpr register reinterpret_cast requires restrict return short signed sizeof
    static static_assert static_cast struct switch synchronized template this thread_local throw true try typedef
    typeid typename typeof typeof_unqual union unsigned using virtual void volatile wchar_t while xor xor_eq
    """.split()
)


def unknown_keywords(where: str, unknown: Iterable[str], known: Iterable[str]) -> str:
    """What to say of keywords that a function does not have: the nearest that it has, or all."""
    from difflib import get_close_matches

    names = sorted(known)
    said = []
    for word in unknown:
        near = get_close_matches(word, names, n=2, cutoff=0.6)
        said.append(f"no option {word}" + (f"; did you mean {' or '.join(near)}?" if near else "."))
    return f"{where}: {', '.join(said)} It has {', '.join(names)}" if said else ""


def check_identifier(name: object, what: str) -> str:
    """Return `name` if it can be a C identifier, else raise.

    Letters, digits and underscores, a letter first (a leading underscore is reserved to the C
    implementation), no keyword of C or C++, 63 characters at most (C99 5.2.4.1).

    Raises:
        IdentifierError: naming `what` and the culprit.
    """
    if not isinstance(name, str):
        raise IdentifierError(f"{what} is a {type(name).__name__}, not a C identifier: give a text")
    if not _IDENTIFIER.fullmatch(name):
        raise IdentifierError(
            f"{what} {name!r} is not a C identifier: use letters, digits and underscores, a letter first"
        )
    if name in KEYWORDS:
        raise IdentifierError(f"{what} {name!r} is a keyword of C or C++: choose another name, {name}_ for instance")
    if len(name) > 63:
        raise IdentifierError(f"{what} {name!r} has {len(name)} characters: C99 promises 63")
    return name


def shown(value: object) -> str:
    """The repr of any value in one line, cut; an integer too long to be written is described."""
    try:
        text = " ".join(repr(value).split())
    except (ValueError, RecursionError):
        return f"a {type(value).__name__} too long to be shown"
    return text if len(text) <= 200 else f"{text[:200]}..."
