"""`ssiam train`: train the network of the lite tracker from a config file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ssiam.cli.options import report_leftover_parts
from ssiam.errors import MissingExtraError

if TYPE_CHECKING:
    from ssiam.training.settings import TrainSettings


def train(
    config: Path,
    /,
    *,
    out: Path | None = None,
    so_far: Path | None = None,
    device: Literal["cpu", "cuda"] = "cpu",
    pack: Path | None = None,
    megabytes: float = 40.0,
) -> None:
    """Train the network of the lite tracker.

    After an interruption, start the same command again to continue from the last checkpoint. At the
    end the output folder contains weights.pth and the .onnx files, for --weights of ssiam track.

    Parameters
    ----------
    config
        TOML file; configs/lite.toml shows all settings. Its paths are relative to the current
        folder, those in the config of a pack to its folder.
    out
        Folder for checkpoint, metrics and network; by default runs/NAME for a config NAME.toml.
    so_far
        Do not train. Write the network of the last checkpoint to this folder, to test it.
    device
        Device that trains the network. A checkpoint can be resumed on any device. Processes of
        the CPU draw the pairs and run the teachers: set workers in the config.
    pack
        Do not train. Write crops of the training data, the held-out sequences and the weights of
        the config to this new folder, with a config.toml that trains from them on another machine.
    megabytes
        Maximum size of the pack's files, in 10^6 bytes.
    """
    try:
        import ssiam.networks  # noqa: F401
    except MissingExtraError as error:
        raise MissingExtraError("training needs PyTorch: pip install 'ssiam[train]'") from error
    from ssiam.networks.runners import check_device
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
    root = config.parent if settings.relative else None
    if pack is not None:
        _write_pack(settings, root, pack, megabytes)
        return
    check_device(device)
    folder = out or Path("runs") / config.stem
    inputs = [("the config", config)]
    located = settings.located(root)
    if so_far is not None:
        inputs.append(("the run", folder / CHECKPOINT))
        check_run_outputs(located, "--so-far", so_far, inputs)
        step = write_network_so_far(settings, folder, so_far)
        print(f"{so_far}: {step} of {settings.steps} steps")
        return
    check_run_outputs(located, "--out", folder, inputs)
    report_leftover_parts(leftovers(folder))
    run(settings, training_batches(settings, root), folder, _print_metrics, device, root)


def _write_pack(settings: TrainSettings, root: Path | None, folder: Path, megabytes: float) -> None:
    from ssiam.training.pack import write_pack

    written = write_pack(settings.located(root), folder, megabytes)
    print(
        f"{folder}: {written.crops} crops of {written.targets} targets and {written.sequences} "
        f"held-out sequences, {written.size / 1e6:.1f} MB; train with {folder / 'config.toml'}"
    )


def _print_metrics(step: int, values: dict[str, float]) -> None:
    print(
        f"{step}: " + ", ".join(f"{name} {value:.4g}" for name, value in values.items()), flush=True
    )
