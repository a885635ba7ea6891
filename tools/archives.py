"""What goes out to others: wheels and archives that come out the same each time and load where they say.

    python -m tools.archives wheel WHEEL        its list of what is compiled in (SBOM) made true, dates and paths fixed
    python -m tools.archives archive ZIP        the same for an extension's archive, without the list
    python -m tools.archives sbom WHEEL FILE    takes the list out of the wheel
    python -m tools.archives check FILE …       a sentence for each thing that would keep it from loading; needs lief

The dates are those of $SOURCE_DATE_EPOCH.
"""

from __future__ import annotations

import base64
import csv
import hashlib
import io
import json
import os
import re
import struct
import sys
import time
import zipfile
from pathlib import Path
from typing import Any

from tools import dependencies

ROOT = Path(__file__).parents[1]
#: The least that somebody may have: what manylinux 2.28 and Blender 4.2's macOS 11 promise.
GLIBC = (2, 28)
MACOS = (11, 0)
#: Bytes: what an archive may weigh.
LIMIT = 12_000_000

#: What a system brings along. Whatever else a library asks for is missing on somebody's machine.
LINUX = re.compile(r"(ld-linux-.*|lib(c|m|dl|pthread|rt|util|gcc_s))\.so\.\d+")
MAC = re.compile(r"/usr/lib/(libSystem\.B|libiconv\.2|libcharset\.1|libobjc\.A)\.dylib")
WINDOWS = re.compile(
    r"(python3|kernel32|ntdll|advapi32|bcrypt|bcryptprimitives|userenv|ws2_32|msvcrt|ucrtbase|vcruntime140(_1)?"
    r"|api-ms-win-[a-z0-9-]+)\.dll",
    re.IGNORECASE,
)
#: By the last word of a wheel's platform tag, as lief calls it in ELF, Mach-O and PE.
MACHINES = {
    "x86_64": ("X86_64", "X86_64"),
    "aarch64": ("AARCH64",),
    "arm64": ("ARM64", "ARM64"),
    "amd64": ("AMD64",),
}


# --- the same bytes each time ---------------------------------------------------------------------------


def write_zip(path: Path, entries: dict[str, bytes], stored: set[str], epoch: int) -> None:
    """A zip file with these entries in this order, all of one date; `stored` are not compressed.

    Neither the clock nor the file system has a say in it; a zlib of another make may still pack otherwise.
    """
    # The format knows no dates before 1980.
    date = time.gmtime(max(epoch, 315_532_800))[:6]
    written = io.BytesIO()
    with zipfile.ZipFile(written, "w") as zipped:
        for name, data in entries.items():
            info = zipfile.ZipInfo(name, date)
            # Linux's convention on every system; libraries may be executed.
            info.create_system = 3
            info.external_attr = (0o100755 if name.endswith((".so", ".pyd")) else 0o100644) << 16
            info.compress_type = zipfile.ZIP_STORED if name in stored else zipfile.ZIP_DEFLATED
            zipped.writestr(info, data, compresslevel=9)
    path.write_bytes(written.getvalue())


def read_zip(path: Path) -> tuple[dict[str, bytes], set[str]]:
    """What a zip file holds, without folders, and which of it is not compressed."""
    with zipfile.ZipFile(path) as zipped:
        files = [info for info in zipped.infolist() if not info.is_dir()]
        stored = {info.filename for info in files if info.compress_type == zipfile.ZIP_STORED}
        return {info.filename: zipped.read(info) for info in files}, stored


def fix_archive(path: Path, epoch: int) -> None:
    """Rewrites an archive so that the same content is the same bytes: sorted, of one date."""
    entries, stored = read_zip(path)
    write_zip(path, dict(sorted(entries.items())), stored, epoch)


def fix_wheel(path: Path, shipped: set[tuple[str, str]], epoch: int) -> None:
    """Rewrites a wheel with an SBOM that lists `shipped` alone and no path of this machine.

    maturin writes it by cargo-cyclonedx, from all that Cargo.lock names.
    """
    entries, stored = read_zip(path)
    (name,) = (name for name in entries if name.endswith(".cyclonedx.json"))
    bom = true_sbom(json.loads(entries[name]), shipped)
    entries[name] = (json.dumps(bom, indent=1, ensure_ascii=False) + "\n").encode()
    (record,) = (name for name in entries if name.endswith(".dist-info/RECORD"))
    lines = io.StringIO()
    writer = csv.writer(lines, lineterminator="\n")
    for entry, data in entries.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        writer.writerow([entry, "", ""] if entry == record else [entry, f"sha256={digest}", len(data)])
    entries[record] = lines.getvalue().encode()
    write_zip(path, entries, stored, epoch)


