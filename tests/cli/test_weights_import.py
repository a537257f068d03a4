"""`ssiam weights import`: other weights are kept, and files of different authors stay apart."""

import shutil

import pytest

from helpers.shaky_dataset import write_dataset
from ssiam.cli import main
from ssiam.runtime import MODEL_ZOO
from ssiam.runtime.files import sha256
from ssiam.runtime.manifest import Manifest

pytest.importorskip("torch")
pytest.importorskip("onnx")

from helpers.network_files import save_checkpoint, seeded_state
from helpers.network_models import checkpoint, exported

ALEX, THEIRS = "siamrpn_alex_dwxcorr", "foolwood_siammask_sharp"
HOW = ("off", "paper")  # methods of Table 4


@pytest.fixture(autouse=True)
def store(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    return tmp_path / "cache" / "ssiam" / "weights"


def import_(*words):
    return main(["weights", "import", *map(str, words)])


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_another_checkpoint_is_replaced_only_on_request(store, tmp_path, capsys):
    assert import_(checkpoint(ALEX)) == 0
    before = contents(store / ALEX)
    assert import_(checkpoint(ALEX)) == 0  # the same again
    state = seeded_state(ALEX)
    state["rpn_head.cls.head.3.bias"] = state["rpn_head.cls.head.3.bias"] + 1
    other = save_checkpoint(tmp_path / "other.pth", state)
    capsys.readouterr()
    assert import_(other) == 2
    error = capsys.readouterr().err
    assert "give --replace" in error
    assert sha256(other)[:12] in error
    assert error.count("\n") == 1
    assert contents(store / ALEX) == before
    assert import_(other, "--replace") == 0
    assert Manifest.read(store / ALEX).sha256 == sha256(other)
    assert (store / ALEX / f"{ALEX}.pth").read_bytes() == other.read_bytes()


def test_files_of_siammasks_authors_and_of_pysot_stay_apart(store, tmp_path, capsys):
    theirs = tmp_path / "SiamMask_VOT_LD.pth"
    shutil.copyfile(checkpoint(THEIRS), theirs)
    assert import_(theirs) == 0
    assert f"stored in {store / 'siammask_vot18'} for siammask_vot18" in capsys.readouterr().out
    renamed = tmp_path / "model.pth"
    theirs.rename(renamed)
    assert import_(renamed) == 2
    assert "--tracker, one of siammask_vot, siammask_vot18" in capsys.readouterr().err
    assert {path.name for path in store.iterdir()} == {"siammask_vot18"}


def test_pysots_folder_is_imported_and_listed_with_its_digest(store, tmp_path, capsys):
    folder = tmp_path / "zoo" / ALEX
    folder.mkdir(parents=True)
    shutil.copyfile(checkpoint(ALEX), folder / "model.pth")
    (folder / "config.yaml").write_text("META_ARC: siamrpn\n")
    assert import_(folder) == 0
    capsys.readouterr()
    assert main(["weights", "list"]) == 0
    lines = capsys.readouterr().out
    assert f"SHA-256 of the imported file {sha256(checkpoint(ALEX))}" in lines
    assert "SHA-256 not stated by the authors" in lines


def test_an_exported_folder_keeps_its_tracker(store, tmp_path):
    assert main(["weights", "export", "siamfc", str(checkpoint("siamfc"))]) == 0
    assert import_("weights/siamfc") == 0
    assert Manifest.read(store / "siamfc").name == "siamfc"
    assert import_(exported("siamfc") / "search.onnx") == 0


def test_nanotrack_is_recognized_by_its_networks(shared, store, tmp_path, capsys):
    folder = tmp_path / "any name"
    shutil.copytree(shared("data/weights/nanotrackv2"), folder)
    assert import_(folder) == 0
    assert "nanotrack_v2" in capsys.readouterr().out
    for file in MODEL_ZOO["nanotrack_v2"].files:
        stored = store / "nanotrack_v2" / file.name
        assert (stored.stat().st_size, sha256(stored)) == (file.size, file.sha256)
    assert import_(shared("data/weights/nanotrackv1"), "--tracker", "nanotrack_v2") == 2
    assert "but nanotrack_v2 has nanotrack_v2" in capsys.readouterr().err


def test_the_authors_own_folder_names_are_found(shared, tmp_path, capsys):
    (tmp_path / "weights").symlink_to(shared("data/weights"))
    assert main(["weights", "list"]) == 0
    lines = capsys.readouterr().out
    for number in (1, 2, 3):
        assert f"nanotrack_v{number}: weights/nanotrackv{number} (" in lines
        for file in MODEL_ZOO[f"nanotrack_v{number}"].files:
            assert f"{file.name}: {file.size} bytes, SHA-256 {file.sha256}" in lines


def test_a_folder_without_one_checkpoint_is_refused(tmp_path, capsys):
    assert import_(tmp_path) == 2
    assert "holds 0 .pth files" in capsys.readouterr().err
    assert import_(checkpoint(ALEX), "--tracker", "csrt") == 2
    assert "unknown tracker with weights 'csrt'" in capsys.readouterr().err


def test_presets_run_imported_weights(tmp_path, capsys):
    data = write_dataset(tmp_path / "data", sequences=1, frames=3)
    assert import_(checkpoint("siamfc")) == 0
    bench = ["bench", str(data), "--out", str(tmp_path / "runs"), "--preset", "table4"]
    assert main(bench) == 0
    names = {path.name for path in (tmp_path / "runs").iterdir()}
    assert names == {f"{name}-{how}" for name in ("csrt", "kcf", "siamfc") for how in HOW}
    lines = capsys.readouterr().out.splitlines()
    assert not any(line.startswith("missing: SiamFC") for line in lines)
    assert sum(line.startswith("missing: Siam") for line in lines) == 2
