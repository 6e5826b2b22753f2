import js from "@eslint/js";
import hooks from "eslint-plugin-react-hooks";
import ts from "typescript-eslint";

const node = Object.fromEntries(
  [
    "process",
    "console",
    "Buffer",
    "URL",
    "URLSearchParams",
    "setTimeout",
    "setInterval",
    "clearInterval",
    "fetch",
    "performance",
    "structuredClone",
  ].map((name) => [name, "readonly"]),
);
const page = Object.fromEntries(
  ["window", "document", "requestAnimationFrame", "PerformanceObserver"].map((name) => [name, "readonly"]),
);

export default ts.config(
  { ignores: ["dist", "node_modules", "screenshots", "dist.new"] },
  js.configs.recommended,
  ...ts.configs.strict,
  { plugins: { "react-hooks": hooks }, rules: hooks.configs.recommended.rules },
  { files: ["**/*.mjs"], languageOptions: { globals: { ...node, ...page } } },
  { rules: { "@typescript-eslint/no-non-null-assertion": "error", eqeqeq: "error" } },
);
