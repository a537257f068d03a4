"""Messages for files that are not the authors' checkpoints."""

import zipfile

import pytest

torch = pytest.importorskip("torch")

from helpers.network_files import constant_state, save_checkpoint  # noqa: E402
from ssiam.errors import WeightsError  # noqa: E402
from ssiam.networks import read_checkpoint  # noqa: E402

ALEX = "siamrpn_alex_dwxcorr"
HEAD = "rpn_head.loc.head.3.bias"
SCORES = [f"rpn_head.cls.{layer}" for layer in ("conv_kernel.0.weight", "conv_kernel.1.weight")]


def without(state, start):
    return {key: value for key, value in state.items() if not key.startswith(start)}


def with_renamed_bias(state):
    return {("bbox.bias" if key == HEAD else key): value for key, value in state.items()}


@pytest.mark.parametrize(
    ("change", "message_parts"),
    [
        pytest.param(
            lambda state: without(state, HEAD),
            [f"nearest network (missing: {HEAD}): give the authors' own file"],
            id="one missing",
        ),
        pytest.param(
            lambda state: without(state, "rpn_head.cls."),
            [f"(missing: {SCORES[0]}, {SCORES[1]}", "and 14 more)"],
            id="many missing",
        ),
        pytest.param(
            lambda state: dict(state, extra=torch.zeros(3)),
            ["(unexpected: extra)"],
            id="one unexpected",
        ),
        pytest.param(
            with_renamed_bias, [f"(missing: {HEAD}; unexpected: bbox.bias)"], id="renamed"
        ),
        pytest.param(
            lambda state: {**state, HEAD: torch.zeros(10)},
            [f"(of another shape: {HEAD} (10,) instead of (20,))"],
            id="another shape",
        ),
    ],
)
def test_weights_that_differ(tmp_path, change, message_parts):
    path = save_checkpoint(tmp_path / "model.pth", change(constant_state(ALEX)))
    message = refusal(path)
    for part in [f"differ from those of {ALEX}", *message_parts]:
        assert part in message


@pytest.mark.parametrize(
    ("content", "message"),
    [
        pytest.param(
            {"fc.weight": torch.zeros(2, 2), "fc.bias": torch.zeros(2)},
            "not those of a known network (unexpected: fc.weight, fc.bias): give the authors' "
            "checkpoint of one of siamfc, siamrpn_alex_dwxcorr,",
            id="another network",
        ),
        pytest.param({"epoch": 3, "lr": 0.1}, "hold no named weights, only epoch, lr", id="log"),
        pytest.param({}, "hold no named weights, only nothing", id="nothing"),
        pytest.param(torch.zeros(2), "hold a Tensor, not a network's state dict", id="tensor"),
    ],
)
def test_other_contents(tmp_path, content, message):
    assert message in refusal(save_checkpoint(tmp_path / "model.pth", content))


def test_the_message_names_layers_of_another_width(tmp_path):
    state = constant_state("siamrpn_r50_l234_dwxcorr")
    level = "neck.downsample2.downsample.0.weight"
    state[level] = torch.zeros(1).expand(128, 512, 1, 1)
    message = refusal(save_checkpoint(tmp_path / "model.pth", state))
    assert f"{level} (128, 512, 1, 1) instead of (256, 512, 1, 1)" in message


@pytest.mark.parametrize(
    ("start", "message"),
    [
        pytest.param(b"<!DOCTYPE html><html>", "are a web page (they start with", id="web page"),
        pytest.param(b"\n <html>", "are a web page", id="web page after an empty line"),
        pytest.param(b"", "are empty (0 bytes)", id="empty"),
        pytest.param(b"\x08\x07\x12\x07pytorch", "are not a PyTorch checkpoint", id="ONNX"),
        pytest.param(b"version https://git-lfs", "are not a PyTorch checkpoint", id="LFS pointer"),
        pytest.param(b"\x80\x02hello", "are damaged or cut short (7 bytes)", id="junk"),
    ],
)
def test_other_files(tmp_path, start, message):
    path = tmp_path / "model.pth"
    path.write_bytes(start)
    assert message in refusal(path)


@pytest.mark.parametrize("zipped", [True, False], ids=["zip", "legacy"])
@pytest.mark.parametrize("share", [0.05, 0.5, 0.999])
def test_truncated_files(tmp_path, share, zipped):
    path = save_checkpoint(tmp_path / "model.pth", {"a.weight": torch.zeros(5000)}, zipped=zipped)
    length = int(path.stat().st_size * share)
    path.write_bytes(path.read_bytes()[:length])
    assert f"damaged or cut short ({length} bytes): download the file again" in refusal(path)


