import react from "@vitejs/plugin-react";
import { defineConfig } from "vitest/config";

// The server's content security policy allows nothing inline: every asset is a file of its own.
export default defineConfig({
  plugins: [react()],
  build: { outDir: "dist", assetsInlineLimit: 0, modulePreload: { polyfill: false }, target: "es2022" },
  server: { port: 8303, proxy: { "/api": { target: "http://127.0.0.1:8302", ws: true } } },
  test: { include: ["src/**/*.test.{ts,tsx}", "mock/**/*.test.mjs"], environment: "node" },
});
