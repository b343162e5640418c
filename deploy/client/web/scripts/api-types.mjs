// Writes packages/core/src/api.ts: the types of docs/openapi.json that the page uses, and those that they need.
import { readFileSync, writeFileSync } from "node:fs";

const WANTED = ["ModelPage", "PointerRecord", "ProblemDocument", "VersionRecord"];
const here = new URL(".", import.meta.url);
const { schemas } = JSON.parse(readFileSync(new URL("../../../../docs/openapi.json", here), "utf8")).components;

function typeOf(schema, needs) {
  if (schema.$ref) {
    const name = schema.$ref.split("/").at(-1);
    needs.add(name);
    return name;
  }
  if (schema.enum) return schema.enum.map((value) => JSON.stringify(value)).join(" | ");
  if (schema.anyOf) return schema.anyOf.map((each) => typeOf(each, needs)).join(" | ");
  if (schema.type === "array") return `readonly (${typeOf(schema.items, needs)})[]`;
  if (schema.type === "object") {
    const of = schema.additionalProperties;
    return `Readonly<Record<string, ${of && of !== true ? typeOf(of, needs) : "unknown"}>>`;
  }
  const simple = { string: "string", integer: "number", number: "number", boolean: "boolean", null: "null" };
  if (!(schema.type in simple)) throw new Error(`no type for ${JSON.stringify(schema)}`);
  return simple[schema.type];
}

const needs = new Set(WANTED);
const texts = [];
for (const name of needs) {
  const { properties, required = [], description = "" } = schemas[name];
  const members = Object.entries(properties).map(
    ([member, schema]) => `  readonly ${member}${required.includes(member) ? "" : "?"}: ${typeOf(schema, needs)};`,
  );
  texts.push(`/** ${description.split("\n")[0]} */\nexport interface ${name} {\n${members.join("\n")}\n}\n`);
}
const head = "// Written by scripts/api-types.mjs of docs/openapi.json: `npm run types`.\n\n";
writeFileSync(process.argv[2] ?? new URL("../packages/core/src/api.ts", here), head + texts.join("\n"));
