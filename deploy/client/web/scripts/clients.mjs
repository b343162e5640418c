// Packs what others install, and lists it, where the service has it: the same files from the same sources.

import { execFileSync } from "node:child_process";
import { createHash } from "node:crypto";
import { copyFileSync, mkdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { join } from "node:path";

const WEB = join(import.meta.dirname, "..");
const REPOSITORY = join(WEB, "../../..");
const TARGET = join(REPOSITORY, "services/dashboard/static/clients");

function packed(name) {
  const folder = join(WEB, "packages", name);
  rmSync(join(folder, "dist"), { recursive: true, force: true }); // of sources that are no more
  const licence = join(folder, "LICENSE");
  copyFileSync(join(REPOSITORY, "LICENSE"), licence);
  try {
    const options = { cwd: folder, encoding: "utf8", stdio: ["ignore", "pipe", "ignore"] };
    execFileSync("npm", ["pack", "--pack-destination", TARGET, "--silent"], options);
  } finally {
    rmSync(licence);
  }
  const { name: scoped, version, description, peerDependencies = {} } = JSON.parse(readFileSync(join(folder, "package.json")));
  const file = `diaphane-${name}-${version}.tgz`;
  const content = readFileSync(join(TARGET, file));
  const integrity = `sha512-${createHash("sha512").update(content).digest("base64")}`;
  return { name: scoped, version, description, peerDependencies, file, bytes: content.length, integrity };
}

rmSync(TARGET, { recursive: true, force: true });
mkdirSync(TARGET, { recursive: true });
const packages = ["core", "three"].map(packed);
writeFileSync(join(TARGET, "index.json"), JSON.stringify({ packages }, null, 2) + "\n");
