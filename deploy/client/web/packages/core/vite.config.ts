import { defineConfig } from "vite";

// One module of the whole package, with its shaders as text; who imports from it shakes the rest off.
export default defineConfig({
  build: {
    lib: { entry: "src/index.ts", formats: ["es"], fileName: "index" },
    emptyOutDir: false,
    minify: false,
    target: "es2022",
  },
});
