"""Imported weights: what is recognized, where it is stored, and what is refused."""

import pytest

from ssiam.errors import ArgumentError, SinkError, WeightsError
from ssiam.runtime.files import sha256
from ssiam.runtime.manifest import MANIFEST_FILE, Manifest
from ssiam.trackers import nanotrack, weight_imports
from ssiam.trackers.weight_imports import copy_files, import_weights

PIECES = ("template", "search")


def exported(folder, network="siamfc", name="siamfc", digest="a" * 64, **more):
    """A folder as ``ssiam weights export`` writes it, with other contents of the networks."""
    folder.mkdir(parents=True, exist_ok=True)
    for piece in PIECES:
        (folder / f"{piece}.onnx").write_text(f"{piece} {digest}")
    Manifest(name, network, digest, PIECES, **more).write(folder)
    return folder


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_an_exported_folder_is_copied(tmp_path):
    source = exported(tmp_path / "mine")
    (source / "notes.txt").touch()
    found = import_weights(source, folder=tmp_path / "store")
    assert found == ("siamfc", "siamfc", tmp_path / "store" / "siamfc")
    assert (found.network, found.tracker, found.folder) == found
    names = {"template.onnx", "search.onnx", MANIFEST_FILE}
    expected = {name: data for name, data in contents(source).items() if name in names}
    assert contents(found.folder) == expected


def test_one_file_of_an_exported_folder_stands_for_all(tmp_path):
    source = exported(tmp_path / "mine")
    found = import_weights(source / "search.onnx", folder=tmp_path / "store")
    assert len(contents(found.folder)) == 3


def test_without_a_folder_the_weights_are_stored_in_the_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    found = import_weights(exported(tmp_path / "mine"))
    assert found.folder == weight_imports.cache_folder() / "weights" / "siamfc"
    assert found.folder.is_relative_to(tmp_path / "cache")


def test_the_tracker_is_that_of_the_export_or_the_given_one(tmp_path):
    source = exported(tmp_path / "mine", "siammask_r50_l3", "siammask_e")
    found = import_weights(source, folder=tmp_path / "store")
    assert (found.network, found.tracker) == ("siammask_r50_l3", "siammask_e")
    other = import_weights(source, "siammask_vot", tmp_path / "store")
    assert (other.network, other.tracker) == ("siammask_r50_l3", "siammask_vot")
    assert other.folder == tmp_path / "store" / "siammask_vot"


def test_trackers_without_published_weights_are_unknown(tmp_path):
    source = exported(tmp_path / "mine")
    for name in ("kcf", "lite", "magic"):
        with pytest.raises(ArgumentError, match=f"unknown tracker with weights '{name}'"):
            import_weights(source, name, tmp_path / "store")
    assert not (tmp_path / "store").exists()


def test_a_tracker_of_another_network_is_refused(tmp_path):
    source = exported(tmp_path / "mine")
    with pytest.raises(WeightsError) as caught:
        import_weights(source, "siammask_e", tmp_path / "store")
    reason = "are those of siamfc, but siammask_e has siammask_r50_l3"
    assert str(caught.value) == f"weights {source} {reason}"


def test_networks_that_no_tracker_imports_are_refused(tmp_path):
    source = exported(tmp_path / "mine", "lite2", "lite")
    with pytest.raises(WeightsError) as caught:
        import_weights(source, folder=tmp_path / "store")
    assert str(caught.value) == f"weights {source} are those of lite2, which no tracker uses"


def test_other_weights_are_replaced_only_on_request(tmp_path):
    store = tmp_path / "store"
    import_weights(exported(tmp_path / "first"), folder=store)
    before = contents(store / "siamfc")
    import_weights(exported(tmp_path / "again"), folder=store)  # the same weights
    assert contents(store / "siamfc") == before
    second = exported(tmp_path / "second", digest="b" * 64)
    with pytest.raises(WeightsError) as caught:
        import_weights(second, folder=store)
    assert str(caught.value) == (
        f"{store / 'siamfc'} holds other weights (SHA-256 aaaaaaaaaaaa..., those of {second} have "
        "bbbbbbbbbbbb...): give --replace to replace them"
    )
    assert contents(store / "siamfc") == before
    import_weights(second, folder=store, replace=True)
    assert contents(store / "siamfc") == contents(second)


def test_int8_weights_are_other_weights(tmp_path):
    import_weights(exported(tmp_path / "first"), folder=tmp_path / "store")
    quantized = exported(tmp_path / "second", precision="int8")
    with pytest.raises(WeightsError, match="holds other weights"):
        import_weights(quantized, folder=tmp_path / "store")
    import_weights(quantized, folder=tmp_path / "store", replace=True)
    with pytest.raises(WeightsError, match="holds other weights"):
        import_weights(tmp_path / "first", folder=tmp_path / "store")


