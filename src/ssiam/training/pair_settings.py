"""`PairSettings`: what the pairs of crops are like."""

from __future__ import annotations

from dataclasses import dataclass, field

from ssiam.errors import ArgumentError
from ssiam.training.augment import AugmentSettings
from ssiam.training.windows import WindowSettings


@dataclass(frozen=True)
class PairSettings:
    """What pairs are like.

    Threads: a value; any number of threads may share it.

    Attributes
    ----------
    reach : int
        Frames between the template's and the search crop's picture, at most.
    negatives : float
        Share 0..1 of pairs whose search crop does not show the target.
    beside, away : float
        Shares 0..1 of them that show another object of the same picture, where there is one, and
        another part of the same picture. The others show another track's target.
    recent : float
        Share 0..1 of batches whose pairs show the target a second time, as a tracker has seen it
        lately; in the others the template counts as recent, which saves its time.
    mistaken : float
        Share 0..1 of the pairs of those whose recent template shows a distractor instead.
    towards : float
        Share 0..1 of search crops that are shifted towards a distractor of the same picture.
    surroundings : float
        Share 0..1 of search crops beyond whose picture another track's picture is seen, and not
        only a colour.
    windows : WindowSettings
    augment : AugmentSettings

    Raises
    ------
    ArgumentError
        A share is none, or `reach` is negative.
    """

    reach: int = 100
    negatives: float = 0.12
    beside: float = 0.4
    away: float = 0.2
    recent: float = 0.0
    mistaken: float = 0.05
    towards: float = 0.0
    surroundings: float = 0.5
    windows: WindowSettings = field(default_factory=WindowSettings)
    augment: AugmentSettings = field(default_factory=AugmentSettings)

    def __post_init__(self) -> None:
        shares = "negatives", "beside", "away", "recent", "mistaken", "towards", "surroundings"
        for name in shares:
            if not 0 <= (value := getattr(self, name)) <= 1:
                raise ArgumentError(f"{name} {value} of pairs: give a share from 0 to 1")
        if self.beside + self.away > 1:
            raise ArgumentError("beside and away of pairs: together they are more than 1")
        if self.reach < 0:
            raise ArgumentError(f"reach {self.reach} of pairs: give 0 or more frames")
