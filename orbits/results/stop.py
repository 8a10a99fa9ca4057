"""Why and where a run ended early."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from astropy import units as u

if TYPE_CHECKING:
    from orbits.system import System


@dataclass(frozen=True)
class Stop:
    """Why and where a run ended early.

    reason : in words; condition : the event or the condition that was met; None if the callback ended the run, or for
        a run that is read from an archive, which has the reason alone
    time : since the epoch, with unit; system : the state at that time
    """

    reason: str
    condition: Any
    time: u.Quantity
    system: System
