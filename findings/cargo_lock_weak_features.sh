#!/usr/bin/env bash
# Cargo.lock, and `cargo metadata` with it, list packages of features that are off.
#
# nalgebra 0.35.0 without default features compiles no glam; its `std` feature only says what would hold of glam if it were
# asked for. Cargo locks all of them all the same: whoever collects licences or double versions from `cargo metadata` finds
# packages that no build has. `cargo tree` tells them apart; Oncue's tools/dependencies.py asks it.
# Seen on 2026-11-29 with cargo 1.95: glam stands in the metadata and not in the tree. Fails when that changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
mkdir src
cat > Cargo.toml <<'TOML'
[package]
name = "finding"
version = "0.0.0"
edition = "2024"
[dependencies]
nalgebra = { version = "=0.35.0", default-features = false, features = ["std"] }
TOML
echo 'fn main() {}' > src/main.rs
in_metadata=$(cargo metadata --format-version 1 --quiet | grep -o '"name":"glam","version":"[^"]*"' | sort -u | wc -l)
in_tree=$(cargo tree --quiet --target all --prefix none | grep -c '^glam ' || true)
echo "glam: $in_metadata versions in the metadata, $in_tree in the tree"
[ "$in_metadata" -gt 0 ] && [ "$in_tree" = 0 ]
