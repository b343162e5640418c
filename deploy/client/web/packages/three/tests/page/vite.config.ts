import { defaultClientConditions, defineConfig } from "vite";

// The page that tests drive; it is built where the test tells.
export default defineConfig({
  root: import.meta.dirname,
  base: "./",
  resolve: { conditions: ["diaphane-source", ...defaultClientConditions] },
  build: { emptyOutDir: true, minify: false, target: "es2022", chunkSizeWarningLimit: 4096 },
});
