#!/usr/bin/env bash
# bvh_anim 0.4.0: its documented builder gives a Bvh without joints.
#
# `builder::Builder … build()` keeps the frames and drops the skeleton (its source has a note in the place of the conversion), and
# says Ok. What is written of it has a MOTION section under an empty HIERARCHY. `BvhLiteralBuilder`, which the `bvh!` macro
# uses and the documentation hides, keeps both; Oncue writes with that one.
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
bstr = "=0.1.4"
TOML
cat > src/main.rs <<'RUST'
use bvh_anim::{BvhLiteralBuilder, ChannelType, builder::Builder};

fn main() {
    let joints = Builder::with_root_joint(bstr::BStr::new("Hips"), [0.0; 3].into(), &[ChannelType::RotationX])
        .push_child(1, bstr::BStr::new("Head"), [0.0, 1.0, 0.0].into(), &[])
        .push_end([0.0, 1.0, 0.0].into());
    let bvh = joints.with_motion(1, std::time::Duration::from_millis(40)).push_frame(&[90.0]).build().unwrap();
    println!("documented: {} joints, {} frames", bvh.joints().count(), bvh.frames().count());

    let mut hidden = BvhLiteralBuilder::default();
    hidden.push_root("Hips");
    hidden.push_channel(ChannelType::RotationX);
    hidden.current_depth = 1;
    hidden.push_joint("Head");
    hidden.push_joint_offset([0.0, 1.0, 0.0].into(), true);
    hidden.set_num_frames(1);
    hidden.set_motion_values(vec![90.0]);
    println!("hidden: {} joints, {} frames", hidden.bvh.joints().count(), hidden.bvh.frames().count());
}
RUST
seen=$(cargo run --quiet)
expected='documented: 0 joints, 1 frames
hidden: 2 joints, 1 frames'
echo "$seen"
[ "$seen" = "$expected" ] || { echo "It was: $expected"; exit 1; }