def true_sbom(bom: dict[str, Any], shipped: set[tuple[str, str]]) -> dict[str, Any]:
    """A CycloneDX document of Rust packages held to those that are compiled into the library.

    Cargo.lock, and with it every tool that reads `cargo metadata`, names packages of features that are off
    (findings/cargo_lock_weak_features.sh), and those that only the build runs. The workspace's own folder is left out.
    """
    text = json.dumps(bom)
    for place in (ROOT.as_uri(), ROOT.as_posix()):
        text = text.replace(place.removeprefix("file://"), "")
    bom = json.loads(text)
    components = [c for c in bom["components"] if (c["name"], c["version"]) in shipped]
    for component in components:
        # cargo-cyclonedx excludes what it takes for the build's; here all that is left is in the library.
        component["scope"] = "required"
    kept = {component["bom-ref"] for component in components} | {bom["metadata"]["component"]["bom-ref"]}
    relations = []
    for entry in bom["dependencies"]:
        if entry["ref"] in kept:
            on = [ref for ref in entry.get("dependsOn", []) if ref in kept]
            relations.append({"ref": entry["ref"], **({"dependsOn": on} if on else {})})
    # A number that is drawn anew each time.
    bom.pop("serialNumber", None)
    return {**bom, "components": components, "dependencies": relations}


def sbom_of(wheel: Path) -> bytes:
    """The SBOM in a wheel."""
    entries, _ = read_zip(wheel)
    (data,) = (data for name, data in entries.items() if name.endswith(".cyclonedx.json"))
    return data


# --- whether it loads where it says ---------------------------------------------------------------------


def complaints(path: Path) -> list[str]:
    """A sentence for each thing that would keep somebody from using this wheel, or this archive with a wheel in it."""
    entries, _ = read_zip(path)
    found = []
    if path.stat().st_size > LIMIT:
        found.append(f"{path.name} has {path.stat().st_size / 1e6:.1f} MB, more than {LIMIT / 1e6:.0f}.")
    if path.suffix == ".zip":
        inside = [name for name in entries if name.endswith(".whl")]
        if len(inside) != 1:
            found.append(f"{path.name} holds {len(inside)} wheels.")
        found += [f"{path.name} holds {name}." for name in entries if name.endswith((".pyc", ".pyo", ".DS_Store"))]
        found += [f"{path.name} lacks {name}." for name in REQUIRED if name not in entries]
        return found
    if "-cp311-abi3-" not in path.name:
        found.append(f"{path.name} is not for every Python from 3.11 on.")
    for ending in ("licenses/LICENSES-THIRD-PARTY.txt", ".cyclonedx.json", "/py.typed", "/_native.pyi"):
        if not any(name.endswith(ending) for name in entries):
            found.append(f"{path.name} lacks {ending.strip('/')}.")
    libraries = [data for name, data in entries.items() if name.endswith((".so", ".pyd"))]
    if len(libraries) != 1:
        return [*found, f"{path.name} holds {len(libraries)} compiled modules."]
    return found + [f"{path.name}: {sentence}" for sentence in of_library(libraries[0], path.stem.split("-")[-1])]


#: What an extension's archive has at least.
REQUIRED = ("blender_manifest.toml", "__init__.py", "LICENSE", "LICENSES-THIRD-PARTY.txt", "oncue_core.cyclonedx.json")


