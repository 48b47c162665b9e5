"""LibrarySources: C text ready for the compiler, with what is to be known of it; plain data that travels as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lie_codegen.codegen.signature import Signature


@dataclass(frozen=True)
class LibrarySources:
    """What the runtime compiles: one unit that includes the package's own source.

    Attributes:
        namespace: prefix of every symbol.
        files: flat file name -> text.
        main: the file to hand to the compiler.
        statements: number of statements of the longest kernel, by which the runtime chooses the optimisation level.
        signatures: one a kernel.
        notes: what the build log says about them.
    """

    namespace: str
    files: Mapping[str, str]
    main: str
    statements: int
    signatures: tuple[Signature, ...]
    notes: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """As a JSON object."""
        return {
            "namespace": self.namespace,
            "files": dict(self.files),
            "main": self.main,
            "statements": self.statements,
            "signatures": [signature.to_json() for signature in self.signatures],
            "notes": list(self.notes),
        }

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> LibrarySources:
        """From a JSON object."""
        return LibrarySources(
            namespace=data["namespace"],
            files=dict(data["files"]),
            main=data["main"],
            statements=data["statements"],
            signatures=tuple(Signature.from_json(each) for each in data["signatures"]),
            notes=tuple(data["notes"]),
        )
