"""`ssiam train`: train the network of the lite tracker from a config file."""

from __future__ import annotations

from pathlib import Path

from ssiam.cli.options import report_leftover_parts
from ssiam.errors import MissingExtraError


def train(config: Path, /, *, out: Path | None = None, so_far: Path | None = None) -> None:
    """Train the network of the lite tracker.

    After an interruption, start the same command again to continue from the last checkpoint. At the
    end the output folder contains weights.pth and the .onnx files, for --weights of ssiam track.

    Parameters
    ----------
    config
        TOML file; configs/lite.toml shows all settings. Its paths are relative to the current
        folder.
    out
        Folder for checkpoint, metrics and network; by default runs/NAME for a config NAME.toml.
    so_far
        Do not train. Write the network of the last checkpoint to this folder, to test it.
    """
    try:
        import ssiam.networks  # noqa: F401
    except MissingExtraError as error:
        raise MissingExtraError("training needs PyTorch: pip install 'ssiam[train]'") from error
    from ssiam.training.checkpoints import (
        CHECKPOINT,
        check_run_outputs,
        leftovers,
        write_network_so_far,
    )
    from ssiam.training.config import read_config
    from ssiam.training.trainer import train as run
    from ssiam.training.trainer import training_batches

    settings = read_config(config)
    folder = out or Path("runs") / config.stem
    inputs = [("the config", config)]
    if so_far is not None:
        inputs.append(("the run", folder / CHECKPOINT))
        check_run_outputs(settings, "--so-far", so_far, inputs)
        step = write_network_so_far(settings, folder, so_far)
        print(f"{so_far}: {step} of {settings.steps} steps")
        return
    check_run_outputs(settings, "--out", folder, inputs)
    report_leftover_parts(leftovers(folder))
    run(settings, training_batches(settings), folder, _print_metrics)


def _print_metrics(step: int, values: dict[str, float]) -> None:
    print(
        f"{step}: " + ", ".join(f"{name} {value:.4g}" for name, value in values.items()), flush=True
    )
