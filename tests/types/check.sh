#!/usr/bin/env bash
# The types of the page's modules, by the compiler of TypeScript, which reads JavaScript as it is: a name that is not there, an
# argument too many, text in place of a number. Nothing is built with it. Skips with a line where there is no npm, or where the
# registry does not answer. `check.sh` checks web/; `check.sh FOLDER` a copy of it.
set -euo pipefail
cd "$(dirname "$0")/../.."

version="5.9.3"
tools="${CARGO_TARGET_DIR:-target}/typescript"
from="${1:-web}"

skip() {
    echo "skipped: the types of the page's modules: $1"
    exit 0
}

for needed in node npm; do
    command -v "$needed" >/dev/null || skip "there is no $needed (sudo apt install npm)"
done
tools="$(mkdir -p "$tools" && cd "$tools" && pwd)"
tsc="$tools/node_modules/typescript/bin/tsc"
if [ "$(node "$tsc" --version 2>/dev/null)" != "Version $version" ]; then
    timeout 20 npm install --prefix "$tools" --no-audit --no-fund --ignore-scripts --silent "typescript@$version" \
        || skip "npm does not install typescript@$version"
fi

checked="$(mktemp -d)"
trap 'rm -r "$checked"' EXIT
mkdir "$checked/vendor"
cp "$from"/*.js "$from"/*.d.ts tests/types/page.d.ts "$checked"
# What comes from three.js is taken as it is: its own types are ten times the page.
names="$(cat "$from"/*.js | tr "\n" " " \
    | grep -oE 'import \{[^}]*\} from "\./vendor/three\.js"' | sed -E 's/import \{([^}]*)\}.*/\1/' | tr -d ' ' | tr ',' '\n' | sort -u | grep .)"
[ -n "$names" ] || { echo "no module takes anything from three.js: the names are not read"; exit 1; }
for name in $names; do
    echo "export const $name: any; export type $name = any;"
done > "$checked/vendor/three.d.ts"

cd "$checked"
node "$tsc" --allowJs --checkJs --noEmit --strict false --target es2023 --lib es2023,dom,dom.iterable --module esnext \
    --moduleResolution bundler *.js *.d.ts
echo "types of the page's modules: $(ls *.js | wc -l) files, nothing to complain of"
