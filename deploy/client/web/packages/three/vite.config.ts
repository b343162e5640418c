import { defaultClientConditions, defineConfig } from "vite";

// One module; three.js and the core stay with whoever uses it.
export default defineConfig({
  resolve: { conditions: ["diaphane-source", ...defaultClientConditions] },
  build: {
    lib: { entry: "src/index.ts", formats: ["es"], fileName: "index" },
    rolldownOptions: { external: [/^three(\/|$)/, "@diaphane/core"] },
    emptyOutDir: false,
    minify: false,
    target: "es2022",
  },
});
