#!/usr/bin/env bash
# bvh_anim 0.4.0 cuts a joint's name at a colon or a space.
#
# Names of many exporters have a name-space before a colon ("mixamorig:Hips"); all joints of such a file get the same name,
# "mixamorig". The tokens of every line are split at whitespace and ':' alike.
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
    let text = b"HIERARCHY\nROOT mixamorig:Hips\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\nJOINT Left Leg\n{\nOFFSET 0 1 0\nCHANNELS 0\nEnd Site\n{\nOFFSET 0 1 0\n}\n}\n}\nMOTION\nFrames: 1\nFrame Time: 0.04\n0 0 0\n";
    for joint in bvh_anim::from_bytes(&text[..]).unwrap().joints() {
        println!("{}", joint.data().name());
    }
}
RUST
seen=$(cargo run --quiet)
expected='mixamorig
Left'
echo "$seen"
[ "$seen" = "$expected" ] || { echo "It was: $expected"; exit 1; }