def test_an_altered_archive(tmp_path):
    path = save_checkpoint(tmp_path / "model.pth", {"a.weight": torch.zeros(5000)}, zipped=True)
    data = path.read_bytes()
    start = data.index(b"data.pkl") + 60
    path.write_bytes(data[:start] + bytes(100) + data[start + 100 :])
    assert "damaged or cut short" in refusal(path)


def test_an_archive_of_something_else(tmp_path):
    with zipfile.ZipFile(tmp_path / "model.zip", "w") as archive:
        archive.writestr("siammask_r50_l3/model.pth", b"")
    assert "an archive of 1 files (siammask_r50_l3/model.pth)" in refusal(tmp_path / "model.zip")


def test_a_missing_file_and_a_folder(tmp_path):
    assert "do not exist" in refusal(tmp_path / "model.pth")
    assert "are a folder" in refusal(tmp_path)


class WritesWhenUnpickled:
    """Creates a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return (open, (str(self.path), "w"))


@pytest.mark.parametrize("zipped", [True, False], ids=["zip", "legacy"])
def test_code_is_not_run(tmp_path, zipped):
    created = tmp_path / "created"
    content = {"state_dict": constant_state(ALEX), "hook": WritesWhenUnpickled(created)}
    message = refusal(save_checkpoint(tmp_path / "model.pth", content, zipped=zipped))
    assert "hold code (io.open) and were not loaded" in message
    assert not created.exists()


def test_a_pickled_module_is_code(tmp_path):
    message = refusal(save_checkpoint(tmp_path / "model.pth", torch.nn.Linear(2, 2)))
    assert "hold code (torch.nn.modules.linear.Linear)" in message


def refusal(path):
    """The message for a file, which is one line that begins with the path."""
    with pytest.raises(WeightsError) as caught:
        read_checkpoint(path)
    message = str(caught.value)
    assert message.startswith(f"weights {path} ")
    assert "\n" not in message
    return message


def test_an_altered_table_of_contents(tmp_path):
    path = save_checkpoint(tmp_path / "model.pth", {"a.weight": torch.zeros(50)}, zipped=True)
    data = bytearray(path.read_bytes())
    for offset in (0, 8, 42):  # the magic number, flags and position of the first entry
        altered = data.copy()
        altered[data.index(b"PK\x01\x02") + offset] ^= 0xFF
        path.write_bytes(altered)
        assert " are " in refusal(path)


@pytest.mark.parametrize("zipped", [True, False], ids=["zip", "legacy"])
def test_any_altered_byte_is_one_error(tmp_path, zipped):
    path = save_checkpoint(tmp_path / "model.pth", {"a.weight": torch.zeros(50)}, zipped=zipped)
    data = path.read_bytes()
    for position in range(0, len(data), 17):
        path.write_bytes(data[:position] + bytes([data[position] ^ 0x55]) + data[position + 1 :])
        assert "weights" in refusal(path)


def test_compressed_content_is_refused_before_it_is_read(tmp_path):
    stored = save_checkpoint(tmp_path / "a.pth", {"a.weight": torch.zeros(10**6)}, zipped=True)
    path = tmp_path / "model.pth"
    compressed = zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED)
    with zipfile.ZipFile(stored) as source, compressed as target:
        for entry in source.infolist():
            target.writestr(entry.filename, source.read(entry))
    assert "are compressed: " in refusal(path)


def test_a_name_to_the_end_of_the_file_does_not_reach_pytorch(tmp_path):
    """PyTorch searches it for minutes with a regular expression, for its message."""
    path = tmp_path / "a.pth"
    path.write_bytes(b"\x80\x02ctorch._utils\n_rebuild" + b'{"a":' * 2000)
    with pytest.raises(WeightsError, match="are damaged") as caught:
        read_checkpoint(path)
    assert caught.value.__cause__.__cause__ is None  # no error of PyTorch's


def test_weights_without_plain_numbers(tmp_path):
    state = constant_state(ALEX)
    state[HEAD] = torch.zeros(20, device="meta")
    path = save_checkpoint(tmp_path / "model.pth", state)
    assert f"hold no plain numbers for {HEAD}" in refusal(path)