def test_weights_may_be_imported_from_where_they_are(tmp_path):
    source = exported(tmp_path / "store" / "siamfc")
    before = contents(source)
    import_weights(source, folder=tmp_path / "store")
    assert contents(source) == before


@pytest.mark.parametrize("count", [0, 2])
def test_a_folder_needs_one_checkpoint(tmp_path, count):
    for number in range(count):
        (tmp_path / f"{number}.pth").touch()
    with pytest.raises(WeightsError) as caught:
        import_weights(tmp_path)
    expected = f"weights folder {tmp_path} holds {count} .pth files: give one of them"
    assert str(caught.value) == expected


def test_a_single_onnx_file_is_refused(tmp_path):
    (tmp_path / "net.onnx").touch()
    with pytest.raises(WeightsError) as caught:
        import_weights(tmp_path / "net.onnx")
    assert str(caught.value) == (
        f"weights {tmp_path / 'net.onnx'} are ONNX without a network.json beside them: give the "
        "folder of NanoTrack's or FEAR-XS's two files, or the file to a tracker directly"
    )


def pair(folder):
    folder.mkdir()
    for name in ("x_backbone.onnx", "x_head.onnx"):
        (folder / name).write_text(name)
    (folder / "other.pth").touch()  # ONNX comes first
    return folder


@pytest.fixture
def loads(monkeypatch):
    """NanoTrack's networks load as the versions in this list."""
    versions = []

    def load(name, path, options):
        if name not in versions:
            raise WeightsError(f"not {name}")

    monkeypatch.setattr(weight_imports.NanoTrackNetworks, "load", load)
    return versions


@pytest.mark.parametrize("name", ["nanotrack_v1", "nanotrack_v2", "nanotrack_v3"])
def test_nanotrack_is_the_version_that_loads(tmp_path, loads, name):
    source = pair(tmp_path / "mine")
    loads.append(name)
    found = import_weights(source, folder=tmp_path / "store")
    assert found == (name, name, tmp_path / "store" / name)
    assert set(contents(found.folder)) == {"x_backbone.onnx", "x_head.onnx"}
    import_weights(source, folder=tmp_path / "store")  # the same again
    (source / "x_head.onnx").write_text("another")
    with pytest.raises(WeightsError, match="holds other weights"):
        import_weights(source, folder=tmp_path / "store")


def test_files_of_no_version_of_nanotrack_are_refused(tmp_path, loads):
    with pytest.raises(WeightsError, match=r"^not nanotrack_v3$"):
        import_weights(pair(tmp_path / "mine"), folder=tmp_path / "store")
    (tmp_path / "mine" / "x_head.onnx").unlink()
    with pytest.raises(WeightsError, match=r"holds 0 files named \*head\*\.onnx"):
        import_weights(tmp_path / "mine", folder=tmp_path / "store")


def test_the_pair_of_nanotrack(tmp_path):
    folder = pair(tmp_path / "mine")
    expected = folder / "x_backbone.onnx", folder / "x_head.onnx"
    for path in (folder, *expected):
        assert nanotrack.onnx_pair(path) == expected
    with pytest.raises(WeightsError, match="do not exist: give the folder of NanoTrack's two"):
        nanotrack.onnx_pair(tmp_path / "none")
    with pytest.raises(WeightsError, match=r"are not an \.onnx file: NanoTrack runs from ONNX"):
        nanotrack.onnx_pair(folder / "other.pth")
    (folder / "y_backbone.onnx").touch()
    with pytest.raises(WeightsError) as caught:
        nanotrack.onnx_pair(folder)
    assert str(caught.value) == (
        f"weights folder {folder} holds 2 files named *backbone*.onnx, NanoTrack needs exactly one"
    )


def test_copied_files_replace_others_and_keep_the_rest(tmp_path):
    source, target = tmp_path / "source", tmp_path / "deep" / "target"
    source.mkdir()
    for name in ("a", "b"):
        (source / name).write_text(f"new {name}")
    target.mkdir(parents=True)
    (target / "a").write_text("old")
    (target / "kept").write_text("kept")
    copy_files([source / "a", source / "b"], target)
    assert contents(target) == {"a": b"new a", "b": b"new b", "kept": b"kept"}
    copy_files([source / "a"], target, "c")
    assert (target / "c").read_text() == "new a"