def of_library(data: bytes, tag: str) -> list[str]:
    """What is wrong with a compiled module that is to load where a wheel's platform tag says."""
    import lief  # type: ignore[import-not-found, unused-ignore]

    library: Any = lief.parse(data)
    if isinstance(library, lief.MachO.FatBinary):
        library = library.at(0)
    found = []
    machine = next(names for end, names in MACHINES.items() if tag.endswith(end))
    if isinstance(library, lief.ELF.Binary):
        actual, needed, system = library.header.machine_type.name, library.libraries, LINUX
        asked = {
            (int(major), int(minor))
            for version in library.symbols_version_requirement
            for auxiliary in version.get_auxiliary_symbols()
            for major, minor in re.findall(r"^GLIBC_(\d+)\.(\d+)", auxiliary.name)
        }
        if max(asked, default=GLIBC) > GLIBC:
            found.append(f"asks for glibc {'.'.join(map(str, max(asked)))}, more than {'.'.join(map(str, GLIBC))}.")
        # .dynsym is what the loader reads; .symtab is for debuggers.
        left = [section.name for section in library.sections if section.name.startswith((".symtab", ".debug"))]
        families = ("linux",)
    elif isinstance(library, lief.PE.Binary):
        actual, needed, system = library.header.machine.name, [entry.name for entry in library.imports], WINDOWS
        left = [section.name for section in library.sections if section.name.startswith(".debug")]
        families = ("win",)
        # zig exports all of it where rustc's list does not come through, and then nothing that is unused is left out.
        if inner := [entry.name for entry in library.exported_functions if entry.name.startswith(("_R", "_ZN"))]:
            found.append(f"exports {len(inner)} functions of its inside.")
        if "python3.dll" not in [name.lower() for name in needed]:
            found.append("does not ask for python3.dll, which is the same for every Python.")
    else:
        actual = library.header.cpu_type.name
        needed, system = [entry.name for entry in library.libraries if entry.command.name != "ID_DYLIB"], MAC
        left = [section.name for section in library.sections if section.segment_name == "__DWARF"]
        families = ("macos",)
        if (least := least_macos(library)) > MACOS:
            found.append(f"asks for macOS {'.'.join(map(str, least))}.")
        if tag.endswith("arm64"):
            found += of_signature(data, library)
    if actual not in machine or not any(family in tag for family in families):
        found.append(f"is for {actual}.")
    found += [f"asks for {name}, which not every system has." for name in needed if not system.fullmatch(name)]
    if left:
        found.append(f"is not stripped of {', '.join(left)}.")
    if leak := re.search(re.escape(str(Path.home())).encode() + rb"[^\0]{0,60}", data):
        found.append(f"names a path of the machine that built it: {leak[0].decode(errors='replace')}.")
    return found


def least_macos(library: Any) -> tuple[int, ...]:
    """The oldest macOS that a Mach-O library says it runs on."""
    command = library.build_version if library.has_build_version else library.version_min
    version = command.minos if library.has_build_version else command.version
    return tuple(version[:2])


def of_signature(data: bytes, library: Any) -> list[str]:
    """What Apple's processors kill a program for: no code signature, or one whose pages have changed since."""
    if not library.has_code_signature:
        return ["is not signed, not even ad hoc, and Apple's processors run nothing unsigned."]
    at = library.code_signature.data_offset
    (_, _, count) = struct.unpack_from(">III", data, at)
    for i in range(count):
        kind, offset = struct.unpack_from(">II", data, at + 12 + 8 * i)
        # The code directory: SHA-256 of each page up to where the signature begins.
        if kind == 0:
            break
    else:
        return ["has a signature without a code directory."]
    start = at + offset
    hashes, _, _, pages, limit = struct.unpack_from(">IIIII", data, start + 16)
    size, kind, _, shift = struct.unpack_from(">BBBB", data, start + 36)
    if kind != 2:
        return [f"is signed by hashes of kind {kind}, not by SHA-256."]
    for page in range(pages):
        content = data[page << shift : min((page + 1) << shift, limit)]
        if hashlib.sha256(content).digest() != data[start + hashes + page * size :][:size]:
            return [f"was changed after it was signed: page {page} of {pages}."]
    return []


def main() -> None:
    epoch = int(os.environ.get("SOURCE_DATE_EPOCH", "0"))
    match sys.argv[1:]:
        case ["wheel", wheel]:
            fix_wheel(Path(wheel), dependencies.shipped(), epoch)
        case ["archive", archive]:
            fix_archive(Path(archive), epoch)
        case ["sbom", wheel, file]:
            Path(file).write_bytes(sbom_of(Path(wheel)))
        case ["check", *files] if files:
            found = [sentence for file in files for sentence in complaints(Path(file))]
            print(
                "\n".join(found) or f"{len(files)} {'file is' if len(files) == 1 else 'files are'} as they should be."
            )
            sys.exit(bool(found))
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main()
