import { defaultClientConditions, defineConfig } from "vite";

const PAGES = ["index", "first", "bottles", "foliage", "assembly", "split"];

// Pages with hashed files beside them, and nothing inline: they live under `script-src 'self'`.
export default defineConfig({
  root: import.meta.dirname,
  base: "/examples/",
  resolve: { conditions: ["diaphane-source", ...defaultClientConditions] },
  server: { fs: { allow: ["../../../.."] } },
  build: {
    outDir: "../../../../services/dashboard/static/examples",
    emptyOutDir: true,
    assetsInlineLimit: 0,
    modulePreload: false,
    target: "es2022",
    chunkSizeWarningLimit: 2048,
    license: { fileName: "licences.md" },
    rolldownOptions: { input: PAGES.map((name) => `${import.meta.dirname}/${name}.html`) },
  },
});
