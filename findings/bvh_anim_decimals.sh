#!/usr/bin/env bash
# bvh_anim 0.4.0 writes motion values with two decimals unless it is told otherwise.
#
# `Bvh::write_to` and `to_bstring` turn 12.3456789° into 12.35: half a hundredth of a degree at the shoulder is a tenth of a
# millimetre at the hand, and the chain adds up. `WriteOptions::with_motion_values_significant_figures` sets the number of decimals
# (its name says significant figures). Oncue asks for six.
# Seen on 2026-11-29 with Rust 1.95: see `expected` below. Fails when that changes.
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
bvh_anim = "=0.4.0"
TOML
cat > src/main.rs <<'RUST'
fn main() {
    let text = b"HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\nJOINT Head\n{\nOFFSET 0 1 0\nCHANNELS 0\nEnd Site\n{\nOFFSET 0 1 0\n}\n}\n}\nMOTION\nFrames: 1\nFrame Time: 0.04\n12.345678 -0.004 100.005\n";
    let bvh = bvh_anim::from_bytes(&text[..]).unwrap();
    println!("{}", bvh.to_string().lines().last().unwrap());
    let six = bvh_anim::write::WriteOptions::new().with_motion_values_significant_figures(6);
    println!("{}", six.write_to_string(&bvh).to_string().lines().last().unwrap());
}
RUST
seen=$(cargo run --quiet)
expected='12.35 -0.00 100.00
12.345678 -0.004000 100.004997'
echo "$seen"
[ "$seen" = "$expected" ] || { echo "It was: $expected"; exit 1; }
