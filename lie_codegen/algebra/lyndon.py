"""Lyndon words and their brackets: a basis of the free Lie algebra, layer by layer.

A word is Lyndon if it is smaller than all its proper suffixes. Its bracket is [u, v] for the standard factorization
w = u v with v the longest proper suffix that is Lyndon; these brackets are a basis of the free Lie algebra (Chen, Fox,
Lyndon, Ann. Math. 68 (1958) 81), so their images span every layer of a Lie algebra that the letters generate.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

Word = tuple[int, ...]


@dataclass(frozen=True)
class BracketWord:
    """An iterated bracket of the controls.

    Attributes:
        word: positions of the letters, from left to right.
        left, right: the two brackets it is made of, None for a single letter.
        text: as it is written, as in "[w1, [w1, w2]]".
    """

    word: Word
    left: BracketWord | None
    right: BracketWord | None
    text: str

    @property
    def length(self) -> int:
        """Number of letters."""
        return len(self.word)

    def __str__(self) -> str:
        return self.text


def lyndon_words(letters: int, length: int) -> Iterator[Word]:
    """All Lyndon words of one length over the letters 0, 1, ..., in lexicographic order (Duval's algorithm)."""
    word = [-1]
    while word:
        word[-1] += 1
        if len(word) == length:
            yield tuple(word)
        period = len(word)
        while len(word) < length:
            word.append(word[-period])
        while word and word[-1] == letters - 1:
            word.pop()


def standard_factorization(word: Word) -> tuple[Word, Word]:
    """u, v with w = u v and v the longest proper suffix that is Lyndon (the smallest proper suffix)."""
    start = min(range(1, len(word)), key=lambda position: word[position:])
    return word[:start], word[start:]


def bracket_word(word: Word, labels: tuple[str, ...]) -> BracketWord:
    """The bracket of a Lyndon word, its letters named by the labels."""
    if len(word) == 1:
        return BracketWord(word, None, None, labels[word[0]])
    u, v = standard_factorization(word)
    left, right = bracket_word(u, labels), bracket_word(v, labels)
    return BracketWord(word, left, right, f"[{left}, {right}]")
