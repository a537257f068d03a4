"""`ssiam train`: train the small tracker's network from a config."""

from __future__ import annotations

from pathlib import Path

from ssiam.errors import MissingExtraError


def train(config: Path, /, *, out: Path | None = None, so_far: Path | None = None) -> None:
    """Train the small tracker.

    Start the same command after an interruption, and it goes on from its last checkpoint. At the
    end the folder holds weights.pth and the .onnx files that the tracker runs.

    Parameters
    ----------
    config
        TOML file; configs/lite.toml shows all there is. Paths in it start from the current
        folder.
    out
        Folder of checkpoint, metrics and network; by default runs/NAME, after the config.
    so_far
        Do not train: write what the run has learnt up to now to this folder, to try it.
    """
    try:
        import ssiam.networks  # noqa: F401
    except MissingExtraError as error:
        raise MissingExtraError(
            "PyTorch is not installed, which training needs: pip install 'ssiam[train]'"
        ) from error
    from ssiam.training.checkpoints import CHECKPOINT, check_run_outputs, write_network_so_far
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
    run(settings, training_batches(settings), folder, _show)


def _show(step: int, values: dict[str, float]) -> None:
    print(
        f"{step}: " + ", ".join(f"{name} {value:.4g}" for name, value in values.items()), flush=True
    )
