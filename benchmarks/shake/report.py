"""Markdown tables of the runs of benchmarks/shake/run.py."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence

from benchmarks.shake.records import NO_SHAKE, Runs, ShakeRun
from ssiam.datasets.shake.path import SHAKE_KINDS
from ssiam.evaluation.measures.compare import paired_difference

TRUE_MOTION = "predict, true motion"
MODELS = {f"predict, {model}": model for model in ("similarity", "homography", "mesh")}
MAIN = ("off", "paper", "literal", "predict", TRUE_MOTION)
KINDS = ("white", "handheld")  # summed in the first table and in the plot


def report(runs: Runs, ablate: str) -> str:
    """All tables as Markdown; `ablate` is the tracker of the last one."""
    parts = [
        f"{len(runs)} runs, {sum(run.frames for run in runs)} frames, "
        f"{sum(run.seconds for run in runs) / 3600:.2f} hours of one core.",
        f"Lost targets, {' and '.join(KINDS)} summed:",
        table(lost_rows(runs)),
        "The same runs, differences by sequence, bootstrap 95 % interval:",
        table(paired_rows(runs)),
        f"Lost targets of {ablate} by kind of shake, all strengths summed:",
        table(kind_rows([run for run in runs if run.tracker == ablate])),
    ]
    if any(run.setting in MODELS for run in runs):
        parts += ["Models of the camera motion against predict's:", table(model_rows(runs))]
    return "\n\n".join(parts)


def table(rows: Iterator[Sequence[object]]) -> str:
    """Rows as Markdown; the first one is the head."""
    lines = ["| " + " | ".join(map(str, row)) + " |" for row in rows]
    return "\n".join([lines[0], "|---" * (lines[0].count("|") - 1) + "|", *lines[1:]])


def comparable(runs: Runs, settings: Sequence[str]) -> list[ShakeRun]:
    """Runs in these settings on the shaken sequences that all settings of a tracker have."""
    kept: list[ShakeRun] = []
    chosen = [run for run in runs if run.setting in settings]
    for own in by(chosen, lambda run: run.tracker).values():
        groups = by(own, lambda run: run.setting).values()
        common = set.intersection(*({run.shaken for run in group} for group in groups))
        kept += [run for run in own if run.shaken in common]
    return kept


def by(runs: Runs, key: Callable[[ShakeRun], str]) -> dict[str, list[ShakeRun]]:
    """Runs grouped by a key."""
    groups: dict[str, list[ShakeRun]] = defaultdict(list)
    for run in runs:
        groups[key(run)].append(run)
    return groups


def lost_rows(runs: Runs) -> Iterator[Sequence[object]]:
    """Lost targets: a row per tracker, strength and setting."""
    yield (
        *("tracker", "shake", "setting", "lost", "of off", "of paper", "per 1000 frames"),
        *("accuracy", "with burn-in", "success", "reported lost"),
    )
    listed = [run for run in comparable(runs, MAIN) if run.kind in (NO_SHAKE, *KINDS)]
    for tracker, own in by(listed, lambda run: run.tracker).items():
        for strength in sorted({run.strength for run in own}):
            group = [run for run in own if run.strength == strength]
            settings = by(group, lambda run: run.setting)
            for setting in ordered(settings):
                ratios = [_ratio(settings[setting], settings.get(s)) for s in ("off", "paper")]
                here = settings[setting]
                head = tracker, f"{100 * strength:g} %", setting, lost(here), *ratios
                yield (*head, f"{per_1000(here):.2f}", *_quality(here))


def ordered(settings: dict[str, list[ShakeRun]]) -> list[str]:
    """Names of settings, the main ones first."""
    return sorted(settings, key=lambda s: (MAIN.index(s) if s in MAIN else len(MAIN), s))


def lost(runs: Runs) -> int:
    """Number of lost targets of all runs."""
    return sum(run.lost for run in runs)


def per_1000(runs: Runs) -> float:
    """Lost targets per 1000 frames."""
    return 1000 * lost(runs) / sum(run.frames for run in runs)


def _ratio(runs: Runs, others: Runs | None) -> str:
    return f"{lost(runs) / lost(others):.2f}" if others and lost(others) else "-"


def _quality(runs: Runs) -> list[str]:
    """Accuracy without and with burn-in, success, share of the frames reported as lost."""
    settled = sum(run.settled_overlap for run in runs), sum(run.settled for run in runs)
    counted = sum(run.overlap for run in runs), sum(run.counted for run in runs)
    known = [run.success for run in runs if run.success is not None]
    reported = sum(run.reported_lost for run in runs), sum(run.tracked for run in runs)
    means = [*settled], [*counted], [sum(known), len(known)]
    cells = [f"{part / whole:.3f}" if whole else "-" for part, whole in means]
    return [*cells, f"{100 * reported[0] / reported[1]:.1f} %" if reported[1] else "-"]


def kind_rows(runs: Runs) -> Iterator[Sequence[object]]:
    """Lost targets: a row per setting, a column per kind of shake."""
    every = comparable(runs, [*{run.setting for run in runs}])
    kinds = [kind for kind in (NO_SHAKE, *SHAKE_KINDS) if any(run.kind == kind for run in every)]
    yield ("setting", *kinds, "all", "accuracy", "with burn-in", "success", "reported lost")
    settings = by(every, lambda run: run.setting)
    for setting in ordered(settings):
        kind = by(settings[setting], lambda run: run.kind)
        cells = [lost(kind[name]) for name in kinds]
        yield (setting, *cells, lost(settings[setting]), *_quality(settings[setting]))


def paired_rows(runs: Runs) -> Iterator[Sequence[object]]:
    """Lost targets and success of "predict" minus other settings, by tracker and strength."""
    yield ("tracker", "shake", "difference", "lost targets", "success", "sequences")
    listed = [run for run in comparable(runs, MAIN) if run.kind in (NO_SHAKE, *KINDS)]
    for tracker, own in by(listed, lambda run: run.tracker).items():
        for strength in sorted({run.strength for run in own}):
            group = by([run for run in own if run.strength == strength], lambda run: run.setting)
            for other in ("off", "paper"):
                if other in group and "predict" in group:
                    cells = differences(group["predict"], group[other])
                    yield (tracker, f"{100 * strength:g} %", f"predict - {other}", *cells)


def model_rows(runs: Runs) -> Iterator[Sequence[object]]:
    """Lost targets, success and time of predict with other models of the camera motion."""
    yield ("tracker", "shake", "model", "lost", "success", "lost, difference", "success", "time")
    names = ("predict", *MODELS)
    for tracker, own in by(comparable(runs, names), lambda run: run.tracker).items():
        for strength in sorted({run.strength for run in own}):
            group = by([run for run in own if run.strength == strength], lambda run: run.setting)
            base = group["predict"]
            for setting in ordered(group):
                here = group[setting]
                head = (
                    tracker,
                    f"{100 * strength:g} %",
                    setting,
                    lost(here),
                    f"{_success(here):.3f}",
                )
                time = sum(run.seconds for run in here) / sum(run.seconds for run in base)
                cells = ("-", "-") if here is base else differences(here, base)[:2]
                yield (*head, *cells, f"{time:.2f}")


def differences(runs: Runs, others: Runs) -> list[object]:
    """Cells: difference of lost targets, difference of mean success, number of sequences."""
    first, second = (by(each, lambda run: run.sequence) for each in (runs, others))
    found = paired_difference(
        {name: lost(group) for name, group in first.items()},
        {name: lost(group) for name, group in second.items()},
        over="sum",
    )
    cells: list[object] = [f"{found.value:+.0f} [{found.low:+.0f}, {found.high:+.0f}]"]
    if math.isnan(_success(runs) + _success(others)):
        return [*cells, "-", found.sequences]
    gain = paired_difference(
        {name: _success(group) for name, group in first.items()},
        {name: _success(group) for name, group in second.items()},
    )
    return [*cells, f"{gain.value:+.3f} [{gain.low:+.3f}, {gain.high:+.3f}]", found.sequences]


def _success(runs: Runs) -> float:
    """Mean success; nan if a run has none."""
    values = [math.nan if run.success is None else run.success for run in runs]
    return sum(values) / len(values)
