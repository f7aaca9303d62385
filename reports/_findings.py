"""What the numbers say, in sentences: is the paper's selector better than plain choice, and by more than chance?"""

from ._statistics import Difference, difference, interval, number, over_ratios, signed, summary
from ._study import FULL, Study, and_list, percent

BASELINES = ("uniform", "random")
SUBJECT = "maxmin"  # the paper's own selector; a study without it is told about its best one
HEADLINES = {
    "better": "is better than {baseline} on {scenes}",
    "worse": "is worse than {baseline} on {scenes}",
    "not told apart": "cannot be told apart from {baseline} by these seeds on {scenes}",
    "one sample": "was compared with {baseline} by a single sample on {scenes}",
    "no spread": "was compared with {baseline} by seeds that all give the same on {scenes}",
}
WORDS = {
    "better": "more than the seeds explain",
    "worse": "more than the seeds explain",
    "not told apart": "no more than the seeds explain",
    "one sample": "one sample, so no interval",
    "no spread": "the seeds give the same, so no interval",
}


def headline(study: Study) -> list[str]:
    """One sentence per baseline over all scenes: where the subject is better, worse, or not told apart."""
    subject = subject_of(study)
    if subject is None:
        return []
    sentences = []
    for baseline in BASELINES:
        scenes: dict[str, list[str]] = {}
        for backend, scene in study.panels():
            found = against(study, backend, scene, subject, baseline)
            if found is not None:
                words = f"{study.label(backend, scene)} ({_short_interval(found)})"
                scenes.setdefault(found.verdict, []).append(words)
        parts = [
            words.format(baseline=baseline, scenes=and_list(scenes[verdict]))
            for verdict, words in HEADLINES.items()
            if verdict in scenes
        ]
        if parts:
            sentences.append(f"{subject} {'; it '.join(parts)}.")
    return sentences


def details(study: Study) -> list[str]:
    """A few sentences per scene: the subject's score, the differences with intervals, the best, the full data."""
    subject = subject_of(study)
    panels = [panel for panel in study.panels() if subject is not None and study.asks(panel[0], subject)]
    return [_scene(study, backend, scene, str(subject)) for backend, scene in panels]


def subject_of(study: Study) -> str | None:
    """The selector that the findings are about; None where no selector has a score."""
    present = [name for name in study.selectors if study.find(selector=name)]
    if SUBJECT in present:
        return SUBJECT
    candidates = [name for name in present if name not in BASELINES] or present
    return max(candidates, key=lambda name: _mean(study, name), default=None)


def against(
    study: Study,
    backend: str,
    scene: str,
    selector: str,
    baseline: str,
    ratios: tuple[float, ...] | None = None,
) -> Difference | None:
    """Difference of PSNR in dB, averaged over `ratios` (all that the backend runs when left out).

    None where the two are the same or a side has no seed with a score at every ratio.
    """
    ratios = ratios or study.ratios_of(backend)
    ours = over_ratios(study.find(backend, scene, selector), ratios)
    theirs = over_ratios(study.find(backend, scene, baseline), ratios)
    return difference(ours, theirs) if ours and theirs and selector != baseline else None


def _scene(study: Study, backend: str, scene: str, subject: str) -> str:
    label = study.label(backend, scene)
    ratios = study.ratios_of(backend)
    samples = {name: over_ratios(study.find(backend, scene, name), ratios) for name in study.selectors}
    means = {name: summary(values).mean for name, values in samples.items() if values}
    if subject not in means:
        return f"{label}: {subject} lacks a score at some ratio, so nothing is concluded."
    averaged = f"on average over the ratios {and_list(map(percent, ratios))}"
    over = f"at a ratio of {percent(ratios[0])}" if len(ratios) == 1 else averaged
    sentences = [f"{label}: {subject} scores {number(means[subject], 2)} dB {over}."]
    for baseline in BASELINES:
        found = against(study, backend, scene, subject, baseline)
        if found is not None:
            sentences.append(f"Against {baseline}: {_with_interval(found)}, {WORDS[found.verdict]}.")
            sentences += _at_single_ratios(study, backend, scene, subject, baseline)
    ranked = sorted(means, key=lambda name: -means[name])
    if ranked[0] != subject:
        sentences.append(f"The highest mean is that of {ranked[0]}, {number(means[ranked[0]], 2)} dB.")
    elif len(ranked) > 1:
        sentences.append(f"Its mean is the highest; {ranked[1]} comes next with {number(means[ranked[1]], 2)} dB.")
    return " ".join(sentences + _against_full(study, backend, scene, subject))


def _at_single_ratios(study: Study, backend: str, scene: str, subject: str, baseline: str) -> list[str]:
    """Zero or one sentence: the differences at each ratio, where there are several."""
    ratios = study.ratios_of(backend)
    if len(ratios) < 2:
        return []
    found = [(ratio, against(study, backend, scene, subject, baseline, (ratio,))) for ratio in ratios]
    parts = [f"{interval(item)} at {percent(ratio)}" for ratio, item in found if item is not None]
    return [f"Ratio by ratio: {', '.join(parts)}."] if parts else []


def _short_interval(found: Difference) -> str:
    if found.low is None or found.high is None:
        return f"{signed(found.mean)} dB"
    return f"{signed(found.mean)} dB, {signed(found.low)} to {signed(found.high)}"


def _with_interval(found: Difference) -> str:
    if found.low is None or found.high is None:
        return f"{signed(found.mean)} dB"
    return f"{signed(found.mean)} dB (95 % interval {signed(found.low)} to {signed(found.high)})"


def _against_full(study: Study, backend: str, scene: str, subject: str) -> list[str]:
    """Zero or one sentence: the subject's largest ratio beside the models trained on all views."""
    ratio = study.ratios_of(backend)[-1]
    reference = study.find(backend, scene, FULL)
    full = [cell.psnr_db for cell in reference if cell.psnr_db is not None]
    scores = [cell.psnr_db for cell in study.find(backend, scene, subject, ratio) if cell.psnr_db is not None]
    if not full or not scores:
        return []
    gap = difference(scores, full)
    models = "one model" if len(full) == 1 else f"{len(full)} models"
    return [
        f"At {percent(ratio)} its difference to {models} trained on all {reference[0].count} views "
        f"({number(summary(full).mean, 2)} dB) is {_with_interval(gap)}."
    ]


def _mean(study: Study, selector: str) -> float:
    return summary([cell.psnr_db for cell in study.find(selector=selector) if cell.psnr_db is not None]).mean