def test_if_a_copy_fails_nothing_is_replaced(tmp_path):
    (tmp_path / "a").write_text("new")
    target = tmp_path / "target"
    target.mkdir()
    (target / "a").write_text("old")
    with pytest.raises(SinkError, match=r"target: cannot be written \(No such file"):
        copy_files([tmp_path / "a", tmp_path / "missing"], target)
    assert contents(target) == {"a": b"old"}
    with pytest.raises(SinkError, match=r"a: cannot be written"):
        copy_files([tmp_path / "a"], tmp_path / "a")


def test_the_manifest_is_written_last(tmp_path, monkeypatch):
    """A folder without one is incomplete."""
    source, order = exported(tmp_path / "mine"), []
    real = weight_imports.Path.replace

    def replace(path, target):
        order.append(path.name)
        return real(path, target)

    monkeypatch.setattr(weight_imports.Path, "replace", replace)
    copy_files([source / MANIFEST_FILE, source / "template.onnx"], tmp_path / "out")
    assert order == ["template.onnx", MANIFEST_FILE]


@pytest.fixture
def checkpoint(tmp_path, monkeypatch):
    """A .pth file of the network "siammask_r50_l3", and whether it is of SiamMask's authors."""
    for package in ("torch", "onnx"):
        pytest.importorskip(package)
    from ssiam import networks
    from ssiam.networks import checkpoints
    from ssiam.runtime import export

    file = tmp_path / "SiamMask_DAVIS.pth"
    file.write_bytes(b"weights")
    made = {"authors": True, "calls": [], "network": "siammask_r50_l3"}

    class Found:
        @property
        def name(self):
            return made["network"]

    def write(path, folder, *, name, network):
        made["calls"].append((path, folder, name, network))
        exported(folder, network, name, sha256(path))

    monkeypatch.setattr(networks, "read_checkpoint", lambda path: Found())
    monkeypatch.setattr(checkpoints, "is_of_siammask_authors", lambda path: made["authors"])
    monkeypatch.setattr(export, "export_network", write)
    return file, made


def test_a_checkpoint_is_exported_and_copied(checkpoint, tmp_path):
    file, made = checkpoint
    found = import_weights(file, folder=tmp_path / "store")
    assert found == ("siammask_r50_l3", "siammask_davis", tmp_path / "store" / "siammask_davis")
    assert made["calls"] == [(file, found.folder, "siammask_davis", "siammask_r50_l3")]
    assert (found.folder / "siammask_r50_l3.pth").read_bytes() == b"weights"
    import_weights(file, folder=tmp_path / "store")  # the same again
    file.write_bytes(b"others")
    with pytest.raises(WeightsError, match="holds other weights"):
        import_weights(file, folder=tmp_path / "store")


def test_pysots_checkpoint_of_siammask_is_for_the_tracker_of_that_name(checkpoint, tmp_path):
    file, made = checkpoint
    made["authors"] = False
    assert import_weights(file, folder=tmp_path / "store").tracker == "siammask_r50_l3"
    made["network"] = "siamfc"
    assert import_weights(file, folder=tmp_path / "store").tracker == "siamfc"


def test_a_renamed_checkpoint_of_siammasks_authors_needs_the_tracker(checkpoint, tmp_path):
    file, _ = checkpoint
    renamed = file.rename(tmp_path / "model.pth")
    with pytest.raises(WeightsError) as caught:
        import_weights(renamed, folder=tmp_path / "store")
    assert str(caught.value) == (
        f"weights {renamed} are of SiamMask's authors, who publish SiamMask_VOT.pth, "
        "SiamMask_VOT_LD.pth, SiamMask_DAVIS.pth: give --tracker, one of siammask_vot, "
        "siammask_vot18, siammask_davis"
    )
    assert import_weights(renamed, "siammask_vot", tmp_path / "store").tracker == "siammask_vot"


@pytest.mark.parametrize("name", ["template.onnx", "search.onnx", "refine.onnx", MANIFEST_FILE])
def test_a_checkpoint_that_the_export_would_replace_is_refused(checkpoint, tmp_path, name):
    file, made = checkpoint
    target = tmp_path / "store" / "siammask_davis"
    target.mkdir(parents=True)
    (target / name).hardlink_to(file)
    with pytest.raises(ArgumentError, match=r"--folder .* is the file of the weights"):
        import_weights(file, folder=tmp_path / "store", replace=True)
    assert made["calls"] == []


def test_the_only_checkpoint_of_a_folder_is_used(checkpoint, tmp_path):
    file, made = checkpoint
    (tmp_path / "authors").mkdir()
    moved = file.rename(tmp_path / "authors" / file.name)
    import_weights(tmp_path / "authors", folder=tmp_path / "store")
    assert made["calls"][0][0] == moved
