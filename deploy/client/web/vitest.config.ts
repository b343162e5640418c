import { defaultServerConditions } from "vite";
import { defineConfig } from "vitest/config";

// Packages use each other as sources, so that nothing has to be built before it is tested.
const conditions = ["diaphane-source", ...defaultServerConditions];

export default defineConfig({
  resolve: { conditions },
  ssr: { resolve: { conditions } },
  test: { include: ["packages/*/tests/**/*.test.ts"] },
});
