import { defaultClientConditions, defineConfig } from "vite";

// One page with hashed files beside it, and nothing inline: it lives under `script-src 'self'`.
export default defineConfig({
  base: "/demo/",
  resolve: { conditions: ["diaphane-source", ...defaultClientConditions] },
  build: {
    outDir: "../../../../../services/dashboard/static/demo",
    emptyOutDir: true,
    assetsInlineLimit: 0,
    modulePreload: false,
    target: "es2022",
    license: { fileName: "licences.md" },
  },
});
