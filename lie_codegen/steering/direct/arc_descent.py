"""Words of arcs made shorter: the descent on a word, empty arcs and whole turns left out, arcs added and taken away."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.direct.arc_words import with_one_less, with_one_more
from lie_codegen.steering.direct.assemble import Manoeuvre, programme_of
from lie_codegen.steering.direct.programme import Goal, Machine, Programme, Settings
from lie_codegen.steering.direct.search import threshold

_GONE = 1e-9
#: Times that arcs are added, the relative gain below which that ends, and the loss that an arc less may cost.
_MOST_MORE, _GAIN, _SAME = 6, 1e-8, 1e-9


#: (duration, word, durations of its arcs with the free motions at the ends, which of the goal's values).
Candidate = tuple[float, Array, Array, int]


@dataclass(frozen=True)
class WordDescent:
    """What shortens words of arcs.

    Attributes:
        arcs: the manoeuvre, of one control an arc: its duration.
        solver: compiled or not.
        velocities: (letters, n) constant body velocities.
        limits: (letters,) times after which exp(s V) comes back; `longest` where it never does.
        settings: of the solver.
        longest: arc.
    """

    arcs: Manoeuvre
    solver: Machine
    velocities: Array
    limits: Array
    settings: Settings
    longest: float

    def sharpened(self, candidate: Candidate) -> Candidate:
        """The candidate, descended on its own word until nothing is gained."""
        total, word, u, variant = candidate
        fine = replace(self.settings, relative=1e-14, descend_iterations=2 * self.settings.descend_iterations)
        programme = self.programme(word[None])
        lower = self.solver.descend(programme, self.arcs.goal(np.array([variant])), u[None], fine)
        shorter, durations, size = self.tidied(word, lower.u[0], variant)
        now = float(np.sum(self.arcs.own(durations)))
        better = size <= threshold(self.arcs, self.settings) and now < total
        return (now, shorter, durations, variant) if better else candidate

    def with_other_arcs(self, candidate: Candidate) -> Candidate:
        """The candidate, with arcs between its own as long as that makes it shorter, then without those that do not matter.

        A word is extremal if no letter, begun with zero length at any time, shortens it (Pontryagin's maximum principle: <mu(t), V> <= 1 for
        all letters V). Every letter is tried before, in the middle of, and after each arc; the descent gives length to what helps.
        """

        def best_of(words: Array, lengths: Array) -> Candidate | None:
            before, after = self.arcs.free_slots
            u, variant = candidate[2], candidate[3]
            ends = [np.repeat(side[None], len(words), 0) for side in (u[:before], u[len(u) - after :])]
            programme = self.programme(words)
            goal = self.arcs.goal(np.full(len(words), variant))
            first = np.concatenate([ends[0], lengths[..., None], ends[1]], axis=1)
            near = self.solver.reach(programme, goal, first, replace(self.settings, damping=1e-9))
            lower = self.solver.descend(programme, goal, near.u, self.settings)
            costs = np.where(lower.size <= threshold(self.arcs, self.settings), lower.cost, np.inf)
            lane = int(np.argmin(costs))
            if not np.isfinite(costs[lane]):
                return None
            found = (float(costs[lane]), words[lane], lower.u[lane], variant)
            word, durations, size = self.tidied(*found[1:])
            tidy = (float(np.sum(self.arcs.own(durations))), word, durations, variant)
            tidy = self.sharpened(tidy)
            return tidy if size <= threshold(self.arcs, self.settings) else None

        for _ in range(_MOST_MORE):
            words, lengths = with_one_more(candidate[1], self.arcs.own(candidate[2])[:, 0], len(self.velocities))
            other = best_of(words, lengths) if len(words) else None
            if other is None or not other[0] < candidate[0] * (1 - _GAIN):
                break
            candidate = other
        while len(candidate[1]) > 1:
            other = best_of(*with_one_less(candidate[1], self.arcs.own(candidate[2])[:, 0]))
            if other is None or not other[0] <= candidate[0] * (1 + _SAME) or len(other[1]) >= len(candidate[1]):
                break
            candidate = other
        return candidate

    def programme(self, words: Array) -> Programme:
        """Arcs as exponentials of one control each, their duration."""
        lanes, count = words.shape
        table = (np.zeros_like(self.velocities), self.velocities[:, None], np.zeros(count, int))
        limited = replace(self.arcs, high=np.full(1, self.longest))
        programme = programme_of(limited, table, np.arange(count), np.tile([1.0, 0.0], (count, 1)), np.ones(count))
        entry = np.repeat(programme.entry, lanes, axis=0)
        before = self.arcs.free_slots[0]
        entry[:, before : before + count] = words
        return replace(programme, entry=entry)

    def tidied(self, word: Array, u: Array, variant: int) -> tuple[Array, Array, float]:
        """The word without empty arcs, full turns and repeated letters, brought to the goal again; the residual."""
        before, after = self.arcs.free_slots
        durations = self.arcs.own(u)[:, 0]
        # exp(s V) of a letter that comes back after the time `limits` does not change when whole turns are left out
        turns = self.limits[word] < self.longest
        durations = np.where(turns, np.mod(durations, np.where(turns, self.limits[word], 1.0)), durations)
        durations = np.where(turns & (self.limits[word] - durations < _GONE), 0.0, durations)
        letters: list[int] = []
        lengths: list[float] = []
        for letter, length in zip(word, durations, strict=True):
            if length <= _GONE:
                continue
            if letters and letters[-1] == letter:
                lengths[-1] += length
            else:
                letters.append(int(letter))
                lengths.append(float(length))
        if not letters:
            letters, lengths = [int(word[0])], [0.0]
        kept = np.array(letters)
        short = np.concatenate([u[:before], np.array(lengths)[:, None], u[len(u) - after :]])
        programme = self.programme(kept[None])
        goal: Goal = self.arcs.goal(np.array([variant]))
        found = self.solver.reach(
            programme, goal, short[None], replace(self.settings, damping=1e-9, reach_iterations=12)
        )
        return kept, found.u[0], float(found.size[0])
