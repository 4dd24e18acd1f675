import { defineConfig } from "vitest/config";
import { compress } from "./build/compress";

// Where `npm run dev` sends what the service answers: the mock, or a service given by its address.
const service = process.env.ROOMSIGHT_URL ?? "http://127.0.0.1:18101";

export default defineConfig({
  // Relative, so that the page works under any prefix of a proxy.
  base: "./",
  esbuild: { jsx: "automatic", jsxImportSource: "preact" },
  build: {
    outDir: "dist/page",
    emptyOutDir: true,
    target: "es2022",
    // The content security policy takes files, nothing within the document.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
  },
  plugins: [compress()],
  server: {
    host: "127.0.0.1",
    port: 18100,
    proxy: { "/v1": { target: service, ws: true }, "/docs": service, "/metrics": service },
  },
  test: { include: ["src/**/*.test.ts"] },
});
