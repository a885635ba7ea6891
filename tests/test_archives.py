"""tools/archives.py: what goes out is the same each time, says what is in it, and is refused where it cannot load."""

import base64
import hashlib
import json
import struct
import sys
import zipfile
from pathlib import Path
from types import SimpleNamespace

import oncue_core
import pytest

from tools import archives

EPOCH = 1_700_000_000


def zip_of(path, entries, date):
    with zipfile.ZipFile(path, "w") as zipped:
        for name, data in entries:
            zipped.writestr(zipfile.ZipInfo(name, date), data, zipfile.ZIP_DEFLATED)
    return path


def test_an_archive_is_the_same_whenever_it_was_made(tmp_path):
    entries = [("b.py", b"b" * 99), ("wheels/", b""), ("a.py", b"a")]
    first = zip_of(tmp_path / "1.zip", entries, (2026, 1, 2, 3, 4, 6))
    second = zip_of(tmp_path / "2.zip", entries[::-1], (2024, 5, 6, 7, 8, 10))
    for path in (first, second):
        archives.fix_archive(path, EPOCH)
    assert first.read_bytes() == second.read_bytes()
    with zipfile.ZipFile(first) as zipped:
        assert zipped.namelist() == ["a.py", "b.py"]
        assert zipped.read("b.py") == b"b" * 99
        assert {info.date_time for info in zipped.infolist()} == {(2023, 11, 14, 22, 13, 20)}
    archives.fix_archive(second, EPOCH + 86400)
    assert first.read_bytes() != second.read_bytes()


def sbom():
    """What cargo-cyclonedx says of a library with a dependency, a macro, and a package of a feature that is off."""
    ours, home = f"path+{archives.ROOT.as_uri()}/rust/oncue-python#0.1.0", "registry+index#"
    names = {"serde": "required", "serde_derive": "excluded", "glam": "required"}
    components = [
        {"bom-ref": f"{home}{name}@1.0.0", "name": name, "version": "1.0.0", "scope": scope}
        for name, scope in names.items()
    ]
    relations = [
        {"ref": ours, "dependsOn": [f"{home}serde@1.0.0", f"{home}glam@1.0.0"]},
        {"ref": f"{home}serde@1.0.0", "dependsOn": [f"{home}serde_derive@1.0.0"]},
        {"ref": f"{home}glam@1.0.0"},
    ]
    return {
        "serialNumber": "urn:uuid:drawn",
        "metadata": {"component": {"bom-ref": ours, "name": "oncue-python"}},
        "components": components,
        "dependencies": relations,
    }


def test_the_sbom_lists_what_is_compiled_in_and_no_folder_of_ours():
    bom = archives.true_sbom(sbom(), {("serde", "1.0.0"), ("serde_derive", "2.0.0")})
    assert [component["name"] for component in bom["components"]] == ["serde"]
    ours = bom["metadata"]["component"]["bom-ref"]
    assert ours == "path+file:///rust/oncue-python#0.1.0"
    assert bom["dependencies"] == [
        {"ref": ours, "dependsOn": ["registry+index#serde@1.0.0"]},
        {"ref": "registry+index#serde@1.0.0"},
    ]
    assert "serialNumber" not in bom


def test_a_wheel_is_the_same_and_its_record_true(tmp_path):
    info = "oncue_core-0.1.0.dist-info"
    entries = [
        ("oncue_core/__init__.py", b"pass\n"),
        (f"{info}/sboms/oncue-python.cyclonedx.json", json.dumps(sbom()).encode()),
        (f"{info}/RECORD", b"stale"),
    ]
    wheels = [zip_of(tmp_path / f"{day}.whl", entries, (2026, 1, day, 0, 0, 0)) for day in (1, 2)]
    for wheel in wheels:
        archives.fix_wheel(wheel, {("serde", "1.0.0")}, EPOCH)
    assert wheels[0].read_bytes() == wheels[1].read_bytes()
    with zipfile.ZipFile(wheels[0]) as zipped:
        lines = [line.split(",") for line in zipped.read(f"{info}/RECORD").decode().splitlines()]
        assert [line[0] for line in lines] == zipped.namelist()
        assert lines[-1] == [f"{info}/RECORD", "", ""]
        for name, hashed, size in lines[:-1]:
            data = zipped.read(name)
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).decode().rstrip("=")
            assert (hashed, int(size)) == (f"sha256={digest}", len(data))
    assert b"glam" not in archives.sbom_of(wheels[0])


