// Usage: node validate.mjs FILE…  Prints one JSON object: file → its errors and warnings.
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import validator from "gltf-validator";

const reports = {};
for (const file of process.argv.slice(2)) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(file)), {
    maxIssues: 0,
    externalResourceFunction: async (uri) =>
      new Uint8Array(readFileSync(join(dirname(file), decodeURIComponent(uri)))),
  });
  reports[file] = report.issues.messages.map(({ severity, code, pointer }) => ({
    severity,
    code,
    pointer: pointer ?? "",
  }));
}
process.stdout.write(JSON.stringify(reports));
