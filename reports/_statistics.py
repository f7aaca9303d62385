"""Means over seeds and differences of means, with an uncertainty that does not pretend.

Choices with equal seed numbers share no randomness, and trainings with equal seed numbers start alike but on other
views, so differences are not paired by seed: the two groups are compared by Welch's t interval, as independent ones. A
group of one sample has no spread, and a difference with such a group has no interval.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from ._study import Cell

LEVEL = 0.95  # of the intervals


@dataclass(frozen=True)
class Summary:
    """n samples; `std` is the sample standard deviation, None for a single sample."""

    mean: float
    std: float | None
    n: int

    @property
    def variance_of_mean(self) -> float:
        """std² / n, the square of the mean's standard error; 0 of a single sample, which says nothing of it."""
        return 0.0 if self.std is None else self.std**2 / self.n


@dataclass(frozen=True)
class Difference:
    """Difference of two means with its 95 % interval; the bounds are None where a group has one sample."""

    mean: float
    low: float | None
    high: float | None
    reason: str = "one sample"  # why there is no interval

    @property
    def verdict(self) -> str:
        """ "better", "worse", "not told apart", or where no interval can be given "one sample" or "no spread"."""
        if self.low is None or self.high is None:
            return self.reason
        return "better" if self.low > 0 else "worse" if self.high < 0 else "not told apart"


def summary(values: Sequence[float]) -> Summary:
    """Mean and sample standard deviation (divisor n - 1). Raises ValueError for no values."""
    n = len(values)
    if n == 0:
        raise ValueError("no values to summarise")
    mean = math.fsum(values) / n
    std = math.sqrt(math.fsum((value - mean) ** 2 for value in values) / (n - 1)) if n > 1 else None
    return Summary(mean, std, n)


def difference(ours: Sequence[float], theirs: Sequence[float]) -> Difference:
    """mean(ours) - mean(theirs) with Welch's interval: se² = s₁²/n₁ + s₂²/n₂ and the t quantile at
    df = se⁴ / (s₁⁴/(n₁²(n₁-1)) + s₂⁴/(n₂²(n₂-1)))."""
    a, b = summary(ours), summary(theirs)
    mean = a.mean - b.mean
    if a.std is None or b.std is None:
        return Difference(mean, None, None)
    va, vb = a.variance_of_mean, b.variance_of_mean
    if va + vb == 0:  # whatever repeated here repeated nothing
        return Difference(mean, None, None, "no spread")
    from scipy.special import stdtrit

    freedom = (va + vb) ** 2 / (va**2 / (a.n - 1) + vb**2 / (b.n - 1))
    half = float(stdtrit(freedom, 0.5 + LEVEL / 2)) * math.sqrt(va + vb)
    return Difference(mean, mean - half, mean + half)


def over_samples(values: Sequence[float], least: float = 0.0) -> Difference:
    """The mean of differences that are one sample each, with Student's interval (n − 1 degrees of freedom).

    `least` is a standard error of the mean that is known from elsewhere, as from what each sample was averaged of:
    where the samples happen to lie closer together than that, it stands in.
    """
    found = summary(values)
    if found.std is None:
        return Difference(found.mean, None, None)
    error = max(math.sqrt(found.variance_of_mean), least)
    if error == 0:
        return Difference(found.mean, None, None, "no spread")
    from scipy.special import stdtrit

    half = float(stdtrit(found.n - 1, 0.5 + LEVEL / 2)) * error
    return Difference(found.mean, found.mean - half, found.mean + half)


def over_ratios(cells: Sequence[Cell], ratios: Sequence[float]) -> list[float]:
    """PSNR in dB of each seed, averaged over `ratios`; a seed that lacks one of them is left out.

    The seed is the unit that repeats: cells of one seed at several ratios may share their first picks.
    """
    by_seed: dict[int, dict[float, float]] = {}
    for cell in cells:
        if cell.psnr_db is not None:
            by_seed.setdefault(cell.seed, {})[cell.ratio] = cell.psnr_db
    complete = (found for _, found in sorted(by_seed.items()) if all(ratio in found for ratio in ratios))
    return [math.fsum(found[ratio] for ratio in ratios) / len(ratios) for found in complete]


def usual_n(summaries: Iterable[Summary]) -> int:
    """The number of samples that most groups have (the larger one on a tie); 0 for no groups."""
    counts = [item.n for item in summaries]
    return max(counts, key=lambda n: (counts.count(n), n), default=0)


def with_spread(item: Summary, digits: int, expected: int) -> str:
    """ "20.91 ± 0.12", "20.91" for one sample; "(n = 2)" is added where some of the `expected` samples are missing."""
    if item.std is None:
        return number(item.mean, digits)
    missing = f" (n = {item.n})" if item.n != expected else ""
    return f"{number(item.mean, digits)} ± {number(item.std, digits)}{missing}"


def number(value: float, digits: int) -> str:
    """Fixed digits, with a true minus sign."""
    return f"{value:.{digits}f}".replace("-", "−")


def signed(value: float, digits: int = 2) -> str:
    """As `number`, with its sign always shown."""
    return f"{value:+.{digits}f}".replace("-", "−")


def interval(item: Difference) -> str:
    """ "+0.52 (+0.20 to +0.84)", or the mean alone where there is no interval."""
    if item.low is None or item.high is None:
        return signed(item.mean)
    return f"{signed(item.mean)} ({signed(item.low)} to {signed(item.high)})"
