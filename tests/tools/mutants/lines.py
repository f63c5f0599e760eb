"""Counts the lines of the libraries that tests reach, by folder.

    RUSTC_WORKSPACE_WRAPPER=tests/tools/mutants/counted.sh cargo test --no-run \
        --message-format=json ... > built.json
    python3 tests/tools/mutants/lines.py RAW LIST built.json...

Runs each test program that was built, for at most ten minutes, with its counts in the folder RAW, and
prints a table; lines that no program reaches are listed in the file LIST. Test modules do not count.
Needs the component llvm-tools of rustup.
"""

import glob
import json
import os
import subprocess
import sys
from collections import defaultdict

raw, listed, *built = sys.argv[1:]
raw = os.path.abspath(raw)
root = os.path.abspath(os.path.join(os.path.dirname(__file__), "../../.."))
os.makedirs(raw, exist_ok=True)

programs, others = [], []
for path in built:
    for line in open(path):
        if not line.startswith("{"):
            continue
        message = json.loads(line)
        if not message.get("executable"):
            continue
        folder = os.path.dirname(message["manifest_path"])
        is_test = message["profile"]["test"]
        (programs if is_test else others).append((message["executable"], folder))

for program, folder in programs:
    name = os.path.basename(program)
    if glob.glob(f"{raw}/{name}-*"):
        continue
    env = dict(os.environ, CARGO_MANIFEST_DIR=folder, INSTA_UPDATE="no")
    env["PROPTEST_DISABLE_FAILURE_PERSISTENCE"] = "1"
    env["LLVM_PROFILE_FILE"] = f"{raw}/{name}-%m.profraw"
    quiet = subprocess.DEVNULL
    try:
        ended = subprocess.run(
            [program], cwd=folder, env=env, stdout=quiet, stderr=quiet, timeout=600
        ).returncode
    except subprocess.TimeoutExpired:
        ended = "too long"
    print(name, ended, file=sys.stderr, flush=True)

sysroot = subprocess.check_output(["rustc", "--print", "sysroot"], text=True).strip()
tools = glob.glob(f"{sysroot}/lib/rustlib/*/bin")[0]
counts = glob.glob(f"{raw}/*.profraw")
merged = f"{raw}/all.profdata"
subprocess.check_call([f"{tools}/llvm-profdata", "merge", "-sparse", *counts, "-o", merged])
objects = [p for p, _ in programs + others]
command = [f"{tools}/llvm-cov", "export", "-format=lcov", f"-instr-profile={merged}", objects[0]]
for program in objects[1:]:
    command += ["-object", program]
text = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)

lines = defaultdict(dict)
for line in text.stdout.splitlines():
    if line.startswith("SF:"):
        file = os.path.relpath(line[3:], root)
    elif line.startswith("DA:"):
        number, count = map(int, line[3:].split(",")[:2])
        lines[file][number] = max(lines[file].get(number, 0), count)

folders = defaultdict(lambda: [0, 0])
with open(listed, "w") as out:
    for file, counted in sorted(lines.items()):
        parts = file.split("/")
        if parts[1] != "src" or parts[0] not in ("codegen", "runtime") or "tests.rs" in file:
            continue
        source = open(os.path.join(root, file)).read().splitlines()
        tests = [i for i, s in enumerate(source) if s.startswith("mod tests {")]
        end = tests[0] if tests else len(source)
        for number, count in sorted(counted.items()):
            if number > end:
                continue
            # count for the whole crate, and for the folder below it if there is one
            for folder in {"/".join(parts[:2]), "/".join(parts[:-1][:3])}:
                folders[folder][0] += 1
                folders[folder][1] += count > 0
            if count == 0:
                out.write(f"{file}:{number}: {source[number - 1].strip()}\n")

print("| folder | lines | reached | |\n|---|---|---|---|")
for folder, (total, reached) in sorted(folders.items()):
    print(f"| `{folder}` | {total} | {reached} | {100 * reached / total:.1f} % |")
