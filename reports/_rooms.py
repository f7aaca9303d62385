"""Differences to plain choice with rooms as the sample: what holds over rooms of such a kind.

A mixed model of the differences with a random effect of the room gives the same mean and, with n − 1 degrees of freedom
and where it finds a spread between rooms, the same interval. Where it finds none, so that the rooms lie closer together
than their seeds explain, the interval is by the seeds' error instead of by that luck.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from . import _findings
from ._statistics import Difference, interval, over_ratios, over_samples, summary
from ._study import Study, in_order

LEAST = 2  # rooms: fewer are no sample
ALL = ""  # in place of a walk's name
WORDS = {
    "better": "is better than {baseline}",
    "worse": "is worse than {baseline}",
    "not told apart": "cannot be told apart from {baseline}",
    "one sample": "was compared with {baseline} in a single one",
    "no spread": "differs from {baseline} by the same in each",
}
VERDICTS = ("better", "not told apart", "worse")  # of a scene by its seeds: wins, level, losses


@dataclass(frozen=True)
class OverRooms:
    """What one selector gains over a baseline, in dB, room by room."""

    rooms: dict[str, float]  # the mean over the room's scenes
    mean: Difference  # over rooms, each counted once, with the interval that rooms give
    counts: tuple[int, int, int]  # scenes that it wins, that the seeds cannot tell apart, that it loses

    @property
    def left_out(self) -> tuple[float, float]:
        """The lowest and the highest mean when one room is left out."""
        total, n = math.fsum(self.rooms.values()), len(self.rooms)
        means = [(total - value) / (n - 1) for value in self.rooms.values()]
        return min(means), max(means)


def groups(study: Study) -> dict[str, dict[str, str]]:
    """The scenes to take together, and the room of each: all, then those of each walk where there are several.

    A group of scenes in a single room is left out.
    """
    scenes = {scene: study.scene(scene) for scene in study.scenes if any(cell.scene == scene for cell in study.done)}
    walks = in_order(info.walk for info in scenes.values() if info.walk)
    found = {ALL: {scene: info.room for scene, info in scenes.items()}}
    for walk in walks if len(walks) > 1 else ():
        found[walk] = {scene: info.room for scene, info in scenes.items() if info.walk == walk}
    return {name: rooms for name, rooms in found.items() if len(set(rooms.values())) >= LEAST}


def headline(study: Study) -> list[str]:
    """One sentence a backend and baseline about the study's subject over rooms; none for a study in a single room."""
    subject, found = _findings.subject_of(study), groups(study)
    if subject is None or ALL not in found:
        return []
    sentences = []
    for backend in study.backends:
        for baseline in _findings.BASELINES:
            means = {
                walk: item
                for walk, rooms in found.items()
                if (item := over_rooms(study, rooms, backend, subject, baseline, study.ratios_of(backend)))
            }
            if ALL in means:
                total, number = means.pop(ALL).mean, len(set(found[ALL].values()))
                walks = "".join(f"; {walk} walks {interval(item.mean)}" for walk, item in means.items())
                who = subject if len(study.backends) == 1 else f"{subject} ({backend})"
                words = WORDS[total.verdict].format(baseline=baseline)
                sentences.append(f"Over {number} rooms {who} {words}: {interval(total)} dB{walks}.")
    return sentences


def over_rooms(
    study: Study, rooms: Mapping[str, str], backend: str, selector: str, baseline: str, ratios: Sequence[float]
) -> OverRooms | None:
    """The differences of mean PSNR in dB, averaged over `ratios`, then over the scenes of each room, then over rooms.

    `rooms` has the room of each scene that counts. None where fewer than two rooms have both sides.
    """
    found: dict[str, list[float]] = {}
    variances: dict[str, list[float]] = {}
    verdicts: list[str] = []
    for scene in study.scenes:
        if scene in rooms and (item := _findings.against(study, backend, scene, selector, baseline, tuple(ratios))):
            found.setdefault(rooms[scene], []).append(item.mean)
            sides = (over_ratios(study.find(backend, scene, name), ratios) for name in (selector, baseline))
            variances.setdefault(rooms[scene], []).append(math.fsum(summary(side).variance_of_mean for side in sides))
            verdicts.append(item.verdict)
    if len(found) < LEAST:
        return None
    means = {room: math.fsum(values) / len(values) for room, values in found.items()}
    counts = [sum(verdict == word for verdict in verdicts) for word in VERDICTS]
    counts[1] = len(verdicts) - counts[0] - counts[2]  # a single sample tells nothing either
    of_rooms = (math.fsum(values) / len(values) ** 2 for values in variances.values())
    by_seeds = math.sqrt(math.fsum(of_rooms)) / len(means)
    return OverRooms(means, over_samples(list(means.values()), by_seeds), (counts[0], counts[1], counts[2]))
