// Whether Kubernetes would take the manifests: manifests.mjs FILE... compares them with the schemas of its API, and refuses
// fields that the API does not know, as `kubectl apply --validate=strict` does. It stands beside the folder node_modules.
import { readFileSync } from "node:fs";
import { parseAllDocuments } from "yaml";

// A field that the schema's check has not read is one that it does not know.
function watched(value, path, unread) {
  if (value === null || typeof value !== "object") return value;
  const fields = Object.keys(value);
  if (!Array.isArray(value)) for (const field of fields) unread.add(`${path}.${field}`);
  const inner = Object.fromEntries(fields.map((field) => [field, watched(value[field], `${path}.${field}`, unread)]));
  return new Proxy(value, {
    get(target, field) {
      unread.delete(`${path}.${String(field)}`);
      return Object.hasOwn(inner, field) ? inner[field] : target[field];
    },
  });
}

let wrong = 0;
let checked = 0;
for (const file of process.argv.slice(2)) {
  for (const document of parseAllDocuments(readFileSync(file, "utf8"))) {
    const manifest = document.toJS();
    try {
      const module = await import(`./node_modules/kubernetes-models/${manifest.apiVersion}/${manifest.kind}.js`);
      const unread = new Set();
      const model = new module[manifest.kind](manifest);
      for (const field of Object.keys(manifest)) model[field] = watched(manifest[field], field, unread);
      model.validate();
      if (unread.size > 0) throw new Error(`unknown: ${[...unread].join(", ")}`);
      checked += 1;
    } catch (error) {
      console.error(`${file}: ${manifest.kind} ${manifest.metadata?.name}: ${error.message}`);
      wrong += 1;
    }
  }
}
console.log(`${checked} manifests are as the API wants them, ${wrong} are not`);
process.exit(wrong > 0 || checked === 0 ? 1 : 0);
