#!/usr/bin/env bash
# Blender 5.2.3 (bpy): `extension build --split-platforms` of the same files gives another archive each time.
#
# Without the option an archive has the dates of the files, so that two builds are the same bytes. With it the tool appends what
# it has generated to the manifest and writes that with the date of now. Whoever compares archives, or attests them, has to set
# the dates anew; Oncue's tools/archives.py does.
# Seen on 2026-11-30. Needs Python 3.13 and fetches Blender's Python module (375 MB). Fails when the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
if [ -z "${BPY_SITE_PACKAGES:-}" ]; then
    python3.13 -m venv "$folder/venv"
    "$folder/venv/bin/python" -m pip install --quiet --no-deps bpy==5.2.3
    BPY_SITE_PACKAGES=$(echo "$folder"/venv/lib/python3.13/site-packages)
fi
tool="$BPY_SITE_PACKAGES/bpy/5.2/scripts/addons_core/bl_pkg/cli/blender_ext.py"
mkdir "$folder/source"
cat > "$folder/source/blender_manifest.toml" <<'TOML'
schema_version = "1.0.0"
id = "finding"
version = "1.0.0"
name = "Finding"
tagline = "Two builds of the same files"
maintainer = "Nobody"
type = "add-on"
blender_version_min = "4.2.0"
license = ["SPDX:GPL-3.0-or-later"]
platforms = ["linux-x64", "windows-x64"]
TOML
echo 'def register(): pass' > "$folder/source/__init__.py"
for run in first second; do
    for way in whole split; do
        mkdir -p "$folder/$way/$run"
        option=$([ "$way" = split ] && echo --split-platforms || true)
        # shellcheck disable=SC2086
        python3 "$tool" build $option --source-dir "$folder/source" --output-dir "$folder/$way/$run" >/dev/null
    done
    # The format counts in two seconds.
    sleep 3
done
for way in whole split; do
    result=$(diff -rq "$folder/$way/first" "$folder/$way/second" >/dev/null && echo same || echo differ)
    echo "$way: $result"
    [ "$way $result" = "whole same" ] || [ "$way $result" = "split differ" ]
done
