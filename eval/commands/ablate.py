"""x"""

from dataclasses import dataclass


@dataclass
class Ablate:
    """x"""

    def __call__(self) -> None: ...
