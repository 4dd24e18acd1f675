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
  // Trainings give way to all others, and machines where changes are checked are busy.
  timeout: 120_000,
  retries: process.env.CI ? 1 : 0,
  expect: { timeout: 20_000 },
  reporter: process.stdout.isTTY ? "list" : "dot",
  use: {
    viewport: { width: 1280, height: 800 },
    screenshot: "only-on-failure",
    permissions: ["camera"],
    launchOptions: cameraOf("walk"),
  },
});
