#!/usr/bin/env bash
# `maturin build --zig` for Windows has the linker export a function that no module has, where the module's name has a dot.
#
# maturin 1.16.0 hands a .def file to the linker when zig links for Windows. It names `PyInit_` and the module's full name;
# Python, and pyo3 with it, name the function by the last part alone. So a package with its module inside (`package._native`)
# does not link: "undefined symbol: PyInit_package._native". The flag goes to every crate of the build, too, so that
# a dependency that is a cdylib besides fails first. Without --zig there is no such file; Oncue's noxfile.py has cargo call
# maturin's zig as the linker instead.
# Seen on 2026-11-30 with maturin 1.16.0 and ziglang 0.17.1. The file is written before anything is compiled, so that Rust's
# standard library for Windows need not be there. Fails when that changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv tools
tools/bin/pip install --quiet maturin==1.16.0 ziglang==0.17.1
mkdir -p src python/package
touch python/package/__init__.py
cat > Cargo.toml <<'TOML'
[package]
name = "package"
version = "0.1.0"
edition = "2021"
[lib]
crate-type = ["cdylib"]
[dependencies]
pyo3 = { version = "=0.30.1", features = ["abi3-py311"] }
TOML
cat > pyproject.toml <<'TOML'
[build-system]
requires = ["maturin"]
build-backend = "maturin"
[project]
name = "package"
version = "0.1.0"
[tool.maturin]
python-source = "python"
module-name = "package._native"
TOML
cat > src/lib.rs <<'RUST'
#[pyo3::pymodule]
mod _native {}
RUST
for zig in "--zig" ""; do
    rm -rf target/maturin
    PATH="$folder/tools/bin:$PATH" VIRTUAL_ENV="$folder/tools" \
        maturin build --quiet --target x86_64-pc-windows-gnu $zig >/dev/null 2>&1 || true
    exported=$(cat target/maturin/*.def 2>/dev/null | grep -o 'PyInit_.*' || echo nothing)
    echo "maturin build $zig: the linker is told to export $exported"
    case "$zig" in
        --zig) [ "$exported" = "PyInit_package._native" ] ;;
        *) [ "$exported" = nothing ] ;;
    esac
done