def test_what_a_wheel_lacks_is_said(tmp_path):
    wheel = zip_of(tmp_path / "oncue_core-0.1.0-cp313-cp313-win_amd64.whl", [("a.py", b"")], (2026, 1, 1, 0, 0, 0))
    found = " ".join(archives.complaints(wheel))
    for word in ("not for every Python", "LICENSES-THIRD-PARTY", "cyclonedx", "py.typed", "0 compiled modules"):
        assert word in found


def test_what_an_archive_lacks_and_has_too_much_is_said(tmp_path, monkeypatch):
    entries = [("blender_manifest.toml", b""), ("__init__.py", b""), ("bridge/a.pyc", b"")]
    path = zip_of(tmp_path / "oncue-0.1.0-linux_x64.zip", entries, (2026, 1, 1, 0, 0, 0))
    monkeypatch.setattr(archives, "LIMIT", 100)
    found = " ".join(archives.complaints(path))
    for word in ("holds 0 wheels", "a.pyc", "lacks LICENSE.", "oncue_core.cyclonedx.json", "MB, more than 0"):
        assert word in found


def signed(pages, changed=None):
    """The pages of a program and a signature of Apple's over them; the page `changed` is another than was signed."""
    size, shift = 32, 12
    content = b"".join(bytes([page]) * (1 << shift) for page in range(pages))
    hashes = b"".join(hashlib.sha256(content[i << shift : (i + 1) << shift]).digest() for i in range(pages))
    fields = (0xFADE0C02, 44 + len(hashes), 0, 2, 44, 0, 0, pages, len(content), size, 2, 0, shift)
    header = struct.pack(">IIIIIIIIIBBBB", *fields)
    directory = header.ljust(44, b"\0") + hashes
    blob = struct.pack(">IIIII", 0xFADE0CC0, 20 + len(directory), 1, 0, 20) + directory
    if changed is not None:
        content = content[: changed << shift] + b"!" + content[(changed << shift) + 1 :]
    signature = SimpleNamespace(data_offset=len(content))
    return content + blob, SimpleNamespace(has_code_signature=True, code_signature=signature)


def test_a_program_that_was_changed_after_it_was_signed_is_refused():
    assert archives.of_signature(*signed(3)) == []
    assert archives.of_signature(*signed(3, changed=2)) == ["was changed after it was signed: page 2 of 3."]
    (sentence,) = archives.of_signature(b"", SimpleNamespace(has_code_signature=False))
    assert "not signed" in sentence


@pytest.mark.skipif(sys.platform != "linux", reason="reads the module of a Linux wheel")
def test_a_module_for_another_machine_is_refused():
    pytest.importorskip("lief")
    data = next(Path(oncue_core.__file__).parent.glob("_native*.so")).read_bytes()
    here, other = ("x86_64", "aarch64") if data[18] == 0x3E else ("aarch64", "x86_64")
    right = archives.of_library(data, f"manylinux_2_28_{here}")
    assert not [sentence for sentence in right if sentence.startswith(("is for", "asks for lib"))]
    assert any(s.startswith("is for") for s in archives.of_library(data, f"manylinux_2_28_{other}"))
    assert any(s.startswith("is for") for s in archives.of_library(data, "macosx_11_0_arm64"))
    # A library that no system brings along; the name lies in the file's strings.
    foreign = data.replace(b"libc.so.6\0", b"libq.so.6\0")
    assert any("libq.so.6" in s for s in archives.of_library(foreign, f"manylinux_2_28_{here}"))
