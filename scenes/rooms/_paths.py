"""Camera paths: steered by hand (walk, dwell, pan, sprint, with jitter), and at constant speed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...common.errors import UserError
from ._exact import exp, length, smoothed
from ._types import RGB, Walk

FRAMES_PER_S, TEST_FRAMES_PER_S = 10.0, 1.0  # that are taken of a path, as the paper does
STEPS_PER_S = 60  # in which a path is steered; frames are taken from those
LOOK_S, PLACE_S = 0.28, 0.3  # over which direction and place are smoothed
JITTER_S = 0.5  # correlation time of a hand's jitter (Ornstein-Uhlenbeck)
JITTER = (0.012, 0.012, 0.012, 0.012, 0.012, 0.010)  # its deviation: metres, then parts of the unit direction
JITTER_SMOOTHED_S = 0.06
STRIDE_M, BOB_M = 0.7, 0.012  # a step's length and how far it lifts the camera
LOOK_SHARE = 0.45  # of a metre that the looked-at point moves, in a metre of the camera's own motion


@dataclass(frozen=True)
class Go:
    """Walk straight to a place, looking at a point, or ahead where it is None."""

    to: RGB
    speed: float  # metres a second; from about 1.5 on it is a sprint
    look: RGB | None = None


@dataclass(frozen=True)
class Stay:
    """Stand still for a time, looking at one point after the other."""

    seconds: float
    looks: tuple[RGB, ...]


def steered(events: Sequence[Go | Stay], start: RGB, seed: int, jitter: float = 1.0, look_s: float = LOOK_S) -> Walk:
    """A path as a person with a camera in hand goes it: the events in order, smoothed, with jitter and bobbing.

    `jitter` scales the deviation; `look_s` is the deviation in seconds of the Gaussian that smooths the direction, so
    the longer it is the slower the camera turns. The poses are STEPS_PER_S a second.
    """
    places, looks = _followed(events, np.array(start, dtype=np.float64))
    n = len(places)
    directions = looks - places
    directions = smoothed(_unit(directions), look_s * STEPS_PER_S)
    places = smoothed(places, PLACE_S * STEPS_PER_S)
    shake = smoothed(_jitter(n, seed, jitter), JITTER_SMOOTHED_S * STEPS_PER_S)
    speed = np.r_[0, np.linalg.norm(np.diff(places, axis=0), axis=1)] * STEPS_PER_S
    phase = np.cumsum(speed) / STEPS_PER_S * 2 * np.pi / STRIDE_M
    places = places + shake[:, :3]
    places[:, 2] += BOB_M * np.sin(phase) * np.minimum(speed, 1)
    return Walk(np.arange(n) / STEPS_PER_S, places, _unit(_unit(directions) + shake[:, 3:]))


def _followed(events: Sequence[Go | Stay], place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) places and looked-at points of the events, before any smoothing."""
    places: list[np.ndarray] = []
    looks: list[np.ndarray] = []
    for event in events:
        if isinstance(event, Go):
            way = np.array(event.to) - place
            n = max(2, int(length(way) / event.speed * STEPS_PER_S))
            ahead = way / length(way) * 2
            for share in np.linspace(0, 1, n, endpoint=False) + 1 / n:
                places.append(place + way * share)
                looks.append(np.array(event.look, float) if event.look else places[-1] + ahead + [0, 0, -0.35])
            place = np.array(event.to)
        else:
            n = int(event.seconds * STEPS_PER_S)
            for i in range(n):
                places.append(place)
                looks.append(np.array(event.looks[min(int(i / n * len(event.looks)), len(event.looks) - 1)], float))
    return np.array(places), np.array(looks)


def _jitter(n: int, seed: int, scale: float) -> np.ndarray:
    """(n, 6) of an Ornstein-Uhlenbeck process that starts at rest."""
    random = np.random.default_rng(seed)
    deviation = np.array(JITTER) * scale
    kept = exp(np.array([-1 / (STEPS_PER_S * JITTER_S)]))[0]
    state, states = np.zeros(6), np.zeros((n, 6))
    for i in range(n):
        state = kept * state + np.sqrt(1 - kept * kept) * deviation * random.normal(size=6)
        states[i] = state
    return states


def at_rate(walk: Walk, rate: float) -> Walk:
    """Of a steered path, `rate` poses a second."""
    chosen = np.arange(0, len(walk), STEPS_PER_S / rate).astype(int)
    return Walk(chosen / STEPS_PER_S, walk.positions[chosen], walk.directions[chosen])


def frames(walk: Walk, rate: float, count: int) -> Walk:
    """`count` poses of a steered path, evenly spread: of `rate` a second or, where those are too few, of all.

    Raises UserError where there are not so many.
    """
    slow = at_rate(walk, rate)
    if count > len(walk):
        raise UserError(f"the path has {len(walk)} poses, {STEPS_PER_S} a second; --frames {count} is more")
    return (slow if count <= len(slow) else walk).picked(count)


def constant_speed(stations: Sequence[tuple[RGB, RGB]], count: int, rate: float = FRAMES_PER_S) -> Walk:
    """A closed path through (place, looked-at point) `stations`, at one speed of both together, `rate` frames a second.

    Periodic cubic splines, as a robot or a careful operator goes.
    """
    from scipy.interpolate import CubicSpline

    places = np.array([place for place, _ in [*stations, stations[0]]], dtype=np.float64)
    looks = np.array([look for _, look in [*stations, stations[0]]], dtype=np.float64)
    knots = np.r_[0, np.cumsum(_moved(places, looks))]
    place, look = (CubicSpline(knots, values, bc_type="periodic") for values in (places, looks))
    fine = np.linspace(0, knots[-1], 20001)
    way = np.r_[0, np.cumsum(_moved(place(fine), look(fine)))]
    at = np.interp(np.linspace(0, way[-1], count, endpoint=False), way, fine)
    return Walk(np.arange(count) / rate, place(at), _unit(look(at) - place(at)))


def _moved(places: np.ndarray, looks: np.ndarray) -> np.ndarray:
    steps = (np.linalg.norm(np.diff(values, axis=0), axis=1) for values in (places, looks))
    return next(steps) + LOOK_SHARE * next(steps)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
