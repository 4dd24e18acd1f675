import { defineConfig } from "@playwright/test";
import { cameraOf } from "./tests/support/browser";

export default defineConfig({
  testDir: "tests",
  globalSetup: "./tests/support/setup.ts",
  outputDir: "test-results",
  // A service and a browser for each: more would only be slower.
  workers: 2,
  fullyParallel: true,
  forbidOnly: true,
  timeout: 60_000,
  expect: { timeout: 15_000 },
  reporter: process.stdout.isTTY ? "list" : "dot",
  use: {
    viewport: { width: 1280, height: 800 },
    screenshot: "only-on-failure",
    permissions: ["camera"],
    launchOptions: cameraOf("walk"),
  },
});
